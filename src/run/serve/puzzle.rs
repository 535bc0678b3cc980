//! A multiple-choice question found in a free text: [`Puzzle`].

use std::sync::LazyLock;

use hyper::StatusCode;
use regex::Regex;

use super::completion::RequestFault;
use crate::types::questions::letter;

/// A question with its choices.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Puzzle {
    pub(super) question: String,
    pub(super) choices: Vec<String>,
}

/// A line with a choice: `A. yes`, `(B) no`, `C: perhaps`.
static CHOICE: LazyLock<Option<Regex>> =
    LazyLock::new(|| Regex::new(r"^\s*[(\[]?([A-Z])[)\].:]+\s*(\S.*?)\s*$").ok());

impl Puzzle {
    /// The last question of a text. The choices are lines with consecutive letters. The question is the last line before
    /// them that ends with a question mark, else the line just before them.
    pub(super) fn read(text: &str) -> Result<Self, RequestFault> {
        let lines: Vec<&str> = text.lines().collect();
        let lettered: Vec<Option<(char, &str)>> = lines.iter().map(|line| choice(line)).collect();
        let first = lettered
            .iter()
            .rposition(|line| matches!(line, Some(('A', _))));
        let none = || {
            let message =
                "no choices in the text; lines like \"A. yes\" and \"B. no\" are expected";
            RequestFault::new(StatusCode::BAD_REQUEST, message)
        };
        let first = first.ok_or_else(none)?;
        let mut choices = Vec::new();
        for line in lettered[first..].iter().flatten() {
            if line.0 == letter(choices.len()) {
                choices.push(line.1.to_owned());
            }
        }
        if choices.len() < 2 {
            return Err(none());
        }
        let mut before = lines[..first]
            .iter()
            .rev()
            .map(|line| line.trim())
            .filter(|line| !line.is_empty());
        let question = before
            .clone()
            .find(|line| line.ends_with('?'))
            .or_else(|| before.next())
            .unwrap_or_default();
        let question = question.strip_prefix("Question:").unwrap_or(question);
        Ok(Self {
            question: question.trim().to_owned(),
            choices,
        })
    }
}

fn choice(line: &str) -> Option<(char, &str)> {
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
            let puzzle = Puzzle::read(text).ok().unwrap();
            assert_eq!(puzzle.question, "Is it dark?", "{text}");
            assert_eq!(puzzle.choices, ["yes", "no"], "{text}");
        }
    }

    #[test]
    fn a_text_without_choices_is_refused() {
        for text in ["", "Hello", "Is it?\nA. yes", "Is it?\nB. no"] {
            assert!(Puzzle::read(text).is_err(), "{text}");
        }
    }
}
