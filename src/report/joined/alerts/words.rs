//! Wording that alerts share: [`run_names`] and [`difference_sentence`].

use crate::report::joined::join::JoinedRun;
use crate::report::joined::settings::Setting;

/// The names of runs.
pub(super) fn run_names(runs: &[JoinedRun]) -> Vec<String> {
    runs.iter().map(|run| run.name.clone()).collect()
}

/// The sentence about a difference, with the settings that cause it: `The light differs: --seed is 0 in a and 1 in b.`
pub(super) fn difference_sentence(what: &str, settings: &[Setting], names: &[String]) -> String {
    let settings: Vec<String> = settings.iter().map(|setting| setting.words(names)).collect();
    format!("{what}: {}.", settings.join("; "))
}
