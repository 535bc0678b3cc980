//! The journal of a run's batches, `batch/state.jsonl`: [`Journal`].
//!
//! It has one line per event, synced to disk before and after each call that changes something at the server. So
//! everything that a killed process did is known, except for the effect of its last call, which is looked up at the
//! server.
//!
//! Events of a part in the journal: [`PartEvent`].
//!
//! An input file and its batch: [`BatchPart`].
//!
//! Names of input files: [`file_name`].

use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions};
use std::io::Write as _;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use darkqa_base::error::{Error, Result};
use darkqa_base::files;
use darkqa_base::types::Digest;
use darkqa_base::types::manifests::RunManifest;
use darkqa_store::{BATCH, BATCH_STATE, now};

/// Number of hexadecimal digits of a run's hash.
const HASH_DIGITS: usize = 16;

/// A line of the journal.
#[derive(Debug, Serialize, Deserialize)]
struct JournalLine {
    /// Name of the part's file.
    file: String,
    #[serde(flatten)]
    event: PartEvent,
    /// Time of the event, in UTC.
    at: String,
}

impl JournalLine {
    /// Checks that all file names are plain names, so that nothing outside the batch folder is read or written.
    fn check_names(&self) -> std::result::Result<(), String> {
        let pieces = match &self.event {
            PartEvent::Split { into } => &into[..],
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
pub struct Journal {
    folder: PathBuf,
    /// Identifies the run in names of files and in marks of batches at the server.
    pub(super) run: String,
    pub(super) parts: Vec<BatchPart>,
    /// Maximum numbers of waiting tokens stated by servers, by [`PartFacts::quota_scope`].
    pub(super) limits: BTreeMap<(String, String), u64>,
}

impl Journal {
    /// Reads the journal of a run; empty if there is none.
    ///
    /// # Errors
    /// If the file cannot be read, or a line is broken.
    pub fn open(run_folder: &Path, manifest: &RunManifest) -> Result<Self> {
        let facts = (&manifest.identity, &manifest.created);
        let hash = Digest::canonical("darkqa.batch/1", &facts)?.to_string();
        let mut journal = Self {
            folder: run_folder.join(BATCH),
            run: hash[..HASH_DIGITS].to_owned(),
            parts: Vec::new(),
            limits: BTreeMap::new(),
        };
        journal.read()?;
        Ok(journal)
    }

    /// Applies the events in the file, if there is one.
    fn read(&mut self) -> Result<()> {
        let path = self.path();
        let text = match files::read(&path) {
            Ok(text) => text,
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(()),
            Err(e) => return Err(Error::file(path, "read", e)),
        };
        for (index, line) in text.split_inclusive(|byte| *byte == b'\n').enumerate() {
            // A killed process may leave the last line incomplete.
            if line.last() != Some(&b'\n') {
                break;
            }
            let line: JournalLine = serde_json::from_slice(line).map_err(|e| Error::json_line(&path, index + 1, &e))?;
            line.check_names().map_err(|problem| Error::line(&path, index + 1, problem))?;
            self.apply(&line.file, &line.event, &line.at);
        }
        Ok(())
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
        self.parts.iter().any(BatchPart::is_out)
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
    pub fn max_open_cost(&self) -> f64 {
        self.parts.iter().filter(|part| part.may_cost()).map(|part| part.facts.max_cost()).sum()
    }

    /// Records the written file of a part.
    pub(super) fn add(&mut self, name: &str, facts: PartFacts) -> Result<()> {
        self.write(name, PartEvent::Written(facts))
    }

    /// Records an event of a part.
    pub(super) fn record(&mut self, part: usize, event: PartEvent) -> Result<()> {
        let name = self.parts[part].name.clone();
        self.write(&name, event)
    }

    /// Appends an event, and syncs the file to disk.
    fn write(&mut self, file: &str, event: PartEvent) -> Result<()> {
        let path = self.path();
        let line = JournalLine { file: file.to_owned(), event, at: now() };
        let mut text = serde_json::to_vec(&line).map_err(|e| Error::file(&path, "write", e.into()))?;
        text.push(b'\n');
        append(&path, &text).map_err(|e| Error::file(&path, "write", e))?;
        tracing::info!("{file}: {}", String::from_utf8_lossy(&text).trim_end());
        self.apply(file, &line.event, &line.at);
        Ok(())
    }

    fn apply(&mut self, file: &str, event: &PartEvent, at: &str) {
        let place = self.parts.iter().position(|part| part.name == file);
        let part = match (place, event) {
            (Some(place), _) => &mut self.parts[place],
            (None, PartEvent::Written(facts)) => {
                self.parts.push(BatchPart::new(file, facts.clone()));
                return;
            }
            (None, _) => return,
        };
        if let PartEvent::QuotaReached { limit: Some(limit) } = event {
            self.limits.insert(part.facts.quota_scope(), *limit);
        }
        part.apply(event, at);
        if let PartEvent::Split { into } = event {
            let pieces = into.iter().map(|piece| BatchPart::new(&piece.file, piece.facts.clone()));
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
    let text = match files::read(path) {
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

/// Facts about a part and its file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PartFacts {
    /// SHA-256 of the file, as 64 hexadecimal digits.
    pub sha256: String,
    /// Size of the file in bytes.
    pub bytes: u64,
    /// Number of requests.
    pub requests: usize,
    /// The model's id at the endpoint.
    pub model: String,
    /// The model's name in tables; empty in journals of earlier versions.
    #[serde(default)]
    pub name: String,
    /// The charged account: the name of the first model with the same base URL, key and headers; empty in journals of
    /// earlier versions.
    #[serde(default)]
    pub account: String,
    /// Base URL of the model's endpoint, without secrets.
    pub base: String,
    /// Path of each request, for example `/v1/chat/completions`.
    pub url: String,
    /// Expected tokens of all prompts.
    pub tokens: f64,
    /// Expected cost in US dollars, at the price of batches; `None` if the model has no known price.
    pub dollars: Option<f64>,
    /// Maximum cost of all requests in US dollars, at the price of batches; `None` if the model has no known price, and
    /// in journals of earlier versions.
    #[serde(default)]
    pub most_dollars: Option<f64>,
    /// Maximum cost of a single request, in US dollars.
    #[serde(default)]
    pub most_dollars_each: Option<f64>,
}

impl PartFacts {
    /// The scope of a limit of waiting tokens: base URL and model id.
    pub(super) fn quota_scope(&self) -> (String, String) {
        (self.base.clone(), self.model.clone())
    }

    /// Maximum cost of the requests, in US dollars; 0 if the model has no known price.
    pub(super) fn max_cost(&self) -> f64 {
        self.most_dollars.or(self.dollars).unwrap_or(0.0)
    }

    /// The number of requests whose maximum cost is within `dollars`; all if the model has no known price.
    pub(super) fn requests_within(&self, dollars: f64) -> usize {
        let each = self.most_dollars_each.unwrap_or(self.max_cost() / self.requests.max(1) as f64);
        let within = if each > 0.0 { dollars / each } else { f64::INFINITY };
        (within.max(0.0) as usize).min(self.requests)
    }

    /// True if the part asks the model with this name and id.
    pub(super) fn asks(&self, name: &str, id: &str) -> bool {
        self.model == id && (self.name.is_empty() || self.name == name)
    }
}

/// An event that has happened to a part, or that is about to happen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum PartEvent {
    /// The file of the part is written.
    Written(PartFacts),
    /// The upload begins.
    Uploading,
    /// The file is at the server.
    Uploaded {
        /// The server's id of the file.
        id: String,
    },
    /// The batch is about to be created.
    Creating {
        /// Number of attempts to create a batch of this part, including this one.
        attempt: u32,
    },
    /// The batch is created.
    Created {
        /// The server's id of the batch.
        id: String,
    },
    /// The last call had no effect.
    Refused {
        /// The server's message.
        why: String,
    },
    /// The batch was refused, because too many tokens are waiting for batches.
    QuotaReached {
        /// Maximum number of waiting tokens; `None` if the server does not state it.
        limit: Option<u64>,
    },
    /// The server reports a new state of the batch.
    Seen {
        /// The state.
        state: String,
    },
    /// The user or `--give-up` asked the server to cancel the batch.
    Cancelled,
    /// The output is downloaded into the batch folder.
    Fetched {
        /// Final state of the batch.
        state: String,
        /// The server's ids of the output file and the error file.
        files: Vec<String>,
    },
    /// The replies are in the records of the run.
    TakenOver {
        /// Number of replies.
        answered: usize,
        /// Number of requests without a reply.
        failed: usize,
    },
    /// The files at the server are deleted.
    Deleted,
    /// The files at the server are kept, or could not be deleted.
    Kept,
    /// The part is split, because it exceeds a limit.
    Split {
        /// The new parts.
        into: Vec<SplitPart>,
    },
    /// The part ended without a batch; its requests may be asked again.
    GaveUp {
        /// The reason.
        why: String,
    },
}

/// A new part that was split off a larger one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SplitPart {
    /// File name.
    pub(super) file: String,
    pub(super) facts: PartFacts,
}

/// Progress of a part.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Stage {
    /// The file is written.
    Written,
    /// The file may be at the server.
    Uploading,
    /// The file is at the server.
    Uploaded,
    /// The batch may exist at the server.
    Creating,
    /// The batch exists, and is not known to have ended.
    Created,
    /// The output is in the batch folder.
    Fetched {
        /// Final state of the batch.
        state: String,
    },
    /// The replies are in the records.
    Imported,
    /// Nothing is left to do.
    Ended,
}

/// An input file and its batch.
#[derive(Debug, Clone)]
pub struct BatchPart {
    /// Name of the file in the batch folder.
    pub(super) name: String,
    pub(super) facts: PartFacts,
    pub(super) stage: Stage,
    /// Number of attempts to create a batch.
    pub(super) attempt: u32,
    /// True if a creation was refused or its batch was not found, so that a batch may exist all the same.
    pub(super) in_doubt: bool,
    /// Number of attempts to upload the file.
    pub(super) uploads: u32,
    /// Ids of the files at the server, the input file first.
    pub(super) files: Vec<String>,
    /// Id of the batch at the server; `None` before it is created.
    pub(super) batch: Option<String>,
    /// Time at which the batch was created, in UTC; empty before.
    pub(super) created: String,
    /// Last state reported by the server, or the reason why the part ended without a batch; empty before.
    pub(super) state: String,
    /// True if the server was asked to cancel the batch.
    pub(super) cancelled: bool,
    /// Numbers of requests with and without a reply; `None` before the replies are imported.
    pub(super) outcome: Option<(usize, usize)>,
}

impl BatchPart {
    pub(super) fn new(name: &str, facts: PartFacts) -> Self {
        Self {
            name: name.to_owned(),
            facts,
            stage: Stage::Written,
            attempt: 0,
            in_doubt: false,
            uploads: 0,
            files: Vec::new(),
            batch: None,
            created: String::new(),
            state: String::new(),
            cancelled: false,
            outcome: None,
        }
    }

    /// The name without the extension.
    pub(super) fn stem(&self) -> &str {
        self.name.strip_suffix(".jsonl").unwrap_or(&self.name)
    }

    /// True if the batch exists or may exist at the server.
    pub(super) fn is_out(&self) -> bool {
        matches!(self.stage, Stage::Creating | Stage::Created)
    }

    /// True if the batch may have costs that are not in the records yet.
    pub(super) fn may_cost(&self) -> bool {
        self.is_out() || matches!(self.stage, Stage::Fetched { .. })
    }

    /// True if the batch is still to be created.
    pub(super) fn is_unsubmitted(&self) -> bool {
        matches!(self.stage, Stage::Written | Stage::Uploading | Stage::Uploaded)
    }

    /// Updates the part by an event at a time in UTC.
    pub(super) fn apply(&mut self, event: &PartEvent, at: &str) {
        self.stage = match event {
            PartEvent::Written(facts) => {
                self.facts = facts.clone();
                Stage::Written
            }
            PartEvent::Uploading => {
                self.uploads += 1;
                Stage::Uploading
            }
            PartEvent::Uploaded { id } => {
                self.files = vec![id.clone()];
                Stage::Uploaded
            }
            PartEvent::Creating { attempt } => {
                self.attempt = *attempt;
                Stage::Creating
            }
            PartEvent::Created { id } => {
                self.batch = Some(id.clone());
                self.state.clear();
                at.clone_into(&mut self.created);
                Stage::Created
            }
            PartEvent::Refused { .. } if self.stage == Stage::Creating => {
                self.in_doubt = true;
                Stage::Uploaded
            }
            PartEvent::Refused { .. } => Stage::Written,
            PartEvent::QuotaReached { .. } => {
                self.batch = None;
                Stage::Uploaded
            }
            PartEvent::Seen { state } => {
                self.state.clone_from(state);
                return;
            }
            PartEvent::Cancelled => {
                self.cancelled = true;
                return;
            }
            PartEvent::Fetched { state, files } => {
                self.state.clone_from(state);
                self.files.extend(files.iter().cloned());
                Stage::Fetched { state: state.clone() }
            }
            PartEvent::TakenOver { answered, failed } => {
                self.outcome = Some((*answered, *failed));
                Stage::Imported
            }
            PartEvent::Split { .. } => {
                "divided into smaller parts".clone_into(&mut self.state);
                Stage::Ended
            }
            PartEvent::GaveUp { why } => {
                self.state.clone_from(why);
                Stage::Ended
            }
            PartEvent::Deleted | PartEvent::Kept => Stage::Ended,
        };
    }
}

/// Converts a text to a part of a file name: characters other than ASCII letters, digits, `-`, `_` and `.` are
/// replaced.
pub(super) fn file_name(text: &str) -> String {
    text.replace(|c: char| !(c.is_ascii_alphanumeric() || "-_.".contains(c)), "_")
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Facts of a part of ten requests.
    pub(crate) fn facts() -> PartFacts {
        PartFacts {
            sha256: "0".repeat(64),
            bytes: 1000,
            requests: 10,
            model: "gpt".to_owned(),
            name: String::new(),
            account: String::new(),
            base: "https://example.org/v1".to_owned(),
            url: "/v1/chat/completions".to_owned(),
            tokens: 500.0,
            dollars: Some(1.0),
            most_dollars: Some(2.0),
            most_dollars_each: Some(0.25),
        }
    }

    fn created() -> Vec<PartEvent> {
        vec![
            PartEvent::Uploading,
            PartEvent::Uploaded { id: "file-1".to_owned() },
            PartEvent::Creating { attempt: 1 },
            PartEvent::Created { id: "batch-1".to_owned() },
        ]
    }

    fn refused() -> PartEvent {
        PartEvent::Refused { why: "no".to_owned() }
    }

    fn fetched() -> PartEvent {
        PartEvent::Fetched { state: "completed".to_owned(), files: vec!["file-2".to_owned()] }
    }

    fn after(events: &[PartEvent]) -> BatchPart {
        let mut part = BatchPart::new("part-1-m-001.jsonl", facts());
        for event in events {
            part.apply(event, "2026-01-02T03:04:05Z");
        }
        part
    }

    #[test]
    fn a_stage_tells_whether_a_batch_may_exist_and_cost() {
        // Stage, then: still to be submitted, at the server or perhaps, may have costs that are not in the records.
        let check = |events: &[PartEvent], stage: Stage, expected: [bool; 3]| {
            let part = after(events);
            assert_eq!(part.stage, stage, "{events:?}");
            assert_eq!([part.is_unsubmitted(), part.is_out(), part.may_cost()], expected, "{events:?}");
        };
        let all = created();
        check(&[], Stage::Written, [true, false, false]);
        check(&all[..1], Stage::Uploading, [true, false, false]);
        check(&all[..2], Stage::Uploaded, [true, false, false]);
        check(&all[..3], Stage::Creating, [false, true, true]);
        check(&all, Stage::Created, [false, true, true]);
        let with = |further: &[PartEvent]| [&all, further].concat();
        check(&with(&[PartEvent::Seen { state: "in_progress".to_owned() }]), Stage::Created, [false, true, true]);
        check(&with(&[PartEvent::Cancelled]), Stage::Created, [false, true, true]);
        let done = Stage::Fetched { state: "completed".to_owned() };
        check(&with(&[fetched()]), done, [false, false, true]);
        let taken = PartEvent::TakenOver { answered: 9, failed: 1 };
        check(&with(&[fetched(), taken.clone()]), Stage::Imported, [false, false, false]);
        for end in [PartEvent::Deleted, PartEvent::Kept] {
            check(&with(&[fetched(), taken.clone(), end]), Stage::Ended, [false, false, false]);
        }
        check(&with(&[PartEvent::GaveUp { why: "gone".to_owned() }]), Stage::Ended, [false, false, false]);
        check(&with(&[PartEvent::Split { into: Vec::new() }]), Stage::Ended, [false, false, false]);
        check(&with(&[PartEvent::QuotaReached { limit: None }]), Stage::Uploaded, [true, false, false]);
    }

    #[test]
    fn a_refused_creation_leaves_doubt_and_a_refused_upload_none() {
        let all = created();
        let part = after(&[&all[..3], &[refused()]].concat());
        assert!(part.stage == Stage::Uploaded && part.in_doubt);
        let part = after(&[&all[..1], &[refused()]].concat());
        assert!(part.stage == Stage::Written && !part.in_doubt);
        let part = after(&[&all[..1], &[refused()], &all[..1]].concat());
        assert_eq!(part.uploads, 2);
    }

    #[test]
    fn files_at_the_server_are_remembered_for_their_deletion() {
        let part = after(&[&created()[..], &[fetched()]].concat());
        assert_eq!(part.files, ["file-1", "file-2"]);
        assert_eq!((part.batch.as_deref(), &*part.created), (Some("batch-1"), "2026-01-02T03:04:05Z"));
        // A batch of another creation has no state yet.
        let again = [&created()[..], &[PartEvent::Seen { state: "failed".to_owned() }], &created()[3..]].concat();
        assert_eq!(after(&again).state, "");
    }

    /// An empty journal in a folder.
    fn journal(folder: &Path) -> Journal {
        Journal { folder: folder.to_owned(), run: "r".to_owned(), parts: Vec::new(), limits: BTreeMap::new() }
    }

    /// The journal as it is read after a restart.
    fn reopened(folder: &Path) -> Result<Journal> {
        let mut journal = journal(folder);
        journal.read()?;
        Ok(journal)
    }

    #[test]
    fn a_restart_reads_what_was_recorded() {
        let folder = tempfile::tempdir().unwrap();
        let mut journal = journal(folder.path());
        journal.add("part-1-m-001.jsonl", facts()).unwrap();
        for event in created() {
            journal.record(0, event).unwrap();
        }
        journal.record(0, PartEvent::QuotaReached { limit: Some(9000) }).unwrap();
        let piece = SplitPart { file: "part-1-m-002.jsonl".to_owned(), facts: PartFacts { requests: 4, ..facts() } };
        journal.record(0, PartEvent::Split { into: vec![piece] }).unwrap();
        let read = reopened(folder.path()).unwrap();
        assert_eq!(format!("{:?}", read.parts), format!("{:?}", journal.parts));
        assert_eq!(read.limits, journal.limits);
        assert_eq!([read.open_requests(), read.free_number("part-1-m") as usize], [4, 3]);
        assert!(read.has_open_parts() && !read.has_batches());
    }

    #[test]
    fn a_line_that_a_kill_cut_is_left_out_and_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        let mut whole = journal(folder.path());
        whole.add("part-1-m-001.jsonl", facts()).unwrap();
        whole.record(0, PartEvent::Uploading).unwrap();
        let path = folder.path().join(BATCH_STATE);
        let complete = fs::read(&path).unwrap();
        let first = complete.iter().position(|byte| *byte == b'\n').unwrap() + 1;
        for length in first..complete.len() {
            fs::write(&path, &complete[..length]).unwrap();
            let mut read = reopened(folder.path()).unwrap();
            assert_eq!(read.parts[0].stage, Stage::Written, "{length} bytes");
            read.record(0, PartEvent::Uploading).unwrap();
            assert_eq!(reopened(folder.path()).unwrap().parts[0].uploads, 1, "{length} bytes");
        }
    }

    #[test]
    fn names_that_lead_out_of_the_folder_are_refused() {
        for name in ["../part-1.jsonl", "part-../x.jsonl", "part-1.txt", "/part-1.jsonl", "part-a/b.jsonl"] {
            let folder = tempfile::tempdir().unwrap();
            let line = JournalLine { file: name.to_owned(), event: PartEvent::Uploading, at: String::new() };
            fs::write(folder.path().join(BATCH_STATE), serde_json::to_string(&line).unwrap() + "\n").unwrap();
            let refused = reopened(folder.path()).unwrap_err().to_string();
            assert!(refused.contains("is no name of a part"), "{refused}");
        }
    }

    fn assert_cost(journal: &Journal, dollars: f64) {
        assert!((journal.max_open_cost() - dollars).abs() < 1e-9, "{}", journal.max_open_cost());
    }

    #[test]
    fn only_batches_that_may_still_cost_count_against_the_budget() {
        let folder = tempfile::tempdir().unwrap();
        let mut journal = journal(folder.path());
        for number in 1..=3 {
            journal.add(&format!("part-1-m-00{number}.jsonl"), facts()).unwrap();
        }
        assert_cost(&journal, 0.0);
        for event in created() {
            journal.record(0, event).unwrap();
        }
        journal.record(1, PartEvent::Creating { attempt: 1 }).unwrap();
        assert_cost(&journal, 4.0);
        journal.record(0, fetched()).unwrap();
        assert_cost(&journal, 4.0);
        journal.record(0, PartEvent::TakenOver { answered: 10, failed: 0 }).unwrap();
        assert_cost(&journal, 2.0);
    }

    #[test]
    fn a_budget_buys_whole_requests_at_their_highest_cost() {
        for (dollars, requests) in [(0.0, 0), (0.24, 0), (0.25, 1), (1.0, 4), (100.0, 10), (-1.0, 0)] {
            assert_eq!(facts().requests_within(dollars), requests, "{dollars}");
        }
        let unpriced = PartFacts { dollars: None, most_dollars: None, most_dollars_each: None, ..facts() };
        assert_eq!(unpriced.requests_within(0.0), 10);
        let earlier = PartFacts { most_dollars: None, most_dollars_each: None, ..facts() };
        assert_eq!(earlier.requests_within(0.35), 3);
    }
}
