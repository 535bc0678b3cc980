//! Servers that differ between runs: [`server_alerts`].

use std::collections::{BTreeMap, BTreeSet};

use super::words::{names, sentence};
use crate::run_reports::join::Joined;
use crate::run_reports::settings::{Settings, address, differing, is_of_people, listed};
use crate::text::alert::{Alert, AlertKind};
use darkqa_score::answers::record::Detail;

/// The names that servers gave for a model, and the addresses, if there are several.
pub(super) fn server_alerts<D: Detail>(joined: &Joined<D>) -> Vec<Alert> {
    let names = names(&joined.runs);
    let mut served = BTreeMap::<&str, BTreeMap<usize, &BTreeSet<String>>>::new();
    for (index, run) in joined
        .runs
        .iter()
        .enumerate()
        .filter(|(_, run)| !is_of_people(&run.manifest))
    {
        for (model, names) in &run.served {
            served.entry(model).or_default().insert(index, names);
        }
    }
    let mut alerts = Vec::new();
    for (model, runs) in &served {
        let distinct: BTreeSet<&String> = runs.values().copied().flatten().collect();
        if distinct.len() > 1 {
            let runs: Vec<String> = runs
                .iter()
                .map(|(run, served)| {
                    let served: Vec<&String> = served.iter().collect();
                    format!("{} in {}", listed(&served), names[*run])
                })
                .collect();
            let text = format!("{model} was served as {}.", listed(&runs));
            alerts.push(Alert::new(AlertKind::Served, text));
        }
    }
    let models: BTreeSet<&String> = joined
        .runs
        .iter()
        .filter_map(|run| run.manifest.columns.get("model"))
        .flat_map(BTreeMap::keys)
        .collect();
    for model in models {
        let addresses = joined.runs.iter().map(|run| {
            let address = address(&run.manifest, model)?;
            Some(Settings::from([("--base-url".to_owned(), address)]))
        });
        let differing = differing(&addresses.collect::<Vec<_>>());
        if !differing.is_empty() {
            let what = format!("{model} was asked at several addresses");
            alerts.push(Alert::new(
                AlertKind::Served,
                sentence(&what, &differing, &names),
            ));
        }
    }
    alerts
}
