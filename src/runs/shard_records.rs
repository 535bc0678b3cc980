//! Trials of shards with the places of their records in the log files, so that shards are joined without keeping
//! records in memory: [`read_shard`], [`append_records`].
//!
//! Division of a run's sources into shards: [`shard_questions`], [`shard_range`].
//!
//! Shards of the same run with another number of shards: [`OtherShards`].

use std::collections::hash_map::Entry;
use std::collections::{BTreeSet, HashMap, HashSet};
use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};

use super::shard::Shard;
use crate::renamed::rename_record;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::flags::setting_spelling;
use darkqa_base::types::manifests::{PartPlace, RecordedNames, RunManifest, differences};
use darkqa_base::types::text::plural;
use darkqa_base::types::{FrameId, Record, TextPlace, TrialKey, Trials};
use darkqa_score::answers::record::Detail;
use darkqa_store::{RecordLog, Store, each_record};

/// Minimum number of bytes in a write. Chosen to make fewer system calls than there are records.
const CHUNK: usize = 1 << 20;

/// Adds the trials of a shard to `trials`, with the current names of models. `number` is the shard's index among the
/// folders that are joined.
///
/// # Errors
/// If a line is not a record.
pub fn read_shard<D: Detail>(
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
fn latest_trials<D: Detail>(folder: &Path, manifest: &RunManifest) -> Result<Trials<D>> {
    let mut trials = Trials::default();
    read_shard(&mut trials, folder, manifest, 0)?;
    trials.keep_one_per_key(|first, later| Ok(first.or_later(later)))?;
    Ok(trials)
}

/// The record files of several run folders, for reading single records.
pub struct ShardLogs<'a> {
    folders: Vec<&'a Path>,
    open: HashMap<usize, RecordLog>,
}

impl<'a> ShardLogs<'a> {
    /// The record files of these folders, by index. Each file is opened when it is first read.
    pub fn new(folders: &[&'a Path]) -> Self {
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
    pub fn line(&mut self, place: TextPlace) -> Result<Vec<u8>> {
        self.log(place.log())?.line_from(place.start())
    }

    /// Parses the line at a place.
    ///
    /// # Errors
    /// If the line is not a record.
    pub fn record<D: Detail>(&mut self, place: TextPlace, line: &[u8]) -> Result<Record<D>> {
        self.log(place.log())?.record(line)
    }
}

/// Appends the records at these places to a run, except those that the run already has. A line is copied unchanged if
/// the run and the shard map the same recorded names of models to current ones.
///
/// # Errors
/// If a record cannot be read or written.
pub fn append_records<D: Detail>(
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

/// The questions about the sources of a shard, with the place of these sources. The place is `None` if the run is not
/// divided.
///
/// Sources are numbered in the order of their first question. A shard has consecutive sources, and all shards cost
/// about the same. Consecutive sources of one scene stay in one shard if they cost at most as much as a shard. `source`
/// returns the source of a question, `scene` its scene (empty if it has none), and `cost` the cost of a source in any
/// unit.
///
/// # Errors
/// If the shard is empty.
pub fn shard_questions<Q>(
    questions: Vec<Q>,
    shard: Shard,
    source: impl Fn(&Q) -> String,
    scene: impl Fn(&Q) -> String,
    cost: impl Fn(&str) -> u64,
) -> Result<(Vec<Q>, Option<PartPlace>)> {
    if !shard.is_part() {
        return Ok((questions, None));
    }
    let mut positions = HashMap::<String, usize>::new();
    let mut sources = Vec::new();
    for question in &questions {
        let next = positions.len();
        if let Entry::Vacant(place) = positions.entry(source(question)) {
            sources.push(WeightedSource { scene: scene(question), cost: cost(place.key()) });
            place.insert(next);
        }
    }
    let own = shard_range(&sources, shard);
    if own.is_empty() {
        let problem = format!(
            "{shard} is empty: only {}; use at most as many shards",
            plural(positions.len(), "frame or walk", "frames or walks")
        );
        return Err(Error::usage("--shard", problem));
    }
    let place = PartPlace { first: own.start, count: own.len(), of: positions.len() };
    let questions = questions.into_iter().filter(|question| own.contains(&positions[&source(question)]));
    Ok((questions.collect(), Some(place)))
}

/// The scene and the cost of a source.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct WeightedSource {
    /// Empty if the source has no scene.
    pub scene: String,
    /// Cost in any unit; 0 counts as 1.
    pub cost: u64,
}

impl WeightedSource {
    /// A source without a scene and with the same cost as all others.
    pub fn equal() -> Self {
        Self { scene: String::new(), cost: 1 }
    }
}

/// The indices of a shard's sources; empty only if there are more shards than sources.
pub fn shard_range(sources: &[WeightedSource], shard: Shard) -> Range<usize> {
    let mut starts = shard_starts(sources, shard.count().get() as usize);
    starts.push(sources.len());
    let index = shard.index() as usize;
    starts[index]..starts[index + 1]
}

/// The index of the first source of each shard.
fn shard_starts(sources: &[WeightedSource], count: usize) -> Vec<usize> {
    let total: u128 = sources.iter().map(cost).sum();
    // The total cost is cut into equal shares. A source belongs to the share in which it starts.
    let shard_at = |cost_before: u128| (cost_before * count as u128 / total.max(1)) as usize;
    let mut shards = Vec::with_capacity(sources.len());
    let mut cost_before = 0;
    for scene in sources.chunk_by(|one, next| !one.scene.is_empty() && one.scene == next.scene) {
        let scene_cost: u128 = scene.iter().map(cost).sum();
        let fits_in_shard = scene_cost * count as u128 <= total;
        let first = shard_at(cost_before);
        for source in scene {
            shards.push(if fits_in_shard { first } else { shard_at(cost_before) });
            cost_before += cost(source);
        }
    }
    let mut starts: Vec<usize> = (0..count).map(|shard| shards.partition_point(|other| *other < shard)).collect();
    // If there are enough sources, give each shard at least one, although a source may cost more than a share.
    if count <= sources.len() {
        for shard in 1..count {
            starts[shard] = starts[shard].max(starts[shard - 1] + 1);
        }
        for shard in (1..count).rev() {
            starts[shard] = starts[shard].min(sources.len() - (count - shard));
        }
    }
    starts
}

fn cost(source: &WeightedSource) -> u128 {
    u128::from(source.cost.max(1))
}

/// Shards of a run that was divided into another number of shards, for example because a job array was stopped and
/// restarted with another size. Their replies are reused.
pub struct OtherShards(Vec<(PathBuf, RunManifest)>);

impl OtherShards {
    /// Finds the shards of other divisions in the parent folder of a shard.
    ///
    /// # Errors
    /// If one belongs to another run, or another process is writing to it and might ask the same questions.
    pub fn find<D: Detail>(folder: &Path, manifest: &RunManifest) -> Result<Self> {
        let mut shards = Vec::new();
        let (Some(own), Some(run)) = (shard_count(manifest), folder.parent()) else {
            return Ok(Self(shards));
        };
        let entries = fs::read_dir(run).map_err(|e| Error::file(run, "read", e))?;
        for entry in entries {
            let path = entry.map_err(|e| Error::file(run, "read", e))?.path();
            if darkqa_store::schema(&path)?.is_none_or(|schema| schema != D::SCHEMA) {
                continue;
            }
            let Some(other) = darkqa_store::read_manifest(&path, D::SCHEMA)? else {
                continue;
            };
            if shard_count(&other).is_none_or(|count| count == own) {
                continue;
            }
            if let Some((field, before, now)) = differences(&other.identity, &manifest.identity).next() {
                let field = setting_spelling(field);
                return Err(Error::Run {
                    path: path.clone(),
                    problem: format!(
                        "this part is of another run: its {field} is {before}, now it is {now}; use another --out, or the same {field}"
                    ),
                });
            }
            if darkqa_store::is_locked(&path)? {
                return Err(Error::Run {
                    path: path.clone(),
                    problem: format!(
                        "another process is writing to this part of another division, and both might ask the same; wait for it, or end it, \
                         before --shard {} begins",
                        manifest.shard.as_deref().unwrap_or_default()
                    ),
                });
            }
            shards.push((path, other));
        }
        shards.sort_by(|one, other| one.0.cmp(&other.0));
        Ok(Self(shards))
    }

    /// Copies the replies to the trials in `wanted` from the other shards, with the thumbnails and fidelity notes of
    /// `sources`. Returns the number of replies.
    ///
    /// # Errors
    /// If a record cannot be read or written.
    pub fn copy_into<D: Detail>(
        &self,
        store: &mut Store<D>,
        manifest: &RunManifest,
        wanted: &HashSet<TrialKey>,
        sources: &BTreeSet<&FrameId>,
    ) -> Result<usize> {
        let mut found: Vec<(TrialKey, TextPlace)> = Vec::new();
        let mut keys = HashSet::new();
        for (number, (folder, other)) in self.0.iter().enumerate() {
            let trials = latest_trials::<D>(folder, other)?;
            let mut answered: Vec<(TextPlace, TrialKey)> = trials
                .iter()
                .filter(|trial| wanted.contains(&trial.key()) && !trial.failed())
                .map(|trial| (trial.text().in_log(number), trial.key()))
                .collect();
            answered.sort_unstable();
            found.extend(answered.into_iter().filter(|(_, key)| keys.insert(*key)).map(|(place, key)| (key, place)));
        }
        if found.is_empty() {
            return Ok(0);
        }
        let shards: Vec<(&Path, &RunManifest)> =
            self.0.iter().map(|(folder, manifest)| (&**folder, manifest)).collect();
        append_records(store, manifest, &shards, found.iter().copied())?;
        let folders: Vec<&Path> = shards.iter().map(|(folder, _)| *folder).collect();
        store.add_thumbnails_from(&folders, |frame| sources.contains(frame))?;
        store.add_fidelity_from(&folders, |frame| sources.contains(frame))?;
        store.sync()?;
        Ok(found.len())
    }
}

/// The number of shards in the manifest of a shard; `None` if the run is not a shard.
fn shard_count(manifest: &RunManifest) -> Option<&str> {
    let (_, count) = manifest.shard.as_deref()?.split_once('/')?;
    Some(count)
}

#[cfg(test)]
mod tests {
    use std::num::NonZeroU32;

    use super::*;

    fn cuts(scenes: &str, count: u32) -> Vec<Range<usize>> {
        let sources = scenes.chars().map(|letter| WeightedSource {
            scene: match letter {
                '-' => String::new(),
                letter => letter.to_string(),
            },
            cost: 1,
        });
        divided(&sources.collect::<Vec<WeightedSource>>(), count)
    }

    fn divided(sources: &[WeightedSource], count: u32) -> Vec<Range<usize>> {
        let shards = Shard::all(NonZeroU32::new(count).unwrap());
        shards.map(|shard| shard_range(sources, shard)).collect()
    }

    fn divided_costs(costs: &[u64]) -> Vec<WeightedSource> {
        costs.iter().map(|cost| WeightedSource { scene: String::new(), cost: *cost }).collect()
    }

    #[test]
    fn every_source_is_in_one_shard_and_no_shard_is_empty() {
        for count in 1..=20 {
            for scenes in [
                "-".repeat(20),
                "aabbccddeeffgghhiijj".to_owned(),
                "aaaaaaaaaaabbbcddddd".to_owned(),
                "aaaaaaaaaaaaaaaaaaaa".to_owned(),
                "abbbccddddeeeeefffff".to_owned(),
            ] {
                let cuts = cuts(&scenes, count);
                let mut end = 0;
                for cut in &cuts {
                    assert_eq!(cut.start, end, "{scenes} {count}: {cuts:?}");
                    assert!(!cut.is_empty(), "{scenes} {count}: {cuts:?}");
                    end = cut.end;
                }
                assert_eq!(end, 20, "{scenes} {count}: {cuts:?}");
            }
        }
        // More shards than sources: some have none.
        assert_eq!(cuts("--", 3).iter().filter(|cut| cut.is_empty()).count(), 1);
    }

    #[test]
    fn a_scene_is_divided_only_if_it_is_larger_than_a_shard() {
        assert_eq!(cuts("------", 4), [0..2, 2..3, 3..5, 5..6]);
        assert_eq!(cuts("aabbcc", 2), [0..4, 4..6]);
        assert_eq!(cuts("aabbcc", 3), [0..2, 2..4, 4..6]);
        assert_eq!(cuts("aaaaab", 2), [0..3, 3..6]);
    }

    #[test]
    fn shards_cost_about_the_same() {
        // One source costs as much as all others together.
        assert_eq!(divided(&divided_costs(&[4, 1, 1, 1, 1]), 2), [0..1, 1..5]);
        assert_eq!(divided(&divided_costs(&[1, 1, 1, 1, 4]), 2), [0..4, 4..5]);
        assert_eq!(divided(&divided_costs(&[2, 2, 1, 1, 1, 1]), 2), [0..2, 2..6]);
        // An expensive source leaves no shard empty.
        assert_eq!(divided(&divided_costs(&[100, 1, 1]), 3), [0..1, 1..2, 2..3]);
        assert_eq!(divided(&divided_costs(&[1, 1, 100]), 3), [0..1, 1..2, 2..3]);
        assert_eq!(divided(&divided_costs(&[0, 0, 0]), 3), [0..1, 1..2, 2..3]);
        let costs: Vec<u64> = (0..50).map(|i| 1 + i * i % 17).collect();
        let sum: u64 = costs.iter().sum();
        let parts = divided(&divided_costs(&costs), 7);
        assert_eq!(parts.iter().map(Range::len).sum::<usize>(), 50);
        for part in parts {
            let own: u64 = costs[part].iter().sum();
            assert!(own.abs_diff(sum / 7) <= 17, "{own} of {sum}");
        }
    }
}
