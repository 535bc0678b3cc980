//! The subject of a trial ([`OpenItem`]), which is an open question or an answer to mark, and its record.

use std::sync::Arc;

use crate::ask::Query;
use crate::data::openeqa::OpenQuestion;
use crate::engine::images::trials::{Item, Stimulus, Trial};
use crate::pictures::Payload;
use crate::types::{ExposureFacts, OpenDetail, Record, Step, WalkFacts};

/// The subject of one trial.
#[derive(Debug, Clone)]
pub(crate) enum OpenItem {
    /// An open question for a model.
    Answer(Arc<OpenQuestion>),
    /// An answer for the judge.
    Mark {
        question: Arc<OpenQuestion>,
        /// The answer as shown to the judge.
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
    type Detail = OpenDetail;

    fn reply_tokens(&self) -> f64 {
        match self {
            // The reply is a short sentence.
            Self::Answer(_) => 20.0,
            // The reply is "Your mark: 5".
            Self::Mark { .. } => 4.0,
        }
    }

    fn query(&self) -> Query<'_> {
        Query::Open(&self.question().id)
    }

    fn source(&self) -> &str {
        match self {
            Self::Answer(question) => &question.episode,
            // A judge sees no frames, so its failures are counted by question.
            Self::Mark { question, .. } => &question.id.0,
        }
    }

    fn turn(&self) -> u32 {
        0
    }

    fn blank(trial: &Trial<Self>, stimulus: &Stimulus, model: &str) -> Record<OpenDetail> {
        let question = trial.item.question();
        let (condition, detail) = match &trial.item {
            Self::Mark { answer, .. } => {
                let judged = Some(answer.to_string());
                let detail = detail(question, Step::Mark);
                (None, OpenDetail { judged, ..detail })
            }
            Self::Answer(_) => {
                let images = walk_facts(&stimulus.images);
                let detail = detail(question, Step::Answer);
                (stimulus.condition.clone(), OpenDetail { images, ..detail })
            }
        };
        Record::blank(trial.key, question.id.clone(), model, condition, detail)
    }
}

/// The detail of a record before the reply.
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

/// Facts about all images of a stimulus together; `None` without images.
fn walk_facts(images: &[Arc<Payload>]) -> Option<WalkFacts> {
    let first = images.first()?.facts();
    Some(WalkFacts {
        images: images.len(),
        bytes: images.iter().map(|image| image.facts().bytes).sum(),
        digest: Payload::joint_digest(images)?,
        width: first.width,
        height: first.height,
        format: first.format.clone(),
        exposure: ExposureFacts::shared(images.iter().map(|image| image.facts().exposure)),
    })
}
