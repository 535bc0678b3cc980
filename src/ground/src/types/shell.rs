//! Texts as words of a command that is printed: [`shell_word`].

use std::borrow::Cow;

/// A text as one word of a POSIX shell: in single quotes, if a shell would split it or find a meaning in it.
pub fn shell_word(text: &str) -> Cow<'_, str> {
    if !text.is_empty()
        && text
            .chars()
            .all(|c: char| c.is_alphanumeric() || "-_./:=,@%+".contains(c))
    {
        return Cow::Borrowed(text);
    }
    Cow::Owned(format!("'{}'", text.replace('\'', "'\\''")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_shell_would_change_stands_in_quotes() {
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
    fn a_shell_reads_the_text_back() {
        for text in ["a b", "it's", "$(id) `id` \\ \"x\"", "a\nb", "*?[!]#&;|<>"] {
            let command = format!("printf %s {}", shell_word(text));
            let mut shell = std::process::Command::new("sh");
            let said = shell.args(["-c", &command]).output().unwrap();
            assert_eq!(said.stdout, text.as_bytes(), "{text:?}");
        }
    }
}
