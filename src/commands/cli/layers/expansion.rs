//! Replaces keyed flags by the hidden flags that their keys set: [`Expansion`].
//!
//! The value of a flag that was not typed: [`LayeredValue`].
//!
//! A value of TOML as a word of the command line: [`text_of`].

use std::collections::BTreeMap;
use std::ffi::OsString;

use clap::{Arg, ArgAction, Command};
use toml::Value;

use crate::commands::cli::keyed::{name_of, with_value};
use darkqa_base::error::{Error, Result};
use darkqa_base::types::flags::{KEYED_FLAGS, KeyedFlag, KeyedSetting, flag_spelling};

/// The keyed flags of a command, and the hidden flags that their keys set.
pub(super) struct Expansion<'a>(pub(super) &'a Command);

impl Expansion<'_> {
    fn flag(&self, name: &str) -> Option<&Arg> {
        self.0.get_arguments().find(|arg| name_of(arg) == name)
    }

    /// The keyed flag with this name, if the command has it.
    fn keyed(&self, name: &str) -> Option<&'static KeyedFlag> {
        let keyed = KeyedFlag::from_name(name)?;
        let is_used = keyed.keys.iter().any(|(key, flag)| !key.is_empty() && self.flag(flag).is_some());
        is_used.then_some(keyed)
    }

    /// The settings in the value of a keyed flag. A key without a value gets its implied value.
    fn settings(&self, keyed: &KeyedFlag, text: &str) -> Result<Vec<KeyedSetting>, String> {
        let mut settings = keyed.settings(text, |flag| self.flag(flag).is_some())?;
        for setting in settings.iter_mut().filter(|one| one.value.is_none()) {
            let arg = self.flag(setting.flag);
            let possible = arg.map(Arg::get_possible_values).unwrap_or_default();
            setting.value = match (&possible[..], keyed.alone) {
                (_, Some(alone)) => Some(alone.to_owned()),
                _ if arg.is_some_and(|arg| !arg.get_action().takes_values()) => Some("true".to_owned()),
                ([only], _) => Some(only.get_name().to_owned()),
                _ => {
                    let spelling = flag_spelling(setting.flag);
                    let key = spelling.rsplit(' ').next().unwrap_or_default();
                    let form = arg.map(|arg| with_value(key, arg)).unwrap_or_default();
                    return Err(format!("{key} has no value; write {form}"));
                }
            };
        }
        Ok(settings)
    }

    /// The typed words, with each keyed flag replaced by the hidden flags that its keys set.
    ///
    /// # Errors
    /// If a key is unknown or has no value.
    pub(super) fn words(&self, words: Vec<OsString>) -> Result<Vec<OsString>> {
        let mut expanded = Vec::with_capacity(words.len());
        let mut words = words.into_iter();
        while let Some(word) = words.next() {
            if word == "--" {
                expanded.push(word);
                break;
            }
            let text = word.to_str().and_then(|word| word.strip_prefix("--"));
            let (name, value) = match text.map(|text| text.split_once('=').unwrap_or((text, ""))) {
                Some((name, value)) => (name.to_owned(), value.to_owned()),
                None => (String::new(), String::new()),
            };
            let Some(keyed) = self.keyed(&name) else {
                expanded.push(word);
                continue;
            };
            let is_joined = text.is_some_and(|text| text.contains('='));
            let next = if is_joined { None } else { words.next() };
            let value = match next {
                None if is_joined => value,
                Some(next) => match next.into_string() {
                    Ok(value) => value,
                    // Only a path may be other than Unicode, and a path has no keys.
                    Err(next) => {
                        expanded.extend([word, next]);
                        continue;
                    }
                },
                None => {
                    expanded.push(word);
                    break;
                }
            };
            let settings =
                self.settings(keyed, &value).map_err(|problem| Error::usage(format!("--{name}"), problem))?;
            for setting in settings {
                expanded.extend(self.hidden_flag(&setting, &name)?);
            }
        }
        expanded.extend(words);
        Ok(expanded)
    }

    /// The word that sets the hidden flag of a setting; `None` for a switch that is turned off.
    fn hidden_flag(&self, setting: &KeyedSetting, name: &str) -> Result<Option<OsString>> {
        let KeyedSetting { flag, value } = setting;
        let value = value.as_deref().unwrap_or_default();
        let takes_values = self.flag(flag).is_some_and(|arg| arg.get_action().takes_values());
        match value {
            _ if takes_values => Ok(Some(format!("--{flag}={value}").into())),
            "true" | "yes" | "1" => Ok(Some(format!("--{flag}").into())),
            "false" | "no" | "0" => Ok(None),
            _ => {
                let key = flag_spelling(flag);
                let key = key.rsplit(' ').next().unwrap_or_default();
                let problem = format!("{key} takes true or false, not {value:?}");
                Err(Error::usage(format!("--{name}"), problem))
            }
        }
    }

    /// The values of a layer, with each keyed flag replaced by the hidden flags that its keys set.
    ///
    /// # Errors
    /// If a key is unknown or has no value, or the layer sets it twice.
    pub(super) fn layer(&self, mut layer: BTreeMap<String, LayeredValue>) -> Result<BTreeMap<String, LayeredValue>> {
        for keyed in KEYED_FLAGS.iter().filter_map(|keyed| self.keyed(keyed.name)) {
            let Some(LayeredValue { origin, values }) = layer.remove(keyed.name) else {
                continue;
            };
            for value in values {
                let text = match value.into_string() {
                    Ok(text) => text,
                    Err(value) => {
                        let (origin, values) = (origin.clone(), vec![value]);
                        layer.insert(keyed.name.to_owned(), LayeredValue { origin, values });
                        continue;
                    }
                };
                let settings = self.settings(keyed, &text);
                for setting in settings.map_err(|e| Error::usage(&origin, e))? {
                    self.insert(&mut layer, setting, &origin)?;
                }
            }
        }
        Ok(layer)
    }

    /// Adds a setting to a layer.
    fn insert(&self, layer: &mut BTreeMap<String, LayeredValue>, setting: KeyedSetting, origin: &str) -> Result<()> {
        let value = OsString::from(setting.value.unwrap_or_default());
        let arg = self.flag(setting.flag);
        let repeats = arg.is_some_and(|arg| matches!(arg.get_action(), ArgAction::Append));
        match layer.get_mut(setting.flag) {
            Some(known) if repeats => known.values.push(value),
            Some(known) => {
                let problem = format!("{} is set twice, by {} too", flag_spelling(setting.flag), known.origin);
                return Err(Error::usage(origin, problem));
            }
            None => {
                let (origin, values) = (origin.to_owned(), vec![value]);
                layer.insert(setting.flag.to_owned(), LayeredValue { origin, values });
            }
        }
        Ok(())
    }
}

/// The value of one flag from the environment or a file.
pub(super) struct LayeredValue {
    /// The source of the value for messages: a variable, or a file and a key in it.
    pub(super) origin: String,
    pub(super) values: Vec<OsString>,
}

/// The text of a value; `None` if it is not a text, a number or a switch.
pub(super) fn text_of(value: &Value) -> Option<OsString> {
    match value {
        Value::String(text) => Some(text.into()),
        Value::Integer(_) | Value::Float(_) | Value::Boolean(_) => Some(value.to_string().into()),
        _ => None,
    }
}
