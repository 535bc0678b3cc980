//! Recovers files that a killed process left incomplete: [`recover`].
//!
//! Splits a part that exceeds a limit: [`Driver::split`].

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{BufWriter, Write as _};
use std::path::Path;

use sha2::{Digest as _, Sha256};

use super::driver::{Driver, StepOutcome};
use super::file::{PART, hexadecimal};
use super::journal::{Journal, PartEvent, PartFacts, SplitPart, Stage};
use super::replies::{for_each_line, key_of};
use darkqa_base::error::{Error, Result};
use darkqa_base::files::create_new;
use darkqa_base::types::TrialKey;
use darkqa_score::answers::record::Detail;
use darkqa_store::Store;

/// Completes the files of parts with the requests that the run has recorded; gives up parts without such requests, and
/// deletes other unfinished files.
pub(super) fn recover<D: Detail>(journal: &mut Journal, store: &Store<D>) -> Result<()> {
    let waiting = store.pending_in_batches()?;
    for part in 0..journal.parts.len() {
        let path = journal.file(part);
        let unfinished = path.with_extension(PART);
        let piece = path.with_extension(PIECE);
        if piece.exists() {
            fs::rename(&piece, &path).map_err(|e| Error::file(&path, "write", e))?;
        }
        if journal.parts[part].stage != Stage::Written || path.exists() {
            continue;
        }
        let is_complete = unfinished.exists() && complete(journal, part, &unfinished, &waiting)?;
        if !is_complete {
            let why = "its file was not written to its end".to_owned();
            journal.record(part, PartEvent::GaveUp { why })?;
        }
    }
    remove_unfinished(journal.folder())?;
    check_trials(journal, store)
}

/// Checks that the records of all trials in batches at the server exist. Without them, the trials would be asked and
/// paid for again.
fn check_trials<D: Detail>(journal: &Journal, store: &Store<D>) -> Result<()> {
    let at_server: Vec<usize> = (0..journal.parts.len())
        .filter(|part| {
            let stage = &journal.parts[*part].stage;
            matches!(stage, Stage::Creating | Stage::Created | Stage::Fetched { .. })
        })
        .collect();
    if at_server.is_empty() {
        return Ok(());
    }
    let known = store.batch_keys()?;
    for part in at_server {
        let path = journal.file(part);
        if !path.exists() {
            continue;
        }
        let mut lost = 0;
        for_each_line(&path, |line| {
            lost += usize::from(key_of(line).is_some_and(|key| !known.contains(&key)));
            Ok(())
        })?;
        if lost > 0 {
            return Err(Error::Run {
                path: store.batch_trials_file(),
                problem: format!(
                    "{lost} trials of {}, whose batch is at the server, are missing: restore this file from a copy; without it they would be asked and paid again. Without a copy, cancel the batch on the server's page and delete {}",
                    journal.parts[part].name,
                    journal.folder().display()
                ),
            });
        }
    }
    Ok(())
}

/// Completes a file, with only the lines whose trials are recorded. Returns true if there are any.
fn complete(journal: &mut Journal, part: usize, unfinished: &Path, waiting: &BTreeSet<TrialKey>) -> Result<bool> {
    let path = journal.file(part);
    let kept = path.with_extension("kept.part");
    let unwritten = |e| Error::file(&kept, "write", e);
    let mut file = BufWriter::new(create_new(&kept).map_err(unwritten)?);
    let (mut hash, mut facts) = (Sha256::new(), journal.parts[part].facts.clone());
    let before = facts.requests;
    (facts.bytes, facts.requests) = (0, 0);
    for_each_line(unfinished, |line| {
        if key_of(line).is_some_and(|key| waiting.contains(&key)) {
            file.write_all(line.as_bytes()).map_err(unwritten)?;
            hash.update(line);
            facts.bytes += line.len() as u64;
            facts.requests += 1;
        }
        Ok(())
    })?;
    file.into_inner()
        .map_err(std::io::IntoInnerError::into_error)
        .and_then(|file| file.sync_all())
        .map_err(unwritten)?;
    if facts.requests == 0 {
        return Ok(false);
    }
    if facts.requests < before {
        facts.sha256 = hexadecimal(&hash.finalize());
        let name = journal.parts[part].name.clone();
        journal.add(&name, facts)?;
    }
    fs::rename(&kept, &path).map_err(|e| Error::file(&path, "write", e))?;
    Ok(true)
}

/// Deletes the unfinished files of parts.
fn remove_unfinished(folder: &Path) -> Result<()> {
    let Ok(entries) = fs::read_dir(folder) else {
        return Ok(());
    };
    for entry in entries {
        let path = entry.map_err(|e| Error::file(folder, "read", e))?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let is_unfinished = path.extension().is_some_and(|extension| extension == PART || extension == PIECE);
        if is_unfinished && name.starts_with("part-") {
            fs::remove_file(&path).map_err(|e| Error::file(&path, "delete", e))?;
        }
    }
    Ok(())
}

/// Extension of a piece's file until the journal has recorded it.
pub(super) const PIECE: &str = "split";

impl<D: Detail> Driver<'_, D> {
    /// Splits a part into `pieces` new parts.
    ///
    /// The files of the pieces are written first, then one event records all of them, then they get their final names.
    /// So a killed process leaves either the part or its pieces.
    ///
    /// # Errors
    /// If the part has only one request, or a file cannot be written.
    pub(super) async fn split(&mut self, part: usize, pieces: usize) -> Result<StepOutcome> {
        let whole = self.part(part).clone();
        let pieces = pieces.clamp(2, whole.facts.requests.max(2));
        if whole.facts.requests < 2 {
            let problem = format!(
                "{}: one request has about {:.0} tokens, more than may wait for batches of {}; send smaller images with --image max-side=N",
                whole.name, whole.facts.tokens, whole.facts.model
            );
            return Err(Error::Endpoint { endpoint: whole.facts.base, problem });
        }
        for id in &self.files_at_server(part).await? {
            // A remaining file is harmless, because only the pieces are used.
            if let Err(failure) = self.delete_file(part, id).await? {
                tracing::warn!("the file {id} could not be deleted at the server: {failure}");
            }
        }
        let into = self.write_pieces(part, pieces)?;
        self.say(part, &format!("divided into {} parts", into.len()));
        let names: Vec<String> = into.iter().map(|piece| piece.file.clone()).collect();
        self.journal.record(part, PartEvent::Split { into })?;
        for name in names {
            let path = self.journal.folder().join(name);
            fs::rename(path.with_extension(PIECE), &path).map_err(|e| Error::file(&path, "write", e))?;
        }
        let path = self.journal.file(part);
        fs::remove_file(&path).map_err(|e| Error::file(&path, "delete", e))?;
        Ok(StepOutcome::Moved)
    }

    /// Writes the files of the pieces, with the extension [`PIECE`].
    fn write_pieces(&self, part: usize, pieces: usize) -> Result<Vec<SplitPart>> {
        let whole = self.part(part);
        let stem = whole.stem().rsplit_once('-').map_or(whole.stem(), |(stem, _)| stem);
        let first = self.journal.free_number(stem) as usize;
        let max_requests = whole.facts.requests.div_ceil(pieces);
        let name = |index: usize| format!("{stem}-{:03}.jsonl", first + index);
        let path = |index: usize| {
            let path = self.journal.folder().join(name(index));
            path.with_extension(PIECE)
        };
        let mut writer = PieceWriter::default();
        let mut into = Vec::new();
        let finish = |writer: PieceWriter, into: &mut Vec<SplitPart>| {
            let index = into.len();
            let facts = writer.finish(&whole.facts).map_err(|e| Error::file(path(index), "write", e))?;
            into.push(SplitPart { file: name(index), facts });
            Ok(())
        };
        for_each_line(&self.journal.file(part), |line| {
            if writer.requests == max_requests {
                finish(std::mem::take(&mut writer), &mut into)?;
            }
            let path = path(into.len());
            writer.add(line, || create_new(&path)).map_err(|e| Error::file(&path, "write", e))
        })?;
        finish(writer, &mut into)?;
        Ok(into)
    }
}

/// Writer of the file of a piece.
#[derive(Default)]
struct PieceWriter {
    file: Option<BufWriter<File>>,
    hash: Sha256,
    bytes: u64,
    requests: usize,
}

impl PieceWriter {
    fn add(&mut self, line: &str, create: impl FnOnce() -> std::io::Result<File>) -> std::io::Result<()> {
        let file = match self.file.take() {
            Some(file) => file,
            None => BufWriter::new(create()?),
        };
        self.file.insert(file).write_all(line.as_bytes())?;
        self.hash.update(line);
        self.bytes += line.len() as u64;
        self.requests += 1;
        Ok(())
    }

    /// Syncs the file to disk; returns the facts about the piece of a part.
    fn finish(self, whole: &PartFacts) -> std::io::Result<PartFacts> {
        if let Some(file) = self.file {
            file.into_inner().map_err(std::io::IntoInnerError::into_error)?.sync_all()?;
        }
        let share = self.requests as f64 / whole.requests as f64;
        Ok(PartFacts {
            sha256: hexadecimal(&self.hash.finalize()),
            bytes: self.bytes,
            requests: self.requests,
            tokens: (whole.tokens * share).round(),
            dollars: whole.dollars.map(|dollars| dollars * share),
            // The piece may contain the most expensive requests.
            most_dollars: whole.most_dollars_each.map(|each| each * self.requests as f64),
            ..whole.clone()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::batch::journal::tests::facts;

    #[test]
    fn a_piece_has_its_share_of_the_whole() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("piece");
        let mut writer = PieceWriter::default();
        for line in ["{\"a\":1}\n", "{\"b\":2}\n"] {
            writer.add(line, || create_new(&path)).unwrap();
        }
        let piece = writer.finish(&facts()).unwrap();
        let text = "{\"a\":1}\n{\"b\":2}\n";
        assert_eq!(fs::read_to_string(&path).unwrap(), text);
        assert_eq!(piece.sha256, hexadecimal(&Sha256::digest(text)));
        assert_eq!((piece.bytes, piece.requests, piece.tokens), (16, 2, 100.0));
        // The most expensive requests may all be in this piece.
        assert_eq!((piece.dollars, piece.most_dollars), (Some(0.2), Some(0.5)));
        assert_eq!(piece.model, facts().model);
    }
}
