//! Recognition of text that looks like a secret: [`looks_like_key`], [`is_secret_value`], [`is_secret_name`].

/// Prefixes of the keys of common vendors.
const KEY_PREFIXES: [&str; 6] = ["sk-", "AIza", "gsk_", "xai-", "hf_", "Bearer "];

/// Minimum length at which a mixture of letters and digits counts as a key; chosen.
const MIN_LENGTH: usize = 20;

/// True if a text that should be the name of a variable looks like a key: it has the prefix of a key, a character that variable names do
/// not have, or is a long mixture of letters and digits without an underscore.
pub(crate) fn looks_like_key(name: &str) -> bool {
    let is_variable_name = name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
    is_secret_value(name) || !is_variable_name || is_long_mixture(name)
}

/// True if the path of a missing file looks like a key: it has the prefix of a key, or is a long mixture of letters and digits without
/// separators.
pub(super) fn is_key_in_place_of_file(path: &str) -> bool {
    is_secret_value(path) || !path.contains(['/', '\\', '.', ' ']) && is_long_mixture(path)
}

fn is_long_mixture(text: &str) -> bool {
    text.len() >= MIN_LENGTH && !text.contains('_') && text.contains(|c: char| c.is_ascii_digit())
}

/// True if a key is written as in a shell or a `.env` file: in quotation marks, or after the name of a variable.
pub(super) fn is_shell_text(key: &str) -> bool {
    let is_quoted = ['"', '\'']
        .iter()
        .any(|quote| key.len() > 1 && key.starts_with(*quote) && key.ends_with(*quote));
    let is_assigned = key.split_once('=').is_some_and(|(name, value)| {
        let is_name = name
            .bytes()
            .all(|byte| byte.is_ascii_uppercase() || byte == b'_');
        is_name && name.contains('_') && !value.trim_matches('=').is_empty()
    });
    is_quoted || is_assigned
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
