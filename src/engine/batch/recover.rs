//! Recovers files that a killed process left incomplete: [`recover`].

use std::collections::BTreeSet;
use std::fs;
use std::io::{BufWriter, Write as _};
use std::path::Path;

use sha2::{Digest as _, Sha256};

use super::event::Event;
use super::file::{PART, hexadecimal};
use super::import::{for_each_line, key_of};
use super::journal::Journal;
use super::part::Stage;
use super::split::PIECE;
use crate::error::{Error, Result};
use crate::files::create_new;
use crate::store::Store;
use crate::types::TrialKey;
use darkqa_score::answers::record::Detail;

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
            journal.record(part, Event::GaveUp { why })?;
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
