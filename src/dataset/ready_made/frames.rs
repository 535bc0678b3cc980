//! The frames and the ids of the questions of a set: [`Frames`], [`Ids`].

use std::collections::{BTreeMap, HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::cell::FileFacts;
use super::container::{Archive, SetFile};
use super::images::{EmbeddedImage, RowImage, images};
use super::roles::{Column, Roles};
use super::row::Table;
use super::step::Step;
use super::truths::Answered;
use crate::dataset::Root;
use crate::dataset::image_source::ImageSource;
use crate::error::{Error, Result};
use crate::files::reading;
use crate::types::{Digest, FrameId, QuestionId};

/// The ids of questions.
#[derive(Debug)]
pub(super) struct Ids {
    texts: Vec<String>,
    /// The column, or that they follow from the content.
    name: String,
    note: Option<String>,
    /// The places of two questions that differ in their answers alone.
    contradictory: Vec<[usize; 2]>,
}

impl Ids {
    /// The pairs of questions that differ in their answers alone, by their places.
    pub(super) fn contradictory(&self) -> &[[usize; 2]] {
        &self.contradictory
    }

    pub(super) fn id(&self, question: usize) -> QuestionId {
        QuestionId(self.texts[question].clone())
    }

    /// The column, or `content`.
    pub(super) fn name(&self) -> String {
        self.name.clone()
    }

    /// What the user should know of them.
    pub(super) fn note(&self) -> Option<String> {
        self.note.clone()
    }
}

/// Ids by content, the number of repeats, and the pairs that differ in their answers alone.
type ContentIds = (Vec<String>, usize, Vec<[usize; 2]>);

/// The image of a question, found.
enum Found {
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
pub(super) struct Frames<'a> {
    table: &'a Table,
    root: &'a Root,
    /// The ZIP file that holds the set.
    archive: Option<&'a Arc<Archive>>,
    files: &'a [Arc<SetFile>],
    /// The row of each file and id whose own cell holds an image.
    holders: HashMap<(usize, String), usize>,
    roles: &'a Roles,
    /// The name of each image in a cell.
    names: HashMap<Digest, FrameId>,
    sources: BTreeMap<FrameId, ImageSource>,
}

impl<'a> Frames<'a> {
    pub(super) fn new(
        table: &'a Table,
        root: &'a Root,
        archive: Option<&'a Arc<Archive>>,
        files: &'a [Arc<SetFile>],
        roles: &'a Roles,
    ) -> Self {
        let mut frames = Self {
            table,
            root,
            archive,
            files,
            holders: HashMap::new(),
            roles,
            names: HashMap::new(),
            sources: BTreeMap::new(),
        };
        frames.name_embedded();
        frames
    }

    /// Names the images in cells: by the least id of the rows that hold one, so that the order of rows does not matter; without ids
    /// that differ, by their content.
    fn name_embedded(&mut self) {
        let ids = self.roles.ids.iter();
        let mut ids = ids.filter(|column| {
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
        for (at, row) in self.table.rows.iter().enumerate() {
            let found = images(self.table, row, self.roles);
            let [RowImage::Embedded { facts, .. }] = &*found else {
                continue;
            };
            if let Some(id) = named.and_then(|column| column.text(row)) {
                let key = (row.file, id.trim().to_owned());
                self.holders.entry(key).or_insert(at);
            }
            let id = unique.and_then(|column| column.text(row));
            let name = id.map_or_else(|| content_name(&facts.digest), |id| id.trim().to_owned());
            let known = self
                .names
                .entry(facts.digest)
                .or_insert_with(|| FrameId(name.clone()));
            if order(&name) < order(&known.0) {
                *known = FrameId(name);
            }
        }
    }

    /// The image of a question.
    fn find(&self, answered: &Answered) -> Result<Found> {
        let row = answered.item.row;
        let at = |problem| Error::data(self.table.place(row), problem);
        match &answered.item.image {
            RowImage::Embedded {
                column,
                steps,
                facts,
            } => Ok(Found::Cell {
                row,
                column: *column,
                steps: steps.clone(),
                facts: facts.clone(),
            }),
            RowImage::File(path) => self.file(row, path).map_err(at),
            RowImage::Frame(name) => Ok(Found::Frame(FrameId(name.clone()))),
            RowImage::RowOrFile(text) => match self.holder(row, text) {
                Some(found) => Ok(found),
                None => self.file(row, text).map_err(|problem| {
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

    /// The image in the cell of the row with this id.
    fn holder(&self, row: usize, id: &str) -> Option<Found> {
        let file = self.table.rows[row].file;
        let holder = *self.holders.get(&(file, id.trim().to_owned()))?;
        let own = images(self.table, &self.table.rows[holder], self.roles);
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

    /// The frame of a question. Its source is kept.
    pub(super) fn frame(&mut self, answered: &Answered) -> Result<FrameId> {
        match self.find(answered)? {
            Found::Frame(name) => Ok(name),
            Found::Member(name) => {
                if let Some(archive) = self.archive {
                    let archive = Arc::clone(archive);
                    self.sources
                        .entry(name.clone())
                        .or_insert(ImageSource::Member(archive));
                }
                Ok(name)
            }
            Found::File(name, path) => {
                self.sources
                    .entry(name.clone())
                    .or_insert_with(|| ImageSource::image(path));
                Ok(name)
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
                self.sources.entry(name.clone()).or_insert_with(|| {
                    ImageSource::Embedded(EmbeddedImage {
                        file: Arc::clone(&self.files[row.file]),
                        row: row.place.clone(),
                        column: self.table.columns[column].clone(),
                        steps,
                        facts,
                    })
                });
                Ok(name)
            }
        }
    }

    /// The sources of all frames that were asked for.
    pub(super) fn take_sources(&mut self) -> BTreeMap<FrameId, ImageSource> {
        std::mem::take(&mut self.sources)
    }

    /// The ids of the questions: those of the first column in which all differ, or by content.
    pub(super) fn ids(&self, answered: &[Answered]) -> Result<Ids> {
        let texts = |column: &Column| -> Option<Vec<String>> {
            let rows = answered
                .iter()
                .map(|answered| &self.table.rows[answered.item.row]);
            rows.map(|row| Some(column.text(row)?.trim().to_owned()))
                .collect()
        };
        for column in &self.roles.ids {
            let Some(texts) = texts(column) else {
                continue;
            };
            let mut seen = HashSet::new();
            if texts.iter().all(|text| seen.insert(text)) {
                let name = column.name.clone();
                return Ok(Ids {
                    texts,
                    name,
                    note: None,
                    contradictory: Vec::new(),
                });
            }
        }
        let (texts, repeats, contradictory) = self.ids_by_content(answered)?;
        let name = match &*self.roles.ids {
            [] => "content".to_owned(),
            [column, ..] => format!("content ({} does not tell all rows apart)", column.name),
        };
        let note = (repeats > 0).then(|| {
            format!("{repeats} questions repeat an earlier one, with its image and options; each is asked again")
        });
        Ok(Ids {
            texts,
            name,
            note,
            contradictory,
        })
    }

    /// The first 12 hexadecimal digits of a digest over image, question and options. The k-th repeat gets `-k`. So an id depends
    /// neither on the order of rows nor on the name of a file.
    fn ids_by_content(&self, answered: &[Answered]) -> Result<ContentIds> {
        let mut files: HashMap<FrameId, Digest> = HashMap::new();
        let mut seen: HashMap<String, (usize, usize)> = HashMap::new();
        let (mut repeats, mut contradictory) = (0, Vec::new());
        let mut texts = Vec::with_capacity(answered.len());
        for (at, question) in answered.iter().enumerate() {
            let image = match self.find(question)? {
                Found::Cell { facts, .. } => facts.digest,
                Found::Frame(name) => Digest::of(name.0.as_bytes()),
                Found::Member(name) => {
                    if let (None, Some(archive)) = (files.get(&name), self.archive) {
                        files.insert(name.clone(), Digest::of(&archive.image(&name.0)?));
                    }
                    files[&name]
                }
                Found::File(name, path) => {
                    if !files.contains_key(&name) {
                        files.insert(name.clone(), Digest::of(&reading::bytes(&path)?));
                    }
                    files[&name]
                }
            };
            let options = question.choices.texts().iter().map(String::as_bytes);
            let parts = [image.as_bytes(), question.item.text.as_bytes()];
            let digest = Digest::of_parts(parts.into_iter().chain(options));
            let id = digest.to_string()[..12].to_owned();
            let (first, count) = seen.entry(id.clone()).or_insert((at, 0));
            if answered[*first].choices.truth() != question.choices.truth() {
                contradictory.push([*first, at]);
            }
            texts.push(match *count {
                0 => id,
                earlier => format!("{id}-{earlier}"),
            });
            repeats += usize::from(*count > 0);
            *count += 1;
        }
        Ok((texts, repeats, contradictory))
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
            "{path:?} may be {:?} or {:?} in {}; write the one that is meant as it stands from the top, and remove or rename the other",
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

/// The order of ids: shorter ones first, so that numbers are in the order of their values.
fn order(id: &str) -> (usize, &str) {
    (id.len(), id)
}
