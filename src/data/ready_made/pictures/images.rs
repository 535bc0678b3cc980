//! Images of a row: [`images`], and the location of an image inside a table: [`EmbeddedImage`].
//!
//! Image marks in the texts of a row, such as `<image 2>`: [`ImageMarks`].

use std::sync::{Arc, LazyLock};

use regex::{Captures, Regex};

use crate::ready_made::cells::{
    Cell, DroppedFile, MAX_NAME_LENGTH, PathStep, Row, RowPlace, decode_base64, parse_list,
};
use crate::ready_made::columns::{ColumnRoles, ImageColumns, SetColumn};
use crate::ready_made::container::SetFile;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::text::excerpt;
use darkqa_base::types::text::image_mark::mark;
use darkqa_pictures::image_file::format::FileFormat;
use darkqa_pictures::{DecodeRule, ImageFile};

/// Reference to an image of a row.
#[derive(Debug, Clone)]
pub(crate) enum RowImage {
    /// Bytes or base64 in a cell.
    Embedded { column: usize, steps: Vec<PathStep>, facts: DroppedFile },
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
fn named_frame(row: &Row, roles: &ColumnRoles) -> Option<RowImage> {
    let (ImageColumns::First(columns) | ImageColumns::All(columns)) = &roles.images else {
        return None;
    };
    columns.iter().find_map(|column| column.text(row)).map(RowImage::Frame)
}

impl ImageForm {
    /// Images of a row, in order.
    pub(crate) fn in_row(self, row: &Row, roles: &ColumnRoles) -> Vec<RowImage> {
        match self {
            Self::Files => images(row, roles),
            Self::Frames => named_frame(row, roles).into_iter().collect(),
        }
    }
}

/// Images of a row, in order. If several columns may have the image, the first with image data is preferred to paths.
pub(crate) fn images(row: &Row, roles: &ColumnRoles) -> Vec<RowImage> {
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
fn add_column_images(row: &Row, column: &SetColumn, found: &mut Vec<RowImage>) {
    let steps = field_steps(column.field.as_deref());
    add_images(column.cell(row), column.index, &steps, found);
}

/// Steps to a field, given as a path with dots.
fn field_steps(field: Option<&str>) -> Vec<PathStep> {
    field.into_iter().flat_map(|field| field.split('.')).map(|field| PathStep::Field(field.to_owned())).collect()
}

/// Adds the images in a cell, or in a part of a cell at the end of `steps`.
fn add_images(cell: &Cell, column: usize, steps: &[PathStep], found: &mut Vec<RowImage>) {
    if cell.is_absent() {
        return;
    }
    match cell {
        Cell::File(facts) => found.push(RowImage::Embedded { column, steps: steps.to_vec(), facts: (**facts).clone() }),
        Cell::List(cells) => {
            for (index, cell) in cells.iter().enumerate() {
                add_images(cell, column, &with_step(steps, PathStep::Item(index)), found);
            }
        }
        Cell::Fields(_) => {
            let field = ["bytes", "path"]
                .into_iter()
                .filter_map(|name| Some((name, cell.field(name)?)))
                .find(|(_, cell)| !cell.is_absent());
            if let Some((name, cell)) = field {
                add_images(cell, column, &with_step(steps, PathStep::Field(name.to_owned())), found);
            }
        }
        Cell::Text(text) => add_text_images(text, column, steps, found),
        Cell::Number(text) => found.push(RowImage::RowOrFile(text.to_string())),
        Cell::Absent | Cell::Bool(_) | Cell::Bytes(_) => {}
    }
}

fn with_step(steps: &[PathStep], step: PathStep) -> Vec<PathStep> {
    [steps, &[step]].concat()
}

/// Adds the images in a text: a file in base64, a list of texts, a path, or the id of a row.
fn add_text_images(text: &str, column: usize, steps: &[PathStep], found: &mut Vec<RowImage>) {
    if let Some(bytes) = decode_base64(text) {
        found.push(RowImage::Embedded { column, steps: steps.to_vec(), facts: DroppedFile::from_bytes(&bytes) });
        return;
    }
    if let Some(items) = parse_list(text) {
        for (index, item) in items.into_iter().enumerate() {
            let steps = [steps, &[PathStep::Item(index)]].concat();
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
pub struct EmbeddedImage {
    pub(super) file: Arc<SetFile>,
    pub(super) row: RowPlace,
    pub(super) part: Arc<CellPart>,
    pub(super) facts: DroppedFile,
}

/// Part of a row that has an image. Most images of a set share it.
#[derive(Debug)]
pub(super) struct CellPart {
    pub(super) column: String,
    /// Path from the cell to the image.
    pub(super) steps: Vec<PathStep>,
}

impl EmbeddedImage {
    /// Name of the image format, or `other`.
    pub fn format(&self) -> &'static str {
        self.facts.format.map_or("other", FileFormat::name)
    }

    /// Reads the image file from the cell.
    ///
    /// # Errors
    /// If the table cannot be read, or has changed since it was opened.
    pub fn read_image(&self, rule: DecodeRule) -> Result<ImageFile> {
        let place = format!("{}, {}", self.file.label.path.display(), self.row);
        let value = self.file.value(&self.row, &self.part.column, &self.part.steps)?;
        let bytes = std::str::from_utf8(&value).ok().and_then(decode_base64).unwrap_or(value);
        if DroppedFile::from_bytes(&bytes) != self.facts {
            let problem = "the image has changed since the file was opened; start again";
            return Err(Error::data(place, problem));
        }
        Ok(ImageFile::new(bytes, place, rule))
    }
}

/// Mark with the space after it: `<image>`, `<image 2>` or `<image2>`.
static MARK: LazyLock<Option<Regex>> = LazyLock::new(|| Regex::new(r"<image(?: ?(\d+))?>(\s*)").ok());

/// Normalizes the image marks of a row. With one image, marks are removed. With several, the texts of the row must be
/// read in order, because the k-th mark without a number refers to the k-th image.
#[derive(Debug)]
pub(crate) struct ImageMarks {
    /// Number of images.
    images: usize,
    /// Number of marks without a number so far.
    unnumbered: usize,
    has_numbers: bool,
}

impl ImageMarks {
    pub(crate) fn new(images: usize) -> Self {
        Self { images, unnumbered: 0, has_numbers: false }
    }

    /// Rewrites all marks of a text in one form.
    ///
    /// # Errors
    /// If a mark refers to an image that the row does not have, or only some marks have numbers.
    pub(crate) fn read(&mut self, text: &str) -> Result<String, String> {
        let Some(pattern) = &*MARK else {
            return Ok(text.to_owned());
        };
        if self.images == 1 {
            return Ok(pattern.replace_all(text, "").trim().to_owned());
        }
        let mut problem = None;
        let read = pattern.replace_all(text, |found: &Captures<'_>| {
            let number = if let Some(number) = found.get(1) {
                self.has_numbers = true;
                number.as_str().parse().unwrap_or(usize::MAX)
            } else {
                self.unnumbered += 1;
                self.unnumbered
            };
            if self.has_numbers && self.unnumbered > 0 {
                problem = Some("of the marks <image …> some have numbers and some have none".to_owned());
            } else if number == 0 || number > self.images {
                problem = Some(format!(
                    "{:?} is not an image of the row, which shows {}",
                    excerpt(found[0].trim(), 30),
                    self.images
                ));
            }
            format!("{}{}", mark(number.max(1) - 1), &found[2])
        });
        match problem {
            Some(problem) => Err(problem),
            None => Ok(read.trim().to_owned()),
        }
    }

    /// Rewrites all marks of an option in one form. With one image, the option is not changed.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub(crate) fn read_option(&mut self, option: &str) -> Result<String, String> {
        if self.images == 1 {
            return Ok(option.to_owned());
        }
        self.read(option)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_are_normalized() {
        for (images, texts, expected) in [
            (2, ["Is <image 1> like <image 2>?", ""], Ok(["Is <image 1> like <image 2>?", ""])),
            (2, ["<image1> <image2>\nWhich?", "<image 2>"], Ok(["<image 1> <image 2>\nWhich?", "<image 2>"])),
            (3, ["<image> <image>", "<image>"], Ok(["<image 1> <image 2>", "<image 3>"])),
            (2, ["Which is darker?", "the first"], Ok(["Which is darker?", "the first"])),
            (2, ["<image 3>", ""], Err("\"<image 3>\" is not an image of the row, which shows 2")),
            (2, ["<image 0>", ""], Err("not an image of the row")),
            (2, ["<image> <image>", "<image>"], Err("not an image of the row")),
            (2, ["<image 99999999999999999999>", ""], Err("not an image of the row")),
            (2, ["<image 1>", "<image>"], Err("some have none")),
        ] {
            let mut marks = ImageMarks::new(images);
            let read: Result<Vec<String>, String> = texts.iter().map(|text| marks.read(text)).collect();
            match (read, expected) {
                (Ok(read), Ok(expected)) => assert_eq!(read, expected),
                (Err(problem), Err(expected)) => assert!(problem.contains(expected), "{problem}"),
                (read, expected) => panic!("{read:?} {expected:?}"),
            }
        }
    }

    #[test]
    fn marks_of_a_single_image_are_removed() {
        let mut marks = ImageMarks::new(1);
        let read = marks.read("<image 1>\nWhat is <image> this?").unwrap();
        assert_eq!(read, "What is this?");
        assert_eq!(marks.read_option("<image 1>").unwrap(), "<image 1>");
    }
}
