//! The source of the families of questions: [`FamilyOf`].

use std::collections::BTreeSet;

use super::roles::{Column, Families};
use crate::dataset::ready_made::cells::{Row, Table};
use crate::dataset::ready_made::choices::Answered;

/// Where the family of a question stands.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(in crate::dataset::ready_made) enum FamilyOf {
    Column(Column),
    /// The configuration of a repository that holds the row.
    Configuration,
    None,
}

impl FamilyOf {
    /// The first of some columns with more than one value among the questions that are asked; else the configuration, if they are of
    /// several; else the first column.
    pub(in crate::dataset::ready_made) fn from_table(
        table: &Table,
        families: &Families,
        answered: &[Answered],
    ) -> Self {
        let columns = match families {
            Families::Known(columns) => columns,
            Families::Said(column) => return column.clone().map_or(Self::None, Self::Column),
        };
        let rows = || answered.iter().map(|answered| &table.rows[answered.row]);
        let varies = |column: &&Column| has_two(rows().map(|row| column.text(row)));
        if let Some(column) = columns.iter().find(varies) {
            return Self::Column(column.clone());
        }
        if has_two(rows().map(|row| config(table, row))) {
            return Self::Configuration;
        }
        columns.first().cloned().map_or(Self::None, Self::Column)
    }

    /// The family of a row; `None` if nothing names it.
    pub(in crate::dataset::ready_made) fn text(&self, table: &Table, row: &Row) -> Option<String> {
        let text = match self {
            Self::Column(column) => column.text(row),
            Self::Configuration | Self::None => None,
        };
        let config = config(table, row);
        let text = text.map(|text| text.trim().to_owned());
        text.or_else(|| (!config.is_empty()).then(|| config.to_owned()))
    }

    /// In words, for the summary.
    pub(in crate::dataset::ready_made) fn said(&self) -> String {
        match self {
            Self::Column(column) => format!("column {}", column.name),
            Self::Configuration => "by configuration".to_owned(),
            Self::None => "no column of families".to_owned(),
        }
    }
}

fn config<'a>(table: &'a Table, row: &Row) -> &'a str {
    &table.files[row.file].config
}

/// Whether there are two different values.
fn has_two<T: Ord>(values: impl Iterator<Item = T>) -> bool {
    let mut seen = BTreeSet::new();
    let mut values = values;
    values.any(|value| {
        seen.insert(value);
        seen.len() > 1
    })
}
