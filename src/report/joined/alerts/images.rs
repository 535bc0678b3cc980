//! Alerts about images and requests: replies that do not depend on the image, changed requests, and noise.
//!
//! Alerts about models whose replies do not depend on the image ([`image_alerts`]), and about servers that shrink
//! images ([`shrunk_alerts`]).
//!
//! Alerts about requests that were changed because a server refused or did not answer the first, by the program
//! ([`adaptation_alerts`]) and by the user ([`change_alerts`]).
//!
//! Alerts about noise profiles with the same signal-to-noise ratio at every level ([`noise_alerts`]), and about levels
//! that leave too few 8-bit codes ([`rounding_alert`]).

use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};

use serde_json::Value;

use crate::joined::combine::CombinedRuns;
use crate::joined::join::{Joined, JoinedRun};
use crate::joined::settings::joined_with_and;
use crate::text::alert::{Alert, AlertKind};
use darkqa_ask::{ChangedSetting, ImageDetail, ImageTokenCheck, scaling_image_tokens};
use darkqa_base::types::degradations::Kind;
use darkqa_base::types::flags::{read_word, setting_spelling};
use darkqa_base::types::manifests::judge_flag;
use darkqa_base::types::text::plural;
use darkqa_base::types::{Condition, Degradation, Digest, QuestionId, RunQuestion, SetLight, Severity, TrialRef};
use darkqa_runs::renamed::{self, ADAPTED_FOR};
use darkqa_score::answers::record::Detail;
use darkqa_score::answers::{Independence, LitReply};
use darkqa_score::model_in_condition::without_run;

/// One alert for each model at an endpoint whose replies about untouched images do not depend on the image. Returns
/// none for photographs taken in the dark, where a model may see nothing.
pub(super) fn image_alerts(combined: &CombinedRuns) -> Vec<Alert> {
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
pub(super) fn shrunk_alerts(combined: &CombinedRuns) -> Vec<Alert> {
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
fn asked_as(combined: &CombinedRuns, model: &str) -> (String, Option<ImageDetail>, usize) {
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
fn built_in_models(combined: &CombinedRuns) -> BTreeSet<&str> {
    combined
        .trials
        .asked()
        .into_iter()
        .flatten()
        .map(|(model, _)| model)
        .filter(|model| combined.runs.iter().any(|run| run.manifest.is_built_in(without_run(model))))
        .collect()
}

/// One alert for each model whose requests were changed in a run.
pub(super) fn adaptation_alerts(runs: &[JoinedRun]) -> Vec<Alert> {
    let mut alerts = Vec::new();
    for run in runs {
        for (field, changes) in &run.manifest.settings {
            let Some(model) = field.strip_prefix(ADAPTED_FOR) else {
                continue;
            };
            let changes: Vec<&str> = changes.as_array().into_iter().flatten().filter_map(Value::as_str).collect();
            let place = match runs {
                [_] => String::new(),
                _ => format!(" in {}", run.name),
            };
            let text = format!(
                "Requests to {model} were changed{place}, because what was sent first was refused or not answered in time: {}.",
                joined_with_and(&changes)
            );
            alerts.push(Alert::new(AlertKind::Parameters, text));
        }
    }
    alerts
}

/// One alert for each setting of a model or judge that changed within a run. Token limits are in the records, whose
/// alert names them.
pub(super) fn change_alerts(runs: &[JoinedRun]) -> Vec<Alert> {
    let mut alerts = Vec::new();
    for run in runs {
        let place = match runs {
            [_] => String::new(),
            _ => format!(" in {}", run.name),
        };
        for (model, is_judge, changes) in renamed::all(&run.manifest.settings) {
            for change in changes {
                if change.flag == "--max-tokens" && !change.now.is_null() {
                    continue;
                }
                let text = change_sentence(model, is_judge, &place, &change);
                alerts.push(Alert::new(AlertKind::Parameters, text));
            }
        }
    }
    alerts
}

/// Sentence about a setting that changed within a run.
fn change_sentence(model: &str, is_judge: bool, place: &str, change: &ChangedSetting) -> String {
    let ChangedSetting { flag, first, now, after } = change;
    let (judge, flag) = if is_judge { ("the judge ", judge_flag(flag)) } else { ("", flag.clone()) };
    let flag = setting_spelling(&flag);
    let [first, now] = [first, now].map(value_words);
    if *after == 0 {
        return format!("The {flag} of {judge}{model} is {now} in all replies{place}; the run began with {first}.");
    }
    format!(
        "The {flag} of {judge}{model} has two values{place}, because the server refused the first: {first} in {}, then {now}.",
        plural(*after, "reply", "replies")
    )
}

/// A value of a setting in words.
fn value_words(value: &Value) -> String {
    match value {
        Value::Null => "unset".to_owned(),
        Value::String(text) => text.clone(),
        other => other.to_string(),
    }
}

/// The exposure drop, in hundredths of EV, above which an image has at most nine codes: white gets code 255 ·
/// 2^(−EV/2.2) = 8.
const FEW_CODES: u16 = 1100;

/// Alerts about noise profiles whose levels all have the same signal-to-noise ratio, for runs with several levels with
/// noise.
pub(super) fn noise_alerts<D: Detail>(joined: &Joined<D>) -> Vec<Alert> {
    let mut profiles_by_reason = BTreeMap::<&str, BTreeSet<&str>>::new();
    for run in &joined.runs {
        let mut levels = BTreeMap::<String, BTreeSet<Severity>>::new();
        for condition in conditions(joined.trials_of(run)) {
            let Some(degradation) = condition.degradation() else {
                continue;
            };
            if let Some(profile) = degradation.reading() {
                let levels = levels.entry(profile.to_string()).or_default();
                levels.insert(degradation.severity());
            }
        }
        let contents = run.manifest.columns.get("reading").into_iter().flatten();
        for (profile, content) in contents {
            let several = levels.get(profile).is_some_and(|levels| levels.len() > 1);
            if several && content["--coupling"] == "independent" {
                profiles_by_reason.entry(same_noise(content)).or_default().insert(profile);
            }
        }
    }
    profiles_by_reason.into_iter().map(|(why, names)| {
        let names: Vec<&str> = names.into_iter().collect();
        let text = format!(
            "With noise ({}) the signal-to-noise ratio is the same at every level: {why}. --profile physical loses photons with the light.",
            names.join(", ")
        );
        Alert::new(AlertKind::Noise, text)
    }).collect()
}

/// The reason why all levels of a noise profile have the same signal-to-noise ratio, if its light ratio r does not
/// depend on the level.
fn same_noise(profile: &Value) -> &'static str {
    if profile["--draws"] == "shared" {
        "the levels are one noisy image at several brightnesses"
    } else {
        "each level has other noise of the same strength"
    }
}

/// The alert about levels at which an image has too few codes, so that rounding dominates.
pub(super) fn rounding_alert<D: Detail>(joined: &Joined<D>) -> Option<Alert> {
    let levels: BTreeSet<Severity> = conditions(joined.trials.iter())
        .into_iter()
        .filter_map(Condition::degradation)
        .filter(|degradation| {
            matches!(degradation.kind(), Kind::Exposure | Kind::Sensor)
                && degradation.severity().hundredths() > FEW_CODES
        })
        .map(Degradation::severity)
        .collect();
    if levels.is_empty() {
        return None;
    }
    let names: Vec<String> = levels.iter().map(|level| format!("{} EV", level.value())).collect();
    let text = format!(
        "Above 11 EV an image has at most nine codes ({}): such levels test the rounding to 8 bits more than the model.",
        names.join(", ")
    );
    Some(Alert::new(AlertKind::Noise, text))
}

/// The distinct conditions of trials.
fn conditions<'t, D: Detail + 't>(trials: impl Iterator<Item = TrialRef<'t, D>>) -> HashSet<&'t Condition> {
    trials.filter_map(TrialRef::condition).collect()
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn changes_are_sentences() {
        let change =
            |after| ChangedSetting { flag: "--temperature".into(), first: json!("auto"), now: json!("default"), after };
        assert_eq!(
            change_sentence("m", false, "", &change(5)),
            "The --temperature of m has two values, because the server refused the first: auto in 5 replies, then default."
        );
        assert_eq!(
            change_sentence("j", true, " in b", &change(0)),
            "The --judge-temperature of the judge j is default in all replies in b; the run began with auto."
        );
    }
}
