//! A column of a set: [`Column`].

use crate::dataset::ready_made::cells::{Cell, Row};

/// A column, or a field of structs in it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(in crate::dataset::ready_made) struct Column {
    pub(in crate::dataset::ready_made) at: usize,
    pub(in crate::dataset::ready_made) field: Option<String>,
    pub(in crate::dataset::ready_made) name: String,
}

impl Column {
    /// The cell of the column in a row.
    pub(in crate::dataset::ready_made) fn cell<'a>(&self, row: &'a Row) -> &'a Cell {
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
    pub(in crate::dataset::ready_made) fn text(&self, row: &Row) -> Option<String> {
        let cell = self.cell(row);
        (!cell.is_absent()).then(|| cell.text()).flatten()
    }
}
