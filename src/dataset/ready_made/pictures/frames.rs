//! The frames of the questions of a set: [`Frames`].

use std::collections::{BTreeMap, HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::images::{CellPart, EmbeddedImage, ImageForm, RowImage, images};
use crate::dataset::Root;
use crate::dataset::image_source::ImageSource;
use crate::dataset::ready_made::cells::{Cell, FileFacts, LONGEST_NAME, Step, Table};
use crate::dataset::ready_made::choices::Answered;
use crate::dataset::ready_made::columns::map::flag;
use crate::dataset::ready_made::columns::names::Role;
use crate::dataset::ready_made::columns::{Column, Roles};
use crate::dataset::ready_made::container::{Archive, SetFile};
use crate::dataset::ready_made::settings::SeveralImages;
use crate::error::{Error, Result};
use crate::types::text::excerpt;
use crate::types::{Digest, FrameId};

/// The image of a question, found.
pub(super) enum Found {
    /// In a cell of a row.
    Cell {
        row: usize,
        column: usize,
        steps: Vec<Step>,
        facts: FileFacts,
    },
    /// In a file: the name of its frame and its path.
    File(FrameId, PathBuf),
    /// In a file of the archive.
    Member(FrameId),
    /// A frame of other data.
    Frame(FrameId),
}

/// The frames of a set. Equal bytes in cells are one frame, with one noise.
pub(in crate::dataset::ready_made) struct Frames<'a> {
    pub(super) table: &'a Table,
    root: &'a Root,
    /// The ZIP file that holds the set.
    pub(super) archive: Option<&'a Arc<Archive>>,
    files: &'a [Arc<SetFile>],
    /// The row of each file and id whose own cell holds an image.
    holders: HashMap<(usize, String), usize>,
    pub(super) roles: &'a Roles,
    kind: ImageForm,
    /// The part of the row that holds the image, by the column and the steps in its cell.
    parts: HashMap<(usize, Vec<Step>), Arc<CellPart>>,
    /// The name of each image in a cell.
    names: HashMap<Digest, FrameId>,
    sources: BTreeMap<FrameId, ImageSource>,
    series: Series,
}

/// The images of each row that shows several, by the name of all of them together.
pub(in crate::dataset) type Series = BTreeMap<FrameId, Vec<FrameId>>;

impl<'a> Frames<'a> {
    pub(in crate::dataset::ready_made) fn new(
        table: &'a Table,
        root: &'a Root,
        archive: Option<&'a Arc<Archive>>,
        files: &'a [Arc<SetFile>],
        roles: &'a Roles,
        kind: ImageForm,
        several: Option<SeveralImages>,
    ) -> Self {
        let mut frames = Self {
            table,
            root,
            archive,
            files,
            holders: HashMap::new(),
            roles,
            kind,
            parts: HashMap::new(),
            names: HashMap::new(),
            sources: BTreeMap::new(),
            series: Series::new(),
        };
        frames.name_embedded(several);
        frames
    }

    /// Names the images in cells: by the least id of the rows that hold one, so that the order of rows does not matter; without ids
    /// that differ, by their content. The images of a row that shows several are numbered behind its id: `7#1`, `7#2`.
    fn name_embedded(&mut self, several: Option<SeveralImages>) {
        let mut ids = self.roles.ids.iter().filter(|column| {
            let mut seen = HashSet::new();
            let texts = self.table.rows.iter().map(|row| column.text(row));
            texts
                .into_iter()
                .all(|text| text.is_some_and(|text| seen.insert(text.trim().to_owned())))
        });
        let unique = ids.next();
        // Within a file, rows are named by the first column whose values differ there.
        let differs = |column: &&Column| {
            let mut seen = HashSet::new();
            self.table.rows.iter().all(|row| {
                let text = column.text(row);
                text.is_some_and(|text| seen.insert((row.file, text.trim().to_owned())))
            })
        };
        let named = unique.or_else(|| self.roles.ids.iter().find(differs));
        let mut name_rows = false;
        for row in &self.table.rows {
            let found = images(row, self.roles);
            let is_name = |image: &RowImage| matches!(image, RowImage::RowOrFile(_));
            name_rows |= found.iter().any(is_name);
            if found.len() > 1 && several != Some(SeveralImages::Send) {
                continue;
            }
            let id = unique.and_then(|column| column.text(row));
            for (number, image) in (1..).zip(&found) {
                let RowImage::Embedded { facts, .. } = image else {
                    continue;
                };
                let name = match &id {
                    None => content_name(&facts.digest),
                    Some(id) if found.len() == 1 => id.trim().to_owned(),
                    Some(id) => format!("{}#{number}", id.trim()),
                };
                let known = self
                    .names
                    .entry(facts.digest)
                    .or_insert_with(|| FrameId(name.clone()));
                if order(&name) < order(&known.0) {
                    *known = FrameId(name);
                }
            }
        }
        self.tell_apart();
        if name_rows && let Some(column) = named {
            self.find_holders(column);
        }
    }

    /// Finds the rows that others may name by their ids, in this column.
    fn find_holders(&mut self, column: &Column) {
        for (at, row) in self.table.rows.iter().enumerate() {
            let found = images(row, self.roles);
            if let ([RowImage::Embedded { .. }], Some(id)) = (&*found, column.text(row)) {
                let key = (row.file, id.trim().to_owned());
                self.holders.entry(key).or_insert(at);
            }
        }
    }

    /// Names images by their content where an id ends as the number of an image does, so that two images had one name.
    fn tell_apart(&mut self) {
        let mut holders = HashMap::<FrameId, usize>::new();
        for name in self.names.values() {
            *holders.entry(name.clone()).or_default() += 1;
        }
        for (digest, name) in &mut self.names {
            if holders[name] > 1 {
                *name = FrameId(content_name(digest));
            }
        }
    }

    /// The images of a row, in order.
    pub(super) fn in_row(&self, row: usize) -> impl Iterator<Item = Result<Found>> {
        let images = self.kind.in_row(&self.table.rows[row], self.roles);
        images.into_iter().map(move |image| self.find(row, image))
    }

    /// Why an image of a row cannot be used; `None` if all are there. Files are not opened.
    pub(in crate::dataset::ready_made) fn problem(&self, row: usize) -> Option<Error> {
        self.in_row(row).find_map(|found| match found {
            Err(problem) => Some(problem),
            Ok(Found::Cell { row, facts, .. }) if facts.format.is_none() => {
                let problem = "the cell of its image holds bytes that are no image";
                Some(Error::data(self.table.place(row), problem))
            }
            Ok(_) => None,
        })
    }

    /// An image of a row.
    fn find(&self, row: usize, image: RowImage) -> Result<Found> {
        let at = |problem| Error::data(self.table.place(row), problem);
        match image {
            RowImage::Embedded {
                column,
                steps,
                facts,
            } => Ok(Found::Cell {
                row,
                column,
                steps,
                facts,
            }),
            RowImage::File(path) => self
                .file(row, &path)
                .map_err(|problem| at(self.with_other(row, no_path(&path, problem)))),
            RowImage::Frame(name) => Ok(Found::Frame(FrameId(name))),
            RowImage::RowOrFile(text) => match self.holder(row, &text) {
                Some(found) => Ok(found),
                None => self.file(row, &text).map_err(|problem| {
                    let problem = self.with_other(row, no_path(&text, problem));
                    let is_number = text.bytes().all(|byte| byte.is_ascii_digit());
                    at(if is_number {
                        format!("{problem}; and no row with an image has the id {text}")
                    } else {
                        problem
                    })
                }),
            },
        }
    }

    /// A problem of the path in a row, with the column that holds an image in its place.
    fn with_other(&self, row: usize, problem: String) -> String {
        let row = &self.table.rows[row];
        let columns = self.table.columns.iter().enumerate();
        let holds_image = |at: usize| match row.cell(at) {
            Cell::File(facts) => facts.format.is_some(),
            Cell::Fields(_) => matches!(row.cell(at).field("bytes"), Some(Cell::File(_))),
            _ => false,
        };
        let mut holders = columns.filter(|(at, _)| holds_image(*at));
        match holders.next() {
            Some((_, name)) => format!(
                "{problem}; the column {name:?} holds images: {}",
                flag(Role::Image, name, None)
            ),
            None => problem,
        }
    }

    /// The image in the cell of the row with this id.
    fn holder(&self, row: usize, id: &str) -> Option<Found> {
        let file = self.table.rows[row].file;
        let holder = *self.holders.get(&(file, id.trim().to_owned()))?;
        let own = images(&self.table.rows[holder], self.roles);
        let [
            RowImage::Embedded {
                column,
                steps,
                facts,
            },
        ] = &*own
        else {
            return None;
        };
        (holder != row).then(|| Found::Cell {
            row: holder,
            column: *column,
            steps: steps.clone(),
            facts: facts.clone(),
        })
    }

    /// The file that a row names: below the folder of its table, or below that of the set.
    fn file(&self, row: usize, path: &str) -> Result<Found, String> {
        let file = &self.table.files[self.table.rows[row].file];
        if let (Some(archive), Some(inner)) = (self.archive, &file.inner) {
            return member(archive, inner, path).map(Found::Member);
        }
        let table = &file.path;
        let base = table.parent().unwrap_or(Path::new(""));
        let found = self.root.image(base, path);
        let found = match found {
            Err(problem) if base != self.root.folder() => self
                .root
                .image(self.root.folder(), path)
                .map_err(|_| problem),
            found => found,
        };
        found.map(|(name, path)| Found::File(name, path))
    }

    /// The frame of a question; of a question about several images the name of all of them together. The sources are kept.
    pub(in crate::dataset::ready_made) fn frame(&mut self, answered: &Answered) -> Result<FrameId> {
        let found: Vec<Found> = self.in_row(answered.row).collect::<Result<_>>()?;
        let shown: Vec<FrameId> = found.into_iter().map(|found| self.keep(found)).collect();
        if let [only] = &*shown {
            return Ok(only.clone());
        }
        let name = series_name(&shown);
        self.series.insert(name.clone(), shown);
        Ok(name)
    }

    /// The name of an image. Its source is kept.
    fn keep(&mut self, found: Found) -> FrameId {
        match found {
            Found::Frame(name) => name,
            Found::Member(name) => {
                if let Some(archive) = self.archive {
                    let archive = Arc::clone(archive);
                    self.sources
                        .entry(name.clone())
                        .or_insert(ImageSource::Member(archive));
                }
                name
            }
            Found::File(name, path) => {
                self.sources
                    .entry(name.clone())
                    .or_insert_with(|| ImageSource::image(path));
                name
            }
            Found::Cell {
                row,
                column,
                steps,
                facts,
            } => {
                let name = self.names.get(&facts.digest).cloned();
                let name = name.unwrap_or_else(|| FrameId(content_name(&facts.digest)));
                let row = &self.table.rows[row];
                let columns = &self.table.columns;
                let part = self.parts.entry((column, steps));
                let part = part.or_insert_with_key(|(column, steps)| {
                    Arc::new(CellPart {
                        column: columns[*column].clone(),
                        steps: steps.clone(),
                    })
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

    /// The sources of all frames that were asked for, and the images of rows that show several.
    pub(in crate::dataset::ready_made) fn take_sources(
        &mut self,
    ) -> (BTreeMap<FrameId, ImageSource>, Series) {
        (
            std::mem::take(&mut self.sources),
            std::mem::take(&mut self.series),
        )
    }
}

/// The length from which on a text is hardly a path; chosen.
const LONG: usize = 200;

/// The problem of a text that leads to no image: that of its path, or what it is if it is hardly a path. Long texts are not repeated.
fn no_path(text: &str, problem: String) -> String {
    let is_base64 = |c: char| c.is_ascii_alphanumeric() || "+/=-_".contains(c) || c.is_whitespace();
    let length = text.chars().count();
    let start = excerpt(text, 24);
    let is_long = length > LONGEST_NAME && text.chars().all(is_base64);
    if text.starts_with("data:") || is_long {
        format!(
            "its image is base64 that is cut or damaged ({length} characters, {start:?}); --skip bad leaves such rows out"
        )
    } else if length > LONG {
        format!(
            "its image is a text of {length} characters, {start:?}, which is neither base64 nor a path of a file; --skip bad leaves such rows out"
        )
    } else {
        problem
    }
}

/// The file of an archive that a row names: below the folder of its table, or from the top.
///
/// # Errors
/// If there is none, or both are there.
fn member(archive: &Archive, folder: &Path, path: &str) -> Result<FrameId, String> {
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

/// The name of a frame by the content of its image.
fn content_name(digest: &Digest) -> String {
    format!("image-{}", &digest.to_string()[..12])
}

/// The name of several images in this order: that of the first, how many follow, and a digest of all names.
fn series_name(frames: &[FrameId]) -> FrameId {
    let digest = Digest::from_parts(frames.iter().map(|frame| frame.0.as_bytes()));
    let first = frames.first().map_or("", |frame| &frame.0);
    let more = frames.len().saturating_sub(1);
    FrameId(format!("{first} +{more} ({})", &digest.to_string()[..12]))
}

/// The order of ids: shorter ones first, so that numbers are in the order of their values.
fn order(id: &str) -> (usize, &str) {
    (id.len(), id)
}
