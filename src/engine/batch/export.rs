//! Exports the remaining requests as input files of a Batch API: [`export`].

use std::path::PathBuf;

use super::BatchFileArgs;
use super::file::{Register, RequestCost};
use super::journal::Journal;
use super::requests::{CostOf, Requests, require_remote, summary};
use crate::engine::dark_already;
use crate::engine::experiment::Experiment;
use crate::engine::images::recipes::Maker;
use crate::engine::images::stored::StoredImages;
use crate::engine::images::timings::Timings;
use crate::engine::images::trials::{Item, Plan};
use crate::engine::images::workers::pool;
use crate::engine::open_run::{OpenRun, Remaining, every_model, image_limit, missing_notes, pipeline};
use crate::error::{Error, Result};
use crate::runs::outcome::Outcome;
use crate::types::manifests::Status;

/// Settings for writing input files.
pub(super) struct Target<'a, I: Item> {
    pub(super) files: &'a BatchFileArgs,
    /// Maximum number of tokens waiting for batches of a model; `None` if unknown.
    pub(super) quota: Option<u64>,
    /// Journal for files submitted by the program; `None` for files submitted by the user.
    pub(super) journal: Option<&'a mut Journal>,
    pub(super) cost: CostOf<'a, I>,
}

/// Writes the input files of the first phase with remaining trials, and records in the run that these trials are in a
/// batch.
pub(crate) fn export<E: Experiment>(mut run: OpenRun<'_, E>, files: &BatchFileArgs) -> Result<Outcome> {
    for phase in 0..E::PHASES.len() {
        let models = run.experiment.models(phase);
        let remaining = run.remaining(phase)?;
        let last = phase + 1 == E::PHASES.len();
        if remaining.plan.remaining() == 0 && !last {
            continue;
        }
        require_remote(models)?;
        run.write_counts(&remaining.stored)?;
        let Remaining { plan, in_batch, .. } = remaining;
        let trials = plan.keys.len();
        let answered = trials - plan.remaining() - in_batch;
        let target = Target { files, quota: None, journal: None, cost: &|_, _| RequestCost::default() };
        let written = write(&mut run, phase, plan, target)?;
        let mut output = summary(&written, answered, in_batch, run.store.folder());
        if !last {
            output += "then run the same command again, for the remaining requests and the ";
            output += &(E::PHASES[phase + 1..].join(", ") + "\n");
        }
        return Ok(Outcome::text(Status::Complete, output));
    }
    Ok(Outcome::text(Status::Complete, String::new()))
}

/// Writes the trials of a plan into input files; returns each file with its number of requests.
pub(super) fn write<E: Experiment>(
    run: &mut OpenRun<'_, E>,
    phase: usize,
    plan: Plan<E::Item>,
    target: Target<'_, E::Item>,
) -> Result<Vec<(PathBuf, usize)>> {
    let (experiment, settings) = (run.experiment, run.experiment.settings());
    let workers = pool(settings.loading.threads.threads)?;
    let timings = Timings::default();
    let shows_images = !plan.conditions().is_empty();
    let enhancers = if shows_images { run.enhancers.take_models()? } else { Vec::new() };
    let limit = image_limit(settings);
    let maker = Maker::new(run.enhancers.version(), &settings.loading.size);
    let images = run.images.as_ref();
    let mut pipeline = pipeline(experiment, Vec::new(), limit, &timings);
    pipeline.steps.stored = images.map(|images| StoredImages::new(images, &maker));
    let missing = missing_notes(experiment, run.store.folder());
    let sources = experiment.sources();
    workers.install(|| {
        pipeline.open_enhancers(enhancers, &settings.loading, sources, &plan.sources)?;
        if shows_images {
            dark_already::warn(experiment);
        }
        pipeline.check_largest_image(sources, &plan.sources)
    })?;
    let usages = pipeline.usages();
    let bar = run.progress.bar("writing requests", plan.remaining());
    let register = Register { store: &mut run.store, journal: target.journal };
    let (models, files) = (experiment.models(phase), target.files);
    let all = every_model(experiment);
    let mut requests = Requests::new(models, &all, files, target.quota, register, target.cost)?;
    let mut problems = Vec::new();
    let plan = plan.sources.into_iter();
    workers.install(|| {
        pipeline.for_each_group(sources, plan, &missing, |group| {
            bar.advance(group.trials.len());
            match group.problem {
                Some(ended @ Error::EnhancerEnded { .. }) => Err(ended),
                Some(problem) => {
                    tracing::debug!("{problem}");
                    problems.push(problem.to_string());
                    Ok(())
                }
                None => requests.add(&group),
            }
        })
    })?;
    drop(bar);
    if let Some(first) = problems.first() {
        tracing::warn!(
            "groups of requests that are not in the files, because their images cannot be made: {}; the first: {first}",
            problems.len()
        );
    }
    let written = requests.finish()?;
    run.note_enhancers(usages);
    run.store.write_manifest(&run.manifest)?;
    Ok(written)
}
