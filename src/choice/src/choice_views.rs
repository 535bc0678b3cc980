//! The choices of a question as they occur in plain text: [`ChoiceViews`].

use std::collections::HashMap;

use super::text::words::Role;
use super::text::{Clauses, clean, fold, plain, tokens};
use darkqa_ground::types::questions::Choices;

/// Kind of thing that a choice names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Naming {
    /// A thing or a room. "Table lamp" is no table.
    Thing,
    /// A place, a number, yes or no, which stands before a noun: "on the left side".
    Attribute,
    /// A color or a brightness, which may be the image's own.
    Color,
}

/// The choices as they occur in plain text.
pub(super) struct ChoiceViews {
    /// Texts of the choices without markup.
    pub(super) texts: Vec<String>,
    /// The same texts in lower case without a final period, longest first, each with the index of its choice.
    pub(super) folded: Vec<(String, usize)>,
    /// The choices of letters and blanks alone, by their letters without blanks.
    pub(super) joined: HashMap<String, Vec<usize>>,
    /// Kind of thing that each choice names.
    pub(super) naming: Vec<Naming>,
    /// Indices of "yes" and "no", if both are choices.
    pub(super) yes_no: Option<(usize, usize)>,
}

/// Minimum number of letters of a choice that is also compared without blanks.
const MIN_JOINED: usize = 6;

impl ChoiceViews {
    pub(super) fn new(choices: &Choices) -> Self {
        let texts: Vec<String> = choices
            .texts()
            .iter()
            .map(|text| plain(&clean::tidy(text)))
            .collect();
        let mut folded: Vec<(String, usize)> = texts
            .iter()
            .map(|text| fold(text.strip_suffix('.').unwrap_or(text)))
            .enumerate()
            .map(|(index, text)| (text, index))
            .collect();
        let naming = folded.iter().map(|(text, _)| naming(text)).collect();
        folded.retain(|(text, _)| !text.is_empty());
        let position = |word: &str| {
            folded
                .iter()
                .find(|(text, _)| text == word)
                .map(|(_, index)| *index)
        };
        let yes_no = position("yes").zip(position("no"));
        let mut joined = HashMap::<String, Vec<usize>>::new();
        for (text, index) in &folded {
            let letters: String = text.split(' ').collect();
            if letters.len() >= MIN_JOINED && letters.chars().all(char::is_alphabetic) {
                joined.entry(letters).or_default().push(*index);
            }
        }
        folded.sort_by_key(|(text, index)| (std::cmp::Reverse(text.len()), *index));
        Self {
            texts,
            folded,
            joined,
            naming,
            yes_no,
        }
    }
}

/// Classifies a choice by its words: an attribute or a color if it has only words of that class, else a thing.
fn naming(folded: &str) -> Naming {
    let words = Clauses::new(folded, &tokens(folded)).elements;
    let all = |kinds: &[Role]| words.iter().all(|word| word.roles.has_any(kinds));
    let is_number = words
        .iter()
        .all(|word| word.slice(folded).chars().all(char::is_numeric));
    if !words.is_empty() && all(&[Role::Color, Role::Shade]) {
        Naming::Color
    } else if is_number || all(&[Role::Place, Role::Number]) || matches!(folded, "yes" | "no") {
        Naming::Attribute
    } else {
        Naming::Thing
    }
}
