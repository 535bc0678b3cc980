//! A table of the leaderboard as its page shows it: [`BoardTable`].

use serde::Serialize;

use crate::text::readable::readable;
use crate::text::table::{ColumnKind, TableCell};
use crate::text::words::{ends, interval, words};

/// A table as the template reads it.
#[derive(Serialize)]
pub(super) struct BoardTable {
    pub(super) head: Vec<String>,
    pub(super) rows: Vec<BoardRow>,
}

/// A row: its first cells, the model with the page of its run, and the others.
#[derive(Serialize)]
pub(super) struct BoardRow {
    /// The text that the filter searches.
    pub(super) words: String,
    pub(super) cells: Vec<BoardCell>,
}

/// A cell as the template reads it.
#[derive(Serialize)]
pub(super) struct BoardCell {
    text: String,
    /// Lines beneath it in small letters.
    small: Vec<String>,
    class: &'static str,
    /// By what the column is sorted: a number, or a text; empty if there is nothing.
    key: String,
    /// The page that it leads to; empty without one.
    link: String,
    is_header: bool,
}

impl BoardCell {
    /// A text.
    pub(super) fn text(text: &str) -> Self {
        let text = readable(text);
        Self {
            key: text.clone(),
            text,
            small: Vec::new(),
            class: "text",
            link: String::new(),
            is_header: false,
        }
    }

    /// A cell of a table, whose interval stands beneath it.
    pub(super) fn new(kind: ColumnKind, cell: &TableCell) -> Self {
        let share = interval(kind, cell).or(match (kind, cell) {
            (ColumnKind::Share, TableCell::Estimate(share)) => Some(*share),
            _ => None,
        });
        let (shown, small) = match share {
            Some(share) => (words(ColumnKind::Accuracy, cell), Some(ends(share))),
            None => split(&words(kind, cell)),
        };
        let number = match cell {
            TableCell::Count(count) => Some(*count as f64),
            TableCell::Number(number) => Some(*number),
            TableCell::Estimate(share) | TableCell::Changed(share, _) => Some(share.value),
            TableCell::Threshold(threshold, _) => Some(threshold.value),
            _ => None,
        };
        // Infinity is beyond every number of its column.
        let key = number.map(|number| number.clamp(-1e300, 1e300).to_string());
        Self {
            small: small.into_iter().collect(),
            class: "",
            key: key.unwrap_or_default(),
            ..Self::text(&shown)
        }
    }

    /// The same, sorted by this.
    pub(super) fn keyed(self, key: String) -> Self {
        Self { key, ..self }
    }

    /// The same with a line beneath it.
    pub(super) fn small(mut self, line: &str) -> Self {
        self.small.push(readable(line));
        self
    }

    pub(super) fn class(self, class: &'static str) -> Self {
        Self { class, ..self }
    }

    /// The head of a row, with a link.
    pub(super) fn header(self, link: String) -> Self {
        Self {
            link,
            is_header: true,
            ..self
        }
    }
}

/// A number and the interval behind it, if the text has both.
fn split(text: &str) -> (String, Option<String>) {
    match text.split_once(" [") {
        Some((number, interval)) => (number.to_owned(), Some(format!("[{interval}"))),
        None => (text.to_owned(), None),
    }
}
