//! The run folders in a folder, and the kind of their questions: [`runs_in`], [`one_kind`].

use std::fs;
use std::path::{Path, PathBuf};

use super::part::no_part;
use crate::error::{Error, Result};
use crate::runs::stored::ExperimentKind;
use crate::store;

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
