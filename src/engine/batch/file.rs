//! Input files for one model: [`ModelInputFiles`].
//!
//! Writes the remaining requests as lines of input files: [`Requests`].
//!
//! Exports the remaining requests as input files of a Batch API: [`export`].
//!
//! Models whose batches are not continued by this command: [`StoppedModels`].

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use sha2::{Digest as _, Sha256};

use super::BatchFileArgs;
use super::journal::{Journal, PartFacts, file_name};
use super::servers::account;
use crate::dark_already;
use crate::experiment::Experiment;
use crate::images::recipes::Maker;
use crate::images::stored::StoredImages;
use crate::images::timings::Timings;
use crate::images::trials::{Item, Plan, PreparedGroup, Stimulus, Trial};
use crate::images::workers::pool;
use crate::models::ModelUnderTest;
use crate::open_run::{OpenRun, Remaining, every_model, image_limit, missing_notes, pipeline};
use darkqa_ask::{BatchInterface, TokenBound};
use darkqa_base::error::{Error, Result};
use darkqa_base::files::create_new;
use darkqa_base::types::Record;
use darkqa_base::types::manifests::Status;
use darkqa_base::types::text::counted;
use darkqa_runs::outcome::Outcome;
use darkqa_score::answers::record::Detail;
use darkqa_store::{BATCH, Store};

/// Extension of a file until it is complete.
pub(super) const PART: &str = "part";

/// Maximum contents of a file.
#[derive(Debug, Clone, Copy)]
pub struct FileLimits {
    pub bytes: u64,
    pub requests: usize,
    /// Expected tokens of all prompts.
    pub tokens: f64,
}

/// The expected tokens and dollars of a request.
#[derive(Debug, Clone, Copy, Default)]
pub struct RequestCost {
    /// Tokens of the prompt.
    pub tokens: f64,
    /// Expected cost in US dollars; `None` if the model has no known price.
    pub dollars: Option<f64>,
    /// Maximum cost in US dollars; `None` if the model has no known price.
    pub most_dollars: Option<f64>,
    /// Maximum number of tokens; `None` if the model has no known price.
    pub bound: Option<TokenBound>,
}

/// Model and endpoint of the files, for the facts of a part.
#[derive(Debug, Clone, Default)]
pub struct Destination {
    pub model: String,
    pub name: String,
    pub account: String,
    pub base: String,
    pub url: String,
}

/// Where the requests of a complete file are recorded: in the run, and in the journal if the program submits the file.
pub struct Register<'a, D> {
    pub store: &'a mut Store<D>,
    /// `None` for files submitted by the user.
    pub journal: Option<&'a mut Journal>,
}

/// The input files of one model, split by bytes, requests and tokens.
pub struct ModelInputFiles<D> {
    folder: PathBuf,
    stem: String,
    /// The lowest file number.
    first: u32,
    limits: FileLimits,
    destination: Destination,
    open: Option<OpenFile<D>>,
    /// Finished files, each with its number of requests.
    done: Vec<(PathBuf, usize)>,
}

struct OpenFile<D> {
    path: PathBuf,
    file: BufWriter<File>,
    bytes: u64,
    tokens: f64,
    /// Expected cost in US dollars; `None` if the model has no known price.
    dollars: Option<f64>,
    /// Maximum cost of all requests, in US dollars.
    most_dollars: Option<f64>,
    /// Maximum cost of a single request, in US dollars.
    most_dollars_each: Option<f64>,
    hash: Sha256,
    /// Records of the trials in the file, without outcomes.
    blanks: Vec<Record<D>>,
}

impl<D: Detail> ModelInputFiles<D> {
    /// Files in `folder`, named `stem` with numbers from `first` on.
    pub fn new(folder: &Path, stem: &str, first: u32, limits: FileLimits, destination: Destination) -> Self {
        Self {
            folder: folder.to_owned(),
            stem: stem.to_owned(),
            first,
            limits,
            destination,
            open: None,
            done: Vec::new(),
        }
    }

    /// Adds a line, and the record of its trial without an outcome.
    ///
    /// # Errors
    /// If the line exceeds the maximum size of a file, or cannot be written.
    pub fn add(
        &mut self,
        line: &[u8],
        blank: Record<D>,
        cost: RequestCost,
        register: &mut Register<'_, D>,
    ) -> Result<()> {
        let (size, limits) = (line.len() as u64, self.limits);
        if size > limits.bytes {
            let megabytes = size as f64 / 1e6;
            let problem = format!(
                "one request has {megabytes:.1} MB, more than a file may have; make images smaller with --image max-side=N or --image jpeg:95"
            );
            return Err(Error::usage("--file-size", problem));
        }
        let full = self.open.as_ref().is_some_and(|open| {
            open.bytes + size > limits.bytes
                || open.blanks.len() >= limits.requests
                || open.tokens + cost.tokens > limits.tokens
        });
        if full {
            self.close(register)?;
        }
        let open = match self.open.take() {
            Some(open) => open,
            None => self.create_next()?,
        };
        let open = self.open.insert(open);
        open.file.write_all(line).map_err(|e| Error::file(&open.path, "write", e))?;
        open.hash.update(line);
        open.bytes += size;
        open.tokens += cost.tokens;
        open.dollars = open.dollars.zip(cost.dollars).map(|(sum, one)| sum + one);
        let most = open.most_dollars.zip(cost.most_dollars);
        open.most_dollars = most.map(|(sum, one)| sum + one);
        let each = open.most_dollars_each.zip(cost.most_dollars);
        open.most_dollars_each = each.map(|(most, one)| most.max(one));
        open.blanks.push(blank);
        Ok(())
    }

    /// Closes the last file; returns all files, each with its number of requests.
    pub fn finish(mut self, register: &mut Register<'_, D>) -> Result<Vec<(PathBuf, usize)>> {
        self.close(register)?;
        Ok(self.done)
    }

    /// Creates a file, with the first unused number.
    fn create_next(&self) -> Result<OpenFile<D>> {
        let path = (self.first..=u32::MAX)
            .map(|n| self.folder.join(format!("{}-{n:03}.jsonl", self.stem)))
            .find(|path| !path.exists())
            .unwrap_or_default();
        let part = path.with_extension(PART);
        let file = create_new(&part).map_err(|e| Error::file(&part, "create", e))?;
        Ok(OpenFile {
            path,
            file: BufWriter::new(file),
            bytes: 0,
            tokens: 0.0,
            dollars: Some(0.0),
            most_dollars: Some(0.0),
            most_dollars_each: Some(0.0),
            hash: Sha256::new(),
            blanks: Vec::new(),
        })
    }

    /// Completes the open file. The run records its trials before the file gets its final name, so that nobody uploads
    /// a file whose replies the run would not recognize.
    fn close(&mut self, register: &mut Register<'_, D>) -> Result<()> {
        let Some(open) = self.open.take() else {
            return Ok(());
        };
        open.file
            .into_inner()
            .map_err(std::io::IntoInnerError::into_error)
            .and_then(|file| file.sync_all())
            .map_err(|e| Error::file(&open.path, "write", e))?;
        if let Some(journal) = &mut register.journal {
            let Destination { model, name, account, base, url } = self.destination.clone();
            let file_name = open.path.file_name().unwrap_or_default();
            journal.add(
                &file_name.to_string_lossy(),
                PartFacts {
                    sha256: hexadecimal(&open.hash.finalize()),
                    bytes: open.bytes,
                    requests: open.blanks.len(),
                    model,
                    name,
                    account,
                    base,
                    url,
                    tokens: open.tokens.round(),
                    dollars: open.dollars,
                    most_dollars: open.most_dollars,
                    most_dollars_each: open.most_dollars_each,
                },
            )?;
        }
        register.store.append_to_batch(&open.blanks)?;
        fs::rename(open.path.with_extension(PART), &open.path).map_err(|e| Error::file(&open.path, "write", e))?;
        self.done.push((open.path.clone(), open.blanks.len()));
        Ok(())
    }
}

/// Formats bytes as hexadecimal digits.
pub(super) fn hexadecimal(bytes: &[u8]) -> String {
    bytes
        .iter()
        .flat_map(|byte| [byte >> 4, byte & 15])
        .map(|half| char::from_digit(half.into(), 16).unwrap_or('0'))
        .collect()
}

/// Maximum tokens of a part, as a share of the tokens that may wait for batches; chosen below a half, so that one part
/// can wait while another one is processed.
pub(super) const SHARE_OF_QUOTA: f64 = 0.45;

/// Maximum tokens of a part if the limit is unknown; chosen.
const MAX_PART_TOKENS: f64 = 2e6;

/// Function that returns the expected cost of a trial's request with a stimulus.
pub(super) type CostOf<'a, I> = &'a (dyn Fn(&Trial<I>, &Stimulus) -> RequestCost + Sync);

/// The input files of all models, while they are written.
pub struct Requests<'a, I: Item> {
    models: &'a [ModelUnderTest],
    /// URL path of the requests, by model.
    urls: Vec<String>,
    /// Files by model.
    files: Vec<ModelInputFiles<I::Detail>>,
    register: Register<'a, I::Detail>,
    cost: CostOf<'a, I>,
}

impl<'a, I: Item> Requests<'a, I> {
    /// Input files in the batch folder of a run, which is created if needed. `all` are the models of all phases.
    ///
    /// # Errors
    /// If the folder cannot be created.
    pub fn new(
        models: &'a [ModelUnderTest],
        all: &[&ModelUnderTest],
        args: &'a BatchFileArgs,
        quota: Option<u64>,
        register: Register<'a, I::Detail>,
        cost: CostOf<'a, I>,
    ) -> Result<Self> {
        let folder = register.store.folder().join(BATCH);
        fs::create_dir_all(&folder).map_err(|e| Error::file(&folder, "create", e))?;
        let journal = register.journal.as_deref();
        let (mut files, mut urls) = (Vec::new(), Vec::new());
        for (i, model) in models.iter().enumerate() {
            // The number makes the name unique: two models may have the same file name, or one may be asked with and
            // without images.
            let stem = file_name(&format!("{}-{}", i + 1, model.name));
            let destination = destination(model, all, args)?;
            urls.push(destination.url.clone());
            let known = BatchInterface::at(&destination.base);
            let (stem, first, tokens) = match journal {
                None => (stem, 1, f64::INFINITY),
                Some(journal) => {
                    let stem = format!("part-{stem}");
                    let scope = (destination.base.clone(), destination.model.clone());
                    let limit = journal.limits.get(&scope).copied().or(quota);
                    let tokens = limit.map_or(MAX_PART_TOKENS, |limit| SHARE_OF_QUOTA * limit as f64);
                    (stem.clone(), journal.free_number(&stem), tokens)
                }
            };
            let limits = FileLimits {
                bytes: args.file_size.unwrap_or(known.file_size()).get().saturating_mul(1_000_000),
                requests: args.file_requests.unwrap_or(known.requests()).get(),
                tokens,
            };
            files.push(ModelInputFiles::new(&folder, &stem, first, limits, destination));
        }
        Ok(Self { models, urls, files, register, cost })
    }

    /// Adds all requests of a group.
    pub fn add(&mut self, group: &PreparedGroup<I>) -> Result<()> {
        let stimulus = &group.stimulus;
        group.notes.store(self.register.store)?;
        for trial in &group.trials {
            let under_test = &self.models[trial.model];
            let model = &under_test.model;
            let (id, query) = (trial.key.to_string(), trial.item.query());
            let message = trial.prompt.message(&stimulus.images);
            let line = model.batch_line(&id, &self.urls[trial.model], message, query.choice_count());
            let Some(line) = line.map_err(|e| Error::data(query.id(), e))? else {
                continue;
            };
            let mut blank = under_test.blank(trial, stimulus);
            let cost = (self.cost)(trial, stimulus);
            // The maximum, in case the reply states no tokens.
            if let Some(bound) = cost.bound {
                blank.lost.unstated = bound.unstated();
            }
            self.files[trial.model].add(&line, blank, cost, &mut self.register)?;
        }
        Ok(())
    }

    /// Closes all files; returns each with its number of requests.
    pub fn finish(mut self) -> Result<Vec<(PathBuf, usize)>> {
        let mut written = Vec::new();
        for files in self.files {
            written.extend(files.finish(&mut self.register)?);
        }
        Ok(written)
    }
}

/// Model and endpoint of the requests to a model.
fn destination(model: &ModelUnderTest, all: &[&ModelUnderTest], args: &BatchFileArgs) -> Result<Destination> {
    let base = model.model.batch_base().unwrap_or_default();
    let known = BatchInterface::at(&base);
    let usual = model.model.batch_url().unwrap_or_default();
    let url = args.url.as_deref().unwrap_or_else(|| known.url(usual));
    Ok(Destination {
        model: model.model.name().to_owned(),
        name: model.name.to_string(),
        account: account(model, all)?,
        url: url.to_owned(),
        base,
    })
}

/// Checks that all models can be asked in a batch.
///
/// # Errors
/// If a model is built in.
pub fn require_remote(models: &[ModelUnderTest]) -> Result<()> {
    match models.iter().find(|model| !model.model.is_remote()) {
        None => Ok(()),
        Some(local) => {
            let problem = format_args!("{} is built in; a batch can only ask models of an endpoint", local.name);
            Err(Error::usage("--model", problem))
        }
    }
}

/// Checks that the endpoints of all models support the file and batch API that the program uses.
///
/// # Errors
/// If the vendor of an endpoint does not support it.
pub(super) fn require_files(models: &[ModelUnderTest]) -> Result<()> {
    models
        .iter()
        .filter_map(|model| model.model.batch_base())
        .try_for_each(|base| BatchInterface::at(&base).require_files())
}

/// The text about the written files and the next step for the user.
pub fn summary(written: &[(PathBuf, usize)], answered: usize, in_batch: usize, run: &Path) -> String {
    let requests: usize = written.iter().map(|(_, requests)| requests).sum();
    let mut text = format!(
        "{} in {}; {answered} already answered, {in_batch} waiting for an earlier batch\n",
        counted(requests, "request"),
        counted(written.len(), "file")
    );
    for (path, requests) in written {
        let requests = counted(*requests, "request");
        let _ = writeln!(text, "{} ({requests})", path.display());
    }
    let _ = writeln!(
        text,
        "upload each file to the Batch API, then run: darkqa-eval batch import {} OUTPUT.jsonl ERRORS.jsonl …",
        run.display()
    );
    text
}

/// Settings for writing input files.
pub(super) struct FileSettings<'a, I: Item> {
    pub(super) files: &'a BatchFileArgs,
    /// Maximum number of tokens waiting for batches of a model; `None` if unknown.
    pub(super) quota: Option<u64>,
    /// Journal for files submitted by the program; `None` for files submitted by the user.
    pub(super) journal: Option<&'a mut Journal>,
    pub(super) cost: CostOf<'a, I>,
}

/// Writes the input files of the first phase with remaining trials, and records in the run that these trials are in a
/// batch.
pub fn export<E: Experiment>(mut run: OpenRun<'_, E>, files: &BatchFileArgs) -> Result<Outcome> {
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
        let target = FileSettings { files, quota: None, journal: None, cost: &|_, _| RequestCost::default() };
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
    target: FileSettings<'_, E::Item>,
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
    pipeline.steps.png = run.manifest.png;
    pipeline.steps.stored = images.map(|images| StoredImages::new(images, &maker, run.manifest.png));
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

/// Models whose batches are not continued by this command, because their server refuses all further calls.
#[derive(Debug, Default)]
pub(super) struct StoppedModels {
    /// Base URLs and names of models whose parts stay as they are.
    models: BTreeSet<(String, String)>,
    /// Phases and indices of models that are not asked any more in a phase. In another phase or without images, the
    /// same model may still be asked.
    in_phase: BTreeSet<(usize, usize)>,
    errors: Vec<Error>,
}

impl StoppedModels {
    /// Stops the model of a part.
    pub(super) fn add_part(&mut self, facts: &PartFacts, error: Error) {
        self.models.insert(base_and_name(facts));
        self.errors.push(error);
    }

    /// Stops the model with this index in a phase. Its error must be added by [`add_errors`](Self::add_errors).
    pub(super) fn add_model(&mut self, phase: usize, index: usize) {
        self.in_phase.insert((phase, index));
    }

    /// Adds the errors that stopped models.
    pub(super) fn add_errors(&mut self, errors: Vec<Error>) {
        self.errors.extend(errors);
    }

    /// True if the model of a part is stopped.
    pub(super) fn has_part(&self, facts: &PartFacts) -> bool {
        self.models.contains(&base_and_name(facts))
    }

    /// True if the model with this index in a phase is stopped.
    pub(super) fn has_model(&self, phase: usize, index: usize, model: &ModelUnderTest) -> bool {
        let base = model.model.batch_base().unwrap_or_default();
        self.in_phase.contains(&(phase, index)) || self.models.contains(&(base, model.name.to_string()))
    }

    /// The errors that stopped models; empty if no model is stopped.
    pub(super) fn errors(&self) -> &[Error] {
        &self.errors
    }

    /// Takes the errors out.
    pub(super) fn take_errors(&mut self) -> Vec<Error> {
        std::mem::take(&mut self.errors)
    }
}

/// Base URL and name of the model of a part.
fn base_and_name(facts: &PartFacts) -> (String, String) {
    let name = match &*facts.name {
        "" => &facts.model,
        name => name,
    };
    (facts.base.clone(), name.to_owned())
}
