//! Frames of the questions of a set: [`SetFrames`].

use std::collections::{BTreeMap, HashMap, HashSet};
use std::hash::Hash;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::images::{CellPart, EmbeddedImage, ImageForm, RowImage, images};
use crate::Root;
use crate::openeqa::ImageSource;
use crate::ready_made::cells::{Cell, DroppedFile, MAX_NAME_LENGTH, PathStep, SetRows};
use crate::ready_made::choices::SetQuestion;
use crate::ready_made::columns::map::{ColumnRole, map_flag};
use crate::ready_made::columns::{ColumnRoles, SetColumn};
use crate::ready_made::container::{Archive, SetFile};
use crate::ready_made::settings::SeveralImages;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::text::excerpt;
use darkqa_base::types::{Digest, FrameId};

/// Image of a question.
pub(super) enum LocatedImage {
    /// In a cell of a row.
    Cell { row: usize, column: usize, steps: Vec<PathStep>, facts: DroppedFile },
    /// An image file: the name of its frame and its path.
    File(FrameId, PathBuf),
    /// An image file in the archive.
    Member(FrameId),
    /// A frame of other data.
    Frame(FrameId),
}

/// Names and collects the frames of a set. Equal image data in several cells are one frame, with one noise seed.
pub(crate) struct SetFrames<'a> {
    pub(super) table: &'a SetRows,
    root: &'a Root,
    /// ZIP file of the set.
    pub(super) archive: Option<&'a Arc<Archive>>,
    files: &'a [Arc<SetFile>],
    /// Row with the embedded image that other rows refer to, by file and row id.
    image_rows: HashMap<(usize, String), usize>,
    pub(super) roles: &'a ColumnRoles,
    form: ImageForm,
    /// Shared parts of rows, by column and path in its cell.
    parts: HashMap<(usize, Vec<PathStep>), Arc<CellPart>>,
    /// Names of embedded images.
    names: HashMap<Digest, FrameId>,
    sources: BTreeMap<FrameId, ImageSource>,
    series: Series,
}

/// Images of each row with several, by the name that stands for all of them.
pub(crate) type Series = BTreeMap<FrameId, Vec<FrameId>>;

impl<'a> SetFrames<'a> {
    pub(crate) fn new(
        table: &'a SetRows,
        root: &'a Root,
        archive: Option<&'a Arc<Archive>>,
        files: &'a [Arc<SetFile>],
        roles: &'a ColumnRoles,
        form: ImageForm,
        several: Option<SeveralImages>,
    ) -> Self {
        let mut frames = Self {
            table,
            root,
            archive,
            files,
            image_rows: HashMap::new(),
            roles,
            form,
            parts: HashMap::new(),
            names: HashMap::new(),
            sources: BTreeMap::new(),
            series: Series::new(),
        };
        frames.name_embedded(several);
        frames
    }

    /// Names embedded images by the lowest id of the rows that have them, so that the order of rows does not matter, or
    /// by their content if no id column is unique. Several images of a row get its id and a number: `7#1`, `7#2`.
    fn name_embedded(&mut self, several: Option<SeveralImages>) {
        let id_column = self.roles.ids.iter().find(|column| self.is_unique(column, |_, text| text));
        let mut has_row_references = false;
        for row in &self.table.rows {
            let found = images(row, self.roles);
            has_row_references |= found.iter().any(|image| matches!(image, RowImage::RowOrFile(_)));
            if found.len() > 1 && several != Some(SeveralImages::Send) {
                continue;
            }
            let id = id_column.and_then(|column| column.text(row));
            for (number, image) in (1..).zip(&found) {
                let RowImage::Embedded { facts, .. } = image else {
                    continue;
                };
                let name = match &id {
                    None => content_name(&facts.digest),
                    Some(id) if found.len() == 1 => id.trim().to_owned(),
                    Some(id) => format!("{}#{number}", id.trim()),
                };
                let known = self.names.entry(facts.digest).or_insert_with(|| FrameId(name.clone()));
                if id_order(&name) < id_order(&known.0) {
                    *known = FrameId(name);
                }
            }
        }
        self.resolve_name_clashes();
        if !has_row_references {
            return;
        }
        // A row id need only be unique in its file.
        let row_id_column = id_column
            .or_else(|| self.roles.ids.iter().find(|column| self.is_unique(column, |file, text| (file, text))));
        if let Some(column) = row_id_column {
            self.index_image_rows(column);
        }
    }

    /// True if every row has a text in the column and the keys made of its file and text are unique.
    fn is_unique<K: Eq + Hash>(&self, column: &SetColumn, key: impl Fn(usize, String) -> K) -> bool {
        let mut seen = HashSet::new();
        self.table
            .rows
            .iter()
            .all(|row| column.text(row).is_some_and(|text| seen.insert(key(row.file, text.trim().to_owned()))))
    }

    /// Finds the rows whose images other rows may refer to by their ids in this column.
    fn index_image_rows(&mut self, column: &SetColumn) {
        for (index, row) in self.table.rows.iter().enumerate() {
            let found = images(row, self.roles);
            if let ([RowImage::Embedded { .. }], Some(id)) = (&*found, column.text(row)) {
                let key = (row.file, id.trim().to_owned());
                self.image_rows.entry(key).or_insert(index);
            }
        }
    }

    /// Names images by their content if they share a name, such as an id `7#1` and the first image of the row `7`.
    fn resolve_name_clashes(&mut self) {
        let mut counts = HashMap::<FrameId, usize>::new();
        for name in self.names.values() {
            *counts.entry(name.clone()).or_default() += 1;
        }
        for (digest, name) in &mut self.names {
            if counts[name] > 1 {
                *name = FrameId(content_name(digest));
            }
        }
    }

    /// Images of a row, in order.
    pub(super) fn in_row(&self, row: usize) -> impl Iterator<Item = Result<LocatedImage>> {
        self.form.in_row(&self.table.rows[row], self.roles).into_iter().map(move |image| self.locate(row, image))
    }

    /// Error for the first unusable image of a row; `None` if all exist. Files are not opened.
    pub(crate) fn problem(&self, row: usize) -> Option<Error> {
        self.in_row(row).find_map(|image| match image {
            Err(problem) => Some(problem),
            Ok(LocatedImage::Cell { row, facts, .. }) if facts.format.is_none() => {
                let problem = "the cell of its image holds bytes that are no image";
                Some(Error::data(self.table.place(row), problem))
            }
            Ok(_) => None,
        })
    }

    /// Finds an image that a row refers to.
    fn locate(&self, row: usize, image: RowImage) -> Result<LocatedImage> {
        match image {
            RowImage::Embedded { column, steps, facts } => Ok(LocatedImage::Cell { row, column, steps, facts }),
            RowImage::File(path) => self
                .file(row, &path)
                .map_err(|problem| Error::data(self.table.place(row), self.explain_path_error(row, &path, problem))),
            RowImage::Frame(name) => Ok(LocatedImage::Frame(FrameId(name))),
            RowImage::RowOrFile(text) => match self.image_of_row(row, &text) {
                Some(image) => Ok(image),
                None => self.file(row, &text).map_err(|problem| {
                    let problem = self.explain_path_error(row, &text, problem);
                    let is_number = text.bytes().all(|byte| byte.is_ascii_digit());
                    Error::data(
                        self.table.place(row),
                        if is_number {
                            format!("{problem}; and no row with an image has the id {text}")
                        } else {
                            problem
                        },
                    )
                }),
            },
        }
    }

    /// Improves the error for a path in a row: says if the text is not a path, and suggests a column of the row that
    /// has an image.
    fn explain_path_error(&self, row: usize, text: &str, problem: String) -> String {
        let problem = explain_non_path(text, problem);
        let row = &self.table.rows[row];
        let image_column = self.table.columns.iter().enumerate().find(|(index, _)| match row.cell(*index) {
            Cell::File(facts) => facts.format.is_some(),
            cell @ Cell::Fields(_) => matches!(cell.field("bytes"), Some(Cell::File(_))),
            _ => false,
        });
        match image_column {
            Some((_, name)) => {
                format!("{problem}; the column {name:?} holds images: {}", map_flag(ColumnRole::Image, name, None))
            }
            None => problem,
        }
    }

    /// Embedded image of another row, found by its id.
    fn image_of_row(&self, row: usize, id: &str) -> Option<LocatedImage> {
        let file = self.table.rows[row].file;
        let other = *self.image_rows.get(&(file, id.trim().to_owned()))?;
        let found = images(&self.table.rows[other], self.roles);
        let [RowImage::Embedded { column, steps, facts }] = &*found else {
            return None;
        };
        (other != row).then(|| LocatedImage::Cell {
            row: other,
            column: *column,
            steps: steps.clone(),
            facts: facts.clone(),
        })
    }

    /// File of a path in a row, relative to the folder of its table, or else to the folder of the set.
    fn file(&self, row: usize, path: &str) -> Result<LocatedImage, String> {
        let file = &self.table.files[self.table.rows[row].file];
        if let (Some(archive), Some(inner)) = (self.archive, &file.inner) {
            return find_member(archive, inner, path).map(LocatedImage::Member);
        }
        let base = file.path.parent().unwrap_or(Path::new(""));
        let (name, path) = match self.root.image(base, path) {
            Err(problem) if base != self.root.folder() => {
                self.root.image(self.root.folder(), path).map_err(|_| problem)?
            }
            found => found?,
        };
        Ok(LocatedImage::File(name, path))
    }

    /// Frame of a question, or the name that stands for all frames of a question with several images. Adds their
    /// sources.
    pub(crate) fn frame(&mut self, question: &SetQuestion) -> Result<FrameId> {
        let images: Vec<LocatedImage> = self.in_row(question.row).collect::<Result<_>>()?;
        let frames: Vec<FrameId> = images.into_iter().map(|image| self.add_source(image)).collect();
        if let [only] = &*frames {
            return Ok(only.clone());
        }
        let name = series_name(&frames);
        self.series.insert(name.clone(), frames);
        Ok(name)
    }

    /// Adds the source of an image, and returns the name of its frame.
    fn add_source(&mut self, image: LocatedImage) -> FrameId {
        match image {
            LocatedImage::Frame(name) => name,
            LocatedImage::Member(name) => {
                if let Some(archive) = self.archive {
                    let archive = Arc::clone(archive);
                    self.sources.entry(name.clone()).or_insert(ImageSource::Member(archive));
                }
                name
            }
            LocatedImage::File(name, path) => {
                self.sources.entry(name.clone()).or_insert_with(|| ImageSource::image(path));
                name
            }
            LocatedImage::Cell { row, column, steps, facts } => {
                let name =
                    self.names.get(&facts.digest).cloned().unwrap_or_else(|| FrameId(content_name(&facts.digest)));
                let row = &self.table.rows[row];
                let columns = &self.table.columns;
                let part = self.parts.entry((column, steps)).or_insert_with_key(|(column, steps)| {
                    Arc::new(CellPart { column: columns[*column].clone(), steps: steps.clone() })
                });
                self.sources.entry(name.clone()).or_insert_with(|| {
                    ImageSource::Embedded(EmbeddedImage {
                        file: Arc::clone(&self.files[row.file]),
                        row: row.place.clone(),
                        part: Arc::clone(part),
                        facts,
                    })
                });
                name
            }
        }
    }

    /// Takes out the sources of all added frames, and the images of questions with several.
    pub(crate) fn take_sources(&mut self) -> (BTreeMap<FrameId, ImageSource>, Series) {
        (std::mem::take(&mut self.sources), std::mem::take(&mut self.series))
    }
}

/// Maximum length of a path in error messages, in characters (chosen).
const MAX_PATH_LENGTH: usize = 200;

/// Replaces the error for a path if the text is damaged base64 or too long for a path. Long texts are not repeated in
/// the message.
fn explain_non_path(text: &str, problem: String) -> String {
    let length = text.chars().count();
    let start = excerpt(text, 24);
    let is_long = length > MAX_NAME_LENGTH
        && text.chars().all(|c| c.is_ascii_alphanumeric() || "+/=-_".contains(c) || c.is_whitespace());
    if text.starts_with("data:") || is_long {
        format!("its image is base64 that is cut or damaged ({length} characters, {start:?})")
    } else if length > MAX_PATH_LENGTH {
        format!("its image is a text of {length} characters, {start:?}, which is neither base64 nor a path of a file")
    } else {
        problem
    }
}

/// Finds the file of a path in the archive, relative to the folder of the table, or else to the top folder.
///
/// # Errors
/// If there is no such file, or both paths lead to different files.
fn find_member(archive: &Archive, folder: &Path, path: &str) -> Result<FrameId, String> {
    let top = archive.find(Path::new(""), path);
    match (archive.find(folder, path), top) {
        (Ok(near), Ok(top)) if near != top => Err(format!(
            "{path:?} may be {:?} or {:?} in {}; write the one that is meant as its path from the top folder, and remove or rename the other",
            near.0,
            top.0,
            archive.path().display()
        )),
        (Err(_), Ok(top)) => Ok(top),
        (near, _) => near,
    }
}

/// Name of a frame by the content of its image.
fn content_name(digest: &Digest) -> String {
    format!("image-{}", &digest.to_string()[..12])
}

/// Name for several images in this order: the name of the first, the number of others, and a digest of all names.
fn series_name(frames: &[FrameId]) -> FrameId {
    let digest = Digest::from_parts(frames.iter().map(|frame| frame.0.as_bytes()));
    let first = frames.first().map_or("", |frame| &frame.0);
    let more = frames.len().saturating_sub(1);
    FrameId(format!("{first} +{more} ({})", &digest.to_string()[..12]))
}

/// Sort key of ids: shorter ones first, so that numbers are in numerical order.
fn id_order(id: &str) -> (usize, &str) {
    (id.len(), id)
}
