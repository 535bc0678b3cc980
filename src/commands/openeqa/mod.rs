//! `openeqa`: asks open questions about walks through houses in low light, and has a judge mark the answers.
//!
//! The models are asked for answers first, walk by walk. Then the judge is asked for marks. Both phases use the engine
//! of an evaluation. Models, levels, human answers and judges may be added to a run later.
//!
//! The study page for open questions, on which each person sees each walk in one condition only.

mod experiment;
mod record;
mod settings;
mod setup;

use std::path::Path;
use std::sync::Arc;

use darkqa_base::error::Result;
use darkqa_base::files::write;
use darkqa_base::types::manifests::Status;
use darkqa_base::types::text::counted;
use darkqa_base::types::{Condition, Digest};
use darkqa_engine::experiment::Experiment as _;
use darkqa_engine::images::enhancement::enhancers::EnhancerModels;
use darkqa_engine::images::progress::Progress;
use darkqa_engine::images::recipes::Maker;
use darkqa_engine::images::stored::StoredImages;
use darkqa_engine::images::timings::Timings;
use darkqa_engine::images::workers::pool;
use darkqa_engine::{Job, image_limit, pipeline};
use darkqa_enhance::ModelFile;
use darkqa_pictures::Payload;
use darkqa_report::study::{StudyImage, StudyQuestion, page};
use darkqa_runs::Outcome;
use settings::OpenTask;
use setup::OpenSetup;

pub(crate) use settings::{JudgeArgs, OpenEqaArgs};

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
        OpenTask::Study(folder) => pack(&setup, files, folder, progress),
    }
}

/// Writes the page and its images. Each image has the same bytes as in a request to a model. The page contains no true
/// answers.
///
/// # Errors
/// If a frame cannot be computed or a file cannot be written.
fn pack(setup: &OpenSetup<'_>, files: Vec<ModelFile>, folder: &Path, progress: &Progress) -> Result<Outcome> {
    let settings = setup.settings();
    let mut enhancers = EnhancerModels::load(files, &settings.loading)?;
    let limit = image_limit(settings);
    let timings = Timings::default();
    let images = settings.images.open(settings.access)?;
    let mut pipeline = pipeline(setup, enhancers.take()?, limit, &timings);
    let maker = Maker::new(enhancers.version(), &settings.loading.size);
    let stored = images.as_ref();
    pipeline.steps.stored = stored.map(|images| StoredImages::new(images, &maker, pipeline.steps.png));
    let workers = pool(settings.loading.threads.threads)?;
    let conditions: Vec<&Condition> = setup.conditions.iter().collect();
    let bar = progress.bar("walks", setup.sources.len());
    let (mut asked, mut written, mut walks) = (Vec::new(), 0, 0);
    for (number, walk) in setup.sources.iter().enumerate() {
        if walk.problem.is_some() {
            continue;
        }
        let shown = workers.install(|| pipeline.images(walk, &conditions))?;
        let mut shots = Vec::new();
        for (condition, mut payloads) in conditions.iter().zip(shown) {
            // Consecutive repetitions of a frame are shown once.
            payloads.dedup_by(|next, previous| Arc::ptr_eq(next, previous));
            let mut names = Vec::with_capacity(payloads.len());
            for (place, payload) in payloads.iter().enumerate() {
                let name = image_name(&walk.name.0, condition, place, payload);
                write(&folder.join(&name), payload.file())?;
                names.push(name);
            }
            written += names.len();
            shots.push(StudyImage { condition: condition.to_string(), images: names });
        }
        walks += 1;
        let questions = setup.questions.iter().filter(|question| question.episode == walk.name.0);
        asked.extend(questions.map(|question| StudyQuestion {
            id: question.id.0.clone(),
            frame: number,
            text: question.text.clone(),
            choices: Vec::new(),
            shots: shots.clone(),
        }));
        bar.inc();
    }
    drop(bar);
    let path = folder.join("study.html");
    write(&path, page(&asked)?.as_bytes())?;
    Ok(Outcome::wrote(
        &path,
        Status::Complete,
        format!(
            "{}: {} about {}, {}, {}; a person sees each walk in one of them, and {} people \
             see it in all\nto mark what they save: openeqa --answers NAME=FILE\n",
            path.display(),
            counted(asked.len(), "question"),
            counted(walks, "walk"),
            counted(written, "image"),
            counted(conditions.len(), "condition"),
            conditions.len()
        ),
    ))
}

/// The file name of an image, which does not reveal the level.
fn image_name(walk: &str, condition: &Condition, place: usize, payload: &Payload) -> String {
    let digest = Digest::from_parts([walk.as_bytes(), condition.to_string().as_bytes()]);
    let ending = if payload.facts().format == "png" { "png" } else { "jpg" };
    format!("images/{}-{place:03}.{ending}", &digest.to_string()[..16])
}
