//! Tables as text for the terminal: [`render`].
//!
//! Tables of text that are no wider than the terminal: [`TextTable`].
//!
//! The width of the terminal: [`terminal_columns`].
//!
//! Data in a `script` element of an HTML page: [`to_script_json`].
//!
//! Text wrapped into lines: [`wrapped`].
//!
//! Replies of models as text for an HTML page: [`readable`].

use std::collections::BTreeSet;
use std::fmt::Write;

use comfy_table::presets::UTF8_HORIZONTAL_ONLY;
use comfy_table::{CellAlignment, ColumnConstraint, LineStyle, Width};
use serde::Serialize;
use unicode_width::UnicodeWidthStr;

use super::words::shorten_middle;
use crate::text::table::{Column, ColumnKind, Table, TableCell, TableFormat};
use crate::text::words::{interval, percent, points, reach, stops, widest_reach_of, with_interval, words};
use darkqa_base::error::{Error, Result};
use darkqa_base::types::text::escape_hidden;

/// The lenient number in brackets, ` (LENIENT)`, if it differs from the strict one; otherwise empty.
pub fn differing(strict: &str, lenient: &str) -> String {
    if strict == lenient { String::new() } else { format!(" ({lenient})") }
}

/// A cell as text for the terminal: one text for each name of its column.
pub fn texts(kind: ColumnKind, cell: &TableCell) -> Vec<String> {
    match (kind, cell) {
        (ColumnKind::Points, TableCell::Estimate(e)) => {
            let interval = format!("{} to {}", points(e.low), points(e.high));
            vec![points(e.value), interval]
        }
        (ColumnKind::Threshold, TableCell::Threshold(t, darkest)) => {
            vec![stops(t.value, *darkest), reach(t.low, t.high, *darkest)]
        }
        (ColumnKind::Threshold, TableCell::Unknown(_)) => vec!["–".to_owned(), words(kind, cell)],
        (ColumnKind::Share, TableCell::Estimate(share)) => vec![with_interval(*share)],
        (_, TableCell::Strict(strict, lenient)) => {
            let lenient = differing(&percent(strict.value), &percent(*lenient));
            vec![percent(strict.value) + &lenient]
        }
        _ => vec![words(kind, cell)],
    }
}

/// Wraps a text at the width of the terminal. The first line begins with `first`, the others with `rest`.
pub fn line(first: &str, text: &str, rest: &str) -> String {
    wrapped_to(terminal_columns(), first, text, rest)
}

/// All tables that have a heading, each with its heading and notes.
#[must_use]
pub fn render(tables: &[Table]) -> String {
    let mut text = String::new();
    for parts in tables.chunk_by(|table, next| (table.name, &table.heading) == (next.name, &next.heading)) {
        let Some(heading) = &parts[0].heading else {
            continue;
        };
        if !heading.is_empty() {
            text += &line("", heading, " ");
        }
        text += &table(parts);
        let notes = parts.iter().flat_map(|table| &table.notes);
        let foot = parts.iter().filter_map(|table| table.foot.as_ref()).take(1);
        for note in notes.chain(foot) {
            text += &line("", note, " ");
        }
    }
    text
}

/// Head of the column with the widest interval of a row.
const REACH: &str = "95 %";

/// Formats tables with the same columns as one table; empty without rows. A table of accuracies has a last column with
/// the widest interval of each row.
#[must_use]
pub fn table(parts: &[Table]) -> String {
    let columns = parts.iter().take(1).flat_map(|table| &table.columns);
    let has_reach = columns.clone().any(|column| column.kind == ColumnKind::Accuracy);
    let heads = columns.flat_map(|Column { kind, heads }| {
        heads.terminal.iter().map(|head| TextColumn { head: head.clone(), kind: *kind })
    });
    let reach = has_reach.then(|| TextColumn { head: REACH.to_owned(), kind: ColumnKind::Text });
    let mut rows = Vec::new();
    for table in parts {
        for (heading, row) in table.headed_rows_in(TableFormat::Terminal) {
            if let Some(heading) = heading.filter(|heading| !heading.is_empty()) {
                rows.push(TextRow::Heading(heading.to_owned()));
            }
            let cells = table.cells(row).filter(|(column, _)| !column.heads.terminal.is_empty());
            let reach = has_reach.then(|| widest_reach(cells.clone()));
            let texts = cells.flat_map(|(column, cell)| texts(column.kind, cell));
            rows.push(TextRow::Cells(texts.chain(reach).collect()));
        }
    }
    let table = TextTable { columns: heads.chain(reach).collect(), rows };
    table.format_to(terminal_columns())
}

/// The largest distances of these cells' estimates to the ends of their intervals, as `−7.7 +7.1`; empty if no cell has
/// an interval.
fn widest_reach<'t>(cells: impl Iterator<Item = (&'t Column, &'t TableCell)>) -> String {
    let accuracies = cells.filter(|(column, _)| column.kind == ColumnKind::Accuracy);
    widest_reach_of(accuracies.filter_map(|(column, cell)| interval(column.kind, cell)))
}

/// Terminal columns of a cell in addition to its text, with the gap to the next cell.
const PADDING: usize = 3;

/// Minimum length of a shortened name; chosen.
const MIN_NAME: usize = 12;

/// Heads of columns with names of models.
const MODELS: [&str; 2] = ["model", "less"];

/// Heads of columns that may be left out if all their numbers are 0.
const ZEROS: [&str; 2] = ["unparsed", "failed"];

/// A column of a table of text.
#[derive(Debug, Clone)]
pub(super) struct TextColumn {
    head: String,
    kind: ColumnKind,
}

/// A row of a table of text.
#[derive(Debug, Clone)]
pub(super) enum TextRow {
    /// A heading above the rows that follow.
    Heading(String),
    /// A cell for each column.
    Cells(Vec<String>),
}

/// A table of text.
#[derive(Debug, Clone)]
pub(super) struct TextTable {
    columns: Vec<TextColumn>,
    rows: Vec<TextRow>,
}

/// Width to which a column of text may be wrapped; chosen.
const WRAPPED: usize = 24;

impl TextTable {
    /// Formats the table in lines of at most `most` terminal columns, if its longest text allows that. A wider table is
    /// changed step by step: names of models lose their middle, columns of zeros become a note below it, and finally it
    /// is split into several parts, each with the texts that name its rows.
    fn format_to(mut self, most: usize) -> String {
        if self.rows.iter().all(|row| matches!(row, TextRow::Heading(_))) {
            return String::new();
        }
        let mut note = String::new();
        if self.width() > most {
            self.shorten_models(most);
        }
        if self.width() > most {
            note = self.remove_zeros();
        }
        let parts: String = self.parts(most).iter().map(|part| self.format_columns(part, most)).collect();
        parts + &note
    }

    fn cells(&self) -> impl Iterator<Item = &Vec<String>> {
        self.rows.iter().filter_map(|row| match row {
            TextRow::Cells(cells) => Some(cells),
            TextRow::Heading(_) => None,
        })
    }

    /// The width of a column with its padding.
    fn width_of(&self, column: usize) -> usize {
        let longest = self
            .rows
            .iter()
            .filter_map(|row| match row {
                TextRow::Cells(cells) => Some(cells.get(column)?.width()),
                // A heading is printed in the first column.
                TextRow::Heading(heading) => (column == 0).then(|| heading.width() + 2),
            })
            .max()
            .unwrap_or(0);
        longest.max(self.columns[column].head.width()) + PADDING
    }

    fn width(&self) -> usize {
        (0..self.columns.len()).map(|column| self.width_of(column)).sum::<usize>().saturating_sub(1)
    }

    /// Shortens the names of models until the table fits, but never so far that two of them become equal.
    fn shorten_models(&mut self, most: usize) {
        for column in 0..self.columns.len() {
            let over = self.width().saturating_sub(most);
            if !MODELS.contains(&&*self.columns[column].head) || over == 0 {
                continue;
            }
            let names: BTreeSet<String> = self.cells().filter_map(|cells| cells.get(column)).cloned().collect();
            let longest = names.iter().map(|name| name.width()).max().unwrap_or(0);
            let least = longest.saturating_sub(over).max(MIN_NAME);
            let length = (least..longest)
                .find(|length| {
                    let shortened: BTreeSet<String> = names.iter().map(|name| shorten_middle(name, *length)).collect();
                    shortened.len() == names.len()
                })
                .unwrap_or(longest);
            for row in &mut self.rows {
                if let TextRow::Cells(cells) = row
                    && let Some(cell) = cells.get_mut(column)
                {
                    *cell = shorten_middle(cell, length);
                }
            }
        }
    }

    /// Removes the columns of zeros. Returns a line that names them; empty if there are none.
    fn remove_zeros(&mut self) -> String {
        let mut names = Vec::new();
        for column in (0..self.columns.len()).rev() {
            let head = &self.columns[column].head;
            let is_zero = self.cells().all(|cells| cells.get(column).is_none_or(|cell| cell == "0"));
            if !ZEROS.contains(&&**head) || !is_zero {
                continue;
            }
            names.insert(0, format!("{head} 0"));
            self.columns.remove(column);
            for row in &mut self.rows {
                if let TextRow::Cells(cells) = row
                    && column < cells.len()
                {
                    cells.remove(column);
                }
            }
        }
        match &*names {
            [] => String::new(),
            names => format!(" {} in every row\n", names.join(", ")),
        }
    }

    /// The columns of each part. The texts at the left, which name the rows, are repeated in every part; on a narrow
    /// terminal only as many of them as leave room for another column. Longer texts are wrapped.
    fn parts(&self, most: usize) -> Vec<Vec<usize>> {
        // The last cell has no gap after it.
        let most = most + 1;
        let texts = self
            .columns
            .iter()
            .take_while(|column| column.kind == ColumnKind::Text)
            .count()
            .min(self.columns.len().saturating_sub(1));
        let names = (1..=texts)
            .rev()
            .find(|names| {
                let widest = (*names..self.columns.len()).map(|column| self.least_width_of(column)).max();
                self.width_of_first(*names) + widest.unwrap_or(0) <= most
            })
            .unwrap_or(texts.min(1));
        let named = self.width_of_first(names);
        let mut parts: Vec<Vec<usize>> = Vec::new();
        let mut width = 0;
        for column in names..self.columns.len() {
            let least = self.least_width_of(column);
            let own = self.width_of(column).min(most.saturating_sub(named).max(least));
            match parts.last_mut() {
                Some(part) if width + own <= most => part.push(column),
                _ => {
                    parts.push((0..names).chain([column]).collect());
                    width = named;
                }
            }
            width += own;
        }
        parts
    }

    /// The width of the first columns with their padding.
    fn width_of_first(&self, count: usize) -> usize {
        (0..count).map(|column| self.width_of(column)).sum()
    }

    /// The minimum width of a column, whose texts may be wrapped.
    fn least_width_of(&self, column: usize) -> usize {
        let width = self.width_of(column);
        match self.columns[column].kind {
            ColumnKind::Text => width.min(WRAPPED + PADDING),
            _ => width,
        }
    }

    /// Formats some of the columns; if they are wider than `most`, the last text is wrapped.
    fn format_columns(&self, columns: &[usize], most: usize) -> String {
        let mut grid = comfy_table::Table::new();
        grid.load_style(UTF8_HORIZONTAL_ONLY.row_separator(LineStyle::none()));
        let heads = columns.iter().map(|column| self.columns[*column].head.clone());
        grid.set_header(heads);
        for row in &self.rows {
            match row {
                TextRow::Heading(heading) => grid.add_row([format!("— {heading}")]),
                TextRow::Cells(cells) => {
                    let cells = columns.iter().filter_map(|column| cells.get(*column));
                    grid.add_row(cells)
                }
            };
        }
        for (place, column) in grid.column_iter_mut().zip(columns) {
            let is_number = matches!(
                self.columns[*column].kind,
                ColumnKind::Count | ColumnKind::Accuracy | ColumnKind::Points | ColumnKind::P | ColumnKind::Percent
            );
            if is_number {
                place.set_cell_alignment(CellAlignment::Right);
            }
        }
        let width: usize = columns.iter().map(|column| self.width_of(*column)).sum();
        let last = columns.last().copied().unwrap_or_default();
        // The last cell has no gap after it, unless it is wrapped.
        let over = width.saturating_sub(most);
        if over > 1 && self.columns[last].kind == ColumnKind::Text {
            let room = self.width_of(last).saturating_sub(over).max(WRAPPED);
            let room = u16::try_from(room).unwrap_or(u16::MAX);
            if let Some(column) = grid.column_mut(columns.len() - 1) {
                column.set_constraint(ColumnConstraint::UpperBoundary(Width::Fixed(room)));
            }
        }
        format!("{grid}\n")
    }
}

/// Width in columns if the width of the terminal is unknown.
const DEFAULT: usize = 80;

/// Minimum width in columns that is assumed; chosen.
const MIN: usize = 60;

/// The width of the output in columns: the variable `COLUMNS`, otherwise the width of the terminal, otherwise 80; at
/// least 60.
pub fn terminal_columns() -> usize {
    std::env::var("COLUMNS")
        .ok()
        .and_then(|columns| columns.trim().parse().ok())
        .filter(|columns| *columns > 0)
        .or_else(|| terminal_size::terminal_size().map(|(width, _)| usize::from(width.0)))
        .unwrap_or(DEFAULT)
        .max(MIN)
}

/// A value as JSON for a `script` element, escaped so that it cannot end the script or open a comment.
///
/// # Errors
/// If the value cannot be serialized.
pub fn to_script_json<T: Serialize>(value: &T) -> Result<String> {
    let text = serde_json::to_string(value).map_err(|e| Error::data("page", e))?;
    // In JSON, `<` occurs only inside strings.
    Ok(text.replace('<', "\\u003c"))
}

/// Maximum width of a line in characters.
pub const WIDTH: usize = 80;

/// Wraps a text at [`WIDTH`] characters, or at the width of a narrower terminal. The first line begins with `first`,
/// the others with `rest`.
pub fn wrapped(first: &str, text: &str, rest: &str) -> String {
    wrapped_to(WIDTH.min(terminal_columns()), first, text, rest)
}

/// Wraps a text at `width` characters. The first line begins with `first`, the others with `rest`.
fn wrapped_to(width: usize, first: &str, text: &str, rest: &str) -> String {
    let mut lines = String::new();
    let mut line = first.to_owned();
    let mut is_empty = true;
    for word in text.split(' ') {
        if !is_empty && line.chars().count() + 1 + word.chars().count() > width {
            lines += line.trim_end();
            lines.push('\n');
            rest.clone_into(&mut line);
            is_empty = true;
        }
        if !is_empty {
            line.push(' ');
        }
        line += word;
        is_empty = false;
    }
    lines + line.trim_end() + "\n"
}

/// Maximum number of characters of a text on a page.
const MAX_CHARS: usize = 4_000;

/// Escapes hidden characters as codes such as ⟨U+202E⟩, and cuts a text of more than [`MAX_CHARS`] characters, with a
/// note at its end.
#[must_use]
pub fn readable(text: &str) -> String {
    let cut = text.char_indices().nth(MAX_CHARS);
    let kept = cut.map_or(text, |(at, _)| &text[..at]);
    let mut visible = escape_hidden(kept).into_owned();
    let all = text.chars().count();
    if all > MAX_CHARS {
        let _ = write!(visible, " … ({all} characters, cut here)");
    }
    visible
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A table of six models of 30 letters at six levels.
    fn table() -> TextTable {
        let heads = [
            ("model", ColumnKind::Text),
            ("light", ColumnKind::Text),
            ("L0", ColumnKind::Accuracy),
            ("L1", ColumnKind::Accuracy),
            ("L2", ColumnKind::Accuracy),
            ("L3", ColumnKind::Accuracy),
            ("L4", ColumnKind::Accuracy),
            ("L5", ColumnKind::Accuracy),
            ("n", ColumnKind::Count),
            ("unparsed", ColumnKind::Count),
            ("failed", ColumnKind::Count),
        ];
        let columns = heads.into_iter().map(|(head, kind)| TextColumn { head: head.to_owned(), kind });
        let mut rows = vec![TextRow::Heading("a group".to_owned())];
        for model in 0..6 {
            let mut cells = vec![format!("a-model-with-30-letters-b72-{model:02}"), "with noise + lift".to_owned()];
            cells.extend((0..6).map(|level| format!("{}.{level}", 90 - model)));
            cells.extend(["9999", "0", "0"].map(str::to_owned));
            rows.push(TextRow::Cells(cells));
        }
        TextTable { columns: columns.collect(), rows }
    }

    #[test]
    fn tables_fit_the_terminal_and_keep_all_numbers() {
        for most in [60, 80, 100, 140] {
            let text = table().format_to(most);
            let widest = text.lines().map(UnicodeWidthStr::width).max().unwrap();
            assert!(widest <= most, "{most}: {widest}\n{text}");
            for number in ["90.0", "85.5", "9999", "with noise + lift", "-05", "a group"] {
                assert!(text.contains(number), "{most}: {number}\n{text}");
            }
            // A column of zeros is named even if it is removed.
            assert!(text.contains("unparsed"), "{text}");
        }
        let wide = table().format_to(140);
        assert!(wide.contains("a-model-with-30-letters-b72-03") && !wide.contains("in every row"));
        let narrow = table().format_to(80);
        assert!(narrow.contains("unparsed 0, failed 0 in every row"), "{narrow}");
    }

    #[test]
    fn a_column_with_a_number_stays() {
        let mut table = table();
        if let TextRow::Cells(cells) = &mut table.rows[3] {
            cells[9] = "7".to_owned();
        }
        let text = table.format_to(60);
        assert!(text.contains('7') && text.contains("failed 0 in every row"), "{text}");
        assert!(!text.contains("unparsed 0"), "{text}");
    }

    #[test]
    fn every_part_names_its_rows() {
        let mut table = table();
        table.columns.push(TextColumn { head: "reason".to_owned(), kind: ColumnKind::Text });
        for (number, row) in table.rows.iter_mut().enumerate() {
            if let TextRow::Cells(cells) = row {
                cells[0] = "m".to_owned();
                cells[1] = format!("with noise + enhancer {number}");
                cells.push("a reason that takes a line of its own, which is 60 letters".to_owned());
            }
        }
        let text = table.format_to(80);
        let widest = text.lines().map(UnicodeWidthStr::width).max().unwrap();
        assert!(widest <= 80, "{text}");
        let reasons: Vec<&str> = text.lines().filter(|line| line.contains("a reason")).collect();
        assert_eq!(reasons.len(), 6, "{text}");
        for (number, line) in (1..).zip(reasons) {
            assert!(line.contains(&format!("enhancer {number}")), "{text}");
        }
        assert_eq!(text.matches("letters").count(), 6, "{text}");
    }

    #[test]
    fn hidden_characters_are_escaped_and_long_texts_cut() {
        assert_eq!(readable("a\u{202e}b\u{0}\n"), "a⟨U+202E⟩b⟨U+0000⟩\n");
        let long = readable(&"ü".repeat(MAX_CHARS + 1));
        assert!(long.ends_with("ü … (4001 characters, cut here)"));
    }
}
