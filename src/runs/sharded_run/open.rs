//! Opens a run folder, or joins the shards in a folder into one run: [`open_any_run`], [`open_choice_run`].

use std::fs;
use std::path::{Path, PathBuf};

use super::ShardedRun;
use super::coverage::{MissingShards, no_shard_error};
use crate::missing_thumbnails::MissingThumbnails;
use crate::run_texts::RunTexts;
use crate::stored::{AnyRun, ExperimentKind, RunLayout, StoredRun, open_questions_error, read_run_manifest};
use crate::zipped_run::open_zip;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::{ChoiceDetail, Trials};
use darkqa_data::ready_made::is_zip_file;
use darkqa_score::answers::record::Detail;

/// Opens the run in a folder or a ZIP file. If the folder itself has no run, joins all shards in it, with a warning
/// about missing ones.
///
/// # Errors
/// If the folder or the file has none, or the shards belong to different runs.
pub fn open_any_run(folder: &Path) -> Result<AnyRun> {
    if is_zip_file(folder) {
        return open_zip(folder);
    }
    let Some(parts) = shard_folders_in(folder)? else {
        return AnyRun::open(folder);
    };
    Ok(match common_kind(&parts)? {
        ExperimentKind::Choice => AnyRun::Choice(run_from_shards(folder, &parts)?),
        ExperimentKind::Open => AnyRun::Open(run_from_shards(folder, &parts)?),
    })
}

/// Opens the run of questions with choices in a folder, like [`open_any_run`].
///
/// # Errors
/// Also if the questions are open. That error tells the user what to do `instead`.
pub fn open_choice_run(folder: &Path, instead: &str) -> Result<StoredRun<ChoiceDetail>> {
    if is_zip_file(folder) {
        return match open_zip(folder)? {
            AnyRun::Choice(run) => Ok(run),
            AnyRun::Open(_) => Err(open_questions_error(folder, instead)),
        };
    }
    let Some(parts) = shard_folders_in(folder)? else {
        return StoredRun::open_choices(folder, instead);
    };
    match common_kind(&parts)? {
        ExperimentKind::Choice => run_from_shards(folder, &parts),
        ExperimentKind::Open => Err(open_questions_error(folder, instead)),
    }
}

/// The run folders in a folder, if any of them is a shard; `None` if the folder is a run itself or has no shards.
///
/// # Errors
/// If the manifest of one cannot be read.
fn shard_folders_in(folder: &Path) -> Result<Option<Vec<PathBuf>>> {
    let is_folder = fs::metadata(folder).is_ok_and(|entry| entry.is_dir());
    if !is_folder || darkqa_store::schema(folder)?.is_some() {
        return Ok(None);
    }
    let runs = run_folders_in(folder)?;
    for run in &runs {
        if read_run_manifest(run)?.shard.is_some() {
            return Ok(Some(runs));
        }
    }
    Ok(None)
}

/// Joins these shards, which are in `folder`, into a run for reports.
fn run_from_shards<D: Detail>(folder: &Path, parts: &[PathBuf]) -> Result<StoredRun<D>> {
    let parts = ShardedRun::<D>::read(parts, MissingShards::Accept)?;
    let folders = parts.folders();
    let texts: Result<Vec<RunTexts<D>>> = folders.iter().map(|part| RunTexts::open(part)).collect();
    let wanted = MissingThumbnails::new(parts.questions.frames(), Vec::new());
    Ok(StoredRun {
        folder: folder.to_owned(),
        layout: RunLayout::Shards,
        texts: RunTexts::Shards(texts?),
        thumbnails: darkqa_store::missing_thumbnails(&[], &folders, |frame| wanted.wants(frame)),
        fidelity: darkqa_store::missing_fidelity(&[], &folders, |_| true),
        left_out: Trials::default(),
        manifest: parts.manifest,
        trials: parts.trials,
        questions: parts.questions.into_questions(),
    })
}

/// The run folders directly in a folder, sorted by path.
///
/// # Errors
/// If the folder or a manifest cannot be read.
pub fn run_folders_in(folder: &Path) -> Result<Vec<PathBuf>> {
    let entries = fs::read_dir(folder).map_err(|e| Error::file(folder, "read", e))?;
    let mut runs = Vec::new();
    for entry in entries {
        let path = entry.map_err(|e| Error::file(folder, "read", e))?.path();
        if darkqa_store::schema(&path)?.is_some() {
            runs.push(path);
        }
    }
    runs.sort();
    Ok(runs)
}

/// The kind of questions that all these runs have.
///
/// # Errors
/// If there is no run, or the runs are of different kinds.
pub fn common_kind(folders: &[PathBuf]) -> Result<ExperimentKind> {
    let kinds: Vec<ExperimentKind> =
        folders.iter().map(|folder| ExperimentKind::read(folder)).collect::<Result<_>>()?;
    let first = *kinds.first().ok_or_else(no_shard_error)?;
    if let Some(other) = kinds.iter().position(|kind| *kind != first) {
        let problem = format!(
            "runs of questions with choices and of open questions cannot be merged: {} is of the other kind",
            folders[0].display()
        );
        let path = folders[other].clone();
        return Err(Error::Run { path, problem });
    }
    Ok(first)
}
