//! `batch status`, `batch fetch` and `batch cancel` for the batches of a run folder.

use std::path::PathBuf;

use clap::Args;

use super::report;
use crate::ask::AccessArgs;
use crate::engine::batch::{CollectArgs, FolderBatches, FolderTask};
use crate::engine::images::progress::Progress;
use crate::error::Result;
use crate::report::joined::{choice, open};
use crate::runs::Outcome;
use crate::runs::ShowArgs;
use crate::runs::StdoutFormat;
use crate::runs::stored::{ExperimentKind, StoredRun, read_run_manifest};
use crate::store::{AddressChange, Store};
use crate::types::manifests::Status;
use crate::types::{ChoiceDetail, Decides, OpenDetail};
use darkqa_score::answers::record::Detail;

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
    pub show: ShowArgs,
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
        ExperimentKind::Choice => carry_out_in::<ChoiceDetail>(args, task, progress, choice::write),
        ExperimentKind::Open => carry_out_in::<OpenDetail>(args, task, progress, open::write),
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
