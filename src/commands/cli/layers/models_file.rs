//! The flags of the run that the `[defaults]` of a file of models set: [`values`].

use std::ffi::OsString;
use std::path::Path;

use super::value_text::text_of;
use crate::engine::models::{RunDefault, run_defaults};
use crate::error::{Error, Result};

/// The flags of the run that a file of models sets, each with its place in the file and its text. `flags` are those of
/// the command.
///
/// # Errors
/// If the command has no such flag, or the value has a form that no flag has.
pub(super) fn values(path: &Path, flags: &[String]) -> Result<Vec<(String, String, OsString)>> {
    // An unusable file is reported later, where its models are read.
    let defaults = run_defaults(path).unwrap_or_default();
    defaults
        .into_iter()
        .map(|default| {
            let RunDefault { flag, value, place } = default;
            if !flags.contains(&flag) {
                let problem = format_args!("{flag}: this command has no --{flag}");
                return Err(Error::usage(place, problem));
            }
            let Some(text) = text_of(&value) else {
                let problem = format_args!("{flag}: a text, a number or a switch expected");
                return Err(Error::usage(place, problem));
            };
            Ok((flag, place, text))
        })
        .collect()
}
