//! `merge`: the shards of an evaluation as the one run that they are together.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::fs;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::report::{kept, leave};
use super::thumbnail::Wanted;
use super::{Verdict, count};
use crate::config::{Merge, Missing, Shard};
use crate::error::{Error, Result};
use crate::store::{self, Moved, Store};
use crate::types::manifest::{RunManifest, Status, differences};
use crate::types::{ChoiceDetail, Digest, QuestionId, Record, RunQuestion, Thumbnail, TrialKey};

/// The field of a run's identity that names its shard.
pub(super) const SHARD: &str = "--shard";
/// The field that holds the digest of its images.
const DATA: &str = "--data";
const IMAGES: &str = "images";

/// A shard as it lies in its folder.
struct Part {
    folder: PathBuf,
    shard: Shard,
    manifest: RunManifest,
    records: Vec<Record>,
    questions: Vec<RunQuestion>,
    thumbnails: Vec<Thumbnail>,
}

impl Part {
    fn open(folder: &Path) -> Result<Self> {
        let manifest = kept(folder)?;
        let said = manifest.identity.get(SHARD).and_then(Value::as_str);
        let Some(said) = said else {
            let problem = "the run is no shard: it was made without --shard".to_owned();
            let path = folder.to_owned();
            return Err(Error::Run { path, problem });
        };
        Ok(Self {
            shard: said.parse()?,
            records: store::read_records(folder)?,
            questions: store::read_questions(folder)?,
            thumbnails: store::read_thumbnails(folder)?,
            folder: folder.to_owned(),
            manifest,
        })
    }

    /// The identity without what differs from shard to shard.
    fn common(&self) -> BTreeMap<String, Value> {
        let mut identity = self.manifest.identity.clone();
        identity.remove(SHARD);
        if let Some(data) = identity.get_mut(DATA).and_then(Value::as_object_mut) {
            data.remove(IMAGES);
        }
        identity
    }

    /// The digest of its images.
    fn images(&self) -> Result<Digest> {
        let data = self.manifest.identity.get(DATA);
        let images = data.and_then(|data| data.get(IMAGES)?.as_str());
        images.unwrap_or_default().parse()
    }
}

/// Merges shards: the records of all, in the order of the questions, and the report that one run would have left.
///
/// # Errors
/// Where a folder holds no shard, two hold one, one is of another run, or some are missing and that is refused.
pub fn merge(config: &Merge) -> Result<Verdict> {
    let folders = folders(&config.runs)?;
    let parts: Result<Vec<Part>> = folders.iter().map(|folder| Part::open(folder)).collect();
    let mut parts = parts?;
    parts.sort_by_key(|part| part.shard);
    agree(&parts)?;
    let missing = missing(&parts, config.missing)?;
    unfinished(&parts);
    let mut manifest = whole(&parts)?;
    let questions = interleaved(&parts);
    let (records, thumbnails) = together(parts, &questions)?;
    manifest.counts = count(manifest.counts.trials, &records);
    manifest.status = if missing == 0 && manifest.counts.answered == manifest.counts.trials {
        Status::Complete
    } else {
        Status::Incomplete
    };
    let mut store = Store::<ChoiceDetail>::open(&config.out, &manifest, Moved::Refused)?;
    store.write_questions(&questions)?;
    let there: HashMap<TrialKey, Record> = store
        .records()?
        .into_iter()
        .map(|record| (record.key, record))
        .collect();
    for record in &records {
        if there.get(&record.key) != Some(record) {
            store.append(record)?;
        }
    }
    store.sync()?;
    let drawn: BTreeSet<_> = store::read_thumbnails(&config.out)?
        .into_iter()
        .map(|thumbnail| (thumbnail.frame, thumbnail.condition))
        .collect();
    for thumbnail in thumbnails {
        if !drawn.contains(&(thumbnail.frame.clone(), thumbnail.condition.clone())) {
            store.append_thumbnail(&thumbnail)?;
        }
    }
    let output = leave(&store, &manifest, records, config.show)?;
    Ok(Verdict {
        status: manifest.status,
        output,
    })
}

/// The folders of shards among those named and directly in them.
fn folders(named: &[PathBuf]) -> Result<Vec<PathBuf>> {
    let mut folders = Vec::new();
    for path in named {
        if store::schema(path)?.is_some() {
            folders.push(path.clone());
            continue;
        }
        let entries = fs::read_dir(path).map_err(|e| Error::file(path, "read", e))?;
        let mut inside = Vec::new();
        for entry in entries {
            let entry = entry.map_err(|e| Error::file(path, "read", e))?.path();
            if store::schema(&entry)?.is_some() {
                inside.push(entry);
            }
        }
        if inside.is_empty() {
            let problem = "neither a run nor a folder of runs".to_owned();
            let path = path.clone();
            return Err(Error::Run { path, problem });
        }
        inside.sort();
        folders.extend(inside);
    }
    Ok(folders)
}

/// Makes sure that all are shards of one run, and none is there twice.
fn agree(parts: &[Part]) -> Result<()> {
    let wrong = |part: &Part, problem: String| {
        let path = part.folder.clone();
        Err(Error::Run { path, problem })
    };
    let Some(first) = parts.first() else {
        return Ok(());
    };
    let common = first.common();
    for part in parts {
        if part.shard.of() != first.shard.of() {
            let problem = format!(
                "shard {} is no part of the same run as {}, which is shard {}",
                part.shard,
                first.folder.display(),
                first.shard
            );
            return wrong(part, problem);
        }
        if let Some((field, own, there)) = differences(&part.common(), &common).next() {
            let problem = format!(
                "shard {} is of another run than {}: its {field} is {own}, there it is {there}",
                part.shard,
                first.folder.display()
            );
            return wrong(part, problem);
        }
    }
    let twice = parts.windows(2).find(|pair| pair[0].shard == pair[1].shard);
    match twice {
        None => Ok(()),
        Some(pair) => {
            let problem = format!(
                "shard {} is there twice, also in {}; name one of them",
                pair[1].shard,
                pair[0].folder.display()
            );
            wrong(&pair[1], problem)
        }
    }
}

/// How many shards are missing; an error that names them, where that is refused.
fn missing(parts: &[Part], refused: Missing) -> Result<usize> {
    let Some(first) = parts.first() else {
        return Ok(0);
    };
    let there: BTreeSet<Shard> = parts.iter().map(|part| part.shard).collect();
    let absent = Shard::all(first.shard.of()).filter(|shard| !there.contains(shard));
    let absent: Vec<String> = absent.map(|shard| shard.to_string()).collect();
    if absent.is_empty() {
        return Ok(0);
    }
    let told = format!("{} shards are missing: {}", absent.len(), absent.join(", "));
    if refused == Missing::Refused {
        return Err(Error::Run {
            path: first.folder.clone(),
            problem: format!("{told}; --partial merges what there is"),
        });
    }
    tracing::warn!("{told}; the summary is of what there is");
    Ok(absent.len())
}

/// Says which shards are not done.
fn unfinished(parts: &[Part]) {
    for part in parts {
        let (status, counts) = (part.manifest.status, part.manifest.counts);
        if status != Status::Complete {
            tracing::warn!(
                "{}: shard {} is {status}: {} of {} trials answered",
                part.folder.display(),
                part.shard,
                counts.answered,
                counts.trials
            );
        }
    }
}

/// The manifest of the run that the shards are together.
fn whole(parts: &[Part]) -> Result<RunManifest> {
    let first = parts
        .first()
        .ok_or_else(|| Error::usage("RUN", "no shard is named"))?;
    let images = parts.iter().map(Part::images).collect::<Result<Vec<_>>>()?;
    let mut manifest = first.manifest.clone();
    manifest.identity.remove(SHARD);
    if let Some(data) = manifest.identity.get_mut(DATA) {
        data[IMAGES] = json!(Digest::of_set(images));
    }
    let manifests = parts.iter().map(|part| &part.manifest);
    let created = manifests.clone().map(|one| one.created.clone()).min();
    let updated = manifests.clone().map(|one| one.updated.clone()).max();
    manifest.created = created.unwrap_or_default();
    manifest.updated = updated.unwrap_or_default();
    manifest.counts.trials = manifests.map(|one| one.counts.trials).sum();
    Ok(manifest)
}

/// The questions of all shards in the order of the whole: the frames were dealt out to the shards one by one.
fn interleaved(parts: &[Part]) -> Vec<RunQuestion> {
    let mut frames: Vec<_> = parts
        .iter()
        .map(|part| {
            let frames = part.questions.chunk_by(|one, next| one.frame == next.frame);
            frames.collect::<Vec<_>>().into_iter()
        })
        .collect();
    let mut all = Vec::new();
    loop {
        let dealt: Vec<&[RunQuestion]> = frames.iter_mut().filter_map(Iterator::next).collect();
        if dealt.is_empty() {
            return all;
        }
        all.extend(dealt.concat());
    }
}

/// The records of all shards in the order of the questions, and the small copies of images that one run would have kept.
fn together(parts: Vec<Part>, questions: &[RunQuestion]) -> Result<(Vec<Record>, Vec<Thumbnail>)> {
    let places: HashMap<&QuestionId, usize> = questions.iter().map(|q| &q.id).zip(0..).collect();
    let wanted = Wanted::new(questions.iter().map(|question| &question.frame), Vec::new());
    let (mut records, mut thumbnails) = (Vec::new(), Vec::new());
    let mut keys = HashMap::<TrialKey, PathBuf>::new();
    for part in parts {
        for record in part.records {
            if let Some(other) = keys.insert(record.key, part.folder.clone()) {
                let problem = format!(
                    "the trial {} is in {} as well: these are not the shards of one run",
                    record.key,
                    other.display()
                );
                return Err(Error::Run {
                    path: part.folder,
                    problem,
                });
            }
            records.push(record);
        }
        let kept = part.thumbnails.into_iter();
        thumbnails.extend(kept.filter(|thumbnail| wanted.wants(&thumbnail.frame)));
    }
    records.sort_by_cached_key(|record| {
        let condition = record.condition.clone();
        let place = places.get(&record.question).copied();
        (
            place,
            record.view,
            record.model.clone(),
            condition,
            record.detail.repeat,
            record.key,
        )
    });
    Ok((records, thumbnails))
}
