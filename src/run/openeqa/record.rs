//! What is asked: [`OpenItem`], a question or an answer to it that is to be marked; and the record of either.

use std::sync::Arc;

use crate::ask::{Payload, Query};
use crate::dataset::openeqa::OpenQuestion;
use crate::error::Result;
use crate::job::trial::{Entry, Item, Stimulus, Trial};
use crate::score::llm_match::{Protocol, mark};
use crate::types::{
    Condition, Degradation, Digest, Failure, OpenRecord, QuestionId, Reply, Step, TrialKey,
    Variant, Via, View, WalkFacts,
};

/// What one trial is about.
#[derive(Debug, Clone)]
pub(crate) enum OpenItem {
    /// An open question.
    Answer(Arc<OpenQuestion>),
    /// An answer that is to be marked.
    Mark {
        question: Arc<OpenQuestion>,
        /// As it is judged.
        answer: Arc<str>,
    },
}

impl OpenItem {
    fn question(&self) -> &OpenQuestion {
        match self {
            Self::Answer(question) | Self::Mark { question, .. } => question,
        }
    }
}

impl Item for OpenItem {
    type Record = OpenRecord;

    fn reply_tokens(&self) -> f64 {
        match self {
            // A short sentence.
            Self::Answer(_) => 20.0,
            // "Your mark: 5".
            Self::Mark { .. } => 4.0,
        }
    }

    fn query(&self) -> Query<'_> {
        Query::Open(&self.question().id)
    }

    fn place(&self) -> &str {
        match self {
            Self::Answer(question) => &question.episode,
            // A judge sees no frames: what it refuses, it refuses about the question.
            Self::Mark { question, .. } => &question.id.0,
        }
    }

    fn turn(&self) -> u32 {
        0
    }

    fn blank(trial: &Trial<Self>, stimulus: &Stimulus, model: &str) -> OpenRecord {
        let question = trial.item.question();
        match &trial.item {
            Self::Mark { answer, .. } => OpenRecord {
                judged: Some(answer.to_string()),
                ..empty(trial.key, question, Step::Mark, model)
            },
            Self::Answer(_) => {
                let condition = stimulus.condition.clone();
                let degradation = condition.as_ref().map(|condition| condition.degradation);
                OpenRecord {
                    view: stimulus.view(),
                    level: degradation.map(Degradation::level),
                    variant: degradation.map_or(Variant::None, Degradation::variant),
                    enhancer: condition
                        .as_ref()
                        .and_then(|condition| condition.enhancer.clone()),
                    condition,
                    images: facts(&stimulus.images),
                    ..empty(trial.key, question, Step::Answer, model)
                }
            }
        }
    }
}
impl Entry for OpenRecord {
    fn model(&self) -> &str {
        &self.model
    }

    fn question(&self) -> &QuestionId {
        &self.question
    }

    fn condition(&self) -> Option<&Condition> {
        self.condition.as_ref()
    }

    fn repeat(&self) -> u32 {
        0
    }

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

/// The images of a stimulus together; `None` of none.
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
