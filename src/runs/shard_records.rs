//! Trials of parts of a run by the places of their records, so that joining them holds no record: [`read_part`], [`append`].

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::path::Path;

use crate::error::{Error, Result};
use crate::runs::renamed::rename;
use crate::store::{RecordLog, Store, each_record};
use crate::types::manifests::{RecordedNames, RunManifest};
use crate::types::{Record, TextPlace, TrialKey, Trials};
use darkqa_score::answers::record::Detail;

/// The bytes of records that are written at once. Chosen: fewer calls of the system than records.
const CHUNK: usize = 1 << 20;

/// Adds the trials of a run folder, which is the part of this number: each as its last record states, with the name that its model has now.
///
/// # Errors
/// If a line is not a record.
pub(crate) fn read_part<D: Detail>(
    trials: &mut Trials<D>,
    folder: &Path,
    manifest: &RunManifest,
    part: usize,
) -> Result<()> {
    let names = RecordedNames::from_manifest(manifest);
    each_record(folder, |mut record: Record<D>, place| {
        let shown = names.shown(&record.model);
        if shown != record.model {
            let shown = shown.to_owned();
            record.model = shown;
        }
        trials.add(record, TextPlace::new(place.start).in_log(part));
    })
}

/// The trials of a run folder, each as its last record states.
///
/// # Errors
/// If a line is not a record.
pub(crate) fn trials_of<D: Detail>(folder: &Path, manifest: &RunManifest) -> Result<Trials<D>> {
    let mut trials = Trials::default();
    read_part(&mut trials, folder, manifest, 0)?;
    trials.each_key_once(|first, later| Ok(first.or_later(later)))?;
    Ok(trials)
}

/// The records of several run folders, to read single ones.
pub(crate) struct PartLogs<'a> {
    folders: Vec<&'a Path>,
    open: HashMap<usize, RecordLog>,
}

impl<'a> PartLogs<'a> {
    /// The records in these folders, which are numbered from 0. No file is opened yet.
    pub(crate) fn new(folders: &[&'a Path]) -> Self {
        Self {
            folders: folders.to_vec(),
            open: HashMap::new(),
        }
    }

    fn log(&mut self, part: usize) -> Result<&RecordLog> {
        Ok(match self.open.entry(part) {
            Entry::Occupied(open) => open.into_mut(),
            Entry::Vacant(first) => first.insert(RecordLog::open(self.folders[part])?),
        })
    }

    /// The line of a trial.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub(crate) fn line(&mut self, place: TextPlace) -> Result<Vec<u8>> {
        self.log(place.log())?.line_from(place.start())
    }

    /// A record from the line at a place.
    ///
    /// # Errors
    /// If the line is not a record.
    pub(crate) fn record<D: Detail>(&mut self, place: TextPlace, line: &[u8]) -> Result<Record<D>> {
        self.log(place.log())?.record(line)
    }
}

/// Appends the records at these places to a run that lacks them, one after another. Where a run has the same names of models in its
/// records as the part that a record is from, its line is copied.
///
/// # Errors
/// If a record cannot be read or written.
pub(crate) fn append<D: Detail>(
    store: &mut Store<D>,
    manifest: &RunManifest,
    parts: &[(&Path, &RunManifest)],
    trials: impl Iterator<Item = (TrialKey, TextPlace)>,
) -> Result<()> {
    let names = RecordedNames::from_manifest(manifest);
    let is_copied: Vec<bool> = parts
        .iter()
        .map(|(_, part)| RecordedNames::from_manifest(part) == names)
        .collect();
    let present = trials_of::<D>(store.folder(), manifest)?;
    let present: HashMap<TrialKey, TextPlace> = present
        .iter()
        .map(|trial| (trial.key(), trial.text()))
        .collect();
    let own = RecordLog::open(store.folder())?;
    let mut logs = PartLogs::new(&parts.iter().map(|(folder, _)| *folder).collect::<Vec<_>>());
    let mut chunk = Vec::new();
    for (key, place) in trials {
        let of_part = parts[place.log()].1;
        let line = logs.line(place)?;
        let log = logs.log(place.log())?;
        let shown = |log: &RecordLog, line: &[u8], manifest: &RunManifest| {
            let mut record = log.record::<D>(line)?;
            rename(std::slice::from_mut(&mut record), manifest);
            Ok::<_, Error>(record)
        };
        if let Some(place) = present.get(&key) {
            let present = own.line_from(place.start())?;
            let is_same =
                || Ok::<_, Error>(shown(&own, &present, manifest)? == shown(log, &line, of_part)?);
            if present == line || is_same()? {
                continue;
            }
        }
        if is_copied[place.log()] {
            chunk.extend_from_slice(&line);
        } else {
            chunk.extend_from_slice(&store.line(&shown(log, &line, of_part)?)?);
        }
        if chunk.len() >= CHUNK {
            store.append_lines(&chunk)?;
            chunk.clear();
        }
    }
    store.append_lines(&chunk)
}
