//! The input files of one model: [`ModelInputFiles`].

use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use crate::error::{Error, Result};
use crate::store::Store;
use crate::types::{Detail, Record};

/// Extension of a file until it is complete.
const PART: &str = "part";

/// The input files of one model, split by bytes and by requests.
pub(crate) struct ModelInputFiles<D> {
    folder: PathBuf,
    stem: String,
    max_bytes: u64,
    max_requests: usize,
    open: Option<OpenFile<D>>,
    /// Finished files, each with its number of requests.
    done: Vec<(PathBuf, usize)>,
}

struct OpenFile<D> {
    path: PathBuf,
    file: BufWriter<File>,
    bytes: u64,
    /// The trials in the file, as records without an outcome.
    blanks: Vec<Record<D>>,
}

impl<D: Detail> ModelInputFiles<D> {
    pub(crate) fn new(folder: &Path, model: &str, max_bytes: u64, max_requests: usize) -> Self {
        let safe = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
        Self {
            folder: folder.to_owned(),
            stem: model.replace(|c| !safe(c), "_"),
            max_bytes,
            max_requests,
            open: None,
            done: Vec::new(),
        }
    }

    /// Adds one line, and the record of its trial without an outcome.
    ///
    /// # Errors
    /// If the line alone is larger than a file may be, or cannot be written.
    pub(crate) fn add(
        &mut self,
        line: &[u8],
        blank: Record<D>,
        store: &mut Store<D>,
    ) -> Result<()> {
        let size = line.len() as u64;
        if size > self.max_bytes {
            let megabytes = size as f64 / 1e6;
            let problem = format!(
                "one request has {megabytes:.1} MB, more than a file may have; make images smaller with --max-side or --image jpeg:95"
            );
            return Err(Error::usage("--file-size", problem));
        }
        let full = self.open.as_ref().is_some_and(|open| {
            open.bytes + size > self.max_bytes || open.blanks.len() >= self.max_requests
        });
        if full {
            self.close(store)?;
        }
        let open = match self.open.take() {
            Some(open) => open,
            None => self.next()?,
        };
        let open = self.open.insert(open);
        open.file
            .write_all(line)
            .map_err(|e| Error::file(&open.path, "write", e))?;
        open.bytes += size;
        open.blanks.push(blank);
        Ok(())
    }

    /// Closes the last file; all files, each with its number of requests.
    pub(crate) fn finish(mut self, store: &mut Store<D>) -> Result<Vec<(PathBuf, usize)>> {
        self.close(store)?;
        Ok(self.done)
    }

    /// A new file, with the first number that no file in the folder has.
    fn next(&self) -> Result<OpenFile<D>> {
        let path = (1..=u32::MAX)
            .map(|n| self.folder.join(format!("{}-{n:03}.jsonl", self.stem)))
            .find(|path| !path.exists())
            .unwrap_or_default();
        let part = path.with_extension(PART);
        let file = File::create(&part).map_err(|e| Error::file(&part, "create", e))?;
        Ok(OpenFile {
            path,
            file: BufWriter::new(file),
            bytes: 0,
            blanks: Vec::new(),
        })
    }

    /// Completes the open file. The run records its trials before the file gets its final name. So the user never uploads a file
    /// whose replies the run would not recognize.
    fn close(&mut self, store: &mut Store<D>) -> Result<()> {
        let Some(open) = self.open.take() else {
            return Ok(());
        };
        let unwritten = |e| Error::file(&open.path, "write", e);
        let flushed = open.file.into_inner();
        flushed
            .map_err(std::io::IntoInnerError::into_error)
            .and_then(|file| file.sync_all())
            .map_err(unwritten)?;
        store.append_to_batch(&open.blanks)?;
        fs::rename(open.path.with_extension(PART), &open.path).map_err(unwritten)?;
        self.done.push((open.path.clone(), open.blanks.len()));
        Ok(())
    }
}
