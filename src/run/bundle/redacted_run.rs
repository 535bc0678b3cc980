//! The files of a run as a bundle has them: [`RunParts`].

use std::path::Path;

use clap::ValueEnum;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use super::redact::{Paths, Redactor};
use crate::error::{Error, Result};
use crate::report::page::shown_thumbnails;
use crate::runs::run_files::RunFiles;
use crate::runs::stored::{AnyRun, ExperimentKind, StoredRun, manifest};
use crate::store;
use crate::types::manifests::RunManifest;
use crate::types::{Record, Thumbnail};
use darkqa_score::answers::record::Detail;

/// The small images that a bundle has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ThumbnailChoice {
    /// No image
    None,
    /// Those shown on the page
    Shown,
    /// All that the run has
    All,
}

/// The name and the content of a file.
type NamedFile = (String, Vec<u8>);

/// A run without private parts.
pub(super) struct RunParts {
    pub(super) manifest: RunManifest,
    /// The files from which the run can be read again, by name.
    pub(super) files: Vec<NamedFile>,
    /// The run as read from these files, in a folder of its name.
    pub(super) run: AnyRun,
    /// Number of small images, and of those that are left out.
    pub(super) thumbnails: [usize; 2],
}

impl RunParts {
    /// Reads the run of a folder.
    ///
    /// # Errors
    /// If the folder holds no run, a line of a file is broken, or two models would get one name without their folders.
    pub(super) fn read(
        folder: &Path,
        name: &str,
        thumbnails: ThumbnailChoice,
        redactor: &mut Redactor,
    ) -> Result<Self> {
        let stored = manifest(folder)?;
        let value = serde_json::to_value(&stored).map_err(|e| broken("manifest.json", &e))?;
        let value = redactor.value(value, Paths::Any)?;
        let manifest: RunManifest =
            serde_json::from_value(value).map_err(|e| broken("manifest.json", &e))?;
        let place = Path::new(name);
        match ExperimentKind::read(folder)? {
            ExperimentKind::Choice => {
                let files = RunFiles::read(folder)?;
                let frames: Vec<_> = files.questions.iter().map(|q| q.frame.clone()).collect();
                let shown = |all: &[Thumbnail]| shown_thumbnails(all, &frames);
                let lines = (store::read_records(folder)?, files);
                let parts = parts(lines, thumbnails, shown, redactor)?;
                let run = StoredRun::from_records(place, manifest.clone(), parts.lines)?;
                Self::new(manifest, parts.files, AnyRun::Choice(run), parts.thumbnails)
            }
            ExperimentKind::Open => {
                let lines = (store::read_records(folder)?, RunFiles::read(folder)?);
                let parts = parts(lines, thumbnails, <[Thumbnail]>::to_vec, redactor)?;
                let run = StoredRun::from_records(place, manifest.clone(), parts.lines)?;
                Self::new(manifest, parts.files, AnyRun::Open(run), parts.thumbnails)
            }
        }
    }

    fn new(
        manifest: RunManifest,
        mut files: Vec<NamedFile>,
        run: AnyRun,
        thumbnails: [usize; 2],
    ) -> Result<Self> {
        let mut text =
            serde_json::to_vec_pretty(&manifest).map_err(|e| broken("manifest.json", &e))?;
        text.push(b'\n');
        files.push(("manifest.json".to_owned(), text));
        Ok(Self {
            manifest,
            files,
            run,
            thumbnails,
        })
    }
}

/// The lines of a run's files without private parts, and the files.
struct Parts<D> {
    lines: (Vec<Record<D>>, RunFiles),
    files: Vec<NamedFile>,
    thumbnails: [usize; 2],
}

fn parts<D: Detail>(
    (records, lines): (Vec<Record<D>>, RunFiles),
    thumbnails: ThumbnailChoice,
    shown: impl Fn(&[Thumbnail]) -> Vec<Thumbnail>,
    redactor: &mut Redactor,
) -> Result<Parts<D>> {
    let all = lines.thumbnails.len();
    let kept = match thumbnails {
        ThumbnailChoice::None => Vec::new(),
        ThumbnailChoice::Shown => shown(&lines.thumbnails),
        ThumbnailChoice::All => lines.thumbnails,
    };
    let (records, records_file) = redacted("records.jsonl", records.into_iter(), redactor)?;
    let questions = lines.questions.into_iter();
    let (questions, questions_file) = redacted("questions.jsonl", questions, redactor)?;
    let (thumbnails, thumbnails_file) = redacted("thumbnails.jsonl", kept.into_iter(), redactor)?;
    let fidelity = lines.fidelity.into_iter();
    let (fidelity, fidelity_file) = redacted("fidelity.jsonl", fidelity, redactor)?;
    let files = [records_file, questions_file, thumbnails_file, fidelity_file];
    // A run that stores no such lines has no such file.
    let files = files.into_iter().filter(|(_, content)| !content.is_empty());
    Ok(Parts {
        thumbnails: [thumbnails.len(), all - thumbnails.len()],
        lines: (
            records,
            RunFiles {
                questions,
                thumbnails,
                fidelity,
            },
        ),
        files: files.collect(),
    })
}

/// Lines without private parts, and the file of them.
fn redacted<T: Serialize + DeserializeOwned>(
    name: &str,
    lines: impl Iterator<Item = T>,
    redactor: &mut Redactor,
) -> Result<(Vec<T>, NamedFile)> {
    let (mut kept, mut file) = (Vec::new(), Vec::new());
    for line in lines {
        let value = serde_json::to_value(&line).map_err(|e| broken(name, &e))?;
        let value = without_private(value, redactor)?;
        let line: T = serde_json::from_value(value).map_err(|e| broken(name, &e))?;
        serde_json::to_writer(&mut file, &line).map_err(|e| broken(name, &e))?;
        file.push(b'\n');
        kept.push(line);
    }
    Ok((kept, (name.to_owned(), file)))
}

/// A line without private parts. The message of a failure is of this program or of a server, and any path in it is one of a machine.
fn without_private(mut value: Value, redactor: &mut Redactor) -> Result<Value> {
    if let Some(Value::String(message)) = value.pointer_mut("/failure/message") {
        *message = redactor.text(message, Paths::Any);
    }
    redactor.value(value, Paths::Known)
}

fn broken(name: &str, error: &serde_json::Error) -> Error {
    Error::data(name, error)
}
