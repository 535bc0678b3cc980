//! Column of a set: [`SetColumn`].

use crate::ready_made::cells::{Cell, Row};

/// A column, or a field of the structs in it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct SetColumn {
    /// Index in the table.
    pub index: usize,
    /// Path of the field, with dots; `None` for the whole cell.
    pub field: Option<String>,
    /// Name for messages, with the field.
    pub name: String,
}

impl SetColumn {
    /// A whole column.
    pub(crate) fn new(index: usize, name: &str) -> Self {
        Self { index, field: None, name: name.to_owned() }
    }

    /// A field of the structs in a column.
    pub(super) fn with_field(index: usize, name: &str, field: &str) -> Self {
        Self { index, field: Some(field.to_owned()), name: format!("{name}.{field}") }
    }

    /// Cell of the column in a row.
    pub(crate) fn cell<'a>(&self, row: &'a Row) -> &'a Cell {
        let cell = row.cell(self.index);
        match &self.field {
            None => cell,
            Some(path) => path.split('.').try_fold(cell, |cell, field| cell.field(field)).unwrap_or(&Cell::Absent),
        }
    }

    /// Cell of a row as text; `None` if it is absent or has no text.
    pub(crate) fn text(&self, row: &Row) -> Option<String> {
        let cell = self.cell(row);
        if cell.is_absent() { None } else { cell.text() }
    }
}
