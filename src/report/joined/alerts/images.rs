//! Alerts about models whose replies do not depend on the image ([`image_alerts`]), and about servers that shrink
//! images ([`shrunk_alerts`]).

use std::collections::{BTreeMap, BTreeSet, HashMap};

use crate::ask::{ImageDetail, ImageTokenCheck, scaling_image_tokens};
use crate::report::joined::combine::Combined;
use crate::report::text::alert::{Alert, AlertKind};
use crate::types::flags::read_word;
use crate::types::{Digest, QuestionId, RunQuestion, SetLight};
use darkqa_score::answers::{Independence, LitReply};
use darkqa_score::model_in_condition::without_run;

/// One alert for each model at an endpoint whose replies about untouched images do not depend on the image. Returns
/// none for photographs taken in the dark, where a model may see nothing.
pub(super) fn image_alerts(combined: &Combined) -> Vec<Alert> {
    if combined.photographed_set().light == SetLight::Dark {
        return Vec::new();
    }
    let questions: HashMap<&QuestionId, &RunQuestion> =
        combined.questions.iter().map(|question| (&question.id, question)).collect();
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
        if let Some(reply) = LitReply::from_trial(trial, || Digest::from_parts(words.map(String::as_bytes))) {
            replies.entry(trial.model()).or_default().push(reply);
        }
    }
    replies
        .into_iter()
        .filter_map(|(model, replies)| Some(Independence::find(&replies)?.words(model)))
        .map(|text| Alert::new(AlertKind::ImageIgnored, text))
        .collect()
}

/// One alert for each model whose server counts far fewer tokens an image than the rule of the model's family.
pub(super) fn shrunk_alerts(combined: &Combined) -> Vec<Alert> {
    let questions: HashMap<&QuestionId, usize> =
        combined.questions.iter().map(|question| (&question.id, question.text.chars().count())).collect();
    let mut settings = HashMap::new();
    let mut checks = BTreeMap::<&str, ImageTokenCheck>::new();
    for trial in combined.trials.iter().filter(|trial| trial.has_reply()) {
        let charged = trial.usage().and_then(|usage| usage.prompt_tokens);
        let Some((charged, images)) = charged.zip(trial.images()) else {
            continue;
        };
        let model = trial.model();
        let (id, detail, system) = settings.entry(model).or_insert_with(|| asked_as(combined, model));
        let [width, height] = images.size.map(u64::from);
        let Some(expected) = scaling_image_tokens(id, *detail, width, height) else {
            continue;
        };
        let question = questions.get(trial.question()).copied().unwrap_or(0);
        let choices: usize = trial.choices().iter().map(|one| one.chars().count()).sum();
        checks.entry(model).or_default().add(charged, *system + question + choices, &vec![expected; images.count()]);
    }
    checks
        .into_iter()
        .filter_map(|(model, check)| Some(check.shrunk()?.words(model)))
        .map(|text| Alert::new(AlertKind::Images, text))
        .collect()
}

/// The name of a model at its endpoint, the image detail of its requests, and the characters of its system message.
fn asked_as(combined: &Combined, model: &str) -> (String, Option<ImageDetail>, usize) {
    let name = combined.model_names.original_name(model);
    let column = combined.runs.iter().find_map(|run| {
        let models = run.manifest.columns.get("model")?;
        models.get(name)
    });
    let flag = |flag: &str| column.and_then(|column| column.get(flag)?.as_str());
    (
        flag("--model").unwrap_or(name).to_owned(),
        flag("--detail").and_then(|detail| read_word(detail).ok()),
        flag("--system").map_or(0, |system| system.chars().count()),
    )
}

/// Names of the models that need no endpoint.
fn built_in_models(combined: &Combined) -> BTreeSet<&str> {
    combined
        .trials
        .asked()
        .into_iter()
        .flatten()
        .map(|(model, _)| model)
        .filter(|model| combined.runs.iter().any(|run| run.manifest.is_built_in(without_run(model))))
        .collect()
}
