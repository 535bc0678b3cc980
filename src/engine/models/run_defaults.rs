//! Keys of `[defaults]` that are no model's, because they hold for a whole run: [`run_defaults`].

use std::path::Path;

use toml::Value;

use super::entry::is_of_the_run;
use super::file::ModelsFile;
use crate::error::Result;

/// A flag of the run that a file of models sets.
#[derive(Debug)]
pub(crate) struct RunDefault {
    /// The flag, by its long name.
    pub(crate) flag: String,
    pub(crate) value: Value,
    /// The file and the line.
    pub(crate) place: String,
}

/// The flags of the run that the `[defaults]` of a file of models set.
///
/// # Errors
/// If the file cannot be read as a file of models.
pub(crate) fn run_defaults(path: &Path) -> Result<Vec<RunDefault>> {
    let file = ModelsFile::read(path)?;
    let defaults = file
        .defaults
        .into_iter()
        .filter(|(key, _)| is_of_the_run(key))
        .map(|(flag, located)| RunDefault {
            flag,
            value: located.value,
            place: located.place,
        });
    Ok(defaults.collect())
}
