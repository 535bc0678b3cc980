//! The journal of a run's batches, `batch/state.jsonl`: [`Journal`].
//!
//! It has one line per event, synced to disk before and after each call that changes something at the server. So
//! everything that a killed process did is known, except for the effect of its last call, which is looked up at the
//! server.

use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions};
use std::io::Write as _;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::event::{Event, PartFacts};
use super::part::{Part, Stage};
use super::part_name::file_name;
use crate::error::{Error, Result};
use crate::files::reading;
use crate::store::{BATCH, BATCH_STATE, now};
use crate::types::Digest;
use crate::types::manifests::RunManifest;

/// Number of hexadecimal digits of a run's hash.
const HASH_DIGITS: usize = 16;

/// A line of the journal.
#[derive(Debug, Serialize, Deserialize)]
struct Line {
    /// Name of the part's file.
    file: String,
    #[serde(flatten)]
    event: Event,
    /// Time of the event, in UTC.
    at: String,
}

impl Line {
    /// Checks that all file names are plain names, so that nothing outside the batch folder is read or written.
    fn check_names(&self) -> std::result::Result<(), String> {
        let pieces = match &self.event {
            Event::Split { into } => &into[..],
            _ => &[],
        };
        let names = pieces.iter().map(|piece| &piece.file);
        std::iter::once(&self.file)
            .chain(names)
            .find(|name| !is_part_name(name))
            .map_or(Ok(()), |name| Err(format!("{name:?} is no name of a part, such as part-1-m-001.jsonl")))
    }
}

/// True if a text is the name of a part's file: `part-`, safe characters, and `.jsonl`.
fn is_part_name(text: &str) -> bool {
    text.strip_prefix("part-")
        .and_then(|rest| rest.strip_suffix(".jsonl"))
        .is_some_and(|middle| file_name(middle) == middle)
}

/// The parts of a run and their states.
#[derive(Debug)]
pub(crate) struct Journal {
    folder: PathBuf,
    /// Identifies the run in names of files and in marks of batches at the server.
    pub(super) run: String,
    pub(super) parts: Vec<Part>,
    /// Maximum numbers of waiting tokens stated by servers, by [`PartFacts::quota_scope`].
    pub(super) limits: BTreeMap<(String, String), u64>,
}

impl Journal {
    /// Reads the journal of a run; empty if there is none.
    ///
    /// # Errors
    /// If the file cannot be read, or a line is broken.
    pub(crate) fn open(run_folder: &Path, manifest: &RunManifest) -> Result<Self> {
        let facts = (&manifest.identity, &manifest.created);
        let hash = Digest::canonical("darkqa.batch/1", &facts)?.to_string();
        let mut journal = Self {
            folder: run_folder.join(BATCH),
            run: hash[..HASH_DIGITS].to_owned(),
            parts: Vec::new(),
            limits: BTreeMap::new(),
        };
        let path = journal.path();
        let text = match reading::read(&path) {
            Ok(text) => text,
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(journal),
            Err(e) => return Err(Error::file(path, "read", e)),
        };
        for (index, line) in text.split_inclusive(|byte| *byte == b'\n').enumerate() {
            // A killed process may leave the last line incomplete.
            if line.last() != Some(&b'\n') {
                break;
            }
            let line: Line = serde_json::from_slice(line).map_err(|e| Error::json_line(&path, index + 1, &e))?;
            line.check_names().map_err(|problem| Error::line(&path, index + 1, problem))?;
            journal.apply(&line.file, &line.event, &line.at);
        }
        Ok(journal)
    }

    /// The batch folder of the run.
    pub(super) fn folder(&self) -> &Path {
        &self.folder
    }

    fn path(&self) -> PathBuf {
        self.folder.join(BATCH_STATE)
    }

    /// The path of a part's file.
    pub(super) fn file(&self, part: usize) -> PathBuf {
        self.folder.join(&self.parts[part].name)
    }

    /// The first number that is higher than those of all files with this stem.
    pub(super) fn free_number(&self, stem: &str) -> u32 {
        self.parts
            .iter()
            .filter_map(|part| {
                let rest = part.name.strip_prefix(stem)?.strip_prefix('-')?;
                rest.strip_suffix(".jsonl")?.parse::<u32>().ok()
            })
            .max()
            .unwrap_or(0)
            + 1
    }

    /// True if any part has not ended.
    pub(super) fn has_open_parts(&self) -> bool {
        self.parts.iter().any(|part| part.stage != Stage::Ended)
    }

    /// True if a server may be working on a batch.
    pub(super) fn has_batches(&self) -> bool {
        self.parts.iter().any(Part::is_out)
    }

    /// Number of requests of parts whose replies are not imported.
    pub(super) fn open_requests(&self) -> usize {
        self.parts
            .iter()
            .filter(|part| !matches!(part.stage, Stage::Imported | Stage::Ended))
            .map(|part| part.facts.requests)
            .sum()
    }

    /// Maximum cost of batches whose replies are not imported yet, in US dollars.
    pub(crate) fn max_open_cost(&self) -> f64 {
        self.parts.iter().filter(|part| part.may_cost()).map(|part| part.facts.max_cost()).sum()
    }

    /// Records the written file of a part.
    pub(super) fn add(&mut self, name: &str, facts: PartFacts) -> Result<()> {
        self.write(name, Event::Written(facts))
    }

    /// Records an event of a part.
    pub(super) fn record(&mut self, part: usize, event: Event) -> Result<()> {
        let name = self.parts[part].name.clone();
        self.write(&name, event)
    }

    /// Appends an event, and syncs the file to disk.
    fn write(&mut self, file: &str, event: Event) -> Result<()> {
        let path = self.path();
        let line = Line { file: file.to_owned(), event, at: now() };
        let mut text = serde_json::to_vec(&line).map_err(|e| Error::file(&path, "write", e.into()))?;
        text.push(b'\n');
        append(&path, &text).map_err(|e| Error::file(&path, "write", e))?;
        tracing::info!("{file}: {}", String::from_utf8_lossy(&text).trim_end());
        self.apply(file, &line.event, &line.at);
        Ok(())
    }

    fn apply(&mut self, file: &str, event: &Event, at: &str) {
        let place = self.parts.iter().position(|part| part.name == file);
        let part = match (place, event) {
            (Some(place), _) => &mut self.parts[place],
            (None, Event::Written(facts)) => {
                self.parts.push(Part::new(file, facts.clone()));
                return;
            }
            (None, _) => return,
        };
        if let Event::QuotaReached { limit: Some(limit) } = event {
            self.limits.insert(part.facts.quota_scope(), *limit);
        }
        part.apply(event, at);
        if let Event::Split { into } = event {
            let pieces = into.iter().map(|piece| Part::new(&piece.file, piece.facts.clone()));
            self.parts.extend(pieces);
        }
    }
}

/// Appends to a file after removing an incomplete last line, and syncs it to disk.
fn append(path: &Path, text: &[u8]) -> std::io::Result<()> {
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder)?;
    }
    cut_incomplete_line(path)?;
    let mut file = OpenOptions::new().append(true).create(true).open(path)?;
    file.write_all(text)?;
    file.sync_all()
}

/// Removes an incomplete last line.
fn cut_incomplete_line(path: &Path) -> std::io::Result<()> {
    let text = match reading::read(path) {
        Ok(text) => text,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(()),
        Err(e) => return Err(e),
    };
    let complete = text.iter().rposition(|byte| *byte == b'\n').map_or(0, |last| last + 1);
    if complete == text.len() {
        return Ok(());
    }
    File::options().write(true).open(path)?.set_len(complete as u64)
}
