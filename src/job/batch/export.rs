//! What is left to ask, as input files: [`export`].

use std::path::PathBuf;

use super::BatchFileArgs;
use super::requests::{Requests, remote, summary};
use crate::error::Result;
use crate::job::experiment::Experiment;
use crate::job::open_run::{OpenRun, Remaining, limit, pipeline, wanted};
use crate::job::outcome::Outcome;
use crate::job::plan::Plan;
use crate::job::timings::Timings;
use crate::job::workers::pool;
use crate::types::manifest::Status;

/// Writes the input files of the first phase that has anything left, and notes its trials in the run as sent.
pub(crate) fn export<E: Experiment>(
    mut run: OpenRun<'_, E>,
    files: &BatchFileArgs,
) -> Result<Outcome> {
    for phase in 0..E::PHASES.len() {
        let models = run.experiment.models(phase);
        let left = run.left(phase)?;
        let last = phase + 1 == E::PHASES.len();
        if left.plan.left() == 0 && !last {
            continue;
        }
        remote(models)?;
        run.note_counts(&left.stored)?;
        let Remaining { plan, out, .. } = left;
        let trials = plan.keys.len();
        let answered = trials - plan.left() - out;
        let written = write(&mut run, phase, plan, files)?;
        let mut output = summary(&written, answered, out, run.store.folder());
        if !last {
            output += "and after that the same command again, for what is left and the ";
            output += &(E::PHASES[phase + 1..].join(", ") + "\n");
        }
        return Ok(Outcome {
            status: Status::Complete,
            output,
        });
    }
    Ok(Outcome {
        status: Status::Complete,
        output: String::new(),
    })
}

fn write<E: Experiment>(
    run: &mut OpenRun<'_, E>,
    phase: usize,
    plan: Plan<E::Item>,
    files: &BatchFileArgs,
) -> Result<Vec<(PathBuf, usize)>> {
    let (experiment, settings) = (run.experiment, run.experiment.settings());
    let workers = pool(settings.loading.threads.threads)?;
    let timings = Timings::default();
    let enhancers = if plan.conditions().is_empty() {
        Vec::new()
    } else {
        run.enhancers.take()?
    };
    let limit = limit(settings);
    let mut pipeline = pipeline(experiment, enhancers, limit, &timings);
    let wanted = wanted(experiment, run.store.folder())?;
    let sources = experiment.sources();
    workers.install(|| pipeline.largest(sources, &plan.sources))?;
    let bar = run.progress.bar("writing requests", plan.left());
    let mut requests = Requests::<E::Item>::new(experiment.models(phase), files, &mut run.store)?;
    let mut unshown = Vec::new();
    let plan = plan.sources.into_iter();
    workers.install(|| {
        pipeline.one_by_one(sources, plan, &wanted, |group| {
            bar.advance(group.trials.len());
            if let Some(problem) = &group.problem {
                tracing::debug!("{problem}");
                unshown.push(problem.clone());
                return Ok(());
            }
            requests.add(&group)
        })
    })?;
    drop(bar);
    if let Some(first) = unshown.first() {
        tracing::warn!(
            "{} groups of requests have images that cannot be made and are not in the files; the first: {first}",
            unshown.len()
        );
    }
    requests.finish()
}
