//! Tables of text that are no wider than the terminal: [`TextTable`].

use std::collections::BTreeSet;

use comfy_table::presets::UTF8_HORIZONTAL_ONLY;
use comfy_table::{CellAlignment, ColumnConstraint, LineStyle, Width};
use unicode_width::UnicodeWidthStr;

use crate::report::text::table::ColumnKind;
use crate::report::text::words::shorten_middle;

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
    pub(super) head: String,
    pub(super) kind: ColumnKind,
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
    pub(super) columns: Vec<TextColumn>,
    pub(super) rows: Vec<TextRow>,
}

/// Width to which a column of text may be wrapped; chosen.
const WRAPPED: usize = 24;

impl TextTable {
    /// Formats the table in lines of at most `most` terminal columns, if its longest text allows that. A wider table is
    /// changed step by step: names of models lose their middle, columns of zeros become a note below it, and finally it
    /// is split into several parts, each with the texts that name its rows.
    pub(super) fn format_to(mut self, most: usize) -> String {
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
}
