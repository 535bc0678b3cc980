//! Source of the families of questions: [`FamilySource`].

use super::column::SetColumn;
use super::roles::FamilyColumns;
use crate::ready_made::cells::{Row, SetRows};
use crate::ready_made::choices::SetQuestion;

/// Source of the family of each question.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum FamilySource {
    Column(SetColumn),
    /// The configuration of the repository that has the row.
    Configuration,
    None,
}

impl FamilySource {
    /// Chooses the column given by the user. Without one: the first candidate with more than one value among the
    /// questions, else the configuration if there are several, else the first candidate.
    pub(crate) fn choose(table: &SetRows, families: &FamilyColumns, questions: &[SetQuestion]) -> Self {
        let columns = match families {
            FamilyColumns::Candidates(columns) => columns,
            FamilyColumns::Chosen(column) => {
                return column.clone().map_or(Self::None, Self::Column);
            }
        };
        let varying = columns
            .iter()
            .find(|column| has_several_values(questions.iter().map(|question| column.text(&table.rows[question.row]))));
        if let Some(column) = varying {
            return Self::Column(column.clone());
        }
        if has_several_values(questions.iter().map(|question| config(table, &table.rows[question.row]))) {
            return Self::Configuration;
        }
        columns.first().cloned().map_or(Self::None, Self::Column)
    }

    /// Name of the family of a row: the cell of the column, else the configuration; `None` if both are empty.
    pub(crate) fn family(&self, table: &SetRows, row: &Row) -> Option<String> {
        if let Self::Column(column) = self
            && let Some(text) = column.text(row)
        {
            return Some(text.trim().to_owned());
        }
        let config = config(table, row);
        (!config.is_empty()).then(|| config.to_owned())
    }

    /// Description for the summary.
    pub(crate) fn description(&self) -> String {
        match self {
            Self::Column(column) => format!("column {}", column.name),
            Self::Configuration => "by configuration".to_owned(),
            Self::None => "no column of families".to_owned(),
        }
    }
}

fn config<'a>(table: &'a SetRows, row: &Row) -> &'a str {
    &table.files[row.file].config
}

/// True if the values are not all equal.
fn has_several_values<T: PartialEq>(mut values: impl Iterator<Item = T>) -> bool {
    let first = values.next();
    first.is_some_and(|first| values.any(|value| value != first))
}
