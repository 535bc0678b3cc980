//! Changes to a list of models by a call: `--set` ([`set`]) and `--only` ([`select`]).

use super::entry::{Entry, check_keys};
use super::file::{Keys, Located};
use crate::error::{Error, Result};

/// Carries out one `--set NAME.KEY=VALUE`.
///
/// # Errors
/// If there is no such model, or the key or its value cannot be used.
pub(super) fn set(entries: &mut [Entry], text: &str) -> Result<()> {
    let wrong = |problem: String| Error::usage("--set", problem);
    let (place, value) = text
        .split_once('=')
        .ok_or_else(|| wrong("NAME.KEY=VALUE expected, as GPT-4o.rpm=60".to_owned()))?;
    let of_name = |entry: &Entry| {
        place
            .strip_prefix(&*entry.name)?
            .strip_prefix('.')
            .map(str::to_owned)
    };
    // The longest name first: a name may begin as another one does.
    let longest = entries
        .iter()
        .filter(|entry| of_name(entry).is_some())
        .map(|entry| entry.name.clone())
        .max_by_key(String::len);
    let Some(name) = longest else {
        let names: Vec<&str> = entries.iter().map(|entry| &*entry.name).collect();
        let problem = format!(
            "{place}: no model of this name; the models are {}",
            names.join(", ")
        );
        return Err(wrong(problem));
    };
    // What is no value of TOML is a text.
    let mut parsed: toml::Table = format!("value = {value}").parse().unwrap_or_default();
    let as_text = || toml::Value::String(value.to_owned());
    let value = parsed.remove("value").unwrap_or_else(as_text);
    let key = place[name.len() + 1..].replace('_', "-");
    if matches!(&*key, "name" | "id") {
        return Err(wrong(format!(
            "{key} identifies the model, and cannot be set"
        )));
    }
    let located = Located {
        value,
        place: "--set".to_owned(),
    };
    let keys = Keys::from([(key, located)]);
    check_keys(&keys, false)?;
    let mut named = entries.iter_mut().filter(|entry| entry.name == name);
    named.try_for_each(|entry| {
        if keys.contains_key("endpoints") {
            // A key that belongs to another address is not sent to this one.
            entry.asking.forget_key();
        }
        entry.apply(&keys)
    })
}

/// Keeps only the models that `--only` names.
///
/// # Errors
/// If there is no model of one of these names.
pub(super) fn select(entries: &mut Vec<Entry>, only: &[String]) -> Result<()> {
    if only.is_empty() {
        return Ok(());
    }
    for name in only {
        if !entries.iter().any(|entry| entry.name == *name) {
            let names: Vec<&str> = entries.iter().map(|entry| &*entry.name).collect();
            let problem = format_args!(
                "{name}: no model of this name; the models are {}",
                names.join(", ")
            );
            return Err(Error::usage("--only", problem));
        }
    }
    entries.retain(|entry| only.contains(&entry.name));
    Ok(())
}
