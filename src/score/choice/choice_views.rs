//! [`ChoiceViews`]: the choices of a question, prepared for search in plain text.

use std::collections::HashMap;

use super::text::{Clauses, fold, tokens};
use crate::choice::text::plain;
use crate::choice::text::tokens::Role;
use darkqa_base::types::questions::Choices;

/// Kind of thing that a choice names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Naming {
    /// A thing or a room. "Table lamp" does not name a table.
    Thing,
    /// A place, a number, yes or no. A noun may follow: "on the left side".
    Attribute,
    /// A color or a brightness, which may describe the image.
    Color,
}

/// The choices of a question in the forms in which a reply may contain them.
pub(super) struct ChoiceViews {
    /// Texts of the choices without markup.
    pub(super) texts: Vec<String>,
    /// The same texts in lower case without a final period, longest first, each with the index of its choice.
    pub(super) folded: Vec<(String, usize)>,
    /// Indices of the choices that consist of letters and spaces, by their letters without spaces.
    pub(super) joined: HashMap<String, Vec<usize>>,
    /// Kind of thing that each choice names.
    pub(super) naming: Vec<Naming>,
    /// Indices of "yes" and "no", if both are choices.
    pub(super) yes_no: Option<(usize, usize)>,
}

/// Minimum length in bytes of a choice that is also compared without spaces.
const MIN_JOINED: usize = 6;

impl ChoiceViews {
    pub(super) fn new(choices: &Choices) -> Self {
        let texts: Vec<String> = choices.texts().iter().map(|text| plain(&plain::tidy(text))).collect();
        let mut folded: Vec<(String, usize)> = texts
            .iter()
            .map(|text| fold(text.strip_suffix('.').unwrap_or(text)))
            .enumerate()
            .map(|(index, text)| (text, index))
            .collect();
        let naming = folded.iter().map(|(text, _)| classify(text)).collect();
        folded.retain(|(text, _)| !text.is_empty());
        let [yes, no] = ["yes", "no"].map(|word| folded.iter().find(|(text, _)| text == word).map(|(_, index)| *index));
        let yes_no = yes.zip(no);
        let mut joined = HashMap::<String, Vec<usize>>::new();
        for (text, index) in &folded {
            let letters: String = text.split(' ').collect();
            if letters.len() >= MIN_JOINED && letters.chars().all(char::is_alphabetic) {
                joined.entry(letters).or_default().push(*index);
            }
        }
        folded.sort_by_key(|(text, index)| (std::cmp::Reverse(text.len()), *index));
        Self { texts, folded, joined, naming, yes_no }
    }
}

/// Classifies a choice by its words: a color or an attribute if it has only words of that class, otherwise a thing.
fn classify(folded: &str) -> Naming {
    let words = Clauses::new(folded, &tokens(folded)).elements;
    let is_color = words.iter().all(|word| word.roles.has_any(&[Role::Color, Role::Shade]));
    let is_place = words.iter().all(|word| word.roles.has_any(&[Role::Place, Role::Number]));
    let is_number = words.iter().all(|word| word.slice(folded).chars().all(char::is_numeric));
    if !words.is_empty() && is_color {
        Naming::Color
    } else if is_number || is_place || matches!(folded, "yes" | "no") {
        Naming::Attribute
    } else {
        Naming::Thing
    }
}
