//! Changes to the list of models by flags: `--set` ([`apply_set`]) and `--only` ([`retain_only`]).

use super::entry::{Entry, check_keys};
use super::file::{Keys, Located};
use crate::error::{Error, Result};

/// Applies one `--set NAME.KEY=VALUE`.
///
/// # Errors
/// If no model has the name, or the key or its value is invalid.
pub(super) fn apply_set(entries: &mut [Entry], text: &str) -> Result<()> {
    let (place, value) =
        text.split_once('=').ok_or_else(|| Error::usage("--set", "NAME.KEY=VALUE expected, as GPT-4o.rpm=60"))?;
    // The longest matching name, because a name may contain a dot and begin with another name.
    let longest_match = entries
        .iter()
        .filter(|entry| place.strip_prefix(&*entry.name).is_some_and(|rest| rest.starts_with('.')))
        .map(|entry| entry.name.clone())
        .max_by_key(String::len);
    let Some(name) = longest_match else {
        let names: Vec<&str> = entries.iter().map(|entry| &*entry.name).collect();
        let problem = format!("{place}: no model of this name; the models are {}", names.join(", "));
        return Err(Error::usage("--set", problem));
    };
    // A value that is not TOML is taken as a string.
    let mut parsed: toml::Table = format!("value = {value}").parse().unwrap_or_default();
    let value = parsed.remove("value").unwrap_or_else(|| toml::Value::String(value.to_owned()));
    let key = place[name.len() + 1..].replace('_', "-");
    if matches!(&*key, "name" | "id") {
        return Err(Error::usage("--set", format_args!("{key} identifies the model, and cannot be set")));
    }
    let located = Located { value, place: "--set".to_owned() };
    let keys = Keys::from([(key, located)]);
    check_keys(&keys, false)?;
    for entry in entries.iter_mut().filter(|entry| entry.name == name) {
        if keys.contains_key("endpoints") {
            // The API key belongs to the earlier address.
            entry.asking.forget_key();
        }
        entry.apply(&keys)?;
    }
    Ok(())
}

/// Keeps only the models that `--only` names.
///
/// # Errors
/// If no model has one of the names.
pub(super) fn retain_only(entries: &mut Vec<Entry>, only: &[String]) -> Result<()> {
    if only.is_empty() {
        return Ok(());
    }
    for name in only {
        if !entries.iter().any(|entry| entry.name == *name) {
            let names: Vec<&str> = entries.iter().map(|entry| &*entry.name).collect();
            let problem = format_args!("{name}: no model of this name; the models are {}", names.join(", "));
            return Err(Error::usage("--only", problem));
        }
    }
    entries.retain(|entry| only.contains(&entry.name));
    Ok(())
}
