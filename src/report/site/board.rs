//! Table of the leaderboard's page: [`BoardTable`].

use serde::Serialize;

use crate::text::table::{ColumnKind, TableCell};
use crate::text::terminal::readable;
use crate::text::words::{ends, interval, words};

/// Table for the template.
#[derive(Serialize)]
pub(super) struct BoardTable {
    pub(super) head: Vec<String>,
    pub(super) rows: Vec<BoardRow>,
}

/// Table row for the template.
#[derive(Serialize)]
pub(super) struct BoardRow {
    /// Text that the filter of the page searches.
    pub(super) words: String,
    pub(super) cells: Vec<BoardCell>,
}

/// Table cell for the template.
#[derive(Serialize)]
pub(super) struct BoardCell {
    text: String,
    /// Lines below the text, in a small font.
    small: Vec<String>,
    /// CSS class.
    class: &'static str,
    /// Sort key, a number or a text; empty for a missing value.
    key: String,
    /// Address of a page; empty without a link.
    link: String,
    is_header: bool,
}

impl BoardCell {
    /// Cell with a text, which is also its sort key.
    pub(super) fn text(text: &str) -> Self {
        let text = readable(text);
        Self { key: text.clone(), text, small: Vec::new(), class: "text", link: String::new(), is_header: false }
    }

    /// Cell of a table, with its interval below.
    pub(super) fn new(kind: ColumnKind, cell: &TableCell) -> Self {
        let share = interval(kind, cell).or(match (kind, cell) {
            (ColumnKind::Share, TableCell::Estimate(share)) => Some(*share),
            _ => None,
        });
        let (text, small) = match share {
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
        // The script cannot sort infinity; a huge number takes its place.
        let key = number.map(|number| number.clamp(-1e300, 1e300).to_string());
        Self { small: small.into_iter().collect(), class: "", key: key.unwrap_or_default(), ..Self::text(&text) }
    }

    /// Sets the sort key.
    pub(super) fn with_key(self, key: String) -> Self {
        Self { key, ..self }
    }

    /// Adds a line below the text.
    pub(super) fn with_line(mut self, line: &str) -> Self {
        self.small.push(readable(line));
        self
    }

    /// Sets the CSS class.
    pub(super) fn with_class(self, class: &'static str) -> Self {
        Self { class, ..self }
    }

    /// Adds a link.
    pub(super) fn with_link(self, link: String) -> Self {
        Self { link, ..self }
    }

    /// Makes the cell a row header with a link.
    pub(super) fn into_header(self, link: String) -> Self {
        Self { link, is_header: true, ..self }
    }
}

/// Splits a text into a number and its interval in brackets, if it has one.
fn split(text: &str) -> (String, Option<String>) {
    match text.split_once(" [") {
        Some((number, interval)) => (number.to_owned(), Some(format!("[{interval}"))),
        None => (text.to_owned(), None),
    }
}
