//! API keys that are never printed ([`Secret`]), and removal of keys from text that a server sent ([`Scrub`]).

use std::fmt;
use std::path::Path;

use super::key_form::{is_key_in_place_of_file, is_shell_text};
use super::secret_parts::{MASK, SecretParts};
use crate::error::{Error, Result};
use crate::files::reading;

/// Maximum size of a key file, in bytes. Chosen: twice the longest tokens.
const MAX_FILE: u64 = 4096;

/// An API key that is never printed.
#[derive(Clone, PartialEq, Eq)]
pub struct Secret(String);

impl Secret {
    /// Creates a key from a text, without surrounding white space; `origin` is its variable or file, for errors.
    ///
    /// # Errors
    /// If the key is empty or has characters other than visible ASCII, which an HTTP header cannot carry. The error
    /// does not show the key.
    pub fn new(text: &str, origin: &str) -> Result<Self> {
        let key = text.trim();
        if key.is_empty() {
            return Err(Error::usage(origin, "the key is empty; for an endpoint without keys use --api-key-env none"));
        }
        if !key.bytes().all(|byte| byte.is_ascii_graphic()) {
            return Err(Error::usage(
                origin,
                "the key has spaces or characters that an HTTP header cannot carry; it must be one line of visible ASCII",
            ));
        }
        if is_shell_text(key) {
            return Err(Error::usage(
                origin,
                "the key is in quotation marks, or has NAME= before it; leave only the key itself",
            ));
        }
        Ok(Self(key.to_owned()))
    }

    /// Reads a key from a file.
    ///
    /// # Errors
    /// If the file cannot be read, or is not a single line of visible ASCII, such as a file named by mistake. The error
    /// shows neither its content nor a key in place of the path.
    pub(crate) fn read(path: &Path) -> Result<Self> {
        let bytes = reading::at_most(path, MAX_FILE).map_err(|error| {
            if path.to_str().is_some_and(is_key_in_place_of_file) {
                Error::usage(
                    "--api-key-file",
                    "the name of a file expected; this value looks like a key and is not shown here: write it to a file, and name that file",
                )
            } else {
                error
            }
        })?;
        let origin = format!("--api-key-file {}", path.display());
        let text = String::from_utf8_lossy(&bytes);
        if text.contains("-----BEGIN") {
            let problem = "this is a private key or a certificate, not an API key; nothing of it was sent";
            return Err(Error::usage(origin, problem));
        }
        Self::new(text.trim_start_matches('\u{feff}'), &origin)
    }

    /// The key as plain text, for HTTP headers.
    pub(crate) fn expose(&self) -> &str {
        &self.0
    }
}

impl fmt::Debug for Secret {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Secret(…)")
    }
}

/// Maximum length of a line of server text, in characters; chosen.
const MAX_LINE: usize = 300;

/// Number of bytes of a server text to inspect for such a line; chosen.
const MAX_READ: usize = 64 << 10;

/// Minimum length of a secret to remove, in bytes. Shorter ones are placeholders such as `x` for servers that accept
/// any key; their removal would damage ordinary words.
const MIN_SECRET: usize = 4;

/// Minimum length of a secret to remove from the reply of a model, in bytes. Real keys are longer, and an answer may
/// contain a shorter word.
const MIN_SECRET_IN_REPLY: usize = 16;

/// Filter that makes the text of a server safe for terminals, logs and tables: removes secrets and control characters,
/// and shortens it.
#[derive(Clone, Default)]
pub(crate) struct Scrub {
    /// Secrets, longest first: if one secret contains another, no part of the longer one must remain.
    secrets: Vec<String>,
    /// Parts of the secrets that are long enough for [`MIN_SECRET_IN_REPLY`].
    parts: SecretParts,
}

impl Scrub {
    /// Creates a filter for these secrets.
    pub(crate) fn new(secrets: impl IntoIterator<Item = String>) -> Self {
        let mut secrets: Vec<String> = secrets.into_iter().filter(|secret| secret.len() >= MIN_SECRET).collect();
        secrets.sort_by_key(|secret| std::cmp::Reverse(secret.len()));
        secrets.dedup();
        let parts = SecretParts::new(keys(&secrets));
        Self { secrets, parts }
    }

    /// This filter, which also removes another secret.
    pub(crate) fn with(&self, secret: String) -> Self {
        Self::new(self.secrets.iter().cloned().chain([secret]))
    }

    /// True if there are no secrets to remove.
    pub(crate) fn is_empty(&self) -> bool {
        self.secrets.is_empty()
    }

    /// Removes keys, whole, in parts or in base64, from the reply of a model; the rest is unchanged.
    pub(super) fn reply(&self, text: String) -> String {
        self.parts.masked(self.without_whole_keys(text))
    }

    /// Removes keys from a line of JSON. Each string is filtered alone. Ids of requests in a batch are not searched for
    /// parts of keys.
    pub(crate) fn json_line(&self, line: String) -> String {
        let line = self.without_whole_keys(line);
        let parts: Vec<&str> = line.split('"').collect();
        parts
            .iter()
            .enumerate()
            .map(|(index, part)| {
                let is_id = index >= 2 && parts[index - 2] == "custom_id";
                if is_id { (*part).to_owned() } else { self.parts.masked((*part).to_owned()) }
            })
            .collect::<Vec<_>>()
            .join("\"")
    }

    /// Replaces whole keys, but not parts of them.
    fn without_whole_keys(&self, text: String) -> String {
        keys(&self.secrets).fold(text, |text, key| if text.contains(key) { text.replace(key, MASK) } else { text })
    }

    /// Puts a text on one line of at most 300 characters, without secrets and hidden characters.
    pub(crate) fn line(&self, text: &str) -> String {
        let text = &text[..text.floor_char_boundary(MAX_READ)];
        let visible: String = text.chars().filter(|c| !is_hidden(*c)).collect();
        let words: Vec<&str> = visible.split_whitespace().collect();
        let mut line = words.join(" ");
        // Shorten last: otherwise the first half of a secret could remain.
        for secret in &self.secrets {
            line = line.replace(secret, MASK);
        }
        let line = self.parts.masked(line);
        match line.char_indices().nth(MAX_LINE) {
            None => line,
            Some((end, _)) => format!("{}…", &line[..end]),
        }
    }
}

/// Secrets that are long enough to remove from replies.
fn keys(secrets: &[String]) -> impl Iterator<Item = &str> {
    secrets.iter().map(String::as_str).filter(|secret| secret.len() >= MIN_SECRET_IN_REPLY)
}

/// True for control characters other than white space, and for characters that reverse or hide text.
fn is_hidden(c: char) -> bool {
    (c.is_control() && !c.is_whitespace())
        || matches!(c, '\u{200B}'..='\u{200F}' | '\u{202A}'..='\u{202E}' | '\u{2060}'..='\u{2069}' | '\u{FEFF}')
}

impl fmt::Debug for Scrub {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Scrub({} secrets)", self.secrets.len())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn invalid_keys_are_refused_and_not_shown() {
        let key = Secret::new(" sk-abc\n", "KEY").unwrap();
        assert_eq!(key.expose(), "sk-abc");
        assert!(!format!("{key:?}").contains("abc"));
        for wrong in ["", " \n", "sk-a b", "sk-\u{7f}", "sk-é", "sk\nab"] {
            let error = Secret::new(wrong, "KEY").unwrap_err().to_string();
            assert!(error.starts_with("KEY: "), "{error}");
            assert!(!error.contains("sk-"), "{error}");
        }
    }

    #[test]
    fn keys_in_shell_syntax_are_refused() {
        for wrong in ["\"sk-abc\"", "'sk-abc'", "OPENAI_API_KEY=sk-abc"] {
            let error = Secret::new(wrong, "KEY").unwrap_err().to_string();
            assert!(error.contains("leave only the key itself"), "{error}");
            assert!(!error.contains("sk-"), "{error}");
        }
        for right in ["c2VjcmV0LWtleQ==", "AB_C==", "a=b", "\"", "it's"] {
            assert_eq!(Secret::new(right, "KEY").unwrap().expose(), right);
        }
    }

    #[test]
    fn a_key_in_place_of_its_file_is_not_shown() {
        for key in ["sk-proj-0123", "0123456789abcdef0123456789abcdef"] {
            let error = Secret::read(Path::new(key)).unwrap_err().to_string();
            assert!(error.contains("the name of a file expected"), "{error}");
            assert!(!error.contains(key), "{error}");
        }
        for file in ["nowhere", "nowhere/key-of-the-vision-team-2026.txt"] {
            let error = Secret::read(Path::new(file)).unwrap_err().to_string();
            assert!(error.contains(file), "{error}");
        }
    }

    fn read_text(path: &std::path::Path, text: &[u8]) -> Result<Secret, String> {
        std::fs::write(path, text).unwrap();
        Secret::read(path).map_err(|e| e.to_string())
    }

    #[test]
    fn files_without_a_key_are_refused() {
        let file = tempfile::NamedTempFile::new().unwrap();
        for right in [&b"sk-abc\n"[..], b"\xef\xbb\xbfsk-abc\r\n"] {
            assert_eq!(read_text(file.path(), right).unwrap().expose(), "sk-abc");
        }
        for wrong in [
            &b"sk-abc\nsk-def\n"[..],
            b"-----BEGIN OPENSSH PRIVATE KEY-----\nabc\n",
            b"-----BEGIN-abc",
            &[b'a'; 4097],
            b"sk-\xff",
        ] {
            let error = read_text(file.path(), wrong).unwrap_err();
            assert!(error.contains(&*file.path().to_string_lossy()), "{error}");
            assert!(!["sk-", "abc", "aaa"].iter().any(|part| error.contains(part)), "{error}");
        }
    }

    #[test]
    fn only_keys_are_removed_from_replies() {
        let scrub = Scrub::new(["kitchen".to_owned(), "sk-0123456789abcdef".to_owned()]);
        let reply = "A  kitchen\nsk-0123456789abcdef".to_owned();
        assert_eq!(scrub.reply(reply), "A  kitchen\n[secret]");
    }

    #[test]
    fn secrets_are_removed_before_shortening() {
        let scrub = Scrub::new(["sk-abcdef".to_owned(), "sk-abcdef-long".to_owned()]);
        assert_eq!(scrub.line("key \u{1b}[31msk-abc\u{200b}def-long,\r\n\tsk-abcdef"), "key [31m[secret], [secret]");
        let long = format!("{}sk-abcdef", "x".repeat(MAX_LINE - 4));
        assert!(!scrub.line(&long).contains("sk-"));
        assert_eq!(scrub.line(&"é".repeat(400)).chars().count(), MAX_LINE + 1);
        assert_eq!(Scrub::new(["x".to_owned()]).line("an axe\u{202e}"), "an axe");
    }
}
