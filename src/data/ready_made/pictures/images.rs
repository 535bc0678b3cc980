//! Images of a row: [`images`], and the location of an image inside a table: [`EmbeddedImage`].

use std::sync::Arc;

use crate::data::ready_made::cells::{
    Cell, FileFacts, MAX_NAME_LENGTH, Row, RowPlace, Step, decode_base64, parse_list,
};
use crate::data::ready_made::columns::{Column, ImageColumns, Roles};
use crate::data::ready_made::container::SetFile;
use crate::error::{Error, Result};
use crate::pictures::image_file::format::FileFormat;
use crate::pictures::{DecodeRule, ImageFile};

/// Reference to an image of a row.
#[derive(Debug, Clone)]
pub(crate) enum RowImage {
    /// Bytes or base64 in a cell.
    Embedded { column: usize, steps: Vec<Step>, facts: FileFacts },
    /// Path of a file.
    File(String),
    /// Short text that may be the id of another row, or a path.
    RowOrFile(String),
    /// Name of a frame of other data.
    Frame(String),
}

/// Content of the image columns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ImageForm {
    /// Images, or the paths of files.
    Files,
    /// Names of frames of other data.
    Frames,
}

/// Frame of other data that a row is about, if it has one.
fn named_frame(row: &Row, roles: &Roles) -> Option<RowImage> {
    let (ImageColumns::First(columns) | ImageColumns::All(columns)) = &roles.images else {
        return None;
    };
    columns.iter().find_map(|column| column.text(row)).map(RowImage::Frame)
}

impl ImageForm {
    /// Images of a row, in order.
    pub(crate) fn in_row(self, row: &Row, roles: &Roles) -> Vec<RowImage> {
        match self {
            Self::Files => images(row, roles),
            Self::Frames => named_frame(row, roles).into_iter().collect(),
        }
    }
}

/// Images of a row, in order. If several columns may have the image, the first with image data is preferred to paths.
pub(crate) fn images(row: &Row, roles: &Roles) -> Vec<RowImage> {
    let mut found = Vec::new();
    match &roles.images {
        ImageColumns::First(columns) => {
            for column in columns {
                let mut in_column = Vec::new();
                add_column_images(row, column, &mut in_column);
                if in_column.iter().any(|image| matches!(image, RowImage::Embedded { .. })) {
                    return in_column;
                }
                if found.is_empty() {
                    found = in_column;
                }
            }
        }
        ImageColumns::All(columns) => {
            for column in columns {
                add_column_images(row, column, &mut found);
            }
        }
        ImageColumns::Template(template) => {
            found.extend(template.fill(row).map(RowImage::File));
        }
    }
    found
}

/// Adds the images of a row in a column.
fn add_column_images(row: &Row, column: &Column, found: &mut Vec<RowImage>) {
    let steps = field_steps(column.field.as_deref());
    add_images(column.cell(row), column.index, &steps, found);
}

/// Steps to a field, given as a path with dots.
fn field_steps(field: Option<&str>) -> Vec<Step> {
    field.into_iter().flat_map(|field| field.split('.')).map(|field| Step::Field(field.to_owned())).collect()
}

/// Adds the images in a cell, or in a part of a cell at the end of `steps`.
fn add_images(cell: &Cell, column: usize, steps: &[Step], found: &mut Vec<RowImage>) {
    if cell.is_absent() {
        return;
    }
    match cell {
        Cell::File(facts) => found.push(RowImage::Embedded { column, steps: steps.to_vec(), facts: (**facts).clone() }),
        Cell::List(cells) => {
            for (index, cell) in cells.iter().enumerate() {
                add_images(cell, column, &with_step(steps, Step::Item(index)), found);
            }
        }
        Cell::Fields(_) => {
            let field = ["bytes", "path"]
                .into_iter()
                .filter_map(|name| Some((name, cell.field(name)?)))
                .find(|(_, cell)| !cell.is_absent());
            if let Some((name, cell)) = field {
                add_images(cell, column, &with_step(steps, Step::Field(name.to_owned())), found);
            }
        }
        Cell::Text(text) => add_text_images(text, column, steps, found),
        Cell::Number(text) => found.push(RowImage::RowOrFile(text.to_string())),
        Cell::Absent | Cell::Bool(_) | Cell::Bytes(_) => {}
    }
}

fn with_step(steps: &[Step], step: Step) -> Vec<Step> {
    [steps, &[step]].concat()
}

/// Adds the images in a text: a file in base64, a list of texts, a path, or the id of a row.
fn add_text_images(text: &str, column: usize, steps: &[Step], found: &mut Vec<RowImage>) {
    if let Some(bytes) = decode_base64(text) {
        found.push(RowImage::Embedded { column, steps: steps.to_vec(), facts: FileFacts::from_bytes(&bytes) });
        return;
    }
    if let Some(items) = parse_list(text) {
        for (index, item) in items.into_iter().enumerate() {
            let steps = [steps, &[Step::Item(index)]].concat();
            add_images(&Cell::Text(item), column, &steps, found);
        }
        return;
    }
    found.push(if text.len() <= MAX_NAME_LENGTH {
        RowImage::RowOrFile(text.trim().to_owned())
    } else {
        RowImage::File(text.trim().to_owned())
    });
}

/// Location of an image inside a table. The image is read when needed, so that a large file is never in memory as a
/// whole.
#[derive(Debug, Clone)]
pub(crate) struct EmbeddedImage {
    pub(super) file: Arc<SetFile>,
    pub(super) row: RowPlace,
    pub(super) part: Arc<CellPart>,
    pub(super) facts: FileFacts,
}

/// Part of a row that has an image. Most images of a set share it.
#[derive(Debug)]
pub(super) struct CellPart {
    pub(super) column: String,
    /// Path from the cell to the image.
    pub(super) steps: Vec<Step>,
}

impl EmbeddedImage {
    /// Name of the image format, or `other`.
    pub(crate) fn format(&self) -> &'static str {
        self.facts.format.map_or("other", FileFormat::name)
    }

    /// Reads the image file from the cell.
    ///
    /// # Errors
    /// If the table cannot be read, or has changed since it was opened.
    pub(crate) fn read_image(&self, rule: DecodeRule) -> Result<ImageFile> {
        let place = format!("{}, {}", self.file.label.path.display(), self.row);
        let value = self.file.value(&self.row, &self.part.column, &self.part.steps)?;
        let bytes = std::str::from_utf8(&value).ok().and_then(decode_base64).unwrap_or(value);
        if FileFacts::from_bytes(&bytes) != self.facts {
            let problem = "the image has changed since the file was opened; start again";
            return Err(Error::data(place, problem));
        }
        Ok(ImageFile::new(bytes, place, rule))
    }
}
