//! The layer of the file of models: the flags of the run that its `[defaults]` set ([`values`]).

use std::collections::BTreeMap;
use std::path::PathBuf;

use clap::{ArgMatches, Command};

use super::{LayeredValue, key, settable_flags, text_of};
use crate::error::{Error, Result};
use crate::job::models::{RunDefault, run_defaults};

/// The flag for the file of models.
const MODELS: &str = "models";

/// The flags of the run that the `[defaults]` of the file of models set, which the call or a lower layer names.
///
/// # Errors
/// If the command has no such flag, or the value has a form that no flag has.
pub(super) fn values(
    own: &ArgMatches,
    command: &Command,
    layers: [&BTreeMap<String, LayeredValue>; 2],
) -> Result<BTreeMap<String, LayeredValue>> {
    if !settable_flags(command).any(|arg| arg.get_id() == MODELS) {
        return Ok(BTreeMap::new());
    }
    let typed = own.get_one::<PathBuf>(MODELS).cloned();
    let layered = layers.into_iter().find_map(|layer| {
        let value = layer.get(MODELS)?;
        value.values.first().map(PathBuf::from)
    });
    let Some(path) = typed.or(layered) else {
        return Ok(BTreeMap::new());
    };
    // A file that cannot be used is an error where its models are read.
    let defaults = run_defaults(&path).unwrap_or_default();
    let values = defaults.into_iter().map(|default| {
        let RunDefault { flag, value, place } = default;
        if !settable_flags(command).any(|arg| key(arg) == flag) {
            let problem = format_args!("{flag}: this command has no --{flag}");
            return Err(Error::usage(place, problem));
        }
        let text = text_of(&value).ok_or_else(|| {
            let problem = format_args!("{flag}: a text, a number or a switch expected");
            Error::usage(place.clone(), problem)
        })?;
        let origin = place;
        let values = vec![text];
        Ok((flag, LayeredValue { origin, values }))
    });
    values.collect()
}
