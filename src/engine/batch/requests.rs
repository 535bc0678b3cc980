//! Writes the remaining requests as lines of input files: [`Requests`].

use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

use super::BatchFileArgs;
use super::file::{Destination, FileLimits, ModelInputFiles, Register, RequestCost};
use super::part_name::file_name;
use super::servers::account;
use crate::ask::BatchInterface;
use crate::engine::images::trials::{Item, PreparedGroup, Stimulus, Trial};
use crate::engine::models::ModelUnderTest;
use crate::error::{Error, Result};
use crate::store::BATCH;
use crate::types::text::counted;

/// Maximum tokens of a part, as a share of the tokens that may wait for batches; chosen below a half, so that one part
/// can wait while another one is processed.
pub(super) const SHARE_OF_QUOTA: f64 = 0.45;

/// Maximum tokens of a part if the limit is unknown; chosen.
const MAX_PART_TOKENS: f64 = 2e6;

/// Function that returns the expected cost of a trial's request with a stimulus.
pub(super) type CostOf<'a, I> = &'a (dyn Fn(&Trial<I>, &Stimulus) -> RequestCost + Sync);

/// The input files of all models, while they are written.
pub(crate) struct Requests<'a, I: Item> {
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
    pub(crate) fn new(
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
    pub(crate) fn add(&mut self, group: &PreparedGroup<I>) -> Result<()> {
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
    pub(crate) fn finish(mut self) -> Result<Vec<(PathBuf, usize)>> {
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
pub(crate) fn require_remote(models: &[ModelUnderTest]) -> Result<()> {
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
pub(crate) fn summary(written: &[(PathBuf, usize)], answered: usize, in_batch: usize, run: &Path) -> String {
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
