//! Trials of shards with the places of their records in the log files, so that shards are joined without keeping
//! records in memory: [`read_shard`], [`append_records`].

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::path::Path;

use crate::error::Result;
use crate::runs::renamed::rename_record;
use crate::store::{RecordLog, Store, each_record};
use crate::types::manifests::{RecordedNames, RunManifest};
use crate::types::{Record, TextPlace, TrialKey, Trials};
use darkqa_score::answers::record::Detail;

/// Minimum number of bytes in a write. Chosen to make fewer system calls than there are records.
const CHUNK: usize = 1 << 20;

/// Adds the trials of a shard to `trials`, with the current names of models. `number` is the shard's index among the
/// folders that are joined.
///
/// # Errors
/// If a line is not a record.
pub(crate) fn read_shard<D: Detail>(
    trials: &mut Trials<D>,
    folder: &Path,
    manifest: &RunManifest,
    number: usize,
) -> Result<()> {
    let names = RecordedNames::from_manifest(manifest);
    each_record(folder, |mut record: Record<D>, place| {
        rename_record(&mut record, &names);
        trials.add(record, TextPlace::new(place.start).in_log(number));
    })
}

/// The trials of a run folder, each with its last record.
///
/// # Errors
/// If a line is not a record.
pub(crate) fn latest_trials<D: Detail>(folder: &Path, manifest: &RunManifest) -> Result<Trials<D>> {
    let mut trials = Trials::default();
    read_shard(&mut trials, folder, manifest, 0)?;
    trials.keep_one_per_key(|first, later| Ok(first.or_later(later)))?;
    Ok(trials)
}

/// The record files of several run folders, for reading single records.
pub(crate) struct ShardLogs<'a> {
    folders: Vec<&'a Path>,
    open: HashMap<usize, RecordLog>,
}

impl<'a> ShardLogs<'a> {
    /// The record files of these folders, by index. Each file is opened when it is first read.
    pub(crate) fn new(folders: &[&'a Path]) -> Self {
        Self { folders: folders.to_vec(), open: HashMap::new() }
    }

    fn log(&mut self, number: usize) -> Result<&RecordLog> {
        Ok(match self.open.entry(number) {
            Entry::Occupied(open) => open.into_mut(),
            Entry::Vacant(entry) => entry.insert(RecordLog::open(self.folders[number])?),
        })
    }

    /// The line at a place.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub(crate) fn line(&mut self, place: TextPlace) -> Result<Vec<u8>> {
        self.log(place.log())?.line_from(place.start())
    }

    /// Parses the line at a place.
    ///
    /// # Errors
    /// If the line is not a record.
    pub(crate) fn record<D: Detail>(&mut self, place: TextPlace, line: &[u8]) -> Result<Record<D>> {
        self.log(place.log())?.record(line)
    }
}

/// Appends the records at these places to a run, except those that the run already has. A line is copied unchanged if
/// the run and the shard map the same recorded names of models to current ones.
///
/// # Errors
/// If a record cannot be read or written.
pub(crate) fn append_records<D: Detail>(
    store: &mut Store<D>,
    manifest: &RunManifest,
    shards: &[(&Path, &RunManifest)],
    trials: impl Iterator<Item = (TrialKey, TextPlace)>,
) -> Result<()> {
    let names = RecordedNames::from_manifest(manifest);
    let shard_names: Vec<RecordedNames> = shards.iter().map(|(_, shard)| RecordedNames::from_manifest(shard)).collect();
    let present = latest_trials::<D>(store.folder(), manifest)?;
    let present: HashMap<TrialKey, TextPlace> = present.iter().map(|trial| (trial.key(), trial.text())).collect();
    let own_log = RecordLog::open(store.folder())?;
    let mut logs = ShardLogs::new(&shards.iter().map(|(folder, _)| *folder).collect::<Vec<_>>());
    let mut chunk = Vec::new();
    for (key, place) in trials {
        let shard_names = &shard_names[place.log()];
        let line = logs.line(place)?;
        let log = logs.log(place.log())?;
        if let Some(own_place) = present.get(&key) {
            let own_line = own_log.line_from(own_place.start())?;
            if own_line == line
                || renamed_record::<D>(&own_log, &own_line, &names)? == renamed_record(log, &line, shard_names)?
            {
                continue;
            }
        }
        if *shard_names == names {
            chunk.extend_from_slice(&line);
        } else {
            let record = renamed_record::<D>(log, &line, shard_names)?;
            chunk.extend_from_slice(&store.line(&record)?);
        }
        if chunk.len() >= CHUNK {
            store.append_lines(&chunk)?;
            chunk.clear();
        }
    }
    store.append_lines(&chunk)
}

/// Parses a line and gives its model the current name.
fn renamed_record<D: Detail>(log: &RecordLog, line: &[u8], names: &RecordedNames) -> Result<Record<D>> {
    let mut record = log.record(line)?;
    rename_record(&mut record, names);
    Ok(record)
}
