//! Recognition of private keys and service accounts, in plain text and in base64: [`is_private_key`].

use base64::Engine as _;
use base64::alphabet::{STANDARD, URL_SAFE};
use base64::engine::DecodePaddingMode;
use base64::engine::general_purpose::{GeneralPurpose, GeneralPurposeConfig};
use serde_json::Value;

/// Texts that only files with private keys have: PEM of any kind, PGP, PuTTY, and age.
const MARKS: [&str; 4] = ["PRIVATE KEY-----", "PRIVATE KEY BLOCK-----", "PuTTY-User-Key-File", "AGE-SECRET-KEY-"];

/// Maximum length of a text that is decoded from base64, in bytes (chosen). The largest private keys in use have 13 kB.
const MAX_ENCODED: usize = 64 << 10;

/// True if a text contains a private key or a service account, or if it is one of them in base64.
pub(super) fn is_private_key(text: &str) -> bool {
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

#[cfg(test)]
mod tests {
    use base64::engine::general_purpose::STANDARD as BASE64;
    use serde_json::json;

    use super::*;

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
