//! One model of a run before it is opened, merged from the flags and the tables of a models file: [`ModelEntry`].
//!
//! Keys in the `[defaults]` of a models file that are settings of the whole run: [`run_defaults`].

use std::collections::BTreeSet;
use std::num::NonZeroUsize;
use std::path::Path;

use serde_json::json;
use toml::Value;

use super::asking::AskingArgs;
use super::file::{Keys, Located, ModelsFile};
use super::name::ModelName;
use darkqa_ask::Price;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::View;
use darkqa_base::types::text::{did_you_mean, nearest};

/// Keys of a model that do not correspond to a flag, or have another form than the flag.
const MODEL_KEYS: [&str; 10] =
    ["name", "id", "deployment", "group", "view", "price", "limit", "headers", "body", "omit"];

/// Keys with another name than their flag, each with the flag.
const RENAMED_KEYS: [(&str, &str); 5] = [
    ("endpoints", "base-url"),
    ("key-env", "api-key-env"),
    ("key-file", "api-key-file"),
    ("body", "extra-body"),
    ("omit", "omit-field"),
];

/// Keys that cannot be set for all models together.
const NOT_IN_DEFAULTS: [&str; 4] = ["name", "id", "deployment", "endpoints"];

/// Keys of settings that apply to the whole run, because all models are shown the same images at the same position in
/// the prompt.
const RUN_KEYS: [&str; 3] = ["image", "max-side", "image-first"];

/// Names from other tools, each with the key that users probably mean.
const FOREIGN_KEYS: [(&str, &str); 6] = [
    ("model", "id"),
    ("label", "name"),
    ("base-url", "endpoints"),
    ("api-base", "endpoints"),
    ("api-key", "key-env"),
    ("extra-body", "body"),
];

/// One model of a run, not opened yet.
#[derive(Debug, Clone)]
pub(super) struct ModelEntry {
    /// Name in tables.
    pub(super) name: String,
    pub(super) id: ModelName,
    /// The views of the model; both if it is asked with and without images.
    pub(super) views: Vec<View>,
    pub(super) deployment: Option<String>,
    /// Heading in tables under which the model is listed.
    pub(super) group: Option<String>,
    pub(super) asking: AskingArgs,
    /// The model's own price; `None` for the price in the table.
    pub(super) price: Option<Price>,
    /// Number of questions that the model is asked; `None` for all.
    pub(super) limit: Option<NonZeroUsize>,
    /// File and line of the model's table; `None` for a model that a flag names.
    pub(super) place: Option<String>,
}

impl ModelEntry {
    /// A model that a flag names, with the settings of the flags.
    pub(super) fn from_flag(id: ModelName, view: View, asking: AskingArgs) -> Self {
        Self {
            name: match &id {
                ModelName::Script(path) => format!("script:{}", path.display()),
                id => id.label(),
            },
            id,
            views: vec![view],
            deployment: None,
            group: None,
            asking,
            price: None,
            limit: None,
            place: None,
        }
    }

    /// A model of a models file: the settings of the flags, overridden by each layer in order. `keys` is the model's
    /// own table.
    ///
    /// # Errors
    /// If a key is unknown or has an invalid value; the error names the line.
    pub(super) fn from_file(keys: &Keys, layers: &[&Keys], view: View, asking: AskingArgs) -> Result<Self> {
        let place = keys.values().map(|located| located.place.clone()).min();
        let place = place.unwrap_or_default();
        let id = keys.get("id").ok_or_else(|| {
            Error::usage(&place, "a model without id: what the endpoint calls it, or random, observer, script:FILE")
        })?;
        let name: ModelName = id_text(id, "id")?.parse().map_err(|problem| id.error(problem))?;
        let mut entry = Self { place: Some(id.place.clone()), ..Self::from_flag(name, view, asking) };
        if keys.contains_key("endpoints") {
            // An API key from the flags belongs to the address of the flags. One from [defaults] is for all models of
            // the file.
            entry.asking.forget_key();
        }
        for layer in layers {
            entry.apply(layer)?;
        }
        Ok(entry)
    }

    /// Sets the values of the keys of a layer.
    pub(super) fn apply(&mut self, keys: &Keys) -> Result<()> {
        for (key, located) in keys {
            match &**key {
                "name" => id_text(located, key)?.clone_into(&mut self.name),
                "deployment" => self.deployment = Some(id_text(located, key)?.to_owned()),
                "group" => self.group = Some(id_text(located, key)?.to_owned()),
                "view" => self.views = views(located)?,
                "price" => self.price = Some(price(located)?),
                "limit" => self.limit = Some(limit(located)?),
                "id" => {}
                key if is_run_key(key) => {}
                key => {
                    let words = words(key, located)?;
                    let origin = &mut self.asking.parameters.origin;
                    match key {
                        "temperature" => origin.default_temperature = false,
                        "seed" => origin.default_seed = false,
                        _ => {}
                    }
                    if key == "headers" {
                        // A table of headers replaces that of an earlier layer, even if it is empty.
                        self.asking.forget_headers();
                    }
                    self.asking.update(&words).map_err(|problem| located.error(format_args!("{key}: {problem}")))?;
                }
            }
        }
        Ok(())
    }
}

/// Refuses unknown keys, and keys that do not belong in this table.
///
/// # Errors
/// [`Error::Usage`] with the line of the key, and the most similar known key.
pub(super) fn check_keys(keys: &Keys, is_defaults: bool) -> Result<()> {
    let known = known_keys();
    for (key, located) in keys {
        if is_defaults && NOT_IN_DEFAULTS.contains(&&**key) {
            return Err(located.error(format_args!("{key} belongs to one model: it cannot be in [defaults]")));
        }
        if is_run_key(key) {
            if is_defaults {
                continue;
            }
            let problem = format_args!(
                "{key} applies to all models, because each image is made once: set it in [defaults], or use --{key}"
            );
            return Err(located.error(problem));
        }
        if !known.contains(key) {
            let meant = FOREIGN_KEYS
                .iter()
                .find(|(foreign, _)| foreign == key)
                .map(|(_, key)| *key)
                .or_else(|| nearest(key, &known));
            let hint = did_you_mean(meant);
            return Err(located.error(format_args!("there is no key {key}{hint}")));
        }
    }
    Ok(())
}

/// True if a key is a setting of the run, and not of a model.
fn is_run_key(key: &str) -> bool {
    RUN_KEYS.contains(&key)
}

/// All keys of a model.
fn known_keys() -> BTreeSet<String> {
    AskingArgs::flags()
        .into_iter()
        .filter(|flag| !matches!(&**flag, "header" | "header-env"))
        .map(|flag| match RENAMED_KEYS.iter().find(|(_, name)| *name == flag) {
            Some((key, _)) => (*key).to_owned(),
            None => flag,
        })
        .chain(MODEL_KEYS.map(str::to_owned))
        .collect()
}

/// The flag that corresponds to a key; `None` without one.
pub(super) fn flag_of(key: &str) -> Option<&str> {
    match RENAMED_KEYS.iter().find(|(name, _)| *name == key) {
        Some((_, flag)) => Some(flag),
        None if key == "headers" => Some("header"),
        None => (!MODEL_KEYS.contains(&key)).then_some(key),
    }
}

/// Command-line words that set a key to its value.
fn words(key: &str, located: &Located) -> Result<Vec<String>> {
    let flag = flag_of(key).unwrap_or(key);
    let wrong = |expected: &str| Err(located.error(format_args!("{key}: {expected} expected")));
    match (key, &located.value) {
        ("headers", Value::Table(headers)) => {
            let words: Result<Vec<String>, ()> = headers
                .iter()
                .map(|(name, value)| match value {
                    Value::String(text) => Ok(format!("--header={name}: {text}")),
                    Value::Table(table) => match (table.len(), table.get("env")) {
                        (1, Some(Value::String(variable))) => Ok(format!("--header-env={name}={variable}")),
                        _ => Err(()),
                    },
                    _ => Err(()),
                })
                .collect();
            words.or_else(|()| wrong("{ NAME = \"value\", NAME = { env = \"VARIABLE\" } }"))
        }
        ("headers", _) => wrong("a table of headers"),
        ("body", Value::Table(_)) => {
            let json = serde_json::to_string(&json!(located.value));
            let json = json.map_err(|e| located.error(format_args!("body: {e}")))?;
            Ok(vec![format!("--extra-body={json}")])
        }
        (_, Value::Array(items)) => {
            let words: Option<Vec<String>> = items.iter().map(plain_text).collect();
            match words {
                Some(words) => Ok(words.iter().map(|word| format!("--{flag}={word}")).collect()),
                None => wrong("a list of texts"),
            }
        }
        (_, value) => match plain_text(value) {
            Some(word) => Ok(vec![format!("--{flag}={word}")]),
            None => wrong("a text, a number or true or false"),
        },
    }
}

fn plain_text(value: &Value) -> Option<String> {
    match value {
        Value::String(text) => Some(text.clone()),
        Value::Integer(_) | Value::Float(_) | Value::Boolean(_) => Some(value.to_string()),
        _ => None,
    }
}

fn id_text<'a>(located: &'a Located, key: &str) -> Result<&'a str> {
    match &located.value {
        Value::String(text) if !text.trim().is_empty() => Ok(text.trim()),
        _ => Err(located.error(format_args!("{key}: a text expected"))),
    }
}

fn views(located: &Located) -> Result<Vec<View>> {
    match located.value.as_str() {
        Some("image") => Ok(vec![View::Image]),
        Some("blind") => Ok(vec![View::Blind]),
        Some("both") => Ok(vec![View::Image, View::Blind]),
        _ => Err(located.error("view: image, blind or both expected")),
    }
}

fn price(located: &Located) -> Result<Price> {
    let price: Price = located.value.clone().try_into().map_err(|e: toml::de::Error| {
        let problem = e.message().replace('\n', ", ");
        located.error(format_args!(
            "price: {problem}; {{ input = 2.5, output = 10 }} expected, dollars per million tokens"
        ))
    })?;
    let numbers = [price.input, price.output, price.cached_input.unwrap_or(0.0)];
    if numbers.iter().all(|number| number.is_finite() && *number >= 0.0) {
        Ok(price)
    } else {
        Err(located.error("price: numbers of 0 or more expected"))
    }
}

fn limit(located: &Located) -> Result<NonZeroUsize> {
    let number = located.value.as_integer().and_then(|number| usize::try_from(number).ok());
    let number = number.and_then(NonZeroUsize::new);
    number.ok_or_else(|| located.error("limit: a whole number from 1 on expected"))
}

/// A flag of the run that a models file sets.
#[derive(Debug)]
pub struct RunDefault {
    /// Long name of the flag.
    pub flag: String,
    pub value: Value,
    /// File and line.
    pub place: String,
}

/// Reads the flags of the run that the `[defaults]` of a models file set.
///
/// # Errors
/// See [`ModelsFile::read`].
pub fn run_defaults(path: &Path) -> Result<Vec<RunDefault>> {
    let file = ModelsFile::read(path)?;
    Ok(file
        .defaults
        .into_iter()
        .filter(|(key, _)| is_run_key(key))
        .map(|(flag, located)| RunDefault { flag, value: located.value, place: located.place })
        .collect())
}
