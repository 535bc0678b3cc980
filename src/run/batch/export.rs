//! `batch export`: what is left to ask, as input files.

use super::requests::{Requests, remote, told};
use crate::config::BatchExport;
use crate::error::Result;
use crate::run::darkroom::{Darkroom, Desk};
use crate::run::identity::settings;
use crate::run::plan::{FramePlan, Plan, Shot};
use crate::run::progress::Progress;
use crate::run::stage::Stage;
use crate::run::thumbnail::Wanted;
use crate::run::timings::Timings;
use crate::run::trial::Slide;
use crate::run::{Verdict, limit, listed, manifest, moved, open_enhancers};
use crate::store::{Store, read_manifest, read_thumbnails};
use crate::types::manifest::{Counts, Status};
use crate::types::{ChoiceDetail, Detail};

/// Writes the input files, and notes their trials in the run as out.
///
/// # Errors
/// Where a model is built in, an image is larger than the endpoint takes, or a file cannot be written.
pub fn export(config: &BatchExport, progress: &Progress) -> Result<Verdict> {
    Stage::set(&config.evaluation, progress, |stage| {
        write(config, stage, progress)
    })
}

fn write(config: &BatchExport, stage: Stage<'_>, progress: &Progress) -> Result<Verdict> {
    let evaluation = &config.evaluation;
    let askers = stage.inputs.askers;
    remote(askers)?;
    let (_, enhancers) = open_enhancers(stage.files, &evaluation.enhancement)?;
    let kept = read_manifest(&stage.folder, ChoiceDetail::SCHEMA)?;
    let settings = settings(&evaluation.pace, &evaluation.enhancement, &evaluation.ask);
    let images = evaluation.recipe.clone();
    let mut manifest = manifest(ChoiceDetail::SCHEMA, stage.identity, settings, images, kept);
    let mut store = Store::open(&stage.folder, &manifest, moved(&evaluation.output))?;
    store.write_questions(&listed(stage.questions, stage.dataset))?;
    let frames = stage.questions.iter().map(|question| &question.frame);
    let wanted = Wanted::new(frames, read_thumbnails(&stage.folder)?);
    let records = store.records()?;
    let mut plan = Plan::new(&stage.inputs, &records)?;
    let out = plan.leave_out(&store.out_in_batches()?);
    let left = plan.left();
    let answered = plan.trials() - left - out;
    manifest.counts = Counts {
        trials: plan.trials(),
        answered,
        failed: 0,
    };
    store.write_manifest(&manifest)?;
    let mut darkroom = Darkroom {
        dataset: stage.dataset,
        pictures: stage.inputs.pictures,
        recipe: &stage.inputs.recipe,
        enhancers,
        limit: limit(&evaluation.ask, &evaluation.images),
        timings: &Timings::default(),
    };
    darkroom.largest(&plan.frames)?;
    let bar = progress.bar("writing requests", left);
    let mut requests = Requests::new(askers, &config.files, &mut store)?;
    for FramePlan { frame, shots } in plan.frames {
        let mut desk = Desk::new(frame);
        for Shot { condition, trials } in shots {
            let (image, thumbnail) = darkroom.expose(&mut desk, condition.as_ref(), &wanted)?;
            if let Some(thumbnail) = thumbnail {
                requests.store.append_thumbnail(&thumbnail)?;
            }
            let images = image.into_iter().collect();
            requests.add(&Slide { condition, images }, &trials)?;
            bar.advance(trials.len());
        }
    }
    let written = requests.finish()?;
    drop(bar);
    Ok(Verdict {
        status: Status::Complete,
        output: told(&written, answered, out, &stage.folder),
    })
}
