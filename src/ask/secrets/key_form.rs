//! Recognition of text that looks like a secret: [`looks_like_key`], [`is_secret_value`], [`is_secret_name`].

/// Prefixes of the keys of common vendors.
const KEY_PREFIXES: [&str; 6] = ["sk-", "AIza", "gsk_", "xai-", "hf_", "Bearer "];

/// Minimum length at which a mixture of letters and digits counts as a key; chosen.
const MIN_LENGTH: usize = 20;

/// True if a text that should be the name of a variable looks like a key: it has the prefix of a key, a character that variable names do
/// not have, or is a long mixture of letters and digits without an underscore.
pub(crate) fn looks_like_key(name: &str) -> bool {
    let is_variable_name = name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
    let is_long_mixture = name.len() >= MIN_LENGTH
        && !name.contains('_')
        && name.contains(|c: char| c.is_ascii_digit());
    is_secret_value(name) || !is_variable_name || is_long_mixture
}

/// True if a value has the prefix of a key.
pub(crate) fn is_secret_value(value: &str) -> bool {
    KEY_PREFIXES
        .iter()
        .any(|prefix| value.starts_with(prefix) && value.len() > prefix.len())
}

/// True if a header or field of this name usually contains a secret.
pub(crate) fn is_secret_name(name: &str) -> bool {
    let name = name.to_lowercase();
    ["auth", "key", "token", "secret", "cookie"]
        .iter()
        .any(|word| name.contains(word))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_differ_from_variable_names() {
        for name in ["OPENAI_API_KEY", "HF_TOKEN", "none", "key", "my_key_2", "K"] {
            assert!(!looks_like_key(name), "{name}");
        }
        for key in [
            "sk-proj-1",
            "AIzaSy123",
            "gsk_abc",
            "xai-abc",
            "a b",
            "0123456789abcdef0123456789abcdef",
            "a.b",
        ] {
            assert!(looks_like_key(key), "{key}");
        }
    }
}
