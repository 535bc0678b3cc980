//! Alerts about models that a report lists under several names, with the reason: [`model_alerts`].

use std::collections::BTreeMap;

use super::words::run_names;
use crate::report::joined::join::{Joined, JoinedRun};
use crate::report::joined::model_names::SplitModel;
use crate::report::joined::settings::{Setting, joined_with_and};
use crate::report::text::alert::{Alert, AlertKind};
use darkqa_score::answers::record::Detail;

/// Manifest fields of a built-in model, and their names in a sentence.
const FIELDS: [(&str, &str); 3] = [("random", "its seed"), ("script", "its file"), (DIGEST, "its digest")];

/// The field that holds the digest of everything that decides the replies of a built-in model.
const DIGEST: &str = "digest";

/// One alert for all models that are split for the same reason in the same runs.
pub(super) fn model_alerts<D: Detail>(joined: &Joined<D>) -> Vec<Alert> {
    let runs = run_names(&joined.runs);
    let mut by_reason = BTreeMap::<(String, Vec<&str>), Vec<&SplitModel>>::new();
    for split in &joined.model_names.split {
        let suffixes = split.names.iter().map(|name| &name[split.model.len()..]).collect();
        by_reason.entry((reason(split, &runs), suffixes)).or_default().push(split);
    }
    by_reason
        .into_iter()
        .map(|((reason, _), models)| {
            let text = format!("{}: {reason}.", stand_apart(&models));
            Alert::new(AlertKind::Models, text)
        })
        .collect()
}

/// Alerts about the models of each run whose replies are left out.
pub(super) fn left_out_alerts(runs: &[JoinedRun]) -> Vec<Alert> {
    runs.iter().filter(|run| !run.left_out.is_empty()).map(|run| {
        let names: Vec<&String> = run.left_out.iter().collect();
        let are = if names.len() == 1 { "is" } else { "are" };
        let text = format!(
            "{} {are} left out of {}: the file of models has no such model any more, or has it with other settings; report --all shows \
             all.",
            joined_with_and(&names),
            run.name
        );
        Alert::new(AlertKind::Models, text)
    }).collect()
}

/// The sentence about split models, with the names of the first one.
fn stand_apart(models: &[&SplitModel]) -> String {
    let names: Vec<&String> = models.iter().map(|split| &split.model).collect();
    let (all, apart) = (joined_with_and(&names), joined_with_and(&models[0].names));
    if models.len() == 1 {
        format!("{all} stands apart as {apart}")
    } else {
        format!("{all} stand apart, as in {apart}")
    }
}

/// The reason why a model is split: the settings that differ, and the replies or trials that do.
fn reason(split: &SplitModel, runs: &[String]) -> String {
    let mut reasons: Vec<String> =
        named_settings(&split.differences).iter().map(|setting| setting.words(runs)).collect();
    let overlap = split.overlap();
    let up_to = if split.names.len() > 2 { "up to " } else { "" };
    if overlap.other_replies > 0 {
        reasons.push(format!(
            "{up_to}{} of {} replies to the same trials differ",
            overlap.other_replies, overlap.repeated
        ));
    } else if overlap.other_served > 0 {
        reasons.push(format!(
            "{up_to}{} of {} replies to the same trials came from another model, by the name that the server gave",
            overlap.other_served, overlap.repeated
        ));
    }
    if reasons.is_empty() {
        reasons.push(format!(
            "{up_to}{} of the same questions in the same conditions are other trials, by their keys",
            overlap.other_trials
        ));
    }
    reasons.join("; ")
}

/// The settings that differ, with manifest fields replaced by their names in a sentence. The digest is left out if
/// other settings explain it.
fn named_settings(differences: &[Setting]) -> Vec<Setting> {
    let is_explained = differences.iter().any(|setting| setting.flag != DIGEST);
    differences
        .iter()
        .filter(|setting| !is_explained || setting.flag != DIGEST)
        .map(|setting| Setting {
            flag: FIELDS
                .iter()
                .find(|(field, _)| *field == setting.flag)
                .map_or(&*setting.flag, |(_, words)| *words)
                .to_owned(),
            ..setting.clone()
        })
        .collect()
}
