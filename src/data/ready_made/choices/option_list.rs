//! Options of a row: [`OptionList`].

use std::collections::HashSet;
use std::sync::Arc;

use darkqa_base::types::text::excerpt;

/// Options of a row.
#[derive(Debug, Clone, Default, PartialEq, Eq, Hash)]
pub struct OptionList {
    pub texts: Arc<[String]>,
    /// Position of each option among its columns, which its letter or number refers to: if B is empty, C is still C.
    pub(super) positions: Vec<usize>,
    pub(super) origin: OptionOrigin,
}

/// Where the options were found.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub(super) enum OptionOrigin {
    #[default]
    Columns,
    /// In the text of the question, with letters. Such options have no numbers.
    Question,
}

/// Joins the lines of a text with spaces and trims it, because a prompt has one line for each option.
pub(crate) fn one_line(text: &str) -> String {
    let breaks = ['\n', '\r', '\u{b}', '\u{c}', '\u{85}', '\u{2028}', '\u{2029}'];
    let lines: Vec<&str> = text.split(breaks).map(str::trim).filter(|line| !line.is_empty()).collect();
    lines.join(" ")
}

impl OptionList {
    /// Options in columns, with their positions among these columns.
    pub(super) fn with_positions(texts: &[String], positions: Vec<usize>) -> Self {
        Self { texts: texts.iter().map(|text| one_line(text)).collect(), positions, origin: OptionOrigin::Columns }
    }

    /// Excerpt of the options with at most `max` characters, for messages.
    pub(super) fn excerpt(&self, max: usize) -> String {
        excerpt(&format!("{:?}", self.texts), max)
    }

    /// Options in the text of a question, in order.
    pub fn from_question(texts: &[String]) -> Self {
        Self { origin: OptionOrigin::Question, ..Self::from_list(texts) }
    }

    /// Options in a list, in order.
    pub(super) fn from_list(texts: &[String]) -> Self {
        Self::with_positions(texts, (0..texts.len()).collect())
    }
}

/// Stores equal options of different rows once.
#[derive(Debug, Default)]
pub(crate) struct OptionInterner(HashSet<Arc<OptionList>>);

impl OptionInterner {
    pub(crate) fn intern(&mut self, options: OptionList) -> Arc<OptionList> {
        if let Some(known) = self.0.get(&options) {
            return Arc::clone(known);
        }
        let options = Arc::new(options);
        self.0.insert(Arc::clone(&options));
        options
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_are_trimmed_to_one_line() {
        for (text, line) in [
            ("kitchen \n", "kitchen"),
            ("\tliving  room\r\n", "living  room"),
            ("living\r\n  room", "living room"),
            ("a\u{2028}b\u{a0}", "a b"),
        ] {
            assert_eq!(&*OptionList::from_list(&[text.to_owned()]).texts, [line]);
        }
    }
}
