//! The run in a folder, or that of the parts in it: [`any_run`], [`choice_run`], [`runs_in`].

use std::fs;
use std::path::{Path, PathBuf};

use super::joined::RunParts;
use super::missing::MissingParts;
use super::part::no_part;
use crate::error::{Error, Result};
use crate::images::notes::thumbnail::MissingThumbnails;
use crate::runs::run_texts::RunTexts;
use crate::runs::stored::{AnyRun, ExperimentKind, RunLayout, StoredRun, manifest, open_questions};
use crate::store;
use crate::types::{ChoiceDetail, Trials};
use darkqa_score::answers::record::Detail;

/// The run in a folder; that of all parts in it if the folder itself holds none. What is in no part is said.
///
/// # Errors
/// If the folder holds neither, or the parts are not of one run.
pub(crate) fn any_run(folder: &Path) -> Result<AnyRun> {
    let Some(parts) = parts_in(folder)? else {
        return AnyRun::open(folder);
    };
    Ok(match one_kind(&parts)? {
        ExperimentKind::Choice => AnyRun::Choice(run_from_parts(folder, &parts)?),
        ExperimentKind::Open => AnyRun::Open(run_from_parts(folder, &parts)?),
    })
}

/// The run of questions with choices in a folder, as [`any_run`].
///
/// # Errors
/// Also if the questions are open. That error tells the user what to do `instead`.
pub(crate) fn choice_run(folder: &Path, instead: &str) -> Result<StoredRun<ChoiceDetail>> {
    let Some(parts) = parts_in(folder)? else {
        return StoredRun::open_choices(folder, instead);
    };
    match one_kind(&parts)? {
        ExperimentKind::Choice => run_from_parts(folder, &parts),
        ExperimentKind::Open => Err(open_questions(folder, instead)),
    }
}

/// The run folders in a folder that holds no run itself, if any of them is a part.
///
/// # Errors
/// If the manifest of one cannot be read.
fn parts_in(folder: &Path) -> Result<Option<Vec<PathBuf>>> {
    let is_folder = fs::metadata(folder).is_ok_and(|entry| entry.is_dir());
    if !is_folder || store::schema(folder)?.is_some() {
        return Ok(None);
    }
    let inside = runs_in(folder)?;
    for run in &inside {
        if manifest(run)?.shard.is_some() {
            return Ok(Some(inside));
        }
    }
    Ok(None)
}

/// The run of these parts, which are in `folder`, as reports need it.
fn run_from_parts<D: Detail>(folder: &Path, parts: &[PathBuf]) -> Result<StoredRun<D>> {
    let parts = RunParts::<D>::read(parts, MissingParts::Accepted)?;
    let folders = parts.folders();
    let texts: Result<Vec<RunTexts<D>>> = folders.iter().map(|part| RunTexts::open(part)).collect();
    let wanted = MissingThumbnails::new(parts.questions.frames(), Vec::new());
    Ok(StoredRun {
        folder: folder.to_owned(),
        layout: RunLayout::Parts,
        texts: RunTexts::Parts(texts?),
        thumbnails: store::missing_thumbnails(&[], &folders, |frame| wanted.wants(frame)),
        fidelity: store::more_fidelity(&[], &folders, |_| true),
        left_out: Trials::default(),
        manifest: parts.manifest,
        trials: parts.trials,
        questions: parts.questions.into_questions(),
    })
}

/// The run folders directly in a folder, in order.
///
/// # Errors
/// If the folder or a manifest cannot be read.
pub(crate) fn runs_in(folder: &Path) -> Result<Vec<PathBuf>> {
    let entries = fs::read_dir(folder).map_err(|e| Error::file(folder, "read", e))?;
    let mut inside = Vec::new();
    for entry in entries {
        let entry = entry.map_err(|e| Error::file(folder, "read", e))?.path();
        if store::schema(&entry)?.is_some() {
            inside.push(entry);
        }
    }
    inside.sort();
    Ok(inside)
}

/// The kind of questions in these runs.
///
/// # Errors
/// If there is no run, or they are not all of one kind.
pub(crate) fn one_kind(folders: &[PathBuf]) -> Result<ExperimentKind> {
    let kinds: Result<Vec<ExperimentKind>> = folders
        .iter()
        .map(|folder| ExperimentKind::read(folder))
        .collect();
    let kinds = kinds?;
    let first = *kinds.first().ok_or_else(no_part)?;
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
