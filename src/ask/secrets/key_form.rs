//! Recognises text that looks like a secret: [`looks_like_key`], [`is_secret_value`], [`is_secret_name`].

/// How keys of common vendors begin.
const BEGINNINGS: [&str; 6] = ["sk-", "AIza", "gsk_", "xai-", "hf_", "Bearer "];

/// The number of characters from which a mixture of letters and digits is taken for a key; chosen.
const LONG: usize = 20;

/// Whether a text that should be the name of a variable looks like a key: it begins as one, has a character that no name of a
/// variable has, or is a long mixture of letters and digits without an underscore.
pub(crate) fn looks_like_key(name: &str) -> bool {
    let is_name = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let mixed =
        name.len() >= LONG && !name.contains('_') && name.contains(|c: char| c.is_ascii_digit());
    is_secret_value(name) || !name.chars().all(is_name) || mixed
}

/// Whether a value begins as a key does.
pub(crate) fn is_secret_value(value: &str) -> bool {
    BEGINNINGS
        .iter()
        .any(|begin| value.starts_with(begin) && value.len() > begin.len())
}

/// Whether a header of this name usually holds a secret.
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
    fn keys_are_told_from_names_of_variables() {
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
