//! What `batch` is told.

use std::path::PathBuf;

use super::{Config, Show, merge};
use crate::cli::{BatchExportArgs, BatchFileArgs, BatchImportArgs};
use crate::error::{Error, Result};

/// The most bytes of one file at OpenAI and Azure.
const FILE_BYTES: u64 = 200_000_000;

/// The most requests of one file there.
const FILE_REQUESTS: usize = 50_000;

/// What the input files of a Batch API are like.
#[derive(Debug)]
pub struct BatchFiles {
    /// The most bytes of a file.
    pub most_bytes: u64,
    /// The most requests of a file.
    pub most_requests: usize,
    /// The path that each line asks; `None` for the one of the model's API.
    pub url: Option<String>,
}

impl BatchFiles {
    pub(super) fn resolve(said: BatchFileArgs) -> Result<Self> {
        if let Some(url) = said.url.as_deref().filter(|url| !url.starts_with('/')) {
            let problem = format_args!("{url:?}; a path expected, as /v1/chat/completions");
            return Err(Error::usage("--url", problem));
        }
        Ok(Self {
            most_bytes: said
                .file_size
                .map_or(FILE_BYTES, |size| size.get().saturating_mul(1_000_000)),
            most_requests: said.file_requests.map_or(FILE_REQUESTS, usize::from),
            url: said.url,
        })
    }
}

/// Everything `batch export` is told.
#[derive(Debug)]
pub struct BatchExport {
    /// The evaluation.
    pub evaluation: Config,
    /// What the files are like.
    pub files: BatchFiles,
}

impl BatchExport {
    /// Checks what was said by flags, environment and `--config` file.
    ///
    /// # Errors
    /// [`Error::Usage`] with the flag that cannot be used.
    pub fn resolve(said: BatchExportArgs) -> Result<Self> {
        let files = BatchFiles::resolve(said.files)?;
        Ok(Self {
            evaluation: Config::resolve(merge(said.evaluate)?)?,
            files,
        })
    }
}

/// Everything `batch import` is told.
#[derive(Debug)]
pub struct BatchImport {
    /// The run folder.
    pub run: PathBuf,
    /// The files of the Batch API.
    pub files: Vec<PathBuf>,
    /// In what form on standard output.
    pub show: Show,
}

impl BatchImport {
    /// What was said.
    #[must_use]
    pub fn resolve(said: BatchImportArgs) -> Self {
        Self {
            run: said.run,
            files: said.files,
            show: Show::said(said.json),
        }
    }
}
