//! A run without private information, for a bundle: [`RedactedRun`].

use std::path::Path;

use clap::ValueEnum;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use super::redact::{Paths, Redactor};
use crate::error::{Error, Result};
use crate::report::page::fitting_thumbnails;
use crate::runs::run_files::RunFiles;
use crate::runs::stored::{AnyRun, ExperimentKind, StoredRun, read_run_manifest};
use crate::store;
use crate::types::manifests::RunManifest;
use crate::types::{Record, Thumbnail};
use darkqa_score::answers::record::Detail;

/// The thumbnails that a bundle includes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ThumbnailChoice {
    /// No image
    None,
    /// Those shown on the page
    Shown,
    /// All that the run has
    All,
}

/// Name and content of a file.
type NamedFile = (String, Vec<u8>);

/// A run without private information.
pub(super) struct RedactedRun {
    pub(super) manifest: RunManifest,
    /// The files of the run folder.
    pub(super) files: Vec<NamedFile>,
    /// The run as read from these files, in a folder with the name of the run.
    pub(super) run: AnyRun,
    /// Number of thumbnails, and number of thumbnails left out.
    pub(super) thumbnails: [usize; 2],
}

impl RedactedRun {
    /// Reads and redacts the run in a folder.
    ///
    /// # Errors
    /// If the folder has no run, a line of a file is broken, or two models would have the same name without their
    /// folders.
    pub(super) fn read(
        folder: &Path,
        name: &str,
        thumbnails: ThumbnailChoice,
        redactor: &mut Redactor,
    ) -> Result<Self> {
        let stored = read_run_manifest(folder)?;
        let value = serde_json::to_value(&stored).map_err(|e| broken("manifest.json", &e))?;
        let value = redactor.value(value, Paths::Any)?;
        let manifest: RunManifest = serde_json::from_value(value).map_err(|e| broken("manifest.json", &e))?;
        let place = Path::new(name);
        match ExperimentKind::read(folder)? {
            ExperimentKind::Choice => {
                let files = RunFiles::read(folder)?;
                let frames: Vec<_> = files.questions.iter().map(|q| q.frame.clone()).collect();
                let shown = |all: &[Thumbnail]| fitting_thumbnails(all, &frames);
                let records = store::read_records(folder)?;
                let data = RedactedData::new(records, files, thumbnails, shown, redactor)?;
                let run = StoredRun::from_records(place, manifest.clone(), data.records, data.lines)?;
                Self::new(manifest, data.files, AnyRun::Choice(run), data.thumbnails)
            }
            ExperimentKind::Open => {
                let records = store::read_records(folder)?;
                let files = RunFiles::read(folder)?;
                let shown = <[Thumbnail]>::to_vec;
                let data = RedactedData::new(records, files, thumbnails, shown, redactor)?;
                let run = StoredRun::from_records(place, manifest.clone(), data.records, data.lines)?;
                Self::new(manifest, data.files, AnyRun::Open(run), data.thumbnails)
            }
        }
    }

    fn new(manifest: RunManifest, mut files: Vec<NamedFile>, run: AnyRun, thumbnails: [usize; 2]) -> Result<Self> {
        let mut text = serde_json::to_vec_pretty(&manifest).map_err(|e| broken("manifest.json", &e))?;
        text.push(b'\n');
        files.push(("manifest.json".to_owned(), text));
        Ok(Self { manifest, files, run, thumbnails })
    }
}

/// Redacted records and other lines of a run, with the files that contain them.
struct RedactedData<D> {
    records: Vec<Record<D>>,
    lines: RunFiles,
    files: Vec<NamedFile>,
    thumbnails: [usize; 2],
}

impl<D: Detail> RedactedData<D> {
    fn new(
        records: Vec<Record<D>>,
        lines: RunFiles,
        thumbnails: ThumbnailChoice,
        shown: impl Fn(&[Thumbnail]) -> Vec<Thumbnail>,
        redactor: &mut Redactor,
    ) -> Result<Self> {
        let all = lines.thumbnails.len();
        let included = match thumbnails {
            ThumbnailChoice::None => Vec::new(),
            ThumbnailChoice::Shown => shown(&lines.thumbnails),
            ThumbnailChoice::All => lines.thumbnails,
        };
        let (records, records_file) = redact_lines("records.jsonl", records, redactor)?;
        let (questions, questions_file) = redact_lines("questions.jsonl", lines.questions, redactor)?;
        let (thumbnails, thumbnails_file) = redact_lines("thumbnails.jsonl", included, redactor)?;
        let (fidelity, fidelity_file) = redact_lines("fidelity.jsonl", lines.fidelity, redactor)?;
        Ok(Self {
            thumbnails: [thumbnails.len(), all - thumbnails.len()],
            records,
            lines: RunFiles { questions, thumbnails, fidelity },
            // A run without such lines has no such file.
            files: [records_file, questions_file, thumbnails_file, fidelity_file]
                .into_iter()
                .filter(|(_, content)| !content.is_empty())
                .collect(),
        })
    }
}

/// Redacts the lines of a file; also returns the file.
fn redact_lines<T: Serialize + DeserializeOwned>(
    name: &str,
    lines: Vec<T>,
    redactor: &mut Redactor,
) -> Result<(Vec<T>, NamedFile)> {
    let (mut redacted, mut file) = (Vec::new(), Vec::new());
    for line in lines {
        let value = serde_json::to_value(&line).map_err(|e| broken(name, &e))?;
        let value = redact_line(value, redactor)?;
        let line: T = serde_json::from_value(value).map_err(|e| broken(name, &e))?;
        serde_json::to_writer(&mut file, &line).map_err(|e| broken(name, &e))?;
        file.push(b'\n');
        redacted.push(line);
    }
    Ok((redacted, (name.to_owned(), file)))
}

/// Redacts a line. Every path in the message of a failure is redacted, because the message comes from this program or a
/// server.
fn redact_line(mut value: Value, redactor: &mut Redactor) -> Result<Value> {
    if let Some(Value::String(message)) = value.pointer_mut("/failure/message") {
        *message = redactor.text(message, Paths::Any);
    }
    redactor.value(value, Paths::Known)
}

fn broken(name: &str, error: &serde_json::Error) -> Error {
    Error::data(name, error)
}
