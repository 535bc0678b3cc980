//! The options of a row: [`Options`].

use std::sync::Arc;

use super::lettered::{in_cell, without_letters};
use super::offered::Offered;
use crate::dataset::ready_made::cells::{Cell, Fields, Row, dict, list};
use crate::dataset::ready_made::columns::{Column, Roles};
use crate::types::questions::letter;
use crate::types::shell_word;
use crate::types::text::excerpt;

/// The options in the columns of a row.
#[derive(Debug, PartialEq, Eq)]
pub(in crate::dataset::ready_made) enum Options {
    /// No column has any.
    None,
    Found(Offered),
    /// Two columns differ.
    Differ([String; 2]),
    /// A cell that is no list of options, in words.
    Unread(String),
}

impl Options {
    /// The options of a row in its columns.
    pub(in crate::dataset::ready_made) fn from_row(row: &Row, roles: &Roles) -> Self {
        let mut found: Vec<(String, Offered)> = Vec::new();
        let cells = roles
            .cells
            .iter()
            .enumerate()
            .filter_map(|(place, cell)| Some((option(cell.cell(row))?, place)));
        let (texts, places): (Vec<String>, Vec<usize>) = cells.unzip();
        if !texts.is_empty() {
            let offered = Offered::placed(&without_letters(texts), places);
            found.push((cell_names(&roles.cells), offered));
        }
        for column in &roles.options {
            let cell = column.cell(row);
            if cell.is_absent() {
                continue;
            }
            let split = roles.split_options.as_deref();
            let offered = match by_letter(cell).filter(|_| split.is_none()) {
                Some(fields) => options_in_fields(&fields).map_err(|problem| {
                    let shown = cell.shown(60);
                    format!(
                        "the options in the column {:?} {problem}: {shown}",
                        column.name
                    )
                }),
                None => options(cell, split)
                    .map(|texts| Offered::listed(&without_letters(texts)))
                    .ok_or_else(|| no_list(column, cell)),
            };
            match offered {
                Ok(offered) if offered.texts.is_empty() => {}
                Ok(offered) => found.push((column.name.clone(), offered)),
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

fn no_list(column: &Column, cell: &Cell) -> String {
    let split = format!("{}:split(|)", column.name);
    format!(
        "the column {:?} holds no list of options: {}; --map options={} names the signs between them",
        column.name,
        cell.shown(60),
        shell_word(&split)
    )
}

/// The fields of a cell that is an object, or the text of one in JSON or in Python's notation.
fn by_letter(cell: &Cell) -> Option<Fields> {
    match cell {
        Cell::Fields(fields) => Some(fields.clone()),
        Cell::Text(text) => {
            let pairs = dict(text)?.into_iter();
            Some(
                pairs
                    .map(|(name, text)| (name.into(), text.map_or(Cell::Absent, Cell::Text)))
                    .collect(),
            )
        }
        _ => None,
    }
}

/// The options of an object whose fields are the letters from A on, of either case.
fn options_in_fields(fields: &[(Arc<str>, Cell)]) -> Result<Offered, String> {
    let mut sorted: Vec<(char, &Cell)> = Vec::with_capacity(fields.len());
    for (name, cell) in fields {
        let mut chars = name.trim().chars();
        match (chars.next(), chars.next()) {
            (Some(name), None) if name.is_ascii_alphabetic() => {
                sorted.push((name.to_ascii_uppercase(), cell));
            }
            _ => {
                return Err(format!(
                    "have the name {:?}, where a letter is expected",
                    excerpt(name, 60)
                ));
            }
        }
    }
    sorted.sort_by_key(|(name, _)| *name);
    for (place, (name, _)) in sorted.iter().enumerate() {
        let expected = letter(place);
        if *name != expected {
            return Err(format!("have {name} where {expected} is expected"));
        }
    }
    let (mut texts, mut places) = (Vec::new(), Vec::new());
    for (place, (name, cell)) in sorted.into_iter().enumerate() {
        match option(cell) {
            Some(text) => {
                texts.push(text);
                places.push(place);
            }
            None if cell.is_absent() => {}
            None => return Err(format!("hold no text at {name}")),
        }
    }
    Ok(Offered::placed(&without_letters(texts), places))
}

/// The names of the columns of options as `--map` takes them.
fn cell_names(cells: &[Column]) -> String {
    let names: Vec<&str> = cells.iter().map(|cell| cell.name.as_str()).collect();
    names.join(",")
}

/// The option in a cell of its own. `None` is a word that a choice may be, so it is none only where nothing stands at all.
fn option(cell: &Cell) -> Option<String> {
    let text = cell.text()?;
    let is_nothing = matches!(&*text.trim().to_ascii_lowercase(), "nan" | "n/a");
    (!is_nothing).then_some(text)
}

/// The options in a cell.
fn options(cell: &Cell, split: Option<&str>) -> Option<Vec<String>> {
    match (cell, split) {
        (Cell::List(cells), _) => cells.iter().map(Cell::text).collect(),
        (Cell::Text(text), Some(signs)) => {
            let parts = text.split(signs).map(|part| part.trim().to_owned());
            Some(parts.collect())
        }
        (Cell::Text(text), None) => list(text).or_else(|| in_cell(text)),
        _ => None,
    }
}
