//! `merge`: joins the shards of a run into one run.

mod coverage;
mod missing;
mod part;
mod questions;
mod trials;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use clap::Args;

use self::coverage::Coverage;
use self::part::MergePart;
use self::questions::PartQuestions;
use self::trials::each_once;
use super::placed_trials::{append, read_part};
use super::record_table;
use super::report::{choice, open};
use super::stored::{ExperimentKind, StoredRun, sort};
use super::thumbnail::MissingThumbnails;
use super::{Outcome, ShowArgs, StdoutFormat};
use crate::error::{Error, Result};
use crate::store::{self, AddressChange, Store};
use crate::types::manifest::{Counts, RunManifest, Status, differences};
use crate::types::{ChoiceDetail, Decides, Detail, InputSummary, OpenDetail, Trials};

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

fn merge_all<D: Detail>(
    args: &MergeArgs,
    folders: &[PathBuf],
    write: impl FnOnce(&Store<D>, StoredRun<D>, StdoutFormat) -> Result<Outcome>,
) -> Result<Outcome> {
    let parts: Result<Vec<MergePart>> = folders
        .iter()
        .map(|folder| MergePart::open(folder))
        .collect();
    let mut parts = parts?;
    parts.sort_by_key(|part| (part.shard.count(), part.shard));
    check_same_run(&parts)?;
    let places = parts.iter();
    let places = places.map(|part| (part.shard, &*part.folder, &part.manifest));
    let coverage = Coverage::of(places)?;
    let plan = missing::plan(&parts, &coverage)?;
    let is_missing = missing::check(&parts, &coverage, plan.as_ref(), args.partial)?;
    missing::warn_unfinished(&parts, plan.as_ref());
    let mut manifest = merged_manifest(&parts, &coverage)?;
    let folders: Vec<&Path> = parts.iter().map(|part| &*part.folder).collect();
    let questions = PartQuestions::read(&folders)?;
    let mut trials = Trials::<D>::default();
    for (number, part) in parts.iter().enumerate() {
        read_part(&mut trials, &part.folder, &part.manifest, number)?;
    }
    let twice = each_once(&mut trials, &folders)?;
    if twice > 0 {
        tracing::warn!(
            "{twice} replies differ in two parts: they were paid for twice; those of the first part are taken"
        );
    }
    sort(&mut trials, questions.ids(), &manifest.models);
    let failed = trials.iter().filter(|trial| trial.failed()).count();
    manifest.count(Counts {
        trials: coverage.trials().max(trials.len()),
        answered: trials.len() - failed,
        failed,
    });
    if is_missing {
        manifest.status = Status::Incomplete;
    }
    let mut store = Store::<D>::open(&args.out, &manifest, AddressChange::Refused)?;
    questions.write(&store, &folders)?;
    let shards = parts.iter().map(|part| (&*part.folder, &part.manifest));
    let records = trials.iter().map(|trial| (trial.key(), trial.text()));
    append(&mut store, &manifest, &shards.collect::<Vec<_>>(), records)?;
    drop(trials);
    store.sync()?;
    let wanted = MissingThumbnails::new(questions.frames(), Vec::new());
    store.add_thumbnails_of(&folders, |frame| wanted.wants(frame))?;
    store.add_fidelity_of(&folders, |_| true)?;
    let run = StoredRun::reread(&args.out, manifest)?;
    let outcome = write(&store, run, args.show.format())?;
    record_table::update(&args.out, args.show.table())?;
    Ok(outcome)
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

/// Checks that all are parts of the same run.
fn check_same_run(parts: &[MergePart]) -> Result<()> {
    let Some(first) = parts.first() else {
        return Ok(());
    };
    for part in parts {
        let Some((field, own, other)) = difference(&part.manifest, &first.manifest) else {
            continue;
        };
        let problem = format!(
            "shard {} is of another run than {}: its {field} is {own}, that of the other run is {other}",
            part.shard,
            first.folder.display()
        );
        let path = part.folder.clone();
        return Err(Error::Run { path, problem });
    }
    Ok(())
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
fn merged_manifest(parts: &[MergePart], coverage: &Coverage) -> Result<RunManifest> {
    let manifests = parts.iter().map(|part| &part.manifest);
    let first = manifests.clone().next();
    let mut manifest = first
        .ok_or_else(|| Error::usage("RUN", "no shard is named"))?
        .clone();
    manifest.shard = None;
    manifest.part = None;
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
    let once = manifests.clone().zip(coverage.once());
    let once = once.filter_map(|(other, is_taken)| other.inputs.as_ref().filter(|_| is_taken));
    for other in once {
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
    Ok(manifest)
}
