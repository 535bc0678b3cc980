//! A plain text with every name of a choice in it: [`ReplyView`].

use super::letters::letters;
use super::names::{Delimiting, Name, denied, part_of_number, same_word};
use super::plain::{fold, plain};
use super::{clean, markers};
use crate::types::question::Choices;

/// The choices as they occur in plain text.
pub(super) struct ChoiceViews {
    /// Texts of the choices without markup.
    pub(super) texts: Vec<String>,
    /// The same texts in lower case without a final period, longest first, each with the index of its choice.
    folded: Vec<(String, usize)>,
    /// Indices of "yes" and "no", if both are choices.
    pub(super) yes_no: Option<(usize, usize)>,
}

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
            .filter(|(text, _)| !text.is_empty())
            .collect();
        let position = |word: &str| {
            folded
                .iter()
                .find(|(text, _)| text == word)
                .map(|(_, index)| *index)
        };
        let yes_no = position("yes").zip(position("no"));
        folded.sort_by_key(|(text, index)| (std::cmp::Reverse(text.len()), *index));
        Self {
            texts,
            folded,
            yes_no,
        }
    }
}

/// A plain text and the names of choices in it.
pub(super) struct ReplyView<'a> {
    pub(super) text: &'a str,
    /// The text in lower case, with the same byte positions.
    pub(super) folded: &'a str,
    /// The choices of the question.
    pub(super) offered: &'a ChoiceViews,
    /// Letters that name a choice, from left to right.
    pub(super) letters: Vec<Name>,
    /// Texts of choices, from left to right. None lies inside a longer one.
    pub(super) texts: Vec<Name>,
}

impl<'a> ReplyView<'a> {
    /// The view of a text; `folded` is [`fold`] of it.
    pub(super) fn new(text: &'a str, folded: &'a str, offered: &'a ChoiceViews) -> Self {
        let texts = texts(folded, offered);
        let within = |letter: &Name| {
            let after = texts.partition_point(|name| name.start <= letter.start);
            texts[..after]
                .last()
                .is_some_and(|name| name.end > letter.end)
        };
        let mut letters = letters(text, offered.texts.len());
        letters.retain(|letter| !within(letter));
        Self {
            text,
            folded,
            offered,
            letters,
            texts,
        }
    }

    /// The choice's text that begins at a byte, after optional articles and words such as "it is".
    pub(super) fn text_at(&self, at: usize) -> Option<Name> {
        self.text_from(at)
            .or_else(|| self.text_from(at + markers::article(&self.folded[at..])))
    }

    /// The choice's text that begins exactly at a byte.
    pub(super) fn text_from(&self, at: usize) -> Option<Name> {
        let first = self.texts.partition_point(|name| name.start < at);
        let name = self.texts.get(first).copied();
        name.filter(|name| name.start == at)
    }

    /// Whether the words around a name deny it.
    pub(super) fn denies(&self, name: &Name) -> bool {
        denied(self.folded, name.start, name.end)
    }

    /// The choice's text after a letter that labels it: "B. kitchen", "(B) a kitchen", "B: kitchen".
    pub(super) fn labelled_text(&self, letter: &Name) -> Option<Name> {
        let rest = &self.text[letter.end..];
        let after =
            rest.trim_start_matches([')', ']', '.', ':', ',', '、', ' ', '\n', '-', '–', '—']);
        let gap = &rest[..rest.len() - after.len()];
        let name = self.text_at(letter.end + gap.len())?;
        // On another line it is the letter's text only if it fills the line.
        let line = self.text[name.end..].trim_start_matches(['.', ' ']);
        let alone = !gap.contains('\n') || line.is_empty() || line.starts_with('\n');
        (!gap.is_empty() && alone && !self.denies(&name)).then_some(name)
    }
}

/// Every choice's text that occurs as whole words, from left to right. Longer texts take precedence.
fn texts(folded: &str, offered: &ChoiceViews) -> Vec<Name> {
    let mut covered = vec![false; folded.len()];
    let mut names = Vec::new();
    for (i, (text, choice)) in offered.folded.iter().enumerate() {
        // Two choices may differ only in markup; then every occurrence names both.
        let duplicates = offered.folded[i + 1..]
            .iter()
            .take_while(|(duplicate, _)| duplicate.len() == text.len());
        let duplicates: Vec<usize> = duplicates
            .filter(|(duplicate, _)| duplicate == text)
            .map(|(_, index)| *index)
            .collect();
        for (start, _) in folded.match_indices(text.as_str()) {
            let end = start + text.len();
            if covered[start..end].contains(&true) || !stands_alone(folded, start, end) {
                continue;
            }
            covered[start..end].fill(true);
            names.extend([*choice].iter().chain(&duplicates).map(|&choice| Name {
                start,
                end,
                choice: Some(choice),
                delimiting: Delimiting::Plain,
            }));
        }
    }
    names.sort_by_key(|name| name.start);
    names
}

/// Whether a span is not part of a word or a number, not an article, and not a "no" before a noun.
fn stands_alone(folded: &str, start: usize, end: usize) -> bool {
    let span = &folded[start..end];
    let (before, after) = (
        folded[..start].chars().next_back(),
        folded[end..].chars().next(),
    );
    let inside =
        same_word(before, span.chars().next()) || same_word(span.chars().next_back(), after);
    let article = span.len() == 1 && matches!(span, "a" | "i") && after == Some(' ');
    let noun = span == "no" && !after.is_none_or(|c| ".,;:!?)\n".contains(c));
    !inside && !article && !noun && !part_of_number(folded, start, end)
}
