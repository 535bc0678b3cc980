//! The trial of a question with choices, and its record before the reply.

use std::sync::Arc;

use super::plan::ChoiceItem;
use crate::ask::Query;
use crate::images::trial::{Item, Stimulus, Trial};
use crate::picture::Payload;
use crate::types::{ChoiceDetail, Record, TrialOutcome};

impl Item for ChoiceItem {
    type Detail = ChoiceDetail;

    fn reply_tokens(&self) -> f64 {
        // The reply is one letter.
        4.0
    }

    fn query(&self) -> Query<'_> {
        Query::Choice(&self.question)
    }

    fn source(&self) -> &str {
        let shown = self.shown_frame.as_ref();
        &shown.unwrap_or(&self.question.frame).0
    }

    fn turn(&self) -> u32 {
        self.turn
    }

    fn blank(trial: &Trial<Self>, stimulus: &Stimulus, model: &str) -> Record {
        let question = &*trial.item.question;
        let facts = |image: &Arc<Payload>| image.facts().clone();
        let mut images = stimulus.images.iter().map(facts);
        let detail = ChoiceDetail {
            frame: question.frame.clone(),
            family: question.family.clone(),
            choices: question.choices.texts().to_vec(),
            truth: question.choices.truth(),
            repeat: trial.item.repeat,
            strict: None,
            lenient: None,
            outcome: TrialOutcome::Failed,
            image: images.next(),
            more_images: images.collect(),
            shown_frame: trial.item.shown_frame.clone(),
            observed: None,
            options: None,
        };
        let condition = stimulus.condition.clone();
        Record::blank(trial.key, question.id.clone(), model, condition, detail)
    }
}
