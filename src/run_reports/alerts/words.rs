//! Words of alerts: [`names`] and [`sentence`].

use crate::run_reports::join::JoinedRun;
use crate::run_reports::settings::Setting;

/// The names of runs.
pub(super) fn names(runs: &[JoinedRun]) -> Vec<String> {
    runs.iter().map(|run| run.name.clone()).collect()
}

/// The sentence about a difference, with the settings behind it: `The light differs: --seed is 0 in a and 1 in b.`
pub(super) fn sentence(what: &str, settings: &[Setting], names: &[String]) -> String {
    let settings: Vec<String> = settings
        .iter()
        .map(|setting| setting.words(names))
        .collect();
    format!("{what}: {}.", settings.join("; "))
}
