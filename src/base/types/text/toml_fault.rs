//! [`TomlFault`]: a TOML syntax or type error, worded for messages.

use super::near_name::suggestion;

/// The line and the description of an error in a TOML text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TomlFault {
    /// The line, from 1.
    pub line: usize,
    /// The description on one line; for an unknown key with the most similar known key.
    pub problem: String,
}

impl TomlFault {
    /// Describes the parser's error about a text.
    pub fn new(text: &str, error: &toml::de::Error) -> Self {
        let message: Vec<&str> = error.message().lines().map(str::trim).collect();
        Self {
            line: line_at(text, error.span().map_or(0, |span| span.start)),
            problem: message.join(", ") + &suggested_key(error.message()) + quoting_hint(error.message()),
        }
    }
}

/// The line, from 1, of a byte offset in a text.
pub fn line_at(text: &str, start: usize) -> usize {
    text.get(..start).unwrap_or_default().matches('\n').count() + 1
}

/// Suggestion of the most similar known key if the message is about an unknown one; otherwise empty.
fn suggested_key(message: &str) -> String {
    let names: Vec<&str> = message.split('`').skip(1).step_by(2).collect();
    match &*names {
        [unknown, known @ ..] if message.starts_with("unknown field") => suggestion(unknown, known),
        _ => String::new(),
    }
}

/// Hint to quote a text that the parser tried to read as a number or a date; empty for other errors, which need no
/// hint.
fn quoting_hint(message: &str) -> &'static str {
    let is_number =
        ["invalid fraction", "invalid float", "invalid integer"].iter().any(|problem| message.starts_with(problem));
    let is_date = message.starts_with("invalid type: map, expected a string");
    if is_number || is_date { "; a text stands in quotes" } else { "" }
}

#[cfg(test)]
mod tests {
    use serde::Deserialize;

    use super::*;

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Known {
        #[expect(dead_code)]
        range_in: Option<String>,
        #[expect(dead_code)]
        multiple: Option<u32>,
    }

    #[test]
    fn faults_have_a_line_and_a_hint() {
        for (text, line, part) in [
            ("\nrange = \"0..1\"", 2, "; did you mean range_in?"),
            ("range_in = 0..1", 1, "; a text stands in quotes"),
            ("multiple = 2\nrange_in = nchw", 2, "; a text stands in quotes"),
            ("range_in = 2024-01-01", 1, "; a text stands in quotes"),
        ] {
            let fault = TomlFault::new(text, &toml::from_str::<Known>(text).unwrap_err());
            assert_eq!(fault.line, line, "{fault:?}");
            assert!(fault.problem.ends_with(part), "{fault:?}");
            assert!(!fault.problem.contains('\n'), "{fault:?}");
        }
        for text in [
            "multiple = \"2\"",
            "zoom = 1 # far",
            "multiple = true",
            "multiple = 1_0.5",
            "range_in = [1]",
            "multiple = True",
            "range_in = gpt-4o",
            "range_in = \"a\" \"b=c\"",
            "range_in == \"a\"",
            "\"a=b\" = 3 4",
            "zoom = 2024-01-01",
        ] {
            let fault = TomlFault::new(text, &toml::from_str::<Known>(text).unwrap_err());
            assert!(!fault.problem.contains(';'), "{fault:?}");
        }
    }
}
