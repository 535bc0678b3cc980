//! Parses a multiple-choice question in free text: [`ParsedQuestion`].

use std::sync::LazyLock;

use hyper::StatusCode;
use regex::Regex;

use super::completion::RequestFault;
use crate::types::questions::letter;

/// A question with its choices, without their letters.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct ParsedQuestion {
    pub(super) question: String,
    pub(super) choices: Vec<String>,
}

/// A line with a choice: `A. yes`, `(B) no`, `C: perhaps`.
static CHOICE: LazyLock<Option<Regex>> = LazyLock::new(|| Regex::new(r"^\s*[(\[]?([A-Z])[)\].:]+\s*(\S.*?)\s*$").ok());

impl ParsedQuestion {
    /// Parses the last question of a text. The choices are lines with consecutive letters. The question is the last
    /// line before them that ends with a question mark, or else the line directly before them.
    ///
    /// # Errors
    /// 400 if the text has fewer than two choices.
    pub(super) fn parse(text: &str) -> Result<Self, RequestFault> {
        let lines: Vec<&str> = text.lines().collect();
        let parsed: Vec<Option<(char, &str)>> = lines.iter().map(|line| parse_choice(line)).collect();
        let first = parsed.iter().rposition(|line| matches!(line, Some(('A', _)))).ok_or_else(no_choices)?;
        let mut choices = Vec::new();
        for (own_letter, text) in parsed[first..].iter().flatten() {
            if *own_letter == letter(choices.len()) {
                choices.push((*text).to_owned());
            }
        }
        if choices.len() < 2 {
            return Err(no_choices());
        }
        let mut before = lines[..first].iter().rev().map(|line| line.trim()).filter(|line| !line.is_empty());
        let question = before.clone().find(|line| line.ends_with('?')).or_else(|| before.next()).unwrap_or_default();
        let question = question.strip_prefix("Question:").unwrap_or(question);
        Ok(Self { question: question.trim().to_owned(), choices })
    }
}

fn no_choices() -> RequestFault {
    let message = "no choices in the text; lines like \"A. yes\" and \"B. no\" are expected";
    RequestFault::new(StatusCode::BAD_REQUEST, message)
}

/// The letter and the text of a choice; `None` if the line is not a choice.
fn parse_choice(line: &str) -> Option<(char, &str)> {
    let found = CHOICE.as_ref()?.captures(line)?;
    let letter = found.get(1)?.as_str().chars().next()?;
    Some((letter, found.get(2)?.as_str()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn choices_are_read_however_they_are_lettered() {
        for text in [
            "Is it dark?\nA. yes\nB. no\nAnswer with the letter.",
            "You are a helpful assistant.\nQuestion: Is it dark?\n\nOptions:\n(A) yes\n(B) no\n",
            "Is it dark?\n A: yes \n B: no\nThe best answer is:",
            "Was it?\nA. no\nB. yes\nIs it dark?\nA) yes\nB) no",
        ] {
            let parsed = ParsedQuestion::parse(text).ok().unwrap();
            assert_eq!(parsed.question, "Is it dark?", "{text}");
            assert_eq!(parsed.choices, ["yes", "no"], "{text}");
        }
    }

    #[test]
    fn a_text_without_choices_is_refused() {
        for text in ["", "Hello", "Is it?\nA. yes", "Is it?\nB. no"] {
            assert!(ParsedQuestion::parse(text).is_err(), "{text}");
        }
    }
}
