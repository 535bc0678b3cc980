//! What is asked: [`Open`], a question, and [`Judged`], an answer to it; and the record of either.

use std::sync::Arc;

use crate::ask::{Payload, Query};
use crate::dataset::openeqa::OpenQuestion;
use crate::error::Result;
use crate::run::record::Entry;
use crate::run::trial::{Item, Slide, Trial};
use crate::score::llm_match::{Protocol, mark};
use crate::types::{
    Degradation, Digest, Failure, OpenRecord, Reply, Step, TrialKey, Variant, Via, View, WalkFacts,
};

/// An open question.
#[derive(Debug, Clone)]
pub(super) struct Open(pub(super) Arc<OpenQuestion>);

/// An answer that is to be marked.
#[derive(Debug, Clone)]
pub(super) struct Judged {
    pub(super) question: Arc<OpenQuestion>,
    /// As it is judged.
    pub(super) answer: Arc<str>,
}

impl Item for Open {
    type Record = OpenRecord;

    // A short sentence.
    const REPLY: f64 = 20.0;

    fn query(&self) -> Query<'_> {
        Query::Open(&self.0.id)
    }

    fn place(&self) -> &str {
        &self.0.episode
    }

    fn turn(&self) -> u32 {
        0
    }

    fn blank(trial: &Trial<Self>, slide: &Slide, model: &str) -> OpenRecord {
        let condition = slide.condition.clone();
        let degradation = condition.as_ref().map(|condition| condition.degradation);
        OpenRecord {
            key: trial.key,
            view: slide.view(),
            level: degradation.map(Degradation::level),
            variant: degradation.map_or(Variant::None, Degradation::variant),
            enhancer: condition
                .as_ref()
                .and_then(|condition| condition.enhancer.clone()),
            condition,
            images: facts(&slide.images),
            ..empty(trial.key, &trial.item.0, Step::Answer, model)
        }
    }
}

impl Item for Judged {
    type Record = OpenRecord;

    // "Your mark: 5".
    const REPLY: f64 = 4.0;

    fn query(&self) -> Query<'_> {
        Query::Open(&self.question.id)
    }

    // A judge sees no frames: what it refuses, it refuses about the question.
    fn place(&self) -> &str {
        &self.question.id.0
    }

    fn turn(&self) -> u32 {
        0
    }

    fn blank(trial: &Trial<Self>, _: &Slide, model: &str) -> OpenRecord {
        let item = &trial.item;
        OpenRecord {
            judged: Some(item.answer.to_string()),
            ..empty(trial.key, &item.question, Step::Mark, model)
        }
    }
}

impl Entry for OpenRecord {
    fn choices(&self) -> usize {
        0
    }

    fn answered(mut self, reply: Reply) -> Result<Self> {
        if self.step == Step::Mark {
            self.upstream = mark(&reply.text, Protocol::Upstream);
            self.tolerant = mark(&reply.text, Protocol::Tolerant);
        }
        Ok(Self {
            reply: Some(reply.text),
            refusal: reply.refusal,
            finish: Some(reply.finish),
            usage: reply.usage,
            served_model: reply.served_model,
            latency_ms: Some(reply.latency_ms),
            attempts: reply.attempts,
            ..self
        })
    }

    fn failed_by(self, failure: Failure, attempts: u32) -> Self {
        Self {
            failure: Some(failure),
            attempts,
            ..self
        }
    }

    fn batched(self) -> Self {
        Self {
            via: Via::Batch,
            ..self
        }
    }
}

/// A record with nothing but what it is about.
pub(super) fn empty(key: TrialKey, question: &OpenQuestion, step: Step, model: &str) -> OpenRecord {
    OpenRecord {
        key,
        step,
        question: question.id.clone(),
        episode: question.episode.clone(),
        category: question.category.clone(),
        model: model.to_owned(),
        view: View::Blind,
        condition: None,
        level: None,
        variant: Variant::None,
        enhancer: None,
        person: None,
        judged: None,
        reply: None,
        refusal: None,
        finish: None,
        upstream: None,
        tolerant: None,
        via: Via::Direct,
        failure: None,
        usage: None,
        served_model: None,
        latency_ms: None,
        attempts: 0,
        images: None,
    }
}

/// The images of a slide together; `None` of none.
fn facts(images: &[Arc<Payload>]) -> Option<WalkFacts> {
    let first = images.first()?.facts();
    let digests = images.iter().map(|image| image.facts().digest);
    let digests: Vec<Digest> = digests.collect();
    Some(WalkFacts {
        images: images.len(),
        bytes: images.iter().map(|image| image.facts().bytes).sum(),
        digest: Digest::of_parts(digests.iter().map(|digest| &digest.as_bytes()[..])),
        width: first.width,
        height: first.height,
        format: first.format.clone(),
    })
}
