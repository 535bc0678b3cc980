//! Alerts about servers that differ between runs: [`server_alerts`].

use std::collections::{BTreeMap, BTreeSet};

use super::served::has_several;
use super::words::{difference_sentence, run_names};
use crate::report::joined::join::Joined;
use crate::report::joined::settings::{Settings, base_url, differing_settings, has_human_answers, joined_with_and};
use crate::report::text::alert::{Alert, AlertKind};
use darkqa_score::answers::record::Detail;

/// Alerts about models that were served under several names or asked at several base URLs.
pub(super) fn server_alerts<D: Detail>(joined: &Joined<D>) -> Vec<Alert> {
    let run_names = run_names(&joined.runs);
    let mut served = BTreeMap::<&str, BTreeMap<usize, &BTreeSet<String>>>::new();
    for (index, run) in joined.runs.iter().enumerate().filter(|(_, run)| !has_human_answers(&run.manifest)) {
        for (model, names) in &run.served {
            served.entry(model).or_default().insert(index, names);
        }
    }
    let mut alerts = Vec::new();
    for (model, runs) in &served {
        let distinct: BTreeSet<&String> = runs.values().copied().flatten().collect();
        // Names that change within a run have their own alert.
        let is_mixed = runs.values().any(|names| has_several(names));
        if distinct.len() > 1 && !is_mixed {
            let runs: Vec<String> = runs
                .iter()
                .map(|(run, served)| {
                    let served: Vec<&String> = served.iter().collect();
                    format!("{} in {}", joined_with_and(&served), run_names[*run])
                })
                .collect();
            let text = format!("{model} was served as {}.", joined_with_and(&runs));
            alerts.push(Alert::new(AlertKind::Served, text));
        }
    }
    let models: BTreeSet<&String> =
        joined.runs.iter().filter_map(|run| run.manifest.columns.get("model")).flat_map(BTreeMap::keys).collect();
    for model in models {
        let base_urls: Vec<Option<Settings>> = joined
            .runs
            .iter()
            .map(|run| {
                let base_url = base_url(&run.manifest, model)?;
                Some(Settings::from([("--base-url".to_owned(), base_url)]))
            })
            .collect();
        let differences = differing_settings(&base_urls);
        if !differences.is_empty() {
            let what = format!("{model} was asked at several addresses");
            alerts.push(Alert::new(AlertKind::Served, difference_sentence(&what, &differences, &run_names)));
        }
    }
    alerts
}
