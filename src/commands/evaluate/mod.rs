//! The evaluation: questions with choices about each frame ([`evaluate`]).

pub(crate) mod check;
mod experiment;
mod samples;
mod settings;
mod setup;
mod write_plan;

use darkqa_base::error::Result;
use darkqa_engine::Job;
use darkqa_engine::batch::{BatchFileArgs, BatchRunArgs};
use darkqa_engine::images::progress::Progress;
use darkqa_runs::Outcome;
use setup::ChoiceSetup;

pub(crate) use check::{CheckArgs, check};
pub(crate) use settings::{EvaluateArgs, ShrinkArgs};
pub(crate) use write_plan::plan;

/// Runs an evaluation or continues it; a dry run prints the estimate of its cost.
///
/// # Errors
/// If nothing can be asked, or no further trial could succeed. Replies that have arrived stay stored.
pub(crate) fn evaluate(args: EvaluateArgs, progress: &Progress) -> Result<Outcome> {
    let config = args.resolve()?;
    let (setup, files) = ChoiceSetup::open(&config, progress)?;
    setup.print_column_mapping(progress);
    Job::new(&setup, files, progress)?.run()
}

/// The estimate of a run, in words.
fn estimate(args: EvaluateArgs, progress: &Progress) -> Result<String> {
    let config = args.resolve()?;
    let (setup, files) = ChoiceSetup::open(&config, progress)?;
    let outcome = Job::new(&setup, files, progress)?.run()?;
    Ok(outcome.output)
}

/// Writes the remaining trials as files of a Batch API, and marks them in the run as sent.
///
/// # Errors
/// If a model is built in, an image is too large for the endpoint, or a file cannot be written.
pub(crate) fn export_batch(args: EvaluateArgs, files: &BatchFileArgs, progress: &Progress) -> Result<Outcome> {
    let config = args.resolve()?;
    let (setup, models) = ChoiceSetup::open(&config, progress)?;
    setup.print_column_mapping(progress);
    Job::new(&setup, models, progress)?.export_batch(files)
}

/// Asks the remaining trials in batches that the program submits, and waits for their replies.
///
/// # Errors
/// If a model is built in, or a server refuses all further requests. The batches stay, and the same command continues.
pub(crate) fn run_batch(
    args: EvaluateArgs,
    files: &BatchFileArgs,
    batch: &BatchRunArgs,
    progress: &Progress,
) -> Result<Outcome> {
    let config = args.resolve()?;
    let (setup, models) = ChoiceSetup::open(&config, progress)?;
    setup.print_column_mapping(progress);
    Job::new(&setup, models, progress)?.run_batch(files, batch)
}
