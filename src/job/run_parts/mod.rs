//! The parts of a run, read as one run: [`RunParts`]. `merge` writes that run, and `report` reports on it as it is.

mod coverage;
mod joined_manifest;
mod missing;
mod part;
mod questions;
mod stored_parts;
mod trials;

use std::fs;
use std::path::{Path, PathBuf};

use self::coverage::Coverage;
pub(super) use self::missing::MissingParts;
use self::part::StoredPart;
pub(super) use self::questions::PartQuestions;
pub(crate) use self::stored_parts::{any_run, choice_run};
use self::trials::each_once;
use super::placed_trials::read_part;
use super::stored::{ExperimentKind, sort};
use crate::error::{Error, Result};
use crate::store;
use crate::types::manifest::{Counts, RunManifest, Status};
use crate::types::{Detail, Trials};

/// The parts of one run, of any divisions of it.
pub(super) struct RunParts<D: Detail> {
    parts: Vec<StoredPart>,
    pub(super) questions: PartQuestions,
    /// Each trial once, in the order of the questions, conditions and models. The file of a text is the number of its part.
    pub(super) trials: Trials<D>,
    /// The manifest of the run that the parts are together.
    pub(super) manifest: RunManifest,
}

impl<D: Detail> RunParts<D> {
    /// Reads the parts in these folders.
    ///
    /// # Errors
    /// If a folder holds no part, one is of another run, an image of a trial differs in two, or sources are in no part and that is refused.
    pub(super) fn read(folders: &[PathBuf], missing: MissingParts) -> Result<Self> {
        let parts: Result<Vec<StoredPart>> = folders
            .iter()
            .map(|folder| StoredPart::open(folder))
            .collect();
        let mut parts = parts?;
        parts.sort_by_key(|part| (part.shard.count(), part.shard));
        joined_manifest::check_same_run(&parts)?;
        let places = parts.iter();
        let places = places.map(|part| (part.shard, &*part.folder, &part.manifest));
        let coverage = Coverage::of(places)?;
        let plan = missing::plan(&parts, &coverage)?;
        let is_missing = missing::check(&parts, &coverage, plan.as_ref(), missing)?;
        missing::warn_unfinished(&parts, plan.as_ref());
        let mut manifest = joined_manifest::joined_manifest(&parts, &coverage)?;
        let folders: Vec<&Path> = parts.iter().map(|part| &*part.folder).collect();
        let questions = PartQuestions::read(&folders)?;
        let mut trials = Trials::default();
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
        Ok(Self {
            parts,
            questions,
            trials,
            manifest,
        })
    }

    /// The folders of the parts, by their numbers.
    pub(super) fn folders(&self) -> Vec<&Path> {
        self.parts.iter().map(|part| &*part.folder).collect()
    }

    /// The manifest of the run, of which nothing else is needed any more.
    pub(super) fn into_manifest(self) -> RunManifest {
        self.manifest
    }

    /// The folder and the manifest of each part, by their numbers.
    pub(super) fn manifests(&self) -> Vec<(&Path, &RunManifest)> {
        let parts = self.parts.iter();
        parts.map(|part| (&*part.folder, &part.manifest)).collect()
    }
}

/// The run folders directly in a folder, in order.
///
/// # Errors
/// If the folder or a manifest cannot be read.
pub(super) fn runs_in(folder: &Path) -> Result<Vec<PathBuf>> {
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
pub(super) fn one_kind(folders: &[PathBuf]) -> Result<ExperimentKind> {
    let kinds: Result<Vec<ExperimentKind>> = folders
        .iter()
        .map(|folder| ExperimentKind::of(folder))
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

/// The error about a command that names no part.
fn no_part() -> Error {
    Error::usage("RUN", "no shard is named")
}
