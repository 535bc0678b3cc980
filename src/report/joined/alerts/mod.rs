//! Alerts at the top of a report: problems of its runs, differences between them, and limitations of its numbers
//! ([`alerts`]).

mod images;
mod models;
mod questions;
mod replies;

use std::collections::BTreeMap;

use super::combine::CombinedRuns;
use super::enhancers::enhancer_alerts;
use super::join::{Joined, JoinedRun};
use crate::text::alert::{Alert, AlertKind};
use darkqa_base::types::manifests::Status;
use darkqa_base::types::text::plural;
use darkqa_base::types::{InputSummary, OpenDetail, StoredDetail as _, TrialRef};
use darkqa_runs::LUX_AT_L0;
use darkqa_runs::outcome::OverBudget;
use darkqa_score::answers::record::Detail;
use darkqa_score::comparisons::self_agreement::SelfAgreement;
use darkqa_score::comparisons::{compares_enhancers, ranks_models};
use darkqa_score::findings::Findings;
use darkqa_score::photographs::{PairDarkness, PhotographedSet};

pub(super) use replies::{empty_answer_alerts, missing_alerts};

/// All alerts of a report on multiple-choice questions, ordered by kind.
pub(super) fn alerts(combined: &CombinedRuns, findings: &Findings<'_>) -> Vec<Alert> {
    let mut alerts = run_alerts(combined);
    alerts.extend(joining_alerts(combined));
    alerts.extend(missing_alerts(&replies::counts(&findings.health), "Replies"));
    alerts.extend(replies::reply_alerts(&findings.health, "count as wrong"));
    alerts.extend(unread_early_ends(combined, "count as wrong"));
    alerts.extend(replies::empty_choice_alerts(combined));
    alerts.extend(replies::broken_off_alert(combined));
    alerts.extend(replies::people_alerts(combined));
    alerts.extend(images::image_alerts(combined));
    alerts.extend(images::shrunk_alerts(combined));
    alerts.extend(replies::parsing_alerts(combined));
    alerts.extend(replies::confidence_alerts(&combined.runs, &combined.trials));
    alerts.extend(models::constraint_alerts(&combined.runs, &combined.trials));
    alerts.extend(questions::repeat_alert(combined));
    alerts.extend(questions::item_alerts(findings));
    alerts.extend(questions::balance_alert(findings));
    alerts.extend(questions::cluster_alerts(combined, findings.grid.clusters, findings.unit));
    alerts.extend(questions::rare_loss_alert(findings));
    alerts.extend(dark_photographs_alert(findings.set));
    alerts.extend(unused_lux_alert(findings.set, findings.curves.iter().any(|curve| curve.summary.threshold.is_ok())));
    alerts.extend(many_models_alert(findings));
    alerts.extend(many_enhancers_alert(findings));
    alerts
        .extend(findings.pairs.iter().flat_map(PairDarkness::warnings).map(|text| Alert::new(AlertKind::Pairs, text)));
    alerts.sort_by_key(|alert| alert.kind);
    alerts
}

/// All alerts of a report on questions without ground-truth answers, ordered by kind. Such a report measures
/// self-agreement.
pub(super) fn alerts_without_truths(combined: &CombinedRuns, agreement: &SelfAgreement<'_>) -> Vec<Alert> {
    let mut alerts = run_alerts(combined);
    alerts.extend(joining_alerts(combined));
    alerts.extend(missing_alerts(&replies::counts(&agreement.health), "Replies"));
    alerts.extend(replies::reply_alerts(&agreement.health, "do not agree"));
    alerts.extend(unread_early_ends(combined, "do not agree"));
    alerts.extend(replies::empty_choice_alerts(combined));
    alerts.extend(replies::broken_off_alert(combined));
    alerts.extend(replies::parsing_alerts(combined));
    alerts.extend(models::constraint_alerts(&combined.runs, &combined.trials));
    alerts.extend(questions::cluster_alerts(combined, agreement.grid.clusters, agreement.unit));
    alerts.extend(dark_photographs_alert(agreement.set));
    alerts.extend(unused_lux_alert(agreement.set, agreement.curves.iter().any(|curve| curve.threshold.is_ok())));
    alerts.sort_by_key(|alert| alert.kind);
    alerts
}

/// Alert about a stated light at L0 that no number is derived from, because no threshold is known.
fn unused_lux_alert(set: PhotographedSet, has_threshold: bool) -> Option<Alert> {
    let lux = set.lux.filter(|_| set.exposed.is_none() && !has_threshold)?;
    let text =
        format!("{LUX_AT_L0} {lux} changes nothing here: no threshold is known; the table of thresholds says why.");
    Some(Alert::new(AlertKind::Light, text))
}

/// Alerts about replies that the server ended early, and that have no answer in the strict parsing.
fn unread_early_ends(combined: &CombinedRuns, unread_as: &str) -> Vec<Alert> {
    let is_unread = |trial: TrialRef<'_>| trial.strict().is_none_or(|strict| strict.why.is_some());
    replies::ended_early_alerts(combined.trials.iter(), is_unread, unread_as)
}

/// Alerts about answers to open questions that the server ended early without any text: they get no mark.
pub(super) fn open_early_ends(joined: &Joined<OpenDetail>) -> Vec<Alert> {
    replies::ended_early_alerts(
        joined.trials.iter().filter(|trial| trial.is_answer()),
        |trial| {
            let record = trial.record();
            let has_text = record.reply.is_some_and(|reply| !reply.trim().is_empty());
            record.refusal.is_some() || !has_text
        },
        "score 0",
    )
}

/// Alert for a report with too many models for a ranking.
fn many_models_alert(findings: &Findings<'_>) -> Option<Alert> {
    let text = "Too many models to rank them: none is called best. Reports of fewer models rank them.";
    (!ranks_models(&findings.grid)).then(|| Alert::new(AlertKind::Models, text))
}

/// Alert for a report with too many enhancers for pairwise comparisons.
fn many_enhancers_alert(findings: &Findings<'_>) -> Option<Alert> {
    let text = "Too many enhancers to compare them with each other: no pair of them is tested. Reports of fewer enhancers do so.";
    (!compares_enhancers(&findings.grid)).then(|| Alert::new(AlertKind::Models, text))
}

/// Alert for a set of photographs that were taken in the dark.
fn dark_photographs_alert(set: PhotographedSet) -> Option<Alert> {
    set.notice().map(|text| Alert::new(AlertKind::Pairs, text))
}

/// Alerts about the runs themselves, for multiple-choice and open-ended questions: from manifests, questions and
/// trials, not from scores.
pub(super) fn run_alerts<D: Detail>(joined: &Joined<D>) -> Vec<Alert> {
    let mut alerts = progress_alerts(&joined.runs);
    alerts.extend(cost_alerts(&joined.runs));
    alerts.extend(models::server_alerts(joined));
    alerts.extend(models::served_alerts(joined));
    alerts.extend(models::provider_alerts(&joined.trials));
    alerts.extend(models::limit_alerts(joined));
    alerts.extend(enhancer_alerts(&joined.runs));
    alerts.extend(input_alerts(&joined.runs));
    alerts.extend(images::adaptation_alerts(&joined.runs));
    alerts.extend(images::change_alerts(&joined.runs));
    alerts.extend(images::noise_alerts(joined));
    alerts.extend(images::rounding_alert(joined));
    if joined.runs.len() > 1 {
        alerts.extend(models::setting_alerts(joined));
        alerts.extend(questions::question_alerts(joined));
    }
    alerts.sort_by_key(|alert| alert.kind);
    alerts
}

/// One alert for each run that cost more than its limit.
fn cost_alerts(runs: &[JoinedRun]) -> Vec<Alert> {
    runs.iter()
        .filter_map(|run| {
            let sentence = OverBudget::read(&run.manifest)?.sentence();
            let text = match runs {
                [_] => sentence,
                _ => format!("{}: {sentence}", run.name),
            };
            Some(Alert::new(AlertKind::Cost, text))
        })
        .collect()
}

/// Alerts about combining the runs: models under several names, omitted models, and runs whose replies are all in other
/// runs.
pub(super) fn joining_alerts<D: Detail>(joined: &Joined<D>) -> Vec<Alert> {
    let mut alerts: Vec<Alert> = joined
        .runs
        .iter()
        .filter(|run| run.replies > 0 && run.added == 0)
        .map(|run| {
            let text = format!(
                "All {} of {} are in the other runs, too, and count once.",
                plural(run.replies, "reply", "replies"),
                run.name
            );
            Alert::new(AlertKind::Runs, text)
        })
        .collect();
    alerts.extend(models::left_out_alerts(&joined.runs));
    alerts.extend(models::model_alerts(joined));
    alerts
}

/// Alerts about folders that were given more than once on the command line. `folders` has each name with its number of
/// occurrences.
pub(super) fn duplicate_folder_alerts(folders: &[(String, usize)]) -> Vec<Alert> {
    folders
        .iter()
        .map(|(name, times)| {
            let times = match times {
                2 => "twice".to_owned(),
                more => format!("{more} times"),
            };
            let text = format!("{name} is named {times} and counted once.");
            Alert::new(AlertKind::Runs, text)
        })
        .collect()
}

/// Alerts about changes made to images when their files were read. Runs with the same change share an alert.
fn input_alerts(runs: &[JoinedRun]) -> Vec<Alert> {
    let mut lines = BTreeMap::<String, Vec<&str>>::new();
    for run in runs {
        for line in run.manifest.inputs.iter().flat_map(InputSummary::lines) {
            lines.entry(line).or_default().push(&run.name);
        }
    }
    lines
        .into_iter()
        .map(|(line, names)| {
            let text = match runs {
                [_] => format!("{line}."),
                _ => format!("{}: {line}.", names.join(", ")),
            };
            Alert::new(AlertKind::Read, text)
        })
        .collect()
}

/// One alert for each run that is not complete.
fn progress_alerts(runs: &[JoinedRun]) -> Vec<Alert> {
    runs.iter()
        .filter(|run| run.manifest.status != Status::Complete)
        .map(|run| {
            let (status, counts) = (run.manifest.status, run.manifest.counts);
            let text = if counts.answered < counts.trials {
                format!(
                    "{}: {status}: {} of {} trials answered, {} failed. The same command asks the rest.",
                    run.name, counts.answered, counts.trials, counts.failed
                )
            } else {
                let rest = match status {
                    Status::Incomplete if run.manifest.schema == OpenDetail::SCHEMA => {
                        ", but shards are missing, or marks of the judge could not be read."
                    }
                    Status::Incomplete => ", but shards are missing.",
                    _ => ". The same command completes the run.",
                };
                format!("{}: {status}: all {} trials are answered{rest}", run.name, counts.trials)
            };
            Alert::new(AlertKind::NotComplete, text)
        })
        .collect()
}
