//! Keys of the stored trials of a run that decide what is asked: [`answered`], [`truncated`], [`lost_for_good`].

use std::collections::{HashMap, HashSet};

use crate::models::ModelUnderTest;
use crate::settings::JobSettings;
use darkqa_base::types::TrialKey;
use darkqa_store::StoredTrial;

/// Keys of the trials without a reply that were charged as often as `--retries paid` allows.
pub fn lost_for_good(stored: &[StoredTrial], settings: &JobSettings) -> HashSet<TrialKey> {
    let Some(max_lost) = settings.ask.servers().into_iter().map(|server| server.sending.paid_retries).max() else {
        return HashSet::new();
    };
    stored.iter().filter(|trial| trial.failed() && trial.lost_attempts() > max_lost).map(|trial| trial.key).collect()
}

/// Keys of the trials whose reply was truncated at a lower limit than the current one of their model.
pub fn truncated(stored: &[StoredTrial], models: &[ModelUnderTest]) -> HashSet<TrialKey> {
    let limits: HashMap<&str, (u32, u32)> =
        models.iter().filter_map(|model| Some((&*model.name, model.model.token_limits()?))).collect();
    stored
        .iter()
        .filter(|trial| {
            limits.get(trial.model.as_str()).is_some_and(|&(limit, first)| trial.is_truncated_below(limit, first))
        })
        .map(|trial| trial.key)
        .collect()
}

/// Keys of the trials that have a reply.
pub fn answered(stored: &[StoredTrial]) -> HashSet<TrialKey> {
    stored.iter().filter(|record| !record.failed()).map(|record| record.key).collect()
}
