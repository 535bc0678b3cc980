//! The manifest of a run that was lost while its records are intact, made again from the command that made it.

use std::collections::HashSet;
use std::path::Path;

use crate::engine::experiment::Experiment;
use crate::error::{Error, Result};
use crate::images::plan::Plan;
use crate::store;
use crate::types::TrialKey;
use crate::types::manifest::RunManifest;

/// Keys of all trials of this command, in all phases.
pub(crate) fn planned_keys<E: Experiment>(
    experiment: &E,
    folder: &Path,
) -> Result<HashSet<TrialKey>> {
    let mut keys = HashSet::new();
    for phase in 0..E::PHASES.len() {
        let plan = experiment.plan(phase, || store::read_records(folder))?;
        keys.extend(Plan::new(plan).keys);
    }
    Ok(keys)
}

/// Writes the manifest of this command into a run folder that has lost its own. The key of a trial is a digest of all that decides its
/// reply: if the command has the keys of all replies, it is the one that made them.
///
/// # Errors
/// If a reply is not one to a trial of this command.
pub(crate) fn restore<E: Experiment>(
    experiment: &E,
    folder: &Path,
    manifest: &RunManifest,
    damage: &str,
) -> Result<()> {
    let planned = planned_keys(experiment, folder)?;
    let trials = store::read_trials(folder)?;
    let replies = trials.iter().filter(|trial| !trial.failed());
    let (own, others): (Vec<_>, Vec<_>) = replies.partition(|trial| planned.contains(&trial.key));
    if !others.is_empty() {
        let problem = format!(
            "{damage}, and {} of {} replies are not of this command: the records are intact; call the command that made them, with all its \
             models, levels and flags",
            others.len(),
            own.len() + others.len()
        );
        let path = folder.to_owned();
        return Err(Error::Run { path, problem });
    }
    store::restore_manifest(folder, manifest)?;
    tracing::warn!(
        "{damage}; made again: all {} replies of the run are of this command",
        own.len()
    );
    Ok(())
}
