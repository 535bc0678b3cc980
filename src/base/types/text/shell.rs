//! Shell quoting for printed commands: [`shell_word`].

use std::borrow::Cow;

/// Quotes a text as one word of a POSIX shell.
///
/// Single quotes are added to an empty text and to one with a character that is neither alphanumeric nor in
/// `-_./:=,@%+`.
pub fn shell_word(text: &str) -> Cow<'_, str> {
    if !text.is_empty() && text.chars().all(|c: char| c.is_alphanumeric() || "-_./:=,@%+".contains(c)) {
        return Cow::Borrowed(text);
    }
    Cow::Owned(format!("'{}'", text.replace('\'', "'\\''")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quotes_only_where_needed() {
        for plain in ["set/a-1.png", "C:/x", "options=A,B:index0", "été"] {
            assert_eq!(shell_word(plain), plain);
        }
        for (text, word) in [
            ("", "''"),
            ("a b", "'a b'"),
            ("it's", "'it'\\''s'"),
            ("$HOME", "'$HOME'"),
            ("a(1)", "'a(1)'"),
            ("{id}.jpg", "'{id}.jpg'"),
            ("~x", "'~x'"),
        ] {
            assert_eq!(shell_word(text), word);
        }
    }

    #[cfg(unix)]
    #[test]
    fn sh_reads_the_original_text_back() {
        for text in ["a b", "it's", "$(id) `id` \\ \"x\"", "a\nb", "*?[!]#&;|<>"] {
            let command = format!("printf %s {}", shell_word(text));
            let mut shell = std::process::Command::new("sh");
            let output = shell.args(["-c", &command]).output().unwrap();
            assert_eq!(output.stdout, text.as_bytes(), "{text:?}");
        }
    }
}
