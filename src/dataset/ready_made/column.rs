//! A column of a set: [`Column`].

use super::cell::Cell;
use super::row::Row;

/// A column, or a field of structs in it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Column {
    pub(super) at: usize,
    pub(super) field: Option<String>,
    pub(super) name: String,
}

impl Column {
    /// The cell of the column in a row.
    pub(super) fn cell<'a>(&self, row: &'a Row) -> &'a Cell {
        let cell = row.cell(self.at);
        match &self.field {
            None => cell,
            Some(field) => {
                let mut fields = field.split('.');
                fields
                    .try_fold(cell, |cell, field| cell.field(field))
                    .unwrap_or(&Cell::Absent)
            }
        }
    }

    /// The cell as text, if it holds one.
    pub(super) fn text(&self, row: &Row) -> Option<String> {
        let cell = self.cell(row);
        (!cell.is_absent()).then(|| cell.text()).flatten()
    }
}
