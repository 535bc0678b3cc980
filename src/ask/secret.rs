//! What nobody may read: [`Secret`], and [`Scrub`], which takes secrets out of other people's words.

use std::fmt;

use crate::error::{Error, Result};

/// A key that is never printed.
#[derive(Clone, PartialEq, Eq)]
pub struct Secret(String);

impl Secret {
    /// Takes a key without the blanks around it; `origin` is the variable or file it came from, for the error.
    ///
    /// # Errors
    /// Where it is empty or holds anything but visible ASCII, which no HTTP header can carry. The error does not show it.
    pub fn new(text: &str, origin: &str) -> Result<Self> {
        let key = text.trim();
        if key.is_empty() {
            return Err(Error::usage(
                origin,
                "the key is empty; an endpoint without a key needs none set",
            ));
        }
        if !key.bytes().all(|byte| byte.is_ascii_graphic()) {
            return Err(Error::usage(
                origin,
                "the key holds blanks or characters that no HTTP header can carry; it must be one line of visible ASCII",
            ));
        }
        Ok(Self(key.to_owned()))
    }

    /// The key itself.
    pub(super) fn expose(&self) -> &str {
        &self.0
    }
}

impl fmt::Debug for Secret {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Secret(…)")
    }
}

/// How many characters of a server's words are kept.
const KEPT: usize = 300;

/// Shorter secrets are stand-ins like `x` for servers that want any key; taking them out would spoil every word.
const SHORTEST: usize = 4;

/// Shorter secrets are left standing in a model's reply: no real key is, and a word that an answer may need must not be lost.
const SHORTEST_IN_REPLY: usize = 16;

/// Makes the words of a server fit for a terminal, a log and a table: one line, no control characters, no secrets, not long.
#[derive(Clone, Default)]
pub(super) struct Scrub(Vec<String>);

impl Scrub {
    /// A scrub for these secrets.
    pub(super) fn new(secrets: impl IntoIterator<Item = String>) -> Self {
        let mut secrets: Vec<String> = secrets
            .into_iter()
            .filter(|secret| secret.len() >= SHORTEST)
            .collect();
        // The longest first, so that a secret within another one does not leave the rest of it standing.
        secrets.sort_by_key(|secret| std::cmp::Reverse(secret.len()));
        secrets.dedup();
        Self(secrets)
    }

    /// Whether there is anything to hide.
    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// A model's reply as it came, except that a key which it echoes is taken out.
    pub(super) fn reply(&self, text: String) -> String {
        let keys = self.0.iter().filter(|key| key.len() >= SHORTEST_IN_REPLY);
        keys.fold(text, |text, key| {
            if text.contains(key) {
                text.replace(key, "[secret]")
            } else {
                text
            }
        })
    }

    /// The text on one line of at most 300 characters.
    pub(super) fn line(&self, text: &str) -> String {
        let shown: String = text.chars().filter(|c| !is_hidden(*c)).collect();
        let words: Vec<&str> = shown.split_whitespace().collect();
        let mut line = words.join(" ");
        // Cut last: a cut before could leave the first half of a secret.
        for secret in &self.0 {
            line = line.replace(secret, "[secret]");
        }
        match line.char_indices().nth(KEPT) {
            None => line,
            Some((end, _)) => format!("{}…", &line[..end]),
        }
    }
}

/// Controls other than white space, and the marks that turn or hide text.
fn is_hidden(c: char) -> bool {
    (c.is_control() && !c.is_whitespace())
        || matches!(c, '\u{200B}'..='\u{200F}' | '\u{202A}'..='\u{202E}' | '\u{2060}'..='\u{2069}' | '\u{FEFF}')
}

impl fmt::Debug for Scrub {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Scrub({} secrets)", self.0.len())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_checked_and_never_shown() {
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
    fn replies_lose_keys_and_nothing_else() {
        let scrub = Scrub::new(["kitchen".to_owned(), "sk-0123456789abcdef".to_owned()]);
        let reply = "A  kitchen\nsk-0123456789abcdef".to_owned();
        assert_eq!(scrub.reply(reply), "A  kitchen\n[secret]");
    }

    #[test]
    fn secrets_are_taken_out_before_the_cut() {
        let scrub = Scrub::new(["sk-abcdef".to_owned(), "sk-abcdef-long".to_owned()]);
        assert_eq!(
            scrub.line("key \u{1b}[31msk-abc\u{200b}def-long,\r\n\tsk-abcdef"),
            "key [31m[secret], [secret]"
        );
        let long = format!("{}sk-abcdef", "x".repeat(KEPT - 4));
        assert!(!scrub.line(&long).contains("sk-"));
        assert_eq!(scrub.line(&"é".repeat(400)).chars().count(), KEPT + 1);
        assert_eq!(
            Scrub::new(["x".to_owned()]).line("an axe\u{202e}"),
            "an axe"
        );
    }
}
