//! Alerts about models asked with another token limit than the run began with: [`limit_alerts`].

use std::collections::BTreeMap;

use crate::report::joined::join::{Joined, JoinedRun};
use crate::report::text::alert::{Alert, AlertKind};
use crate::types::text::plural;
use darkqa_score::answers::record::Detail;
use darkqa_score::model_in_condition::without_run;

/// One alert for each model asked with more than its first token limit, with the number of replies at each limit.
pub(super) fn limit_alerts<D: Detail>(joined: &Joined<D>) -> Vec<Alert> {
    let mut counts = BTreeMap::<&str, BTreeMap<Option<u32>, usize>>::new();
    for trial in joined.trials.iter().filter(|trial| trial.has_reply()) {
        let limits = counts.entry(trial.model()).or_default();
        *limits.entry(trial.max_tokens()).or_default() += 1;
    }
    counts
        .iter()
        .filter(|(_, limits)| limits.keys().any(Option::is_some)).map(|(model, limits)| {
        let first = first_limit(&joined.runs, without_run(model));
        let words: Vec<String> = limits.iter().map(|(limit, count)| {
            let limit = limit.map_or_else(|| first.clone(), |limit| limit.to_string());
            format!("{} with {limit}", plural(*count, "reply", "replies"))
        }).collect();
        let count = if limits.len() == 1 { "another token limit than the run began with" } else { "several token limits" };
        let text = format!(
            "{model} was asked with {count} (--max-tokens): {}. A truncated reply is asked again when the limit grows.",
            words.join(", ")
        );
        Alert::new(AlertKind::Parameters, text)
    }).collect()
}

/// The first token limit of a model in its runs, as text.
fn first_limit(runs: &[JoinedRun], model: &str) -> String {
    runs.iter()
        .filter_map(|run| {
            let models = run.manifest.columns.get("model")?;
            models.get(model)?.get("--max-tokens")?.as_u64()
        })
        .min()
        .map_or_else(|| "the first limit".to_owned(), |limit| limit.to_string())
}
