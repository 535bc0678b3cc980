//! All names of choices in a text: [`Names`].

use super::markers;
use super::names::{Name, NameState};

/// The names of choices in a text.
pub(super) struct Names<'a> {
    pub(super) text: &'a str,
    /// The text in lower case, with the same byte positions.
    pub(super) folded: &'a str,
    /// Letters that name a choice, from left to right.
    pub(super) letters: Vec<Name>,
    /// Texts of choices, from left to right. None lies inside a longer one.
    pub(super) texts: Vec<Name>,
}

impl Names<'_> {
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

    /// The choice's text after a letter that labels it: "B. kitchen", "(B) a kitchen", "B: kitchen", "B-kitchen".
    pub(super) fn labelled_text(&self, letter: &Name) -> Option<Name> {
        let rest = &self.text[letter.end..];
        let after = rest.trim_start_matches([
            ')', ']', '.', ':', ',', '、', ' ', '\n', '-', '–', '—', '=', '>', '→',
        ]);
        let gap = &rest[..rest.len() - after.len()];
        if gap.is_empty() {
            return None;
        }
        let name = self.text_at(letter.end + gap.len())?;
        // On another line it is the letter's text only if it fills the line.
        let line = self.text[name.end..].trim_start_matches(['.', ' ']);
        let alone = !gap.contains('\n') || line.is_empty() || line.starts_with('\n');
        (alone && name.state.counts()).then_some(name)
    }

    /// The choice's text directly before a letter in brackets: "kitchen (B)".
    pub(super) fn text_before(&self, letter: &Name) -> Option<Name> {
        let open = self.text[..letter.start].strip_suffix(['(', '['])?;
        let end = open.trim_end_matches(' ').len();
        self.text_to(end)
    }

    /// The choice's text that ends exactly at a byte.
    pub(super) fn text_to(&self, end: usize) -> Option<Name> {
        let after = self.texts.partition_point(|name| name.start < end);
        let name = self.texts[..after].last().copied();
        name.filter(|name| name.end == end)
    }

    /// Whether a name begins in `start..end`.
    pub(super) fn any(&self, start: usize, end: usize) -> bool {
        let begins = |names: &[Name]| {
            let first = names.partition_point(|name| name.start < start);
            names.get(first).is_some_and(|name| name.start < end)
        };
        begins(&self.letters) || begins(&self.texts)
    }

    /// The first byte of a name that ends at a byte.
    pub(super) fn start_of(&self, end: usize) -> Option<usize> {
        let ending = |names: &[Name]| {
            let after = names.partition_point(|name| name.start < end);
            names[..after]
                .last()
                .filter(|name| name.end == end)
                .map(|name| name.start)
        };
        ending(&self.texts).or_else(|| ending(&self.letters))
    }

    /// The first byte of the first name that begins at a byte or behind it.
    pub(super) fn first_from(&self, start: usize) -> Option<usize> {
        let first = |names: &[Name]| {
            let first = names.partition_point(|name| name.start < start);
            names.get(first).map(|name| name.start)
        };
        let (letter, text) = (first(&self.letters), first(&self.texts));
        letter.min(text).or(letter).or(text)
    }

    /// The first byte of the last name that begins before a byte.
    pub(super) fn last_before(&self, end: usize) -> Option<usize> {
        let last = |names: &[Name]| {
            let after = names.partition_point(|name| name.start < end);
            names[..after].last().map(|name| name.start)
        };
        last(&self.letters).max(last(&self.texts))
    }

    /// Letters and texts, in no order.
    pub(super) fn all(&self) -> impl Iterator<Item = &Name> {
        self.letters.iter().chain(&self.texts)
    }

    /// Sets the state of each name.
    pub(super) fn set_states(&mut self, state: impl Fn(&Name) -> NameState) {
        for name in self.letters.iter_mut().chain(&mut self.texts) {
            name.state = state(name);
        }
    }
}
