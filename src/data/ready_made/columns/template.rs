//! Templates for the names of image files: [`Template`].

use super::column::Column;
use crate::data::ready_made::cells::{Row, Table};

/// Maximum width of a number (chosen).
const MAX_WIDTH: usize = 64;

/// Name of an image file with columns in braces: `images/{id}.jpg`, or `images/{id:012}.jpg` for a number in twelve
/// digits.
#[derive(Debug)]
pub(crate) struct Template {
    text: String,
    parts: Vec<TemplatePart>,
}

#[derive(Debug)]
enum TemplatePart {
    /// Literal text.
    Literal(String),
    /// Text of a cell, with leading zeros up to a minimum width.
    Cell { column: Column, width: usize },
}

impl Template {
    /// Parses a template for a table. `find_column` finds a column of the table by its name.
    ///
    /// # Errors
    /// If a brace or a column is missing.
    pub(super) fn parse(
        table: &Table,
        text: &str,
        find_column: impl Fn(&str) -> Result<Column, String>,
    ) -> Result<Self, String> {
        let mut parts = Vec::new();
        let mut rest = text;
        while let Some((literal, after)) = rest.split_once('{') {
            let (field, after) = after.split_once('}').ok_or_else(|| format!("{text:?}: '}}' is missing"))?;
            parts.push(TemplatePart::Literal(literal.to_owned()));
            parts.push(parse_field(table, field, &find_column)?);
            rest = after;
        }
        parts.push(TemplatePart::Literal(rest.to_owned()));
        Ok(Self { text: text.to_owned(), parts })
    }

    /// Template as written by the user.
    pub(crate) fn text(&self) -> &str {
        &self.text
    }

    /// Fills in the cells of a row; `None` if one is absent.
    pub(crate) fn fill(&self, row: &Row) -> Option<String> {
        self.parts
            .iter()
            .map(|part| match part {
                TemplatePart::Literal(text) => Some(text.clone()),
                TemplatePart::Cell { column, width } => {
                    let value = column.text(row)?;
                    Some(format!("{:0>width$}", value.trim()))
                }
            })
            .collect()
    }
}

/// Parses a field in braces: a column, or a column with a width in Python's notation, `id:012` or `id:012d`. A column
/// with the whole name takes precedence.
fn parse_field(
    table: &Table,
    field: &str,
    find_column: impl Fn(&str) -> Result<Column, String>,
) -> Result<TemplatePart, String> {
    if table.find(field).is_none()
        && let Some((name, format)) = field.rsplit_once(':')
        && let Some(width) = parse_width(format)
    {
        if width > MAX_WIDTH {
            return Err(format!("{{{field}}}: a width of at most {MAX_WIDTH} expected"));
        }
        let column = find_column(name)?;
        return Ok(TemplatePart::Cell { column, width });
    }
    let column = find_column(field)?;
    Ok(TemplatePart::Cell { column, width: 0 })
}

/// Parses a width with leading zeros, such as `012`; `None` for other texts.
fn parse_width(format: &str) -> Option<usize> {
    let digits = format.strip_suffix('d').unwrap_or(format);
    digits.strip_prefix('0')?.parse().ok()
}
