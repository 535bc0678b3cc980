//! Secrets in the fields that the user adds to the body of requests: [`refuse_secrets`].

use serde_json::{Map, Value};

use super::key_form::{is_secret_name, is_secret_value};
use crate::error::{Error, Result};

/// Ends of names of fields that hold nothing but secrets, in small letters and without hyphens and the like.
const SECRETS: [&str; 8] = [
    "apikey",
    "accesskey",
    "secretkey",
    "secret",
    "password",
    "authorization",
    "accesstoken",
    "authtoken",
];

/// Fields whose names tell of a secret and whose long values are none.
const NO_SECRETS: [&str; 2] = ["prompt_cache_key", "tokenizer"];

/// The number of characters from which the value of a field with a telling name is taken for a secret; chosen.
const LONG: usize = 20;

/// Refuses fields that look like secrets, wherever they stand: bodies are written to the manifest and to files of batches.
///
/// # Errors
/// [`Error::Usage`] with the name of the field, without its value.
pub(in crate::ask) fn refuse_secrets(fields: &Map<String, Value>) -> Result<()> {
    fields
        .iter()
        .try_for_each(|(name, value)| refuse_in_field(name, value))
}

fn refuse_in_field(name: &str, value: &Value) -> Result<()> {
    let refused = |name: &str| {
        let problem = format_args!(
            "{name} looks like a secret, which is not shown here and must not be in a body, because bodies are written to files: \
             put it into a variable, and name that with --header-env or --api-key-env"
        );
        Err(Error::usage("--extra-body", problem))
    };
    if is_secret_value(name) {
        return refused("the name of a field");
    }
    match value {
        Value::String(text) if is_secret(name, text) => refused(name),
        Value::Array(items) => items
            .iter()
            .try_for_each(|item| refuse_in_field(name, item)),
        Value::Object(fields) => refuse_secrets(fields),
        _ => Ok(()),
    }
}

/// Whether the text of a field looks like a secret: it begins as a key does, or its field holds nothing else, or has a telling name and
/// a long text of letters and digits.
fn is_secret(name: &str, text: &str) -> bool {
    let letters: String = name
        .chars()
        .filter(char::is_ascii_alphanumeric)
        .collect::<String>()
        .to_lowercase();
    let named = !text.is_empty() && SECRETS.iter().any(|end| letters.ends_with(end));
    let in_key = |c: char| c.is_ascii_alphanumeric() || "-_.+/=:~".contains(c);
    let long = text.len() >= LONG
        && text.chars().all(in_key)
        && text.contains(|c: char| c.is_ascii_digit());
    let tells = is_secret_name(name) && !NO_SECRETS.contains(&name);
    is_secret_value(text) || named || (tells && long)
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn secrets_are_refused_by_field_and_not_shown() {
        let body = |body: &Value| {
            refuse_secrets(body.as_object().unwrap()).map_err(|error| error.to_string())
        };
        for (fields, name) in [
            (json!({"api_key": "sk-0123456789"}), "api_key"),
            (json!({"user": "sk-0123456789"}), "user"),
            (json!({"a": {"b": [{"X-Api-Key": "0123"}]}}), "X-Api-Key"),
            (json!({"a": ["Bearer 0123"]}), "a"),
            (
                json!({"router": {"token": "0123456789abcdef0123"}}),
                "token",
            ),
            (json!({"sk-0123456789": 1}), "the name of a field"),
        ] {
            let error = body(&fields).unwrap_err();
            let expected = format!("--extra-body: {name} looks like a secret");
            assert!(error.starts_with(&expected), "{error}");
            assert!(
                error.contains("--header-env") && !error.contains("0123"),
                "{error}"
            );
        }
        for fields in [
            json!({"prompt_cache_key": "0f8fad5b-d9cb-469f-a165-70867728950e"}),
            json!({"tokenizer": "mistralai/Mistral-7B-Instruct-v0.3"}),
            json!({"eos_token": "<|end_of_text_number_2|>", "token_limit": 10, "api_key": null}),
            json!({"keywords": ["the colour of 20 lamps in the room"]}),
        ] {
            assert!(body(&fields).is_ok(), "{fields}");
        }
    }
}
