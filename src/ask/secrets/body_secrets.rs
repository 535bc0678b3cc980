//! Check of `--extra-body` for secrets: [`refuse_secrets`].

use serde_json::{Map, Value};

use super::key_form::{is_secret_name, is_secret_value};
use super::private_key::is_key_object;
use crate::error::{Error, Result};

/// Suffixes of field names whose values are always secrets; lower-case letters and digits only.
const SECRET_SUFFIXES: [&str; 9] = [
    "privatekey",
    "apikey",
    "accesskey",
    "secretkey",
    "secret",
    "password",
    "authorization",
    "accesstoken",
    "authtoken",
];

/// Minimum length at which the value of a field with a secret-looking name counts as a secret; chosen.
const MIN_LENGTH: usize = 20;

/// Checks that no field, at any depth, looks like a secret: bodies are written to the manifest and to batch files.
///
/// # Errors
/// [`Error::Usage`] with the name of a field that looks like a secret, without its value.
pub(crate) fn refuse_secrets(fields: &Map<String, Value>) -> Result<()> {
    fields.iter().try_for_each(|(name, value)| refuse_in_field(name, value))
}

fn refuse_in_field(name: &str, value: &Value) -> Result<()> {
    if is_secret_value(name) {
        return secret_error("the name of a field");
    }
    match value {
        Value::String(text) if is_secret(name, text) => secret_error(name),
        Value::Array(items) => items.iter().try_for_each(|item| refuse_in_field(name, item)),
        Value::Object(fields) if is_key_object(fields) => secret_error(name),
        Value::Object(fields) => refuse_secrets(fields),
        _ => Ok(()),
    }
}

fn secret_error(name: &str) -> Result<()> {
    let problem = format_args!(
        "{name} looks like a secret, which is not shown here and must not be in a body, because bodies are written to files: \
             put it into a variable, and name that with --header-env or --api-key-env"
    );
    Err(Error::usage("--extra-body", problem))
}

/// True if the text of a field looks like a secret: it has the form of a key, a private key or a service account, or
/// the field name always means a secret, or the field name looks secret and the text is a long mixture of letters and
/// digits.
fn is_secret(name: &str, text: &str) -> bool {
    let letters: String = name.chars().filter(char::is_ascii_alphanumeric).map(|c| c.to_ascii_lowercase()).collect();
    let has_secret_suffix = SECRET_SUFFIXES.iter().any(|suffix| letters.ends_with(suffix));
    let is_long_key = text.len() >= MIN_LENGTH
        && text.chars().all(|c| c.is_ascii_alphanumeric() || "-_.+/=:~".contains(c))
        && text.contains(|c: char| c.is_ascii_digit());
    is_secret_value(text) || (has_secret_suffix && !text.is_empty()) || (is_secret_name(name) && is_long_key)
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn refusal(body: &Value) -> Result<(), String> {
        refuse_secrets(body.as_object().unwrap()).map_err(|error| error.to_string())
    }

    #[test]
    fn secret_fields_are_refused() {
        for (fields, name) in [
            (json!({"api_key": "sk-0123456789"}), "api_key"),
            (json!({"user": "sk-0123456789"}), "user"),
            (json!({"a": {"b": [{"X-Api-Key": "0123"}]}}), "X-Api-Key"),
            (json!({"a": ["Bearer 0123"]}), "a"),
            (json!({"router": {"token": "0123456789abcdef0123"}}), "token"),
            (json!({"sk-0123456789": 1}), "the name of a field"),
            (json!({"note": "-----BEGIN PRIVATE KEY-----\n0123\n-----END PRIVATE KEY-----"}), "note"),
            (json!({"vertex_credentials": {"type": "service_account", "project_id": "0123"}}), "vertex_credentials"),
            (json!({"a": "{\"type\": \"service_account\", \"b\": \"0123\"}"}), "a"),
            (json!({"jwk": {"kty": "OKP", "d": "0123"}}), "jwk"),
        ] {
            let error = refusal(&fields).unwrap_err();
            let expected = format!("--extra-body: {name} looks like a secret");
            assert!(error.starts_with(&expected), "{error}");
            assert!(error.contains("--header-env") && !error.contains("0123"), "{error}");
        }
        for fields in [
            json!({"prompt_cache_key": "0f8fad5b-d9cb-469f-a165-70867728950e"}),
            json!({"tokenizer": "mistralai/Mistral-7B-Instruct-v0.3"}),
            json!({"eos_token": "<|end_of_text_number_2|>", "token_limit": 10, "api_key": null}),
            json!({"tools": [{"type": "function"}], "certificate": "-----BEGIN CERTIFICATE-----"}),
            json!({"keywords": ["the colour of 20 lamps in the room"]}),
        ] {
            assert!(refusal(&fields).is_ok(), "{fields}");
        }
    }
}
