//! `batch import` reads the output of a Batch API into the records of a run; `folder` has the commands for submitted
//! batches.
//!
//! `batch status`, `batch fetch` and `batch cancel` for the batches of a run folder.

use std::path::PathBuf;

use clap::Args;

use darkqa_ask::AccessArgs;
use darkqa_base::error::Result;
use darkqa_base::types::manifests::{Counts, RunManifest, Status};
use darkqa_base::types::{ChoiceDetail, Decides, OpenDetail, TrialRef};
use darkqa_engine::batch::{CollectArgs, FolderBatches, FolderTask, replies};
use darkqa_engine::images::progress::Progress;
use darkqa_report::joined::written;
use darkqa_runs::stored::{ExperimentKind, StoredRun, read_run_manifest};
use darkqa_runs::{Outcome, PrintArgs, StdoutFormat, record_table};
use darkqa_score::answers::record::Detail;
use darkqa_store::{AddressChange, Store};

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
    pub show: PrintArgs,
}

/// Imports the replies of output and error files. Each reply is imported once, even if a file is imported again.
///
/// # Errors
/// If the folder has no run or no batch, or a line is invalid. The replies of earlier lines stay imported.
pub(crate) fn import(args: &BatchImportArgs) -> Result<Outcome> {
    match ExperimentKind::read(&args.run)? {
        ExperimentKind::Choice => import_into::<ChoiceDetail>(args, written::write),
        ExperimentKind::Open => import_into::<OpenDetail>(args, written::write_open),
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
    show: &PrintArgs,
    text: &str,
    write: impl FnOnce(&Store<D>, StoredRun<D>, StdoutFormat) -> Result<Outcome>,
) -> Result<Outcome> {
    let mut run = StoredRun::reread(store.folder(), manifest, store.indexed().cloned())?;
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

/// The flags of `batch status`.
#[derive(Debug, Args)]
pub(crate) struct BatchStatusArgs {
    /// The folder of the run
    #[arg(value_name = "RUN", add = Decides::Nothing)]
    pub run: PathBuf,
    /// The endpoint and its key; by default the address at which the batches were made.
    #[command(flatten)]
    pub access: AccessArgs,
}

/// The flags of `batch fetch` and `batch cancel`.
#[derive(Debug, Args)]
pub(crate) struct BatchFolderArgs {
    /// The run, its endpoint and key.
    #[command(flatten)]
    pub run: BatchStatusArgs,
    /// The flags for looking after batches.
    #[command(flatten)]
    pub collect: CollectArgs,
    /// How the report is printed.
    #[command(flatten)]
    pub show: PrintArgs,
}

/// Prints the progress of the batches of a run. Changes nothing, and works while another process is waiting for them.
///
/// # Errors
/// If the folder has no batches that the program submitted, or the server cannot be asked.
pub(crate) fn status(args: &BatchStatusArgs) -> Result<Outcome> {
    let manifest = read_run_manifest(&args.run)?;
    let batches = FolderBatches::open(&args.run, &manifest, &args.access)?;
    Ok(Outcome::text(Status::Complete, batches.status()?))
}

/// Queries each batch once, and imports the replies of those that have ended.
///
/// # Errors
/// If the folder has no batches that the program submitted, or the server refuses.
pub(crate) fn fetch(args: &BatchFolderArgs, progress: &Progress) -> Result<Outcome> {
    carry_out(args, FolderTask::Fetch, progress)
}

/// Cancels the batches, waits until they have ended, and imports the existing replies.
///
/// # Errors
/// If the folder has no batches that the program submitted, or the server refuses.
pub(crate) fn cancel(args: &BatchFolderArgs, progress: &Progress) -> Result<Outcome> {
    carry_out(args, FolderTask::Cancel, progress)
}

fn carry_out(args: &BatchFolderArgs, task: FolderTask, progress: &Progress) -> Result<Outcome> {
    match ExperimentKind::read(&args.run.run)? {
        ExperimentKind::Choice => carry_out_in::<ChoiceDetail>(args, task, progress, written::write),
        ExperimentKind::Open => carry_out_in::<OpenDetail>(args, task, progress, written::write_open),
    }
}

fn carry_out_in<D: Detail>(
    args: &BatchFolderArgs,
    task: FolderTask,
    progress: &Progress,
    write: impl FnOnce(&Store<D>, StoredRun<D>, StdoutFormat) -> Result<Outcome>,
) -> Result<Outcome> {
    let folder = &args.run.run;
    let manifest = read_run_manifest(folder)?;
    let mut store = Store::<D>::open(folder, &manifest, AddressChange::Allowed)?;
    let batches = FolderBatches::open(folder, &manifest, &args.run.access)?;
    let text = batches.carry_out(task, &mut store, &args.collect, progress)?;
    report(&store, manifest, &args.show, &text, write)
}
