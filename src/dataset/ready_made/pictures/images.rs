//! The images of a row: [`images`], and the place of one inside a file of rows: [`EmbeddedImage`].

use std::sync::Arc;

use crate::dataset::ready_made::cells::{
    Cell, FileFacts, LONGEST_NAME, Row, RowPlace, Step, decoded, list,
};
use crate::dataset::ready_made::columns::{Images, Roles};
use crate::dataset::ready_made::container::SetFile;
use crate::error::{Error, Result};
use crate::picture::image_file::format::FileFormat;
use crate::picture::{ImageFile, ReadingRule};

/// An image of a row.
#[derive(Debug, Clone)]
pub(in crate::dataset::ready_made) enum RowImage {
    /// Bytes or base64 in a cell.
    Embedded {
        column: usize,
        steps: Vec<Step>,
        facts: FileFacts,
    },
    /// A file, by the path in a cell.
    File(String),
    /// A short text that may be the id of another row, or a path.
    RowOrFile(String),
    /// The name of a frame of other data.
    Frame(String),
}

/// The content of the image columns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::dataset::ready_made) enum ImageForm {
    /// Images, or the paths of files.
    Files,
    /// The names of frames of other data.
    Frames,
}

/// The frames that a row names.
fn named_frames(row: &Row, roles: &Roles) -> Vec<RowImage> {
    let (Images::First(columns) | Images::All(columns)) = &roles.images else {
        return Vec::new();
    };
    let names = columns.iter().filter_map(|column| column.text(row));
    names.take(1).map(RowImage::Frame).collect()
}

impl ImageForm {
    /// The images of a row, in order.
    pub(in crate::dataset::ready_made) fn in_row(self, row: &Row, roles: &Roles) -> Vec<RowImage> {
        match self {
            Self::Files => images(row, roles),
            Self::Frames => named_frames(row, roles),
        }
    }
}

/// The images of a row, in order. Of columns that hold the same image, the first with the image itself goes before paths.
pub(in crate::dataset::ready_made) fn images(row: &Row, roles: &Roles) -> Vec<RowImage> {
    let mut found = Vec::new();
    match &roles.images {
        Images::First(columns) => {
            for column in columns {
                let steps = field_steps(column.field.as_deref());
                let mut own = Vec::new();
                collect(column.cell(row), column.at, &steps, &mut own);
                let is_embedded = |image: &RowImage| matches!(image, RowImage::Embedded { .. });
                if own.iter().any(is_embedded) {
                    return own;
                }
                if found.is_empty() {
                    found = own;
                }
            }
        }
        Images::All(columns) => {
            for column in columns {
                let steps = field_steps(column.field.as_deref());
                collect(column.cell(row), column.at, &steps, &mut found);
            }
        }
        Images::Template(template) => {
            found.extend(template.filled(row).map(RowImage::File));
        }
    }
    found
}

fn field_steps(field: Option<&str>) -> Vec<Step> {
    field
        .into_iter()
        .flat_map(|field| field.split('.'))
        .map(|field| Step::Field(field.to_owned()))
        .collect()
}

/// Adds the images of a cell.
fn collect(cell: &Cell, column: usize, steps: &[Step], found: &mut Vec<RowImage>) {
    if cell.is_absent() {
        return;
    }
    let with = |step: Step| [steps, &[step]].concat();
    match cell {
        Cell::File(facts) => found.push(RowImage::Embedded {
            column,
            steps: steps.to_vec(),
            facts: (**facts).clone(),
        }),
        Cell::List(cells) => {
            for (at, cell) in cells.iter().enumerate() {
                collect(cell, column, &with(Step::Item(at)), found);
            }
        }
        Cell::Fields(_) => {
            let field = ["bytes", "path"]
                .into_iter()
                .filter_map(|name| Some((name, cell.field(name)?)))
                .find(|(_, cell)| !cell.is_absent());
            if let Some((name, cell)) = field {
                collect(cell, column, &with(Step::Field(name.to_owned())), found);
            }
        }
        Cell::Text(text) => text_image(text, column, steps, found),
        Cell::Number(text) => found.push(RowImage::RowOrFile(text.to_string())),
        Cell::Absent | Cell::Bool(_) | Cell::Bytes(_) => {}
    }
}

/// Adds the images of a text: a file in base64, a list of such texts, a path, or the id of a row.
fn text_image(text: &str, column: usize, steps: &[Step], found: &mut Vec<RowImage>) {
    if let Some(bytes) = decoded(text) {
        let (steps, facts) = (steps.to_vec(), FileFacts::from_bytes(&bytes));
        found.push(RowImage::Embedded {
            column,
            steps,
            facts,
        });
        return;
    }
    if let Some(items) = text
        .trim_start()
        .starts_with('[')
        .then(|| list(text))
        .flatten()
    {
        for (at, item) in items.into_iter().enumerate() {
            let steps = [steps, &[Step::Item(at)]].concat();
            collect(&Cell::Text(item), column, &steps, found);
        }
        return;
    }
    found.push(if text.len() <= LONGEST_NAME {
        RowImage::RowOrFile(text.trim().to_owned())
    } else {
        RowImage::File(text.trim().to_owned())
    });
}

/// The place of an image inside a file of rows. It is read when needed, so that files of gigabytes are never in memory.
#[derive(Debug, Clone)]
pub(crate) struct EmbeddedImage {
    pub(super) file: Arc<SetFile>,
    pub(super) row: RowPlace,
    pub(super) part: Arc<CellPart>,
    pub(super) facts: FileFacts,
}

/// The part of a row that holds an image; all images of a set are mostly in the same.
#[derive(Debug)]
pub(super) struct CellPart {
    pub(super) column: String,
    /// From the cell to the image.
    pub(super) steps: Vec<Step>,
}

impl EmbeddedImage {
    /// The name of the format, by its first bytes.
    pub(in crate::dataset::ready_made) fn format(&self) -> &'static str {
        self.facts.format.map_or("other", FileFormat::name)
    }

    /// The image file in the cell.
    ///
    /// # Errors
    /// If the file of rows cannot be read, or has changed since it was opened.
    pub(in crate::dataset) fn read_image(&self, rule: ReadingRule) -> Result<ImageFile> {
        let place = format!("{}, {}", self.file.label.path.display(), self.row);
        let value = self
            .file
            .value(&self.row, &self.part.column, &self.part.steps)?;
        let value = match std::str::from_utf8(&value).ok().and_then(decoded) {
            Some(bytes) => bytes,
            None => value,
        };
        if FileFacts::from_bytes(&value) != self.facts {
            let problem = "the image has changed since the file was opened; start again";
            return Err(Error::data(place, problem));
        }
        Ok(ImageFile::new(value, place, rule))
    }
}
