//! `batch export`: what is left to ask, as input files.

use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

use super::file::Files;
use crate::ask::{Model, Payload, batch};
use crate::config::BatchExport;
use crate::error::{Error, Result};
use crate::run::askers::Asker;
use crate::run::darkroom::{Darkroom, Desk};
use crate::run::plan::{Plan, Shot};
use crate::run::progress::Progress;
use crate::run::stage::Stage;
use crate::run::thumbnail::Wanted;
use crate::run::{Verdict, limit, listed, manifest, moved, open_enhancers, record};
use crate::store::{BATCH, Store, read_manifest, read_thumbnails};
use crate::types::View;
use crate::types::manifest::{Counts, Status};

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
    if let Some(local) = askers.iter().find(|asker| !asker.model.is_remote()) {
        let problem = format_args!(
            "{} is built in; a batch asks models of an endpoint",
            local.model.name()
        );
        return Err(Error::usage("--model", problem));
    }
    let (_, enhancers) = open_enhancers(stage.files, &evaluation.enhancement)?;
    let kept = read_manifest(&stage.folder)?;
    let mut manifest = manifest(evaluation, stage.identity, kept);
    let mut store = Store::open(&stage.folder, &manifest, moved(evaluation))?;
    store.write_questions(&listed(stage.questions, stage.dataset))?;
    let wanted = Wanted::new(stage.questions, read_thumbnails(&stage.folder)?);
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
    let folder = stage.folder.join(BATCH);
    fs::create_dir_all(&folder).map_err(|e| Error::file(&folder, "create", e))?;
    let mut darkroom = Darkroom {
        dataset: stage.dataset,
        pictures: stage.inputs.pictures,
        recipe: &stage.inputs.recipe,
        enhancers,
        limit: limit(evaluation),
    };
    darkroom.largest(&plan.frames)?;
    let bar = progress.bar("writing requests", left);
    let files = askers.iter().enumerate().map(|(i, asker)| {
        // Two models may have names that make one file name, and one model may be asked with images and without.
        let stem = format!("{}-{}", i + 1, asker.model.name());
        Files::new(&folder, &stem, config.file_bytes, config.file_requests)
    });
    let mut requests = Requests {
        askers,
        url: &config.url,
        files: files.collect(),
        store: &mut store,
    };
    for frame in &plan.frames {
        let mut desk = Desk::new(frame.frame.clone());
        for shot in &frame.shots {
            let condition = shot.condition.as_ref();
            let image = condition
                .map(|c| darkroom.image(&mut desk, c))
                .transpose()?;
            if let (Some(condition), Some(image)) = (condition, &image)
                && let Some(thumbnail) = wanted.of(&frame.frame, condition, image)?
            {
                requests.store.append_thumbnail(&thumbnail)?;
            }
            requests.add(shot, image.as_deref())?;
            bar.advance(shot.trials.len());
        }
    }
    let written = requests.finish()?;
    drop(bar);
    Ok(Verdict {
        status: Status::Complete,
        output: told(&written, left, answered, out, &stage.folder),
    })
}

/// The files under way.
struct Requests<'a> {
    askers: &'a [Asker],
    url: &'a str,
    /// Those of each asker.
    files: Vec<Files>,
    store: &'a mut Store,
}

impl Requests<'_> {
    /// Adds all requests about one image.
    fn add(&mut self, shot: &Shot, image: Option<&Payload>) -> Result<()> {
        for trial in &shot.trials {
            let Model::OpenAi(model) = &*self.askers[trial.asker].model else {
                continue;
            };
            let (id, choices) = (trial.key.to_string(), trial.question.choices.len());
            let line = batch::write(model, &id, self.url, &trial.prompt, choices, image)
                .map_err(|e| Error::data(&trial.question.id, e))?;
            let facts = image.map(Payload::facts);
            let condition = shot.condition.clone();
            let blank = record::blank(trial, view(shot), condition, model.name(), facts);
            self.files[trial.asker].add(&line, blank, self.store)?;
        }
        Ok(())
    }

    /// Ends all files; each with its number of requests.
    fn finish(self) -> Result<Vec<(PathBuf, usize)>> {
        let mut written = Vec::new();
        for files in self.files {
            written.extend(files.finish(self.store)?);
        }
        Ok(written)
    }
}

fn view(shot: &Shot) -> View {
    if shot.condition.is_some() {
        View::Image
    } else {
        View::Blind
    }
}

fn told(
    written: &[(PathBuf, usize)],
    left: usize,
    answered: usize,
    out: usize,
    run: &Path,
) -> String {
    let mut text = format!(
        "{left} requests in {} files; {answered} are answered already, {out} out in an earlier batch\n",
        written.len()
    );
    for (path, requests) in written {
        let _ = writeln!(text, "{} ({requests} requests)", path.display());
    }
    let _ = writeln!(
        text,
        "hand each in to the Batch API, then: darkqa-eval batch import {} OUTPUT.jsonl ERRORS.jsonl …",
        run.display()
    );
    text
}
