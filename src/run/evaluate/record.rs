//! What came of a trial, as a line of `records.jsonl`.

use super::plan::ChoiceItem;
use crate::ask::Query;
use crate::job::trial::{Item, Stimulus, Trial};
use crate::types::{Degradation, Outcome, Record, Variant, Via};

impl Item for ChoiceItem {
    type Record = Record;

    fn reply_tokens(&self) -> f64 {
        // It names a letter.
        4.0
    }

    fn query(&self) -> Query<'_> {
        Query::Choice(&self.question)
    }

    fn place(&self) -> &str {
        &self.question.frame.0
    }

    fn turn(&self) -> u32 {
        self.turn
    }

    fn blank(trial: &Trial<Self>, stimulus: &Stimulus, model: &str) -> Record {
        blank(trial, stimulus, model)
    }
}

fn blank(trial: &Trial<ChoiceItem>, stimulus: &Stimulus, model: &str) -> Record {
    let question = &*trial.item.question;
    let condition = stimulus.condition.clone();
    let degradation = condition.as_ref().map(|condition| condition.degradation);
    Record {
        key: trial.key,
        question: question.id.clone(),
        frame: question.frame.clone(),
        family: question.family.clone(),
        model: model.to_owned(),
        view: stimulus.view(),
        level: degradation.map(Degradation::level),
        variant: degradation.map_or(Variant::None, Degradation::variant),
        enhancer: condition
            .as_ref()
            .and_then(|condition| condition.enhancer.clone()),
        condition,
        choices: question.choices.texts().to_vec(),
        truth: question.choices.truth(),
        reply: None,
        refusal: None,
        finish: None,
        strict: None,
        lenient: None,
        repeat: trial.item.repeat,
        via: Via::Direct,
        outcome: Outcome::Failed,
        failure: None,
        usage: None,
        served_model: None,
        latency_ms: None,
        attempts: 0,
        image: stimulus.images.first().map(|image| image.facts().clone()),
    }
}
