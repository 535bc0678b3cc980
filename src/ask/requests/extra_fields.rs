//! Request fields that the user adds or omits: the flags ([`RequestArgs`]) and the resolved fields ([`ExtraFields`]).
//!
//! Setting whether a model thinks before it answers ([`Thinking`]), and the request fields for it ([`ThinkingSwitch`]).
//!
//! The fields differ between vendors; `thinking.toml` lists them by host.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use clap::{Args, ValueEnum};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::endpoints::BaseUrl;
use crate::secrets::refuse_secrets;
use darkqa_base::error::{Error, Result};
use darkqa_base::files;
use darkqa_base::types::Decides;
use darkqa_base::types::flags::flag_words;

/// Flags that add words and fields to every request, or leave fields out.
#[derive(Debug, Clone, Default, PartialEq, Args)]
#[command(next_help_heading = "Model")]
pub struct RequestArgs {
    /// JSON object, or a file with one, merged into every request (JSON Merge Patch, RFC 7396: null removes a field);
    /// default: none
    #[arg(long, value_name = "JSON|@FILE", add = Decides::Reply)]
    pub extra_body: Option<String>,
    /// Leave this field out of every request; repeatable; default: none
    #[arg(long, value_name = "FIELD", add = Decides::Reply)]
    pub omit_field: Vec<String>,
    /// System message before each question; default: none
    #[arg(long, value_name = "TEXT", conflicts_with = "system_file", add = Decides::Reply)]
    pub system: Option<String>,
    /// File with the system message; default: none
    #[arg(long, value_name = "FILE", add = Decides::Reply)]
    pub system_file: Option<PathBuf>,
}

/// Fields set by the program, each with the flag or file that controls it. `--extra-body` cannot set them: the
/// manifest, the cost estimate and the trial keys are computed from the program's settings.
const PROGRAM_FIELDS: [(&str, &str); 15] = [
    ("model", "--model, or id in a file of models"),
    ("messages", "--system, or --prompts"),
    ("input", "--system, or --prompts"),
    ("instructions", "--system"),
    ("stream", "--request wire"),
    ("n", "--repeats"),
    ("max_tokens", "--max-tokens"),
    ("max_completion_tokens", "--max-tokens with --request token-field"),
    ("max_output_tokens", "--max-tokens"),
    ("temperature", "--temperature"),
    ("top_p", "--top-p"),
    ("seed", "--sampling-seed of openeqa, or seed in a file of models"),
    ("reasoning_effort", "--reasoning-effort"),
    ("logprobs", "--request probabilities"),
    ("top_logprobs", "--request probabilities"),
];

/// Fields that cannot be omitted, because no request works without them.
const REQUIRED_FIELDS: [&str; 4] = ["model", "messages", "input", "stream"];

/// Fields that limit the tokens of a reply.
const TOKEN_LIMITS: [&str; 3] = ["max_tokens", "max_completion_tokens", "max_output_tokens"];

/// Fields that limit the thinking tokens. In order: DashScope and Google, Anthropic, llama.cpp.
const THINKING_BUDGETS: [&str; 3] = ["thinking_budget", "budget_tokens", "reasoning_budget"];

/// Additions to and omissions from every request, and the deployment of the model.
///
/// The JSON form is part of the key of each trial. Unset fields are skipped, so that they do not change the keys of
/// older runs.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct ExtraFields {
    /// Name that distinguishes deployments of one model, such as the vendor or the quantisation.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub deployment: Option<String>,
    /// Text of the system message before each question.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub system: Option<String>,
    /// HTTP headers that can change replies, with their values.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub reply_headers: BTreeMap<String, String>,
    /// Fields merged into the body. Serialised as JSON text, which keeps a null: a null removes a field.
    #[serde(rename = "extra_body", skip_serializing_if = "Map::is_empty", serialize_with = "as_text")]
    pub body: Map<String, Value>,
    /// Fields omitted from the body, sorted.
    #[serde(rename = "omit_field", skip_serializing_if = "Vec::is_empty")]
    pub omit: Vec<String>,
}

/// Serialises a map as a string of compact JSON with sorted keys.
fn as_text<S: serde::Serializer>(map: &Map<String, Value>, serializer: S) -> Result<S::Ok, S::Error> {
    let text = serde_json::to_string(map).map_err(serde::ser::Error::custom)?;
    serializer.serialize_str(&text)
}

impl RequestArgs {
    /// Reads the files named by the flags and checks the fields.
    ///
    /// # Errors
    /// If a file cannot be read, the system message is empty, a required field is omitted, the JSON is not an object,
    /// or a field is set by the program or looks like a secret. The error does not show the secret.
    pub fn resolve(&self) -> Result<ExtraFields> {
        let system = match (&self.system, &self.system_file) {
            (Some(text), _) => Some(text.clone()),
            (None, Some(path)) => Some(files::settings(path)?),
            (None, None) => None,
        };
        let system = system.map(|text| text.trim().to_owned());
        if system.as_deref() == Some("") {
            return Err(Error::usage("--system", "the words of the message are missing"));
        }
        let mut omit = self.omit_field.clone();
        for field in &mut omit {
            *field = field.trim().to_owned();
            if field.is_empty() || REQUIRED_FIELDS.contains(&&**field) {
                let problem = format_args!("{field:?} cannot be left out of a request");
                return Err(Error::usage("--request omit-field", problem));
            }
        }
        omit.sort();
        omit.dedup();
        let body = self.extra_body.as_deref().map(parse_body).transpose()?;
        Ok(ExtraFields {
            deployment: None,
            reply_headers: BTreeMap::new(),
            system,
            body: body.unwrap_or_default(),
            omit,
        })
    }
}

/// Parses the value of `--extra-body`: JSON, or `@` and the path of a JSON file.
fn parse_body(value: &str) -> Result<Map<String, Value>> {
    let file = value.strip_prefix('@').map(|path| files::settings(Path::new(path))).transpose()?;
    let json = file.as_deref().unwrap_or(value);
    // Errors of serde_json have a line and a column but no values, so they cannot show a secret.
    let parsed = serde_json::from_str(json).map_err(|e| {
        let expected = "a JSON object expected, as {\"top_k\": 1}, or @FILE with one";
        Error::usage("--extra-body", format_args!("{expected}: {e}"))
    })?;
    let Value::Object(fields) = parsed else {
        return Err(Error::usage("--extra-body", "a JSON object expected, as {\"top_k\": 1}"));
    };
    let owned = PROGRAM_FIELDS.iter().find(|(field, _)| fields.contains_key(*field));
    if let Some((field, setter)) = owned {
        return Err(Error::usage("--extra-body", format_args!("{field} is set by the program: use {setter}")));
    }
    refuse_secrets(&fields)?;
    Ok(fields)
}

impl ExtraFields {
    /// True if the user adds this top-level field.
    pub fn adds(&self, field: &str) -> bool {
        self.body.contains_key(field)
    }

    /// True if the user adds this field to a top-level object.
    pub fn adds_below(&self, object: &str, field: &str) -> bool {
        let object = self.body.get(object).and_then(Value::as_object);
        object.is_some_and(|object| object.contains_key(field))
    }

    /// Service tier that requests ask for; `None` if they leave it to the server.
    pub fn service_tier(&self) -> Option<&str> {
        self.body.get("service_tier")?.as_str()
    }

    /// True if a field that limits the tokens of a reply is omitted.
    pub fn omits_token_limit(&self) -> bool {
        self.omit.iter().any(|field| TOKEN_LIMITS.contains(&&**field))
    }

    /// Limit of thinking tokens in the added fields, at any depth; `None` without one.
    pub fn thinking_budget(&self) -> Option<ThinkingBudget> {
        find_thinking_budget(&self.body)
    }

    /// Applies the user's fields to a request body, given as JSON without its messages.
    ///
    /// The added fields are merged as a JSON merge patch (RFC 7396), then the omitted fields are removed. With neither,
    /// the JSON is returned byte for byte; otherwise its keys are sorted.
    ///
    /// # Errors
    /// If the body is not a JSON object.
    pub fn apply(&self, json: String) -> Result<String, serde_json::Error> {
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

/// Limit on the tokens that a model may spend on thinking.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ThinkingBudget {
    Tokens(u64),
    /// No limit: a negative number, by Google's convention.
    Unlimited,
}

/// Finds the first thinking budget, depth first.
fn find_thinking_budget(fields: &Map<String, Value>) -> Option<ThinkingBudget> {
    fields.iter().find_map(|(name, value)| match value {
        Value::Object(inner) => find_thinking_budget(inner),
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

/// The built-in table.
static TABLE: LazyLock<ServerTable> = LazyLock::new(|| {
    let text = include_str!("../thinking.toml");
    toml::from_str(text).unwrap_or_else(|e| unreachable!("a test reads thinking.toml: {e}"))
});

/// Whether a model thinks before it answers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Thinking {
    /// It answers at once
    Off,
    /// It thinks first
    On,
}

flag_words!(Thinking);

/// Table of servers, with its date.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
struct ServerTable {
    #[expect(dead_code, reason = "for readers of the table")]
    as_of: String,
    server: Vec<ServerRow>,
}

/// Servers with the same switch.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct ServerRow {
    /// Suffixes of their host names.
    #[serde(default)]
    hosts: Vec<String>,
    /// Ports of such servers on this machine.
    #[serde(default)]
    ports: Vec<u16>,
    off: Option<ThinkingSwitch>,
    on: Option<ThinkingSwitch>,
}

/// Request fields that turn thinking on or off.
#[derive(Debug, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ThinkingSwitch {
    /// Reasoning effort; `None` if the switch does not use it.
    pub(super) effort: Option<String>,
    /// Top-level fields of the body.
    #[serde(default)]
    pub(super) body: Map<String, Value>,
}

impl Thinking {
    /// Switch for the server at a base URL.
    ///
    /// # Errors
    /// [`Error::Usage`] if the switch of the server is unknown.
    pub(super) fn switch_for(self, base: &BaseUrl) -> Result<&'static ThinkingSwitch> {
        let servers = &TABLE.server;
        servers
            .iter()
            .find(|row| row.matches(base))
            .or_else(|| servers.iter().find(|row| row.is_fallback()))
            .and_then(|row| match self {
                Self::Off => row.off.as_ref(),
                Self::On => row.on.as_ref(),
            })
            .ok_or_else(|| {
                let problem = format_args!(
                    "how to turn thinking {self} at {base} is not known; set it with --reasoning-effort, in the server's words"
                );
                Error::usage("--thinking", problem)
            })
    }
}

impl ServerRow {
    /// True if the row lists the host, or the port of a server on this machine.
    fn matches(&self, base: &BaseUrl) -> bool {
        let has_host = self.hosts.iter().any(|suffix| {
            base.host() == suffix.trim_start_matches('.')
                || (suffix.starts_with('.') && base.host().ends_with(suffix.as_str()))
        });
        has_host || (base.is_loopback() && base.port().is_some_and(|port| self.ports.contains(&port)))
    }

    /// True for the row of all servers that no other row lists.
    fn is_fallback(&self) -> bool {
        self.hosts.is_empty() && self.ports.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn object(value: &Value) -> Map<String, Value> {
        value.as_object().unwrap().clone()
    }

    /// Object examples of RFC 7396, appendix A.
    #[test]
    fn merge_follows_rfc_7396() {
        for (original, patch, result) in [
            (json!({"a": "b"}), json!({"a": "c"}), json!({"a": "c"})),
            (json!({"a": "b"}), json!({"b": "c"}), json!({"a": "b", "b": "c"})),
            (json!({"a": "b"}), json!({"a": null}), json!({})),
            (json!({"a": "b", "b": "c"}), json!({"a": null}), json!({"b": "c"})),
            (json!({"a": ["b"]}), json!({"a": "c"}), json!({"a": "c"})),
            (json!({"a": "c"}), json!({"a": ["b"]}), json!({"a": ["b"]})),
            (json!({"a": {"b": "c"}}), json!({"a": {"b": "d", "c": null}}), json!({"a": {"b": "d"}})),
            (json!({"a": [{"b": "c"}]}), json!({"a": [1]}), json!({"a": [1]})),
            (json!({"e": null}), json!({"a": 1}), json!({"e": null, "a": 1})),
            (json!({}), json!({"a": {"bb": {"ccc": null}}}), json!({"a": {"bb": {}}})),
        ] {
            let mut merged = object(&original);
            merge(&mut merged, &object(&patch));
            assert_eq!(Value::Object(merged), result, "{original} {patch}");
        }
    }

    #[test]
    fn program_fields_are_refused() {
        for (field, setter) in PROGRAM_FIELDS {
            let extra_body = Some(json!({field: 1}).to_string());
            let args = RequestArgs { extra_body, ..RequestArgs::default() };
            let error = args.resolve().unwrap_err().to_string();
            assert!(error.starts_with("--extra-body: ") && error.contains(setter), "{error}");
        }
    }

    #[test]
    fn invalid_extra_body_is_refused() {
        for wrong in ["", "{", "[1]", "3", "@/nowhere/at/all.json"] {
            let args = RequestArgs { extra_body: Some(wrong.into()), ..RequestArgs::default() };
            assert!(args.resolve().is_err(), "{wrong}");
        }
    }

    #[test]
    fn required_fields_cannot_be_omitted() {
        for wrong in ["model", "messages", " "] {
            let args = RequestArgs { omit_field: vec![wrong.into()], ..RequestArgs::default() };
            assert!(args.resolve().is_err(), "{wrong}");
        }
    }

    #[test]
    fn blank_system_message_is_refused() {
        let args = RequestArgs { system: Some("  ".into()), ..RequestArgs::default() };
        assert!(args.resolve().is_err());
    }

    fn budget(body: &Value) -> Option<ThinkingBudget> {
        let fields = ExtraFields { body: object(body), ..ExtraFields::default() };
        fields.thinking_budget()
    }

    #[test]
    fn thinking_budget_is_found_when_nested() {
        let google = json!({"google": {"thinking_config": {"thinking_budget": -1}}});
        assert_eq!(budget(&google), Some(ThinkingBudget::Unlimited));
        let dashscope = json!({"enable_thinking": true, "thinking_budget": 2048});
        assert_eq!(budget(&dashscope), Some(ThinkingBudget::Tokens(2048)));
        assert_eq!(budget(&json!({"top_k": -1})), None);
    }

    #[test]
    fn unset_fields_are_not_serialised() {
        assert_eq!(json!(ExtraFields::default()), json!({}));
        let args = RequestArgs {
            extra_body: Some(r#"{"b": {"y": 1, "x": null}, "a": 2}"#.into()),
            omit_field: vec!["z".into(), "temperature".into(), "z".into()],
            system: Some(" Look.\n".into()),
            ..RequestArgs::default()
        };
        let fields = args.resolve().unwrap();
        let expected = json!({
            "system": "Look.", "extra_body": r#"{"a":2,"b":{"x":null,"y":1}}"#, "omit_field": ["temperature", "z"],
        });
        assert_eq!(json!(fields), expected);
    }

    #[test]
    fn body_without_extra_fields_is_unchanged() {
        let body = r#"{"model":"m","temperature":0.0}"#.to_owned();
        assert_eq!(ExtraFields::default().apply(body.clone()).unwrap(), body);
    }

    #[test]
    fn fields_are_omitted_after_merging() {
        let body = r#"{"model":"m","temperature":0.0}"#.to_owned();
        let fields = ExtraFields {
            body: object(&json!({"top_k": 1, "cached": {"a": 1}})),
            omit: vec!["temperature".into(), "cached".into()],
            ..ExtraFields::default()
        };
        assert_eq!(fields.apply(body).unwrap(), r#"{"model":"m","top_k":1}"#);
    }

    fn switch_for(base: &str, thinking: Thinking) -> Result<&'static ThinkingSwitch> {
        thinking.switch_for(&base.parse().unwrap())
    }

    #[test]
    fn each_server_has_its_switch() {
        let template = json!({"chat_template_kwargs": {"enable_thinking": false}});
        for (base, effort, body) in [
            ("https://api.openai.com/v1", Some("none"), json!({})),
            ("https://r.openai.azure.com/openai/v1", Some("none"), json!({})),
            ("https://dashscope-intl.aliyuncs.com/compatible-mode/v1", None, json!({"enable_thinking": false})),
            ("https://openrouter.ai/api/v1", None, json!({"reasoning": {"enabled": false}})),
            ("http://127.0.0.1:11434/v1", Some("none"), json!({})),
            ("http://127.0.0.1:8000/v1", None, template.clone()),
            // Ports count only on this machine, and suffixes only as whole domains.
            ("http://gpu7:11434/v1", None, template.clone()),
            ("https://api.openai.com.example/v1", None, template),
        ] {
            let switch = switch_for(base, Thinking::Off).unwrap();
            assert_eq!(switch.effort.as_deref(), effort, "{base}");
            assert_eq!(json!(switch.body), body, "{base}");
        }
    }

    #[test]
    fn unknown_switches_are_errors() {
        for (base, thinking) in
            [("https://api.mistral.ai/v1", Thinking::Off), ("https://api.openai.com/v1", Thinking::On)]
        {
            let error = switch_for(base, thinking).unwrap_err().to_string();
            assert!(error.contains("--thinking"), "{error}");
            assert!(error.contains("--reasoning-effort"), "{error}");
        }
    }

    /// No switch is empty or sets a field of the program.
    #[test]
    fn switches_set_only_thinking_fields() {
        let program_fields =
            ["model", "messages", "input", "stream", "temperature", "max_tokens", "reasoning_effort", "logprobs"];
        let fallbacks = TABLE.server.iter().filter(|row| row.is_fallback());
        assert_eq!(fallbacks.count(), 1);
        for row in &TABLE.server {
            for switch in row.off.iter().chain(&row.on) {
                assert!(switch.effort.is_some() || !switch.body.is_empty(), "{row:?}");
                assert!(program_fields.iter().all(|field| !switch.body.contains_key(*field)));
            }
        }
    }
}
