//! Models of one name that stand apart, and why: [`model_alerts`].

use std::collections::BTreeMap;

use super::words::names;
use crate::run_reports::join::{Joined, JoinedRun};
use crate::run_reports::models::ModelApart;
use crate::run_reports::settings::{Setting, listed};
use crate::text::alert::{Alert, AlertKind};
use darkqa_score::answers::record::Detail;

/// The fields of a built-in model in a manifest, in words.
const FIELDS: [(&str, &str); 3] = [
    ("random", "its seed"),
    ("script", "its file"),
    (DIGEST, "its digest"),
];

/// The field that holds the digest of everything that decides the replies of a built-in model.
const DIGEST: &str = "digest";

/// A line for all models that stand apart for one reason in the same runs.
pub(super) fn model_alerts<D: Detail>(joined: &Joined<D>) -> Vec<Alert> {
    let runs = names(&joined.runs);
    let mut by_reason = BTreeMap::<(String, Vec<&str>), Vec<&ModelApart>>::new();
    for apart in &joined.models.apart {
        let suffixes = apart.names.iter().map(|name| &name[apart.model.len()..]);
        let same = (reason(apart, &runs), suffixes.collect());
        by_reason.entry(same).or_default().push(apart);
    }
    by_reason
        .into_iter()
        .map(|((reason, _), models)| {
            let text = format!("{}: {reason}.", stand_apart(&models));
            Alert::new(AlertKind::Models, text)
        })
        .collect()
}

/// The models of each run whose replies are not shown.
pub(super) fn left_out_alerts(runs: &[JoinedRun]) -> Vec<Alert> {
    let left = runs.iter().filter(|run| !run.left_out.is_empty());
    left.map(|run| {
        let names: Vec<&String> = run.left_out.iter().collect();
        let are = if names.len() == 1 { "is" } else { "are" };
        let text = format!(
            "{} {are} left out of {}: the file of models has no such model any more, or has it with other settings; report --all shows \
             all.",
            listed(&names),
            run.name
        );
        Alert::new(AlertKind::Models, text)
    }).collect()
}

/// The sentence about models that stand apart, with the names of the first.
fn stand_apart(models: &[&ModelApart]) -> String {
    let names: Vec<&String> = models.iter().map(|apart| &apart.model).collect();
    let (all, apart) = (listed(&names), listed(&models[0].names));
    if models.len() == 1 {
        format!("{all} stands apart as {apart}")
    } else {
        format!("{all} stand apart, as in {apart}")
    }
}

/// Why a model stands apart.
fn reason(apart: &ModelApart, runs: &[String]) -> String {
    let mut reasons: Vec<String> = settings(&apart.differences)
        .iter()
        .map(|setting| setting.words(runs))
        .collect();
    let overlap = apart.overlap();
    let up_to = if apart.names.len() > 2 { "up to " } else { "" };
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

/// The settings that differ, in words. Where others explain it, the digest is left out.
fn settings(differences: &[Setting]) -> Vec<Setting> {
    let is_digest = |setting: &&Setting| setting.flag == DIGEST;
    let is_explained = differences.iter().any(|setting| !is_digest(&setting));
    let told = differences
        .iter()
        .filter(|setting| !(is_explained && is_digest(setting)));
    let in_words = |flag: &str| {
        let known = FIELDS.iter().find(|(field, _)| *field == flag);
        known.map_or(flag, |(_, words)| *words).to_owned()
    };
    told.map(|setting| Setting {
        flag: in_words(&setting.flag),
        ..setting.clone()
    })
    .collect()
}
