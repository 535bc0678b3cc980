//! The answer options in the columns of a row: [`Options`].

use std::sync::Arc;

use super::lettered::{split_cell, without_letters};
use super::option_list::OptionList;
use crate::ready_made::cells::{Cell, Fields, Row, parse_list, parse_object};
use crate::ready_made::columns::{ColumnRoles, SetColumn};
use darkqa_base::types::questions::letter;
use darkqa_base::types::shell_word;
use darkqa_base::types::text::excerpt;

/// The answer options in the columns of a row.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Options {
    /// No column has options.
    None,
    /// The options; if several columns have options, all have the same texts.
    Found(OptionList),
    /// Two columns have different options: the names of both.
    Differ([String; 2]),
    /// A cell cannot be read as options: the error message.
    Unread(String),
}

impl Options {
    /// Reads the options of a row from the columns that have this role.
    pub(crate) fn from_row(row: &Row, roles: &ColumnRoles) -> Self {
        let mut found: Vec<(String, OptionList)> = Vec::new();
        let (texts, positions): (Vec<String>, Vec<usize>) = roles
            .option_cells
            .iter()
            .enumerate()
            .filter_map(|(position, column)| Some((single_option(column.cell(row))?, position)))
            .unzip();
        if !texts.is_empty() {
            let options = OptionList::with_positions(&without_letters(texts), positions);
            found.push((joined_names(&roles.option_cells), options));
        }
        for column in &roles.option_lists {
            let cell = column.cell(row);
            if cell.is_absent() {
                continue;
            }
            let separator = roles.option_separator.as_deref();
            let options = match object_fields(cell).filter(|_| separator.is_none()) {
                Some(fields) => lettered_options(&fields).map_err(|problem| {
                    format!("the options in the column {:?} {problem}: {}", column.name, cell.excerpt(60))
                }),
                None => listed_options(cell, separator)
                    .map(|texts| OptionList::from_list(&without_letters(texts)))
                    .ok_or_else(|| not_a_list(column, cell)),
            };
            match options {
                Ok(options) if options.texts.is_empty() => {}
                Ok(options) => found.push((column.name.clone(), options)),
                Err(problem) => return Self::Unread(problem),
            }
        }
        let mut found = found.into_iter();
        let Some((name, options)) = found.next() else {
            return Self::None;
        };
        match found.find(|(_, other)| other.texts != options.texts) {
            Some((other, _)) => Self::Differ([name, other]),
            None => Self::Found(options),
        }
    }
}

/// Error message for a cell that is not a list of options, with the sign that probably separates them.
fn not_a_list(column: &SetColumn, cell: &Cell) -> String {
    let text = cell.text().unwrap_or_default();
    let separator = [("\n", r"\n"), ("|", "|"), (";", ";"), (",", ",")]
        .into_iter()
        .find(|(sign, _)| text.contains(sign))
        .map_or("|", |(_, name)| name);
    let split = format!("{}:split({separator})", column.name);
    format!(
        "the column {:?} holds no list of options: {}; --map options={} names the signs between them",
        column.name,
        cell.excerpt(60),
        shell_word(&split)
    )
}

/// The fields of a cell that is an object, or a text with an object in JSON or a dictionary in Python's notation.
fn object_fields(cell: &Cell) -> Option<Fields> {
    match cell {
        Cell::Fields(fields) => Some(fields.clone()),
        Cell::Text(text) => Some(
            parse_object(text)?
                .into_iter()
                .map(|(name, text)| (name.into(), text.map_or(Cell::Absent, Cell::Text)))
                .collect(),
        ),
        _ => None,
    }
}

/// The options of an object with the field names A, B, C and so on, in upper or lower case.
///
/// # Errors
/// If a name is not the next letter, or a value is not a text. The message continues a sentence about the options.
fn lettered_options(fields: &[(Arc<str>, Cell)]) -> Result<OptionList, String> {
    let mut sorted: Vec<(char, &Cell)> = Vec::with_capacity(fields.len());
    for (name, cell) in fields {
        let mut chars = name.trim().chars();
        match (chars.next(), chars.next()) {
            (Some(key), None) if key.is_ascii_alphabetic() => {
                sorted.push((key.to_ascii_uppercase(), cell));
            }
            _ => {
                return Err(format!("have the name {:?}, where a letter is expected", excerpt(name, 60)));
            }
        }
    }
    sorted.sort_by_key(|(key, _)| *key);
    for (position, (key, _)) in sorted.iter().enumerate() {
        let expected = letter(position);
        if *key != expected {
            return Err(format!("have {key} where {expected} is expected"));
        }
    }
    let (mut texts, mut positions) = (Vec::new(), Vec::new());
    for (position, (key, cell)) in sorted.into_iter().enumerate() {
        match single_option(cell) {
            Some(text) => {
                texts.push(text);
                positions.push(position);
            }
            None if cell.is_absent() => {}
            None => return Err(format!("hold no text at {key}")),
        }
    }
    Ok(OptionList::with_positions(&without_letters(texts), positions))
}

/// The names of columns with commas between them, as in the value of `--map`.
fn joined_names(columns: &[SetColumn]) -> String {
    let names: Vec<&str> = columns.iter().map(|column| column.name.as_str()).collect();
    names.join(",")
}

/// The option in a cell with one option; `None` if the cell has no text or its text is `nan` or `n/a`.
///
/// The word `none` is kept, because it can be an option.
fn single_option(cell: &Cell) -> Option<String> {
    let text = cell.text()?;
    let is_missing = matches!(&*text.trim().to_ascii_lowercase(), "nan" | "n/a");
    (!is_missing).then_some(text)
}

/// The options of a cell that lists them, as a list or as text, split at `separator` if given; `None` if it lists no
/// options.
fn listed_options(cell: &Cell, separator: Option<&str>) -> Option<Vec<String>> {
    match (cell, separator) {
        (Cell::List(cells), _) => cells.iter().map(Cell::text).collect(),
        (Cell::Text(text), Some(separator)) => Some(text.split(separator).map(|part| part.trim().to_owned()).collect()),
        (Cell::Text(text), None) => parse_list(text).or_else(|| split_cell(text)),
        _ => None,
    }
}
