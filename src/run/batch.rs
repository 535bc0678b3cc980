//! `batch import`: the output of a Batch API, as records.

use crate::config::{BatchImport, Show};
use crate::error::Result;
use crate::job::batch::replies;
use crate::job::report::{choice, open};
use crate::job::stored::{Asked, StoredRun, manifest};
use crate::job::{Outcome, count};
use crate::store::{Moved, Store};
use crate::types::{ChoiceDetail, Detail, OpenDetail};

/// Imports the replies of output and error files, each of them once, however often a file is given.
///
/// # Errors
/// If the folder holds no run or no batch, or a line is not one of such a file: those before it are kept.
pub fn import(config: &BatchImport) -> Result<Outcome> {
    match Asked::of(&config.run)? {
        Asked::Choice => import_into::<ChoiceDetail>(config, choice::write),
        Asked::Open => import_into::<OpenDetail>(config, open::write),
    }
}

fn import_into<D: Detail>(
    config: &BatchImport,
    write: impl FnOnce(&Store<D>, StoredRun<D>, Show) -> Result<Outcome>,
) -> Result<Outcome> {
    let manifest = manifest(&config.run)?;
    let mut store = Store::<D>::open(&config.run, &manifest, Moved::Allowed)?;
    let imported = replies::import(&mut store, &manifest, &config.files)?;
    let mut run = StoredRun::of(&config.run, manifest)?;
    let trials = run.manifest.counts.trials.max(run.records.len());
    run.manifest.count(count(trials, &run.records));
    let mut outcome = write(&store, run, config.show)?;
    if config.show == Show::Table {
        outcome.output.insert_str(0, &imported);
    }
    Ok(outcome)
}
