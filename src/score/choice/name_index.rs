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
    /// Texts of choices, from left to right; none is inside a longer one.
    pub(super) texts: Vec<Name>,
}

impl Names<'_> {
    /// The choice's text that begins at a byte, after optional articles and words such as "it is".
    pub(super) fn text_at(&self, at: usize) -> Option<Name> {
        self.text_from(at).or_else(|| self.text_from(at + markers::article_length(&self.folded[at..])))
    }

    /// The choice's text that begins exactly at a byte.
    pub(super) fn text_from(&self, at: usize) -> Option<Name> {
        let first = self.texts.partition_point(|name| name.start < at);
        self.texts.get(first).copied().filter(|name| name.start == at)
    }

    /// The choice's text after a letter that labels it: "B. kitchen", "(B) a kitchen", "B: kitchen", "B-kitchen".
    pub(super) fn labelled_text(&self, letter: &Name) -> Option<Name> {
        let rest = &self.text[letter.end..];
        let after = rest.trim_start_matches([')', ']', '.', ':', ',', '、', ' ', '\n', '-', '–', '—', '=', '>', '→']);
        let gap = &rest[..rest.len() - after.len()];
        if gap.is_empty() {
            return None;
        }
        let name = self.text_at(letter.end + gap.len())?;
        // A text on another line belongs to the letter only if it fills that line.
        let line = self.text[name.end..].trim_start_matches(['.', ' ']);
        let belongs = !gap.contains('\n') || line.is_empty() || line.starts_with('\n');
        (belongs && name.state.counts()).then_some(name)
    }

    /// The choice's text directly before a letter in brackets: "kitchen (B)".
    pub(super) fn text_before(&self, letter: &Name) -> Option<Name> {
        let open = self.text[..letter.start].strip_suffix(['(', '['])?;
        self.text_ending_at(open.trim_end_matches(' ').len())
    }

    /// The choice's text that ends exactly at a byte.
    pub(super) fn text_ending_at(&self, end: usize) -> Option<Name> {
        last_before(&self.texts, end).filter(|name| name.end == end)
    }

    /// True if a name begins in `start..end`.
    pub(super) fn any(&self, start: usize, end: usize) -> bool {
        self.first_start(start).is_some_and(|first| first < end)
    }

    /// The first byte of a name that ends at a byte.
    pub(super) fn start_of_name_ending_at(&self, end: usize) -> Option<usize> {
        [&self.texts, &self.letters]
            .into_iter()
            .filter_map(|names| last_before(names, end))
            .find(|name| name.end == end)
            .map(|name| name.start)
    }

    /// The first byte of the first name that begins at a byte or after it.
    pub(super) fn first_start(&self, start: usize) -> Option<usize> {
        [&self.letters, &self.texts]
            .into_iter()
            .filter_map(|names| {
                let first = names.partition_point(|name| name.start < start);
                names.get(first).map(|name| name.start)
            })
            .min()
    }

    /// The first byte of the last name that begins before a byte.
    pub(super) fn last_start(&self, end: usize) -> Option<usize> {
        [&self.letters, &self.texts]
            .into_iter()
            .filter_map(|names| last_before(names, end))
            .map(|name| name.start)
            .max()
    }

    /// Letters, then texts.
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

/// The last of these sorted names that begins before a byte.
fn last_before(names: &[Name], end: usize) -> Option<Name> {
    let after = names.partition_point(|name| name.start < end);
    names[..after].last().copied()
}
