//! Recognition of text that looks like a secret: [`looks_like_key`], [`is_secret_value`], [`is_secret_name`],
//! [`is_secret_header`].
//!
//! Recognition of private keys and service accounts, in plain text and in base64: [`is_private_key`].
//!
//! The header that carries a key: [`KeyHeader`].

use base64::Engine as _;
use base64::alphabet::{STANDARD, URL_SAFE};
use base64::engine::DecodePaddingMode;
use base64::engine::general_purpose::{GeneralPurpose, GeneralPurposeConfig};
use clap::ValueEnum;
use serde_json::Value;

use darkqa_base::types::flags::flag_words;

/// Prefixes of the keys of common vendors.
const KEY_PREFIXES: [&str; 6] = ["sk-", "AIza", "gsk_", "xai-", "hf_", "Bearer "];

/// Minimum length at which a mixture of letters and digits counts as a key; chosen.
const MIN_LENGTH: usize = 20;

/// True if a text that should be the name of a variable looks like a key: it has the prefix of a key, a character that
/// variable names do not have, or is a long mixture of letters and digits without an underscore.
pub fn looks_like_key(name: &str) -> bool {
    let is_variable_name = name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
    is_secret_value(name) || !is_variable_name || is_long_mixture(name)
}

/// True if the path of a missing file looks like a key: it has the prefix of a key, or is a long mixture of letters and
/// digits without separators.
pub(super) fn is_key_in_place_of_file(path: &str) -> bool {
    is_secret_value(path) || !path.contains(['/', '\\', '.', ' ']) && is_long_mixture(path)
}

fn is_long_mixture(text: &str) -> bool {
    text.len() >= MIN_LENGTH && !text.contains('_') && text.contains(|c: char| c.is_ascii_digit())
}

/// True if a key is written as in a shell or a `.env` file: in quotation marks, or after the name of a variable.
pub(super) fn is_shell_text(key: &str) -> bool {
    let is_quoted = ['"', '\''].iter().any(|quote| key.len() > 1 && key.starts_with(*quote) && key.ends_with(*quote));
    let is_assigned = key.split_once('=').is_some_and(|(name, value)| {
        let is_name = name.bytes().all(|byte| byte.is_ascii_uppercase() || byte == b'_');
        is_name && name.contains('_') && !value.trim_matches('=').is_empty()
    });
    is_quoted || is_assigned
}

/// True if a value has the form of a secret: the prefix of a key, a private key, a service account or a token with a
/// signature.
pub fn is_secret_value(value: &str) -> bool {
    KEY_PREFIXES.iter().any(|prefix| value.starts_with(prefix) && value.len() > prefix.len())
        || is_private_key(value)
        || is_web_token(value)
}

/// True for a JSON Web Token: three parts in base64, of which the first begins with `{"`.
fn is_web_token(value: &str) -> bool {
    let parts: Vec<&str> = value.split('.').collect();
    let is_base64 = |part: &&str| {
        part.len() >= MIN_LENGTH && part.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"-_".contains(&byte))
    };
    parts.len() == 3 && value.starts_with("eyJ") && parts.iter().all(is_base64)
}

/// Words of names whose values are secrets, in lower case and without a plural.
const SECRET_WORDS: [&str; 11] = [
    "auth",
    "authentication",
    "authorization",
    "bearer",
    "cookie",
    "credential",
    "jwt",
    "key",
    "password",
    "secret",
    "token",
];

/// Words before `key` in names of keys that are no secrets: `Idempotency-Key`, `prompt_cache_key`.
const PLAIN_KEYS: [&str; 6] = ["affinity", "cache", "idempotency", "partition", "public", "routing"];

/// Words that are written in one with `key`: `apikey`.
const BEFORE_KEY: [&str; 9] =
    ["access", "account", "api", "auth", "client", "license", "private", "secret", "subscription"];

/// True if a header or field of this name usually contains a secret: one of its words says so. A word that only
/// contains such a word is another one: `x-portkey-trace-id`, `X-Author`, `tokenizer`.
pub(super) fn is_secret_name(name: &str) -> bool {
    let words = name_words(name);
    words.iter().enumerate().any(|(place, word)| {
        let word = word.strip_suffix('s').unwrap_or(word);
        let before = place.checked_sub(1).map(|place| words[place].as_str());
        let is_plain_key = word == "key" && before.is_some_and(|word| PLAIN_KEYS.contains(&word));
        let is_compound =
            word.strip_suffix("key").is_some_and(|before| BEFORE_KEY.iter().any(|known| before.ends_with(known)))
                || ["token", "secret", "password", "passwd", "cookie"].iter().any(|end| word.ends_with(end));
        !is_plain_key && (SECRET_WORDS.contains(&word) || is_compound)
    })
}

/// True if the value of a header is a secret: by its form, or by the name and a length of at least [`MIN_LENGTH`]. A
/// name whose last word only ends with `key` (`x-mykey`) counts if the value is one long mixture of letters and digits.
pub fn is_secret_header(name: &str, value: &str) -> bool {
    let ends_like_key = name.to_lowercase().ends_with("key");
    is_secret_value(value)
        || value.len() >= MIN_LENGTH && (is_secret_name(name) || ends_like_key && is_random_text(value))
}

/// True for a text of letters and digits without separators, with both: the form of most keys, but not of addresses,
/// JSON, ids with hyphens and names.
fn is_random_text(text: &str) -> bool {
    text.bytes().all(|byte| byte.is_ascii_alphanumeric())
        && text.bytes().any(|byte| byte.is_ascii_digit())
        && text.bytes().any(|byte| byte.is_ascii_alphabetic())
}

/// The words of a name in lower case: `X-ApiKey` and `x_api_key` have the words `x`, `api` and `key`.
fn name_words(name: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    let mut before = ' ';
    for letter in name.chars() {
        let begins =
            !letter.is_alphanumeric() || letter.is_uppercase() && (before.is_lowercase() || before.is_ascii_digit());
        if begins {
            words.push(String::new());
        }
        if let Some(word) = words.last_mut().filter(|_| letter.is_alphanumeric()) {
            word.extend(letter.to_lowercase());
        }
        before = letter;
    }
    words.retain(|word| !word.is_empty());
    words
}

/// Texts that only files with private keys have: PEM of any kind, PGP, PuTTY, and age.
const MARKS: [&str; 4] = ["PRIVATE KEY-----", "PRIVATE KEY BLOCK-----", "PuTTY-User-Key-File", "AGE-SECRET-KEY-"];

/// Maximum length of a text that is decoded from base64, in bytes (chosen). The largest private keys in use have 13 kB.
const MAX_ENCODED: usize = 64 << 10;

/// True if a text contains a private key or a service account, or if it is one of them in base64.
fn is_private_key(text: &str) -> bool {
    has_mark(text) || decode(text).is_some_and(|decoded| has_mark(&decoded))
}

/// True for JSON of a private key (JWK) or of a service account. Its fields tell them: `kty` with `d` or `k`, `type`
/// with the text `service_account`.
pub(super) fn is_key_object(fields: &serde_json::Map<String, Value>) -> bool {
    let has = |name: &str| fields.get(name).is_some_and(Value::is_string);
    let is_account = fields.get("type").and_then(Value::as_str) == Some("service_account");
    is_account || has("kty") && (has("d") || has("k"))
}

fn has_mark(text: &str) -> bool {
    let is_object = text.trim_start().starts_with('{')
        && serde_json::from_str::<Value>(text).is_ok_and(|value| value.as_object().is_some_and(is_key_object));
    is_object || MARKS.iter().any(|mark| text.contains(mark))
}

/// The text that is encoded in base64; `None` if it is not.
fn decode(text: &str) -> Option<String> {
    if text.len() > MAX_ENCODED {
        return None;
    }
    let letters: String = text.split_whitespace().collect();
    let config = GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent);
    [STANDARD, URL_SAFE].iter().find_map(|alphabet| {
        let bytes = GeneralPurpose::new(alphabet, config).decode(&letters).ok()?;
        String::from_utf8(bytes).ok()
    })
}

/// The header that carries a key.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum KeyHeader {
    /// `api-key` at Azure, `Authorization` elsewhere.
    #[default]
    Auto,
    /// `Authorization: Bearer …`; at Azure for tokens of Microsoft Entra.
    Bearer,
    /// `api-key: …`, as Azure and gateways before it require it.
    ApiKey,
}

flag_words!(KeyHeader);

#[cfg(test)]
mod tests {
    use base64::engine::general_purpose::STANDARD as BASE64;
    use serde_json::json;

    use super::*;

    #[test]
    fn keys_differ_from_variable_names() {
        for name in ["OPENAI_API_KEY", "HF_TOKEN", "none", "key", "my_key_2", "K"] {
            assert!(!looks_like_key(name), "{name}");
        }
        for key in ["sk-proj-1", "AIzaSy123", "gsk_abc", "xai-abc", "a b", "0123456789abcdef0123456789abcdef", "a.b"] {
            assert!(looks_like_key(key), "{key}");
        }
    }

    #[test]
    fn names_are_judged_by_their_words() {
        for secret in [
            "x-api-key",
            "Authorization",
            "Proxy-Authorization",
            "x-portkey-api-key",
            "X-ApiKey",
            "apikey",
            "x-goog-api-key",
            "Ocp-Apim-Subscription-Key",
            "X-Auth-Token",
            "accessToken",
            "authtoken",
            "cf-access-client-secret",
            "Set-Cookie",
            "api_keys",
        ] {
            assert!(is_secret_name(secret), "{secret}");
        }
        for plain in [
            "x-portkey-custom-host",
            "x-monkey",
            "X-Author",
            "tokenizer",
            "keywords",
            "Idempotency-Key",
            "prompt_cache_key",
            "x-keyboard-layout",
            "secretary",
        ] {
            assert!(!is_secret_name(plain), "{plain}");
        }
    }

    #[test]
    fn headers_are_judged_by_name_and_value() {
        let random = "9f86d081884c7d659a2feaa0c55ad015";
        for (name, value) in [
            ("x-api-key", random),
            ("x-mykey", random),
            ("x-portkey-trace-id", "Bearer abcdefgh"),
            ("X-Team", "sk-0123456789"),
        ] {
            assert!(is_secret_header(name, value), "{name}: {value}");
        }
        for (name, value) in [
            ("x-portkey-custom-host", "http://127.0.0.1:8811/v1"),
            ("x-portkey-config", r#"{"retry":{"attempts":3}}"#),
            ("x-portkey-trace-id", "3b241101-e2bb-4255-8caf-4136c566a962"),
            ("x-portkey-cache-namespace", "night-run-2026-11-experiment"),
            ("Idempotency-Key", "3b241101-e2bb-4255-8caf-4136c566a962"),
            ("x-portkey-trace-id", random),
            ("x-api-key", "none"),
            ("X-Team", random),
        ] {
            assert!(!is_secret_header(name, value), "{name}: {value}");
        }
    }

    #[test]
    fn web_tokens_are_secrets() {
        let part = "eyJhbGciOiJIUzI1NiIsInR5cCI6IkpXVCJ9";
        assert!(is_secret_value(&format!("{part}.{part}.{part}")));
        assert!(!is_secret_value(&format!("{part}.{part}")));
        assert!(!is_secret_value("eyJ.a.b"));
    }

    const PEM: &str = "-----BEGIN RSA PRIVATE KEY-----\nMIIEow==\n-----END RSA PRIVATE KEY-----\n";

    #[test]
    fn private_keys_are_recognised() {
        let account = json!({"type": "service_account", "client_email": "a@b"}).to_string();
        let web_key = json!({"kty": "RSA", "n": "x", "d": "y"}).to_string();
        for key in [PEM, "PuTTY-User-Key-File-3: x", &account, &web_key] {
            assert!(is_private_key(key), "{key}");
            assert!(is_private_key(&BASE64.encode(key)), "{key}");
        }
        assert!(is_private_key(&format!("key: {PEM}")));
    }

    #[test]
    fn other_texts_are_no_private_keys() {
        let certificate = PEM.replace("RSA PRIVATE KEY", "CERTIFICATE");
        let public = json!({"kty": "RSA", "n": "x"}).to_string();
        for text in [&certificate, &public, "{}", "", "the private key of a room"] {
            assert!(!is_private_key(text), "{text}");
            assert!(!is_private_key(&BASE64.encode(text)), "{text}");
        }
    }
}
