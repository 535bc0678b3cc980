//! What is asked: [`Open`], a question, and [`Judged`], an answer to it; and the record of either.

use std::sync::Arc;

use crate::ask::{Payload, Query};
use crate::dataset::openeqa::OpenQuestion;
use crate::error::Result;
use crate::run::trial::{Item, Slide, Trial};
use crate::score::llm_match::{Protocol, mark};
use crate::types::detail::OpenLine;
use crate::types::{Detail, Digest, OpenDetail, Record, Reply, Step, WalkFacts};

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
    type Detail = OpenDetail;

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

    fn blank(trial: &Trial<Self>, slide: &Slide, model: &str) -> Record<OpenDetail> {
        let condition = slide.condition.clone();
        let images = facts(&slide.images);
        let detail = OpenDetail {
            images,
            ..detail(&trial.item.0, Step::Answer)
        };
        Record::blank(trial.key, trial.item.0.id.clone(), model, condition, detail)
    }
}

impl Item for Judged {
    type Detail = OpenDetail;

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

    fn blank(trial: &Trial<Self>, _: &Slide, model: &str) -> Record<OpenDetail> {
        let item = &trial.item;
        let detail = OpenDetail {
            judged: Some(item.answer.to_string()),
            ..detail(&item.question, Step::Mark)
        };
        Record::blank(trial.key, item.question.id.clone(), model, None, detail)
    }
}

impl Detail for OpenDetail {
    type Line = OpenLine;

    const SCHEMA: &'static str = "darkqa.openeqa/2";

    fn read(&mut self, reply: &Reply) -> Result<()> {
        if self.step == Step::Mark {
            self.upstream = mark(&reply.text, Protocol::Upstream);
            self.tolerant = mark(&reply.text, Protocol::Tolerant);
        }
        Ok(())
    }

    fn choices(&self) -> usize {
        0
    }
}

/// What is known of a trial before it is made.
pub(super) fn detail(question: &OpenQuestion, step: Step) -> OpenDetail {
    OpenDetail {
        step,
        episode: question.episode.clone(),
        category: question.category.clone(),
        person: None,
        judged: None,
        upstream: None,
        tolerant: None,
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
