//! Input files for one model: [`ModelInputFiles`].

use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use sha2::{Digest as _, Sha256};

use super::event::PartFacts;
use super::journal::Journal;
use crate::ask::TokenBound;
use crate::error::{Error, Result};
use crate::files::create_new;
use crate::store::Store;
use crate::types::Record;
use darkqa_score::answers::record::Detail;

/// Extension of a file until it is complete.
pub(super) const PART: &str = "part";

/// Maximum contents of a file.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FileLimits {
    pub(crate) bytes: u64,
    pub(crate) requests: usize,
    /// Expected tokens of all prompts.
    pub(crate) tokens: f64,
}

/// The expected tokens and dollars of a request.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct RequestCost {
    /// Tokens of the prompt.
    pub(crate) tokens: f64,
    /// Expected cost in US dollars; `None` if the model has no known price.
    pub(crate) dollars: Option<f64>,
    /// Maximum cost in US dollars; `None` if the model has no known price.
    pub(crate) most_dollars: Option<f64>,
    /// Maximum number of tokens; `None` if the model has no known price.
    pub(crate) bound: Option<TokenBound>,
}

/// Model and endpoint of the files, for the facts of a part.
#[derive(Debug, Clone, Default)]
pub(crate) struct Destination {
    pub(crate) model: String,
    pub(crate) name: String,
    pub(crate) account: String,
    pub(crate) base: String,
    pub(crate) url: String,
}

/// Where the requests of a complete file are recorded: in the run, and in the journal if the program submits the file.
pub(crate) struct Register<'a, D> {
    pub(crate) store: &'a mut Store<D>,
    /// `None` for files submitted by the user.
    pub(crate) journal: Option<&'a mut Journal>,
}

/// The input files of one model, split by bytes, requests and tokens.
pub(crate) struct ModelInputFiles<D> {
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
    pub(crate) fn new(folder: &Path, stem: &str, first: u32, limits: FileLimits, destination: Destination) -> Self {
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
    pub(crate) fn add(
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
    pub(crate) fn finish(mut self, register: &mut Register<'_, D>) -> Result<Vec<(PathBuf, usize)>> {
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
