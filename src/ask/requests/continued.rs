//! Settings of a model that changed within a run: [`Continued`], with one [`ChangedSetting`] for each.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

/// The settings of a stored run that a command continues with others.
#[derive(Debug, Clone, PartialEq)]
pub struct Continued {
    /// Content of the model in the run, as [`Parameters::content`](super::parameters::Parameters) has it.
    pub(super) content: Value,
    /// Settings that differ now or differed in an earlier command.
    pub changes: Vec<ChangedSetting>,
}

/// A setting of a model that has another value than the run began with.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ChangedSetting {
    /// The flag, such as `--temperature`.
    pub flag: String,
    /// The value with which the run began; null if unset.
    pub first: Value,
    /// The current value; null if unset.
    pub now: Value,
    /// Number of the model's replies before the change.
    #[serde(default)]
    pub after: usize,
}

/// Field of a column with the address of the endpoint.
const ADDRESS: &str = "--base-url";

impl Continued {
    /// The settings in a run's column of the model.
    pub(super) fn new(column: &Value, changes: Vec<ChangedSetting>) -> Self {
        let content: Map<String, Value> = column
            .as_object()
            .into_iter()
            .flatten()
            .filter(|(flag, _)| *flag != ADDRESS)
            .map(|(flag, value)| (parameter_name(flag), value.clone()))
            .collect();
        Self { content: Value::Object(content), changes }
    }
}

impl ChangedSetting {
    /// Differences between a run's column of a model and current settings by flag, sorted by flag. The address and null
    /// values are ignored.
    pub(super) fn between(column: &Value, now: &Map<String, Value>) -> Vec<Self> {
        let empty = Map::new();
        let first = column.as_object().unwrap_or(&empty);
        let flags: BTreeSet<&String> = first.keys().chain(now.keys()).collect();
        flags
            .into_iter()
            .filter(|flag| *flag != ADDRESS)
            .map(|flag| Self {
                flag: flag.clone(),
                first: first.get(flag).cloned().unwrap_or_default(),
                now: now.get(flag).cloned().unwrap_or_default(),
                after: 0,
            })
            .filter(|change| change.first != change.now)
            .collect()
    }

    /// True if both set the same flag to the same current value.
    pub fn sets_the_same(&self, other: &Self) -> bool {
        (&self.flag, &self.now) == (&other.flag, &other.now)
    }
}

/// Parameter that a flag sets; the inverse of [`flag_name`](super::parameters::flag_name).
fn parameter_name(flag: &str) -> String {
    match flag {
        "--sampling-seed" => "seed".to_owned(),
        "reply-headers" => "reply_headers".to_owned(),
        flag => flag.trim_start_matches("--").replace('-', "_"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::requests::parameters::flag_name;

    #[test]
    fn names_of_parameters_and_flags_correspond() {
        for name in ["model", "max_tokens", "seed", "deployment", "reply_headers", "extra_body"] {
            assert_eq!(parameter_name(&flag_name(name)), name);
        }
    }
}
