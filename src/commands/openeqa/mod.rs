//! `openeqa`: asks open questions about walks through houses in low light, and has a judge mark the answers.
//!
//! The models are asked for answers first, walk by walk. Then the judge is asked for marks. Both phases use the engine
//! of an evaluation. Models, levels, human answers and judges may be added to a run later.

mod answers_file;
mod experiment;
mod judge;
mod marks;
mod plan;
mod questions;
mod record;
mod settings;
mod setup;
mod study;

use crate::engine::Job;
use crate::engine::images::progress::Progress;
use crate::error::Result;
use crate::runs::Outcome;

pub(crate) use judge::JudgeArgs;
pub(crate) use settings::OpenEqaArgs;
use settings::OpenTask;
use setup::OpenSetup;

/// Asks the questions, writes or submits them as a batch, or writes a study page, depending on the flags.
///
/// # Errors
/// If nothing can be asked, or no further trial could succeed. Replies that have arrived stay stored.
pub(crate) fn openeqa(args: OpenEqaArgs, progress: &Progress) -> Result<Outcome> {
    let config = args.resolve()?;
    let (setup, files) = OpenSetup::open(&config, progress)?;
    match &config.task {
        OpenTask::Run => Job::new(&setup, files, progress)?.run(),
        OpenTask::Batch(batch) => Job::new(&setup, files, progress)?.export_batch(batch),
        OpenTask::BatchRun(batch, args) => Job::new(&setup, files, progress)?.run_batch(batch, args),
        OpenTask::Study(folder) => study::pack(&setup, files, folder, progress),
    }
}
