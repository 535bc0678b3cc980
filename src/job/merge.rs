//! `merge`: joins the shards of a run into one run.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::fs;
use std::path::{Path, PathBuf};

use clap::Args;

use super::report::{choice, open};
use super::shard::Shard;
use super::stored::{ExperimentKind, StoredRun, in_order};
use super::thumbnail::MissingThumbnails;
use super::{Outcome, ShowArgs, StdoutFormat, count};
use crate::error::{Error, Result};
use crate::store::{self, AddressChange, Store};
use crate::types::manifest::{RunManifest, Status, differences};
use crate::types::{
    ChoiceDetail, Decides, Detail, ImageFidelity, InputSummary, ListedModel, OpenDetail, Record,
    RunQuestion, Thumbnail, TrialKey,
};

/// The flags of `merge`.
#[derive(Debug, Args)]
pub(crate) struct MergeArgs {
    /// The folders of the shards, or a folder that holds them
    #[arg(value_name = "RUN", required = true, add = Decides::Nothing)]
    pub runs: Vec<PathBuf>,
    /// The folder of the whole run
    #[arg(long, value_name = "DIR", add = Decides::Nothing)]
    pub out: PathBuf,
    /// Merge the shards that there are, even if others are missing
    #[arg(long, add = Decides::Nothing)]
    pub partial: bool,
    /// How the report is printed.
    #[command(flatten)]
    pub show: ShowArgs,
}

/// One shard, as read from its folder.
struct MergePart<D> {
    shard: Shard,
    run: StoredRun<D>,
}

impl<D: Detail> MergePart<D> {
    fn open(folder: &Path) -> Result<Self> {
        let run = StoredRun::open(folder)?;
        let Some(shard) = run.manifest.shard.as_deref() else {
            let problem = "the run is not a shard: it was made without --shard".to_owned();
            let path = folder.to_owned();
            return Err(Error::Run { path, problem });
        };
        Ok(Self {
            shard: shard.parse()?,
            run,
        })
    }
}

/// Merges shards: the records of all in the order of the questions, with the report that one run would have written.
///
/// # Errors
/// If a folder holds no shard, two folders hold the same, one is of another run, or shards are missing without `--partial`.
pub(crate) fn merge(args: &MergeArgs) -> Result<Outcome> {
    let folders = folders(&args.runs)?;
    let kinds: Result<Vec<ExperimentKind>> = folders
        .iter()
        .map(|folder| ExperimentKind::of(folder))
        .collect();
    let kinds = kinds?;
    if let Some(other) = kinds.iter().position(|kind| *kind != kinds[0]) {
        let problem = format!(
            "runs of questions with choices and of open questions cannot be merged: {} is of the other kind",
            folders[0].display()
        );
        let path = folders[other].clone();
        return Err(Error::Run { path, problem });
    }
    match kinds.first() {
        Some(ExperimentKind::Open) => merge_all::<OpenDetail>(args, &folders, open::write),
        _ => merge_all::<ChoiceDetail>(args, &folders, choice::write),
    }
}

fn merge_all<D: Detail + PartialEq>(
    args: &MergeArgs,
    folders: &[PathBuf],
    write: impl FnOnce(&Store<D>, StoredRun<D>, StdoutFormat) -> Result<Outcome>,
) -> Result<Outcome> {
    let parts: Result<Vec<MergePart<D>>> = folders
        .iter()
        .map(|folder| MergePart::open(folder))
        .collect();
    let mut parts = parts?;
    parts.sort_by_key(|part| part.shard);
    check_same_run(&parts)?;
    let missing = count_missing(&parts, args.partial)?;
    warn_unfinished(&parts);
    let mut manifest = merged_manifest(&parts)?;
    let mut questions: Vec<RunQuestion> = parts
        .iter()
        .flat_map(|part| part.run.questions.clone())
        .collect();
    questions.sort_by_key(|question| question.place);
    // A control of the observer asks a question of one shard with an image of another.
    questions.dedup_by(|later, question| later.id == question.id);
    let merged = MergedParts::of(parts, &questions, &manifest.models)?;
    manifest.count(count(manifest.counts.trials, &merged.records));
    if missing > 0 {
        manifest.status = Status::Incomplete;
    }
    let mut store = Store::<D>::open(&args.out, &manifest, AddressChange::Refused)?;
    store.write_questions(&questions)?;
    let present: HashMap<TrialKey, Record<D>> = store
        .records()?
        .into_iter()
        .map(|record| (record.key, record))
        .collect();
    for record in &merged.records {
        if present.get(&record.key) != Some(record) {
            store.append(record)?;
        }
    }
    store.sync()?;
    let present: BTreeSet<_> = store::read_thumbnails(&args.out)?
        .into_iter()
        .map(|thumbnail| (thumbnail.frame, thumbnail.condition))
        .collect();
    for thumbnail in merged.thumbnails {
        if !present.contains(&(thumbnail.frame.clone(), thumbnail.condition.clone())) {
            store.append_thumbnail(&thumbnail)?;
        }
    }
    let present: BTreeSet<_> = store::read_fidelity(&args.out)?
        .into_iter()
        .map(|image| (image.frame, image.condition))
        .collect();
    for image in merged.fidelity {
        if !present.contains(&(image.frame.clone(), image.condition.clone())) {
            store.append_fidelity(&image)?;
        }
    }
    let run = StoredRun::of(&args.out, manifest)?;
    write(&store, run, args.show.format())
}

/// The run folders among those named, and directly in them.
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

/// Checks that all are shards of the same run, and no shard is present twice.
fn check_same_run<D>(parts: &[MergePart<D>]) -> Result<()> {
    let wrong = |part: &MergePart<D>, problem: String| {
        let path = part.run.folder.clone();
        Err(Error::Run { path, problem })
    };
    let Some(first) = parts.first() else {
        return Ok(());
    };
    for part in parts {
        if part.shard.count() != first.shard.count() {
            let problem = format!(
                "shard {} cannot be of the same run as {}, which is shard {}",
                part.shard,
                first.run.folder.display(),
                first.shard
            );
            return wrong(part, problem);
        }
        if let Some((field, own, other)) = difference(&part.run.manifest, &first.run.manifest) {
            let problem = format!(
                "shard {} is of another run than {}: its {field} is {own}, that of the other run is {other}",
                part.shard,
                first.run.folder.display()
            );
            return wrong(part, problem);
        }
    }
    let twice = parts.windows(2).find(|pair| pair[0].shard == pair[1].shard);
    match twice {
        None => Ok(()),
        Some(pair) => {
            let problem = format!(
                "shard {} is present twice, also in {}; name only one of them",
                pair[1].shard,
                pair[0].run.folder.display()
            );
            wrong(&pair[1], problem)
        }
    }
}

/// Number of missing shards; an error that names them if a partial merge is not allowed.
fn count_missing<D>(parts: &[MergePart<D>], partial: bool) -> Result<usize> {
    let Some(first) = parts.first() else {
        return Ok(0);
    };
    let present: BTreeSet<Shard> = parts.iter().map(|part| part.shard).collect();
    let absent = Shard::all(first.shard.count()).filter(|shard| !present.contains(shard));
    let absent: Vec<String> = absent.map(|shard| shard.to_string()).collect();
    if absent.is_empty() {
        return Ok(0);
    }
    let verb = if absent.len() == 1 { " is" } else { "s are" };
    let problem = format!(
        "{} shard{verb} missing: {}",
        absent.len(),
        absent.join(", ")
    );
    if !partial {
        return Err(Error::Run {
            path: first.run.folder.clone(),
            problem: format!("{problem}; --partial merges the others"),
        });
    }
    tracing::warn!("{problem}; the summary covers only the others");
    Ok(absent.len())
}

/// Warns about each shard that is not complete.
fn warn_unfinished<D>(parts: &[MergePart<D>]) {
    for part in parts {
        let (status, counts) = (part.run.manifest.status, part.run.manifest.counts);
        if status != Status::Complete {
            tracing::warn!(
                "{}: shard {} is {status}: {} of {} trials answered",
                part.run.folder.display(),
                part.shard,
                counts.answered,
                counts.trials
            );
        }
    }
}

/// The first difference between two manifests that makes them different runs: the field, and its value in each.
fn difference(first: &RunManifest, other: &RunManifest) -> Option<(String, String, String)> {
    let identity = differences(&first.identity, &other.identity).next();
    let identity = identity.map(|(field, own, other)| (field.to_owned(), own, other));
    identity.or_else(|| {
        let column = first.column_differences(other).into_iter().next()?;
        let field = format!("{} of the {} {}", column.field, column.column, column.value);
        Some((field, column.first, column.second))
    })
}

/// The manifest of the merged run.
fn merged_manifest<D>(parts: &[MergePart<D>]) -> Result<RunManifest> {
    let manifests = parts.iter().map(|part| &part.run.manifest);
    let first = manifests.clone().next();
    let mut manifest = first
        .ok_or_else(|| Error::usage("RUN", "no shard is named"))?
        .clone();
    manifest.shard = None;
    for other in manifests.clone() {
        for (column, values) in &other.columns {
            let all = manifest.columns.entry(column.clone()).or_default();
            all.extend(values.clone());
        }
    }
    manifest.enhancers = BTreeMap::new();
    for (name, note) in manifests.clone().flat_map(|other| &other.enhancers) {
        let earlier = manifest.enhancers.remove(name);
        let note = note.clone().after(earlier);
        manifest.enhancers.insert(name.clone(), note);
    }
    let mut inputs: Option<InputSummary> = None;
    for other in manifests.clone().filter_map(|other| other.inputs.as_ref()) {
        inputs.get_or_insert_default().join(other);
    }
    manifest.inputs = inputs;
    let created = manifests
        .clone()
        .map(|manifest| manifest.created.clone())
        .min();
    let updated = manifests
        .clone()
        .map(|manifest| manifest.updated.clone())
        .max();
    // The records of all shards are stored as they are; the first version has no name in a manifest.
    let readings = manifests.clone().map(|manifest| &manifest.reply_reading);
    manifest.reply_reading = readings.min().cloned().flatten();
    manifest.created = created.unwrap_or_default();
    manifest.updated = updated.unwrap_or_default();
    manifest.counts.trials = manifests.map(|manifest| manifest.counts.trials).sum();
    Ok(manifest)
}

/// What the shards of a run stored, as one run would have stored it.
struct MergedParts<D> {
    /// Records in the order of the questions.
    records: Vec<Record<D>>,
    thumbnails: Vec<Thumbnail>,
    fidelity: Vec<ImageFidelity>,
}

impl<D: Detail> MergedParts<D> {
    fn of(
        parts: Vec<MergePart<D>>,
        questions: &[RunQuestion],
        listed: &[ListedModel],
    ) -> Result<Self> {
        let frames = questions.iter().map(|question| &question.frame);
        let wanted = MissingThumbnails::new(frames, Vec::new());
        let mut merged = Self {
            records: Vec::new(),
            thumbnails: Vec::new(),
            fidelity: Vec::new(),
        };
        let mut keys = HashMap::<TrialKey, PathBuf>::new();
        for MergePart { run, .. } in parts {
            for record in run.records {
                if let Some(other) = keys.insert(record.key, run.folder.clone()) {
                    let problem = format!(
                        "the trial {} is also in {}: these are not shards of the same run",
                        record.key,
                        other.display()
                    );
                    let path = run.folder;
                    return Err(Error::Run { path, problem });
                }
                merged.records.push(record);
            }
            let copies = run.thumbnails.into_iter();
            let wanted = copies.filter(|thumbnail| wanted.wants(&thumbnail.frame));
            merged.thumbnails.extend(wanted);
            merged.fidelity.extend(run.fidelity);
        }
        merged.records = in_order(merged.records, questions, listed);
        Ok(merged)
    }
}
