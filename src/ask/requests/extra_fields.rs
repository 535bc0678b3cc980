//! Fields of a request that the user adds or leaves out: their flags ([`RequestArgs`]) and what they come to ([`ExtraFields`]).

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;
use serde_json::{Map, Value};

use crate::ask::secrets::refuse_secrets;
use crate::error::{Error, Result};
use crate::files::reading;
use crate::types::Decides;

/// Flags that add words and fields to every request, or leave fields out.
#[derive(Debug, Clone, Default, PartialEq, Args)]
#[command(next_help_heading = "Model")]
pub(crate) struct RequestArgs {
    /// Fields for the body of every request, as a JSON object or in a file: objects are merged field by field, everything else
    /// replaces, null removes (RFC 7396); default: none
    #[arg(long, value_name = "JSON|@FILE", add = Decides::Reply)]
    pub extra_body: Option<String>,
    /// A field that is left out of the body of every request; repeatable; default: none
    #[arg(long, value_name = "FIELD", add = Decides::Reply)]
    pub omit_field: Vec<String>,
    /// The words of a system message before each question; default: none
    #[arg(long, value_name = "TEXT", conflicts_with = "system_file", add = Decides::Reply)]
    pub system: Option<String>,
    /// A file with the words of a system message before each question; default: none
    #[arg(long, value_name = "FILE", add = Decides::Reply)]
    pub system_file: Option<PathBuf>,
}

/// Fields that the program sets, each with what sets it. The user cannot set them in another way: the manifest, the estimate of
/// the cost and the keys of trials follow from the program's settings.
const OWNED: [(&str, &str); 15] = [
    ("model", "--model, or id in a file of models"),
    ("messages", "--system, or --prompts"),
    ("input", "--system, or --prompts"),
    ("instructions", "--system"),
    ("stream", "--request wire"),
    ("n", "--repeats"),
    ("max_tokens", "--max-tokens"),
    (
        "max_completion_tokens",
        "--max-tokens with --request token-field",
    ),
    ("max_output_tokens", "--max-tokens"),
    ("temperature", "--temperature"),
    ("top_p", "--top-p"),
    (
        "seed",
        "--sampling-seed of openeqa, or seed in a file of models",
    ),
    ("reasoning_effort", "--reasoning-effort"),
    ("logprobs", "--request probabilities"),
    ("top_logprobs", "--request probabilities"),
];

/// Fields without which no request can be sent.
const NEEDED: [&str; 4] = ["model", "messages", "input", "stream"];

/// Fields that carry the token limit of a reply.
const TOKEN_LIMITS: [&str; 3] = ["max_tokens", "max_completion_tokens", "max_output_tokens"];

/// Fields that limit the tokens of thinking: DashScope's and Google's, Anthropic's, and that of llama.cpp.
const THINKING_BUDGETS: [&str; 3] = ["thinking_budget", "budget_tokens", "reasoning_budget"];

/// Fields that the user adds to every request body or leaves out, and the deployment that tells two models of one name apart.
///
/// The JSON form is part of the key of each trial. What is not set is not written, so that the keys of runs without it stay.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct ExtraFields {
    /// A name that tells two deployments of one model apart, such as the vendor or the quantisation.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub deployment: Option<String>,
    /// The words of a system message before each question.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub system: Option<String>,
    /// Headers that decide replies, with their values.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub reply_headers: BTreeMap<String, String>,
    /// The fields that are merged into the body. As a text in the key: there a null, which removes a field, is kept.
    #[serde(
        rename = "extra_body",
        skip_serializing_if = "Map::is_empty",
        serialize_with = "as_text"
    )]
    pub body: Map<String, Value>,
    /// The fields that are left out of the body, sorted.
    #[serde(rename = "omit_field", skip_serializing_if = "Vec::is_empty")]
    pub omit: Vec<String>,
}

/// Writes a map as its compact JSON, keys sorted.
fn as_text<S: serde::Serializer>(
    map: &Map<String, Value>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    let text = serde_json::to_string(map).map_err(serde::ser::Error::custom)?;
    serializer.serialize_str(&text)
}

impl RequestArgs {
    /// The fields, with the files read.
    ///
    /// # Errors
    /// If a file cannot be read, the JSON is no object, or a field is one that the program sets or looks like a secret, which the error
    /// does not show.
    pub(crate) fn resolve(&self) -> Result<ExtraFields> {
        let system = match (&self.system, &self.system_file) {
            (Some(words), _) => Some(words.clone()),
            (None, Some(path)) => Some(reading::settings(path)?),
            (None, None) => None,
        };
        let system = system.map(|words| words.trim().to_owned());
        if system.as_deref() == Some("") {
            return Err(Error::usage(
                "--system",
                "the words of the message are missing",
            ));
        }
        let mut omit = self.omit_field.clone();
        for field in &mut omit {
            *field = field.trim().to_owned();
            if field.is_empty() || NEEDED.contains(&&**field) {
                let problem = format_args!("{field:?} cannot be left out of a request");
                return Err(Error::usage("--request omit-field", problem));
            }
        }
        omit.sort();
        omit.dedup();
        let body = self.extra_body.as_deref().map(body).transpose()?;
        Ok(ExtraFields {
            deployment: None,
            reply_headers: BTreeMap::new(),
            system,
            body: body.unwrap_or_default(),
            omit,
        })
    }
}

/// Reads the fields of a body: JSON, or `@` with a file that holds it.
fn body(value: &str) -> Result<Map<String, Value>> {
    let wrong = |problem: String| Error::usage("--extra-body", problem);
    let read = value
        .strip_prefix('@')
        .map(|path| reading::settings(Path::new(path)));
    let read = read.transpose()?;
    let json = read.as_deref().unwrap_or(value);
    // The words of the error of serde_json name a line and column and none of the values.
    let parsed = serde_json::from_str(json).map_err(|e| {
        let expected = "a JSON object expected, as {\"top_k\": 1}, or @FILE with one";
        wrong(format!("{expected}: {e}"))
    })?;
    let Value::Object(fields) = parsed else {
        return Err(wrong(
            "a JSON object expected, as {\"top_k\": 1}".to_owned(),
        ));
    };
    let mut owned = OWNED.iter();
    if let Some((field, by)) = owned.find(|(field, _)| fields.contains_key(*field)) {
        return Err(wrong(format!("{field} is set by the program: use {by}")));
    }
    refuse_secrets(&fields)?;
    Ok(fields)
}

impl ExtraFields {
    /// Whether the user adds a field at the top of the body.
    pub(in crate::ask) fn adds(&self, field: &str) -> bool {
        self.body.contains_key(field)
    }

    /// Whether the user adds a field of an object at the top of the body.
    pub(in crate::ask) fn adds_below(&self, object: &str, field: &str) -> bool {
        let object = self.body.get(object).and_then(Value::as_object);
        object.is_some_and(|object| object.contains_key(field))
    }

    /// Whether a field that carries the token limit is left out or removed.
    pub(in crate::ask) fn omits_token_limit(&self) -> bool {
        self.omit
            .iter()
            .any(|field| TOKEN_LIMITS.contains(&&**field))
    }

    /// The limit of thinking tokens that the user's fields state, at any depth; `None` if they state none.
    pub(in crate::ask) fn thinking_budget(&self) -> Option<ThinkingBudget> {
        thinking_budget(&self.body)
    }

    /// A body, given as JSON without its messages, with the user's fields: the body is merged by JSON merge patch (RFC 7396), then
    /// the omitted fields are removed. Unchanged to the byte if the user sets nothing; else keys are sorted.
    pub(in crate::ask) fn apply(&self, json: String) -> Result<String, serde_json::Error> {
        if self.body.is_empty() && self.omit.is_empty() {
            return Ok(json);
        }
        let mut fields = serde_json::from_str(&json)?;
        merge(&mut fields, &self.body);
        for field in &self.omit {
            fields.remove(field);
        }
        serde_json::to_string(&fields)
    }
}

/// The limit of the tokens that a model may think.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::ask) enum ThinkingBudget {
    Tokens(u64),
    /// As many as the model likes: a negative number, by Google's convention.
    Unlimited,
}

/// The budget in the first field for it.
fn thinking_budget(fields: &Map<String, Value>) -> Option<ThinkingBudget> {
    fields.iter().find_map(|(name, value)| match value {
        Value::Object(inner) => thinking_budget(inner),
        Value::Number(tokens) if THINKING_BUDGETS.contains(&&**name) => {
            let budget = tokens.as_u64().map(ThinkingBudget::Tokens);
            Some(budget.unwrap_or(ThinkingBudget::Unlimited))
        }
        _ => None,
    })
}

/// Merges a patch into an object (RFC 7396, section 2).
fn merge(into: &mut Map<String, Value>, patch: &Map<String, Value>) {
    for (name, value) in patch {
        match value {
            Value::Null => {
                into.remove(name);
            }
            Value::Object(inner) => {
                let target = into.entry(name.clone()).or_insert(Value::Null);
                if !target.is_object() {
                    *target = Value::Object(Map::new());
                }
                if let Some(object) = target.as_object_mut() {
                    merge(object, inner);
                }
            }
            other => {
                into.insert(name.clone(), other.clone());
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn object(value: &Value) -> Map<String, Value> {
        value.as_object().unwrap().clone()
    }

    /// The examples of RFC 7396, appendix A, that are objects.
    #[test]
    fn fields_are_merged_as_a_merge_patch() {
        for (original, patch, result) in [
            (json!({"a": "b"}), json!({"a": "c"}), json!({"a": "c"})),
            (
                json!({"a": "b"}),
                json!({"b": "c"}),
                json!({"a": "b", "b": "c"}),
            ),
            (json!({"a": "b"}), json!({"a": null}), json!({})),
            (
                json!({"a": "b", "b": "c"}),
                json!({"a": null}),
                json!({"b": "c"}),
            ),
            (json!({"a": ["b"]}), json!({"a": "c"}), json!({"a": "c"})),
            (json!({"a": "c"}), json!({"a": ["b"]}), json!({"a": ["b"]})),
            (
                json!({"a": {"b": "c"}}),
                json!({"a": {"b": "d", "c": null}}),
                json!({"a": {"b": "d"}}),
            ),
            (
                json!({"a": [{"b": "c"}]}),
                json!({"a": [1]}),
                json!({"a": [1]}),
            ),
            (
                json!({"e": null}),
                json!({"a": 1}),
                json!({"e": null, "a": 1}),
            ),
            (
                json!({}),
                json!({"a": {"bb": {"ccc": null}}}),
                json!({"a": {"bb": {}}}),
            ),
        ] {
            let mut merged = object(&original);
            merge(&mut merged, &object(&patch));
            assert_eq!(Value::Object(merged), result, "{original} {patch}");
        }
    }

    fn resolve(args: &RequestArgs) -> Result<ExtraFields> {
        args.resolve()
    }

    #[test]
    fn fields_of_the_program_are_refused_with_what_sets_them() {
        for (field, by) in OWNED {
            let extra_body = Some(json!({field: 1}).to_string());
            let args = RequestArgs {
                extra_body,
                ..RequestArgs::default()
            };
            let error = resolve(&args).unwrap_err().to_string();
            assert!(
                error.starts_with("--extra-body: ") && error.contains(by),
                "{error}"
            );
        }
        for wrong in ["", "{", "[1]", "3", "@/nowhere/at/all.json"] {
            let args = RequestArgs {
                extra_body: Some(wrong.into()),
                ..RequestArgs::default()
            };
            assert!(resolve(&args).is_err(), "{wrong}");
        }
        for wrong in ["model", "messages", " "] {
            let args = RequestArgs {
                omit_field: vec![wrong.into()],
                ..RequestArgs::default()
            };
            assert!(resolve(&args).is_err(), "{wrong}");
        }
        let args = RequestArgs {
            system: Some("  ".into()),
            ..RequestArgs::default()
        };
        assert!(resolve(&args).is_err());
    }

    #[test]
    fn thinking_budgets_are_found_at_any_depth() {
        let budget = |body: &Value| {
            let fields = ExtraFields {
                body: object(body),
                ..ExtraFields::default()
            };
            fields.thinking_budget()
        };
        let google = json!({"google": {"thinking_config": {"thinking_budget": -1}}});
        assert_eq!(budget(&google), Some(ThinkingBudget::Unlimited));
        let own = json!({"enable_thinking": true, "thinking_budget": 2048});
        assert_eq!(budget(&own), Some(ThinkingBudget::Tokens(2048)));
        assert_eq!(budget(&json!({"top_k": -1})), None);
    }

    #[test]
    fn only_what_is_set_is_written() {
        assert_eq!(json!(ExtraFields::default()), json!({}));
        let args = RequestArgs {
            extra_body: Some(r#"{"b": {"y": 1, "x": null}, "a": 2}"#.into()),
            omit_field: vec!["z".into(), "temperature".into(), "z".into()],
            system: Some(" Look.\n".into()),
            ..RequestArgs::default()
        };
        let fields = resolve(&args).unwrap();
        let expected = json!({
            "system": "Look.", "extra_body": r#"{"a":2,"b":{"x":null,"y":1}}"#, "omit_field": ["temperature", "z"],
        });
        assert_eq!(json!(fields), expected);
    }

    #[test]
    fn a_body_without_extra_fields_is_unchanged_and_omitting_comes_last() {
        let body = r#"{"model":"m","temperature":0.0}"#.to_owned();
        assert_eq!(ExtraFields::default().apply(body.clone()).unwrap(), body);
        let fields = ExtraFields {
            body: object(&json!({"top_k": 1, "cached": {"a": 1}})),
            omit: vec!["temperature".into(), "cached".into()],
            ..ExtraFields::default()
        };
        assert_eq!(fields.apply(body).unwrap(), r#"{"model":"m","top_k":1}"#);
    }
}
