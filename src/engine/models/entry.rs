//! One model of a run before it is opened: [`Entry`], made of the flags and the layers of a file of models.

use std::collections::BTreeSet;
use std::num::NonZeroUsize;

use serde_json::json;
use toml::Value;

use super::asking::AskingArgs;
use super::file::{Keys, Located};
use super::name::ModelName;
use crate::ask::Price;
use crate::error::{Error, Result};
use crate::types::View;
use crate::types::text::near_name::{nearest, question};

/// Keys of a model that are no flags, or have another form than the flag.
const OWN: [&str; 10] = [
    "name",
    "id",
    "deployment",
    "group",
    "view",
    "price",
    "limit",
    "headers",
    "body",
    "omit",
];

/// Keys that have another name than the flag.
const RENAMED: [(&str, &str); 5] = [
    ("endpoints", "base-url"),
    ("key-env", "api-key-env"),
    ("key-file", "api-key-file"),
    ("body", "extra-body"),
    ("omit", "omit-field"),
];

/// Keys that only one model can have.
const NOT_IN_DEFAULTS: [&str; 4] = ["name", "id", "deployment", "endpoints"];

/// Keys of settings that hold for all models, because each image is made once for all of them, and shown at one place.
const OF_THE_RUN: [&str; 3] = ["image", "max-side", "image-first"];

/// Names that users of other tools may write, with the key.
const ELSEWHERE: [(&str, &str); 6] = [
    ("model", "id"),
    ("label", "name"),
    ("base-url", "endpoints"),
    ("api-base", "endpoints"),
    ("api-key", "key-env"),
    ("extra-body", "body"),
];

/// One model of a run, not opened yet.
#[derive(Debug, Clone)]
pub(super) struct Entry {
    /// The name in tables.
    pub(super) name: String,
    pub(super) id: ModelName,
    /// The views of the model; both if it is asked with and without images.
    pub(super) views: Vec<View>,
    pub(super) deployment: Option<String>,
    /// The heading under which tables show it; `None` without one.
    pub(super) group: Option<String>,
    pub(super) asking: AskingArgs,
    /// The price, if it is not that of the table of prices.
    pub(super) price: Option<Price>,
    /// The number of questions that it is asked; `None` for all.
    pub(super) limit: Option<NonZeroUsize>,
    /// The place of its table in the file; `None` for a model that a flag names.
    pub(super) place: Option<String>,
}

impl Entry {
    /// The model that a flag names, with the settings of the flags.
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

    /// A model of a file: the settings of the flags, then those of each layer, each above the one before.
    ///
    /// # Errors
    /// If a key is unknown or its value cannot be used; the error names the line.
    pub(super) fn from_file(
        keys: &Keys,
        layers: &[&Keys],
        view: View,
        asking: AskingArgs,
    ) -> Result<Self> {
        let place = keys.values().map(|located| located.place.clone()).min();
        let place = place.unwrap_or_default();
        let id = keys.get("id").ok_or_else(|| {
            Error::usage(
                &place,
                "a model without id: what the endpoint calls it, or random, observer, script:FILE",
            )
        })?;
        let name: ModelName = id_text(id, "id")?
            .parse()
            .map_err(|problem| id.error(problem))?;
        let mut entry = Self {
            place: Some(id.place.clone()),
            ..Self::from_flag(name, view, asking)
        };
        if keys.contains_key("endpoints") {
            // A key of the flags belongs to the address of the flags. One of [defaults] is of all models of the file.
            entry.asking.forget_key();
        }
        for layer in layers {
            entry.apply(layer)?;
        }
        Ok(entry)
    }

    /// Sets what the keys of a layer say.
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
                key if is_of_the_run(key) => {}
                key => {
                    let words = words(key, located)?;
                    if key == "headers" {
                        // One table holds, even an empty one: the headers of two layers are not mixed.
                        self.asking.forget_headers();
                    }
                    let wrong = |problem: String| located.error(format_args!("{key}: {problem}"));
                    self.asking.update(&words).map_err(wrong)?;
                }
            }
        }
        Ok(())
    }
}

/// Refuses keys that are not known, with the one that is most alike.
///
/// # Errors
/// The error names the line of the key.
pub(super) fn check_keys(keys: &Keys, is_defaults: bool) -> Result<()> {
    let known = known_keys();
    for (key, located) in keys {
        if is_defaults && NOT_IN_DEFAULTS.contains(&&**key) {
            return Err(located.error(format_args!(
                "{key} belongs to one model: it cannot be in [defaults]"
            )));
        }
        if is_of_the_run(key) {
            if is_defaults {
                continue;
            }
            let problem = format_args!(
                "{key} applies to all models, because each image is made once: set it in [defaults], or use --{key}"
            );
            return Err(located.error(problem));
        }
        if !known.contains(key) {
            let other = ELSEWHERE.iter().find(|(other, _)| other == key);
            let other = other.map(|(_, key)| *key);
            let hint = question(other.or_else(|| nearest(key, &known)));
            return Err(located.error(format_args!("there is no key {key}{hint}")));
        }
    }
    Ok(())
}

/// Whether a key is of the run, and of no model.
pub(super) fn is_of_the_run(key: &str) -> bool {
    OF_THE_RUN.contains(&key)
}

/// All keys of a model.
pub(super) fn known_keys() -> BTreeSet<String> {
    AskingArgs::flags()
        .into_iter()
        .filter(|flag| !matches!(&**flag, "header" | "header-env"))
        .map(
            |flag| match RENAMED.iter().find(|(_, name)| *name == flag) {
                Some((key, _)) => (*key).to_owned(),
                None => flag,
            },
        )
        .chain(OWN.map(str::to_owned))
        .collect()
}

/// The flag that a key sets; `None` for keys that are no flags.
pub(super) fn flag_of(key: &str) -> Option<&str> {
    match RENAMED.iter().find(|(name, _)| *name == key) {
        Some((_, flag)) => Some(flag),
        None if key == "headers" => Some("header"),
        None => (!OWN.contains(&key)).then_some(key),
    }
}

/// The words that set a key, as flags.
fn words(key: &str, located: &Located) -> Result<Vec<String>> {
    let flag = flag_of(key).unwrap_or(key);
    let wrong = |expected: &str| Err(located.error(format_args!("{key}: {expected} expected")));
    let text = |value: &Value| match value {
        Value::String(text) => Some(text.clone()),
        Value::Integer(_) | Value::Float(_) | Value::Boolean(_) => Some(value.to_string()),
        _ => None,
    };
    match (key, &located.value) {
        ("headers", Value::Table(headers)) => {
            let words: Result<Vec<String>, ()> = headers
                .iter()
                .map(|(name, value)| match value {
                    Value::String(text) => Ok(format!("--header={name}: {text}")),
                    Value::Table(table) => match (table.len(), table.get("env")) {
                        (1, Some(Value::String(variable))) => {
                            Ok(format!("--header-env={name}={variable}"))
                        }
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
            let words: Option<Vec<String>> = items.iter().map(text).collect();
            match words {
                Some(words) => Ok(words
                    .iter()
                    .map(|word| format!("--{flag}={word}"))
                    .collect()),
                None => wrong("a list of texts"),
            }
        }
        (_, value) => match text(value) {
            Some(word) => Ok(vec![format!("--{flag}={word}")]),
            None => wrong("a text, a number or true or false"),
        },
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
        located.error(format_args!("price: {problem}; {{ input = 2.5, output = 10 }} expected, dollars per million tokens"))
    })?;
    let numbers = [price.input, price.output, price.cached_input.unwrap_or(0.0)];
    if numbers
        .iter()
        .all(|number| number.is_finite() && *number >= 0.0)
    {
        Ok(price)
    } else {
        Err(located.error("price: numbers of 0 or more expected"))
    }
}

fn limit(located: &Located) -> Result<NonZeroUsize> {
    let number = located
        .value
        .as_integer()
        .and_then(|number| usize::try_from(number).ok());
    let number = number.and_then(NonZeroUsize::new);
    number.ok_or_else(|| located.error("limit: a whole number from 1 on expected"))
}
