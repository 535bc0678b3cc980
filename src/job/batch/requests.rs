//! What is left to ask, as lines of input files: [`Requests`].

use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

use super::BatchFileArgs;
use super::file::ModelInputFiles;
use crate::error::{Error, Result};
use crate::job::models::ModelUnderTest;
use crate::job::trial::{Item, PreparedGroup};
use crate::store::{BATCH, Store};

/// The files under way.
pub(crate) struct Requests<'a, I: Item> {
    models: &'a [ModelUnderTest],
    url: Option<&'a str>,
    /// Those of each model.
    files: Vec<ModelInputFiles<I::Detail>>,
    store: &'a mut Store<I::Detail>,
}

impl<'a, I: Item> Requests<'a, I> {
    /// Begins files in the folder of a run.
    ///
    /// # Errors
    /// Where the folder cannot be made.
    pub(crate) fn new(
        models: &'a [ModelUnderTest],
        config: &'a BatchFileArgs,
        store: &'a mut Store<I::Detail>,
    ) -> Result<Self> {
        let folder = store.folder().join(BATCH);
        fs::create_dir_all(&folder).map_err(|e| Error::file(&folder, "create", e))?;
        let bytes = config.file_size.get().saturating_mul(1_000_000);
        let files = models.iter().enumerate().map(|(i, model)| {
            // Two models may have names that make one file name, and one model may be asked with images and without.
            let stem = format!("{}-{}", i + 1, model.model.name());
            ModelInputFiles::new(&folder, &stem, bytes, config.file_requests.get())
        });
        Ok(Self {
            models,
            url: config.url.as_deref(),
            files: files.collect(),
            store,
        })
    }

    /// Adds all requests of a group.
    pub(crate) fn add(&mut self, group: &PreparedGroup<I>) -> Result<()> {
        let stimulus = &group.stimulus;
        if let Some(thumbnail) = &group.thumbnail {
            self.store.append_thumbnail(thumbnail)?;
        }
        for trial in &group.trials {
            let model = &self.models[trial.model].model;
            let (id, query) = (trial.key.to_string(), trial.item.query());
            let message = trial.prompt.message(&stimulus.images);
            let line = model.batch_line(&id, self.url, message, query.choices());
            let Some(line) = line.map_err(|e| Error::data(query.id(), e))? else {
                continue;
            };
            let blank = I::blank(trial, stimulus, model.name());
            self.files[trial.model].add(&line, blank, self.store)?;
        }
        Ok(())
    }

    /// Ends all files; each with its number of requests.
    pub(crate) fn finish(self) -> Result<Vec<(PathBuf, usize)>> {
        let mut written = Vec::new();
        for files in self.files {
            written.extend(files.finish(self.store)?);
        }
        Ok(written)
    }
}

/// Makes sure that all models can be asked in a batch.
///
/// # Errors
/// Where one is built in.
pub(crate) fn remote(models: &[ModelUnderTest]) -> Result<()> {
    match models.iter().find(|model| !model.model.is_remote()) {
        None => Ok(()),
        Some(local) => {
            let problem = format_args!(
                "{} is built in; a batch asks models of an endpoint",
                local.model.name()
            );
            Err(Error::usage("--model", problem))
        }
    }
}

/// What was written, and what is to be done with it.
pub(crate) fn summary(
    written: &[(PathBuf, usize)],
    answered: usize,
    out: usize,
    run: &Path,
) -> String {
    let left: usize = written.iter().map(|(_, requests)| requests).sum();
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
