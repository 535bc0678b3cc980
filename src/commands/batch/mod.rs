//! `batch import` reads the output of a Batch API into the records of a run; [`folder`] has the commands for submitted
//! batches.

mod folder;

use std::path::PathBuf;

use clap::Args;

use crate::engine::batch::replies;
use crate::error::Result;
use crate::report::joined::{choice, open};
use crate::runs::Outcome;
use crate::runs::ShowArgs;
use crate::runs::StdoutFormat;
use crate::runs::record_table;
use crate::runs::stored::{ExperimentKind, StoredRun, read_run_manifest};
use crate::store::{AddressChange, Store};
use crate::types::manifests::{Counts, RunManifest};
use crate::types::{ChoiceDetail, Decides, OpenDetail, TrialRef};
use darkqa_score::answers::record::Detail;

pub(crate) use folder::{BatchFolderArgs, BatchStatusArgs, cancel, fetch, status};

/// The flags of `batch import`.
#[derive(Debug, Args)]
pub(crate) struct BatchImportArgs {
    /// The folder of the run that the batch was exported from
    #[arg(value_name = "RUN", add = Decides::Nothing)]
    pub run: PathBuf,
    /// The output files and error files of the Batch API, in any order
    #[arg(value_name = "FILE", required = true, add = Decides::Nothing)]
    pub files: Vec<PathBuf>,
    /// How the report is printed.
    #[command(flatten)]
    pub show: ShowArgs,
}

/// Imports the replies of output and error files. Each reply is imported once, even if a file is imported again.
///
/// # Errors
/// If the folder has no run or no batch, or a line is invalid. The replies of earlier lines stay imported.
pub(crate) fn import(args: &BatchImportArgs) -> Result<Outcome> {
    match ExperimentKind::read(&args.run)? {
        ExperimentKind::Choice => import_into::<ChoiceDetail>(args, choice::write),
        ExperimentKind::Open => import_into::<OpenDetail>(args, open::write),
    }
}

fn import_into<D: Detail>(
    args: &BatchImportArgs,
    write: impl FnOnce(&Store<D>, StoredRun<D>, StdoutFormat) -> Result<Outcome>,
) -> Result<Outcome> {
    let manifest = read_run_manifest(&args.run)?;
    let mut store = Store::<D>::open(&args.run, &manifest, AddressChange::Allowed)?;
    let imported = replies::import(&mut store, &manifest, &args.files)?;
    report(&store, manifest, &args.show, &imported, write)
}

/// Writes the report of a run with new replies. The text for standard output begins with `text`, which describes the
/// new replies.
fn report<D: Detail>(
    store: &Store<D>,
    manifest: RunManifest,
    show: &ShowArgs,
    text: &str,
    write: impl FnOnce(&Store<D>, StoredRun<D>, StdoutFormat) -> Result<Outcome>,
) -> Result<Outcome> {
    let mut run = StoredRun::reread(store.folder(), manifest)?;
    let trials = run.manifest.counts.trials.max(run.trials.len());
    let failed = run.trials.iter().map(TrialRef::failed);
    run.manifest.set_counts(Counts::new(trials, failed));
    let mut outcome = write(store, run, show.format())?;
    record_table::update(store.folder(), show.record_table())?;
    if !show.format().is_json() {
        outcome.output.insert_str(0, text);
    }
    Ok(outcome)
}
