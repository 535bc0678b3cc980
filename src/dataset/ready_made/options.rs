//! The options of a row: [`Options`].

use super::cell::Cell;
use super::lettered::{in_cell, without_letters};
use super::offered::Offered;
use super::roles::{Column, Roles};
use super::row::Row;
use super::text_list::list;

/// What the columns of a row offer as options.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Options {
    /// No column has any.
    None,
    Found(Offered),
    /// Two columns differ.
    Differ([String; 2]),
    /// A cell that is no list of options.
    Unread {
        column: String,
        cell: String,
    },
}

impl Options {
    /// The options of a row in its columns.
    pub(super) fn of(row: &Row, roles: &Roles) -> Self {
        let mut found: Vec<(String, Offered)> = Vec::new();
        let cells = roles.cells.iter().enumerate();
        let cells = cells.filter_map(|(place, cell)| Some((option(cell.of(row))?, place)));
        let (texts, places): (Vec<String>, Vec<usize>) = cells.unzip();
        if !texts.is_empty() {
            let texts = without_letters(texts);
            found.push((cell_names(&roles.cells), Offered { texts, places }));
        }
        for column in &roles.options {
            let cell = column.of(row);
            if cell.is_absent() {
                continue;
            }
            match options(cell, roles.split_options.as_deref()) {
                Some(options) if options.is_empty() => {}
                Some(options) => {
                    let offered = Offered::listed(without_letters(options));
                    found.push((column.name.clone(), offered));
                }
                None => {
                    return Self::Unread {
                        column: column.name.clone(),
                        cell: cell.shown(60),
                    };
                }
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
