//! Names of image files with the cells of a row in them: [`Template`].

use super::column::Column;
use crate::dataset::ready_made::cells::{Row, Table};

/// The greatest width of a number; chosen.
const WIDEST: usize = 64;

/// The name of an image file with cells in braces: `images/{id}.jpg`, or `images/{id:012}.jpg` for a number in twelve digits.
#[derive(Debug)]
pub(in crate::dataset::ready_made) struct Template {
    text: String,
    parts: Vec<Part>,
}

#[derive(Debug)]
enum Part {
    Words(String),
    /// A cell, with zeros before it up to a width; 0 for none.
    Cell {
        column: Column,
        width: usize,
    },
}

impl Template {
    /// Reads a template for the columns of a table, which `column` finds by their names.
    ///
    /// # Errors
    /// If a brace is missing, or a column is not there.
    pub(super) fn new(
        table: &Table,
        text: &str,
        column: impl Fn(&str) -> Result<Column, String>,
    ) -> Result<Self, String> {
        let mut parts = Vec::new();
        let mut rest = text;
        while let Some((words, after)) = rest.split_once('{') {
            let (field, after) = after
                .split_once('}')
                .ok_or_else(|| format!("{text:?}: '}}' is missing"))?;
            parts.push(Part::Words(words.to_owned()));
            parts.push(cell(table, field, &column)?);
            rest = after;
        }
        parts.push(Part::Words(rest.to_owned()));
        Ok(Self {
            text: text.to_owned(),
            parts,
        })
    }

    /// The template as the user wrote it.
    pub(in crate::dataset::ready_made) fn text(&self) -> &str {
        &self.text
    }

    /// The name with the cells of a row; `None` if one is absent.
    pub(in crate::dataset::ready_made) fn filled(&self, row: &Row) -> Option<String> {
        self.parts
            .iter()
            .map(|part| match part {
                Part::Words(words) => Some(words.clone()),
                Part::Cell { column, width } => {
                    let value = column.text(row)?;
                    Some(format!("{:0>width$}", value.trim()))
                }
            })
            .collect()
    }
}

/// The cell in braces: a column, or a column and a width as in Python, `id:012` or `id:012d`. A column of the whole name goes first.
fn cell(
    table: &Table,
    field: &str,
    column: impl Fn(&str) -> Result<Column, String>,
) -> Result<Part, String> {
    if table.find(field).is_none()
        && let Some((name, format)) = field.rsplit_once(':')
        && let Some(width) = width(format)
    {
        if width > WIDEST {
            return Err(format!("{{{field}}}: a width of at most {WIDEST} expected"));
        }
        let column = column(name)?;
        return Ok(Part::Cell { column, width });
    }
    let column = column(field)?;
    Ok(Part::Cell { column, width: 0 })
}

/// The width of a format with leading zeros; `None` for other texts.
fn width(format: &str) -> Option<usize> {
    let digits = format.strip_suffix('d').unwrap_or(format);
    let width = digits.strip_prefix('0')?;
    width.parse().ok()
}
