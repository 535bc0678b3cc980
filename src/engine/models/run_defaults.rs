//! Keys in the `[defaults]` of a models file that are settings of the whole run: [`run_defaults`].

use std::path::Path;

use toml::Value;

use super::entry::is_run_key;
use super::file::ModelsFile;
use crate::error::Result;

/// A flag of the run that a models file sets.
#[derive(Debug)]
pub(crate) struct RunDefault {
    /// Long name of the flag.
    pub(crate) flag: String,
    pub(crate) value: Value,
    /// File and line.
    pub(crate) place: String,
}

/// Reads the flags of the run that the `[defaults]` of a models file set.
///
/// # Errors
/// See [`ModelsFile::read`].
pub(crate) fn run_defaults(path: &Path) -> Result<Vec<RunDefault>> {
    let file = ModelsFile::read(path)?;
    Ok(file
        .defaults
        .into_iter()
        .filter(|(key, _)| is_run_key(key))
        .map(|(flag, located)| RunDefault { flag, value: located.value, place: located.place })
        .collect())
}
