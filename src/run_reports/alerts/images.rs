//! Alerts about models whose replies do not depend on the image: [`image_alerts`].

use std::collections::{BTreeMap, BTreeSet, HashMap};

use crate::run_reports::combine::Combined;
use crate::text::alert::{Alert, AlertKind};
use crate::types::{Digest, QuestionId, RunQuestion, SetLight};
use darkqa_score::answers::{Independence, LitReply};
use darkqa_score::model_in_condition::without_run;

/// One alert for each model at an endpoint whose replies about untouched images do not depend on the image. Returns none for photographs
/// taken in the dark, where a model may see nothing.
pub(super) fn image_alerts(combined: &Combined) -> Vec<Alert> {
    if combined.photographed_set().light == SetLight::Dark {
        return Vec::new();
    }
    let questions: HashMap<&QuestionId, &RunQuestion> = combined
        .questions
        .iter()
        .map(|question| (&question.id, question))
        .collect();
    let mut replies = BTreeMap::<&str, Vec<LitReply>>::new();
    let built_in = built_in_models(combined);
    for trial in combined.trials.iter() {
        let Some(question) = questions.get(trial.question()) else {
            continue;
        };
        if built_in.contains(trial.model()) {
            continue;
        }
        let words = std::iter::once(&question.text).chain(trial.choices());
        if let Some(reply) =
            LitReply::from_trial(trial, || Digest::from_parts(words.map(String::as_bytes)))
        {
            replies.entry(trial.model()).or_default().push(reply);
        }
    }
    replies
        .into_iter()
        .filter_map(|(model, replies)| Some(Independence::find(&replies)?.words(model)))
        .map(|text| Alert::new(AlertKind::ImageIgnored, text))
        .collect()
}

/// Names of the models that need no endpoint.
fn built_in_models(combined: &Combined) -> BTreeSet<&str> {
    combined
        .trials
        .asked()
        .into_iter()
        .flatten()
        .map(|(model, _)| model)
        .filter(|model| {
            combined
                .runs
                .iter()
                .any(|run| run.manifest.is_built_in(without_run(model)))
        })
        .collect()
}
