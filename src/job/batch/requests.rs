//! The remaining requests as lines of input files: [`Requests`].

use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

use super::BatchFileArgs;
use super::file::ModelInputFiles;
use crate::error::{Error, Result};
use crate::job::models::ModelUnderTest;
use crate::job::trial::{Item, PreparedGroup};
use crate::store::{BATCH, Store};

/// The input files of all models, while they are written.
pub(crate) struct Requests<'a, I: Item> {
    models: &'a [ModelUnderTest],
    url: Option<&'a str>,
    /// Files of each model, in the order of `models`.
    files: Vec<ModelInputFiles<I::Detail>>,
    store: &'a mut Store<I::Detail>,
}

impl<'a, I: Item> Requests<'a, I> {
    /// Input files in the batch folder of a run, which is created.
    ///
    /// # Errors
    /// If the folder cannot be created.
    pub(crate) fn new(
        models: &'a [ModelUnderTest],
        args: &'a BatchFileArgs,
        store: &'a mut Store<I::Detail>,
    ) -> Result<Self> {
        let folder = store.folder().join(BATCH);
        fs::create_dir_all(&folder).map_err(|e| Error::file(&folder, "create", e))?;
        let bytes = args.file_size.get().saturating_mul(1_000_000);
        let files = models.iter().enumerate().map(|(i, model)| {
            // The number is needed: two names may give the same file name, and a model may be asked with and without images.
            let stem = format!("{}-{}", i + 1, model.name);
            ModelInputFiles::new(&folder, &stem, bytes, args.file_requests.get())
        });
        Ok(Self {
            models,
            url: args.url.as_deref(),
            files: files.collect(),
            store,
        })
    }

    /// Adds all requests of a group.
    pub(crate) fn add(&mut self, group: &PreparedGroup<I>) -> Result<()> {
        let stimulus = &group.stimulus;
        group.notes.store(self.store)?;
        for trial in &group.trials {
            let under_test = &self.models[trial.model];
            let model = &under_test.model;
            let (id, query) = (trial.key.to_string(), trial.item.query());
            let message = trial.prompt.message(&stimulus.images);
            let line = model.batch_line(&id, self.url, message, query.choices());
            let Some(line) = line.map_err(|e| Error::data(query.id(), e))? else {
                continue;
            };
            let blank = I::blank(trial, stimulus, &under_test.name);
            self.files[trial.model].add(&line, blank, self.store)?;
        }
        Ok(())
    }

    /// Closes all files; each with its number of requests.
    pub(crate) fn finish(self) -> Result<Vec<(PathBuf, usize)>> {
        let mut written = Vec::new();
        for files in self.files {
            written.extend(files.finish(self.store)?);
        }
        Ok(written)
    }
}

/// Checks that all models can be asked in a batch.
///
/// # Errors
/// If one is built in.
pub(crate) fn require_remote(models: &[ModelUnderTest]) -> Result<()> {
    match models.iter().find(|model| !model.model.is_remote()) {
        None => Ok(()),
        Some(local) => {
            let problem = format_args!(
                "{} is built in; a batch can only ask models of an endpoint",
                local.name
            );
            Err(Error::usage("--model", problem))
        }
    }
}

/// The files written, with the next step for the user.
pub(crate) fn summary(
    written: &[(PathBuf, usize)],
    answered: usize,
    in_batch: usize,
    run: &Path,
) -> String {
    let ending = |count: usize| if count == 1 { "" } else { "s" };
    let (files, requests) = (written.len(), written.iter().map(|(_, requests)| requests));
    let requests: usize = requests.sum();
    let mut text = format!(
        "{requests} request{} in {files} file{}; {answered} already answered, {in_batch} waiting for an earlier batch\n",
        ending(requests),
        ending(files)
    );
    for (path, requests) in written {
        let ending = ending(*requests);
        let _ = writeln!(text, "{} ({requests} request{ending})", path.display());
    }
    let _ = writeln!(
        text,
        "upload each file to the Batch API, then run: darkqa-eval batch import {} OUTPUT.jsonl ERRORS.jsonl …",
        run.display()
    );
    text
}
