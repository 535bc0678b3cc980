//! The options of a row: [`Offered`].

use std::collections::HashSet;
use std::sync::Arc;

use crate::types::text::excerpt;

/// The options of a row.
#[derive(Debug, Clone, Default, PartialEq, Eq, Hash)]
pub(in crate::dataset::ready_made) struct Offered {
    pub(in crate::dataset::ready_made) texts: Arc<[String]>,
    /// The place of each among its columns, by which letters and numbers name it: where B is empty, C is still C.
    pub(super) places: Vec<usize>,
    pub(super) origin: Origin,
}

/// Where options stand.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub(super) enum Origin {
    #[default]
    Columns,
    /// With their letters in the text of the question. Nothing numbers them.
    Question,
}

/// A text without blanks at its ends, on one line: a prompt has one line for each option.
pub(in crate::dataset) fn one_line(text: &str) -> String {
    let breaks = [
        '\n', '\r', '\u{b}', '\u{c}', '\u{85}', '\u{2028}', '\u{2029}',
    ];
    let lines: Vec<&str> = text
        .split(breaks)
        .map(str::trim)
        .filter(|line| !line.is_empty())
        .collect();
    lines.join(" ")
}

impl Offered {
    /// Options in columns, with their places among these.
    pub(super) fn placed(texts: &[String], places: Vec<usize>) -> Self {
        Self {
            texts: texts.iter().map(|text| one_line(text)).collect(),
            places,
            origin: Origin::Columns,
        }
    }

    /// The options in at most `most` characters, for messages.
    pub(super) fn shown(&self, most: usize) -> String {
        excerpt(&format!("{:?}", self.texts), most)
    }

    /// The options in the text of a question, in order.
    pub(in crate::dataset::ready_made) fn lettered(texts: &[String]) -> Self {
        let origin = Origin::Question;
        Self {
            origin,
            ..Self::listed(texts)
        }
    }

    /// The options of a list, in order.
    pub(super) fn listed(texts: &[String]) -> Self {
        Self::placed(texts, (0..texts.len()).collect())
    }
}

/// The options of all rows. Equal ones are held once.
#[derive(Debug, Default)]
pub(in crate::dataset::ready_made) struct AllOffered(HashSet<Arc<Offered>>);

impl AllOffered {
    pub(in crate::dataset::ready_made) fn once(&mut self, offered: Offered) -> Arc<Offered> {
        if let Some(known) = self.0.get(&offered) {
            return Arc::clone(known);
        }
        let offered = Arc::new(offered);
        self.0.insert(Arc::clone(&offered));
        offered
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_are_on_one_line_without_blanks_at_their_ends() {
        for (text, line) in [
            ("kitchen \n", "kitchen"),
            ("\tliving  room\r\n", "living  room"),
            ("living\r\n  room", "living room"),
            ("a\u{2028}b\u{a0}", "a b"),
        ] {
            assert_eq!(&*Offered::listed(&[text.to_owned()]).texts, [line]);
        }
    }
}
