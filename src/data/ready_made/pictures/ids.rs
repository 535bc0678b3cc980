//! Ids of the questions of a set: [`Ids`].
//!
//! Scenes of the frames of a set: [`Scenes`].

use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};

use super::frames::{LocatedImage, SetFrames};
use crate::ready_made::cells::SetRows;
use crate::ready_made::choices::{SetQuestion, is_native_format};
use crate::ready_made::columns::SetColumn;
use crate::ready_made::columns::map::{ColumnMap, ColumnRole, map_flag};
use crate::ready_made::omissions::find_contradictions;
use crate::ready_made::summary::count;
use darkqa_base::error::{Error, Result};
use darkqa_base::files;
use darkqa_base::types::{Digest, FrameId, QuestionId};

/// Ids of the questions of a set.
#[derive(Debug)]
pub(crate) struct Ids {
    texts: Vec<String>,
    source: String,
    note: Option<String>,
    contradictions: Vec<[usize; 2]>,
}

impl Ids {
    /// Pairs of indices of questions that are equal except for their answers.
    pub(crate) fn contradictions(&self) -> &[[usize; 2]] {
        &self.contradictions
    }

    /// Id of the question with this index.
    pub(crate) fn id(&self, index: usize) -> QuestionId {
        QuestionId(self.texts[index].clone())
    }

    /// Name of the column of ids, or `content`.
    pub(crate) fn source(&self) -> &str {
        &self.source
    }

    /// Note for the user about repeated questions.
    pub(crate) fn note(&self) -> Option<String> {
        self.note.clone()
    }
}

/// How images are compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum ImageIdentity {
    /// By their bytes. Every file is read.
    Content,
    /// Embedded images by digest, image files by name. No file is opened.
    Name,
}

impl SetFrames<'_> {
    /// Makes ids for the questions: from the first column with a different value for each, else from their content.
    pub(crate) fn ids(&self, questions: &[SetQuestion]) -> Result<Ids> {
        for column in &self.roles.ids {
            let Some(texts) = self.unique_texts(column, questions) else {
                continue;
            };
            let digests = self.digests(questions, ImageIdentity::Name)?;
            return Ok(Ids {
                texts,
                source: column.name.clone(),
                note: None,
                contradictions: find_contradictions(questions, &digests),
            });
        }
        let digests = self.digests(questions, ImageIdentity::Content)?;
        let (texts, repeats) = ids_by_content(&digests);
        let source = match &*self.roles.ids {
            [] => "content".to_owned(),
            [column, ..] => format!("content ({} does not tell all rows apart)", column.name),
        };
        let note = (repeats > 0).then(|| {
            format!("questions that repeat an earlier one, with its image and options: {repeats}; each is asked again")
        });
        Ok(Ids { texts, source, note, contradictions: find_contradictions(questions, &digests) })
    }

    /// Texts of the questions in a column; `None` if one is missing or two are equal.
    fn unique_texts(&self, column: &SetColumn, questions: &[SetQuestion]) -> Option<Vec<String>> {
        let mut seen = HashSet::new();
        questions
            .iter()
            .map(|question| {
                let text = column.text(&self.table.rows[question.row])?.trim().to_owned();
                seen.insert(text.clone()).then_some(text)
            })
            .collect()
    }

    /// Digest of each question over its images, its text and its options.
    fn digests(&self, questions: &[SetQuestion], identity: ImageIdentity) -> Result<Vec<Digest>> {
        let mut files: HashMap<FrameId, Digest> = HashMap::new();
        questions
            .iter()
            .map(|question| {
                let images: Vec<Digest> = self
                    .in_row(question.row)
                    .map(|image| match (image?, identity) {
                        (LocatedImage::Member(name) | LocatedImage::File(name, _), ImageIdentity::Name) => {
                            Ok(Digest::from_bytes(name.0.as_bytes()))
                        }
                        (image, _) => self.image_digest(image, &mut files),
                    })
                    .collect::<Result<_>>()?;
                let options = question.choices.texts().iter().map(String::as_bytes);
                let images = images.iter().map(|image| &image.as_bytes()[..]);
                let text = question.text.as_bytes();
                Ok(Digest::from_parts(images.chain([text]).chain(options)))
            })
            .collect()
    }

    /// Digest of an image. `files` caches the digests of files.
    fn image_digest(&self, image: LocatedImage, files: &mut HashMap<FrameId, Digest>) -> Result<Digest> {
        let (name, digest) = match image {
            LocatedImage::Cell { facts, .. } => return Ok(facts.digest),
            LocatedImage::Frame(name) => return Ok(Digest::from_bytes(name.0.as_bytes())),
            LocatedImage::Member(name) | LocatedImage::File(name, _) if files.contains_key(&name) => {
                return Ok(files[&name]);
            }
            LocatedImage::Member(name) => {
                let bytes = match self.archive {
                    Some(archive) => archive.read_image(&name.0)?,
                    None => Vec::new(),
                };
                (name, Digest::from_bytes(&bytes))
            }
            LocatedImage::File(name, path) => {
                let digest = Digest::from_bytes(&files::bytes(&path)?);
                (name, digest)
            }
        };
        files.insert(name, digest);
        Ok(digest)
    }
}

/// Makes ids from the digests of the questions: 12 hexadecimal digits, and `-k` for the k-th repeat. Returns the ids
/// and the number of repeats. The ids depend neither on the order of rows nor on file names.
fn ids_by_content(digests: &[Digest]) -> (Vec<String>, usize) {
    let mut counts: HashMap<String, usize> = HashMap::new();
    let mut repeats = 0;
    let ids = digests
        .iter()
        .map(|digest| {
            let id = digest.to_string()[..12].to_owned();
            let count = counts.entry(id.clone()).or_insert(0);
            *count += 1;
            match *count - 1 {
                0 => id,
                repeat => {
                    repeats += 1;
                    format!("{id}-{repeat}")
                }
            }
        })
        .collect();
    (ids, repeats)
}

/// Scene of each frame that has one.
pub(crate) type SceneNames = BTreeMap<FrameId, String>;

/// Collects the scenes of the frames from the column of scenes.
#[derive(Debug)]
pub(crate) struct Scenes<'a> {
    column: Option<&'a SetColumn>,
    /// True if the user gave the column, or the table is in this program's own format. Then a frame with two scenes is
    /// an error; otherwise the column is ignored.
    is_required: bool,
    names: SceneNames,
    frames: BTreeSet<FrameId>,
    /// Message about the first frame with two scenes.
    contradiction: Option<String>,
}

impl<'a> Scenes<'a> {
    /// No frames yet.
    pub(crate) fn new(table: &SetRows, map: &ColumnMap, column: Option<&'a SetColumn>) -> Self {
        Self {
            column,
            is_required: map.entry(ColumnRole::Scene).is_some() || is_native_format(table),
            names: SceneNames::new(),
            frames: BTreeSet::new(),
            contradiction: None,
        }
    }

    /// Adds the frame of a row.
    ///
    /// # Errors
    /// If the frame already has another scene and the column is required.
    pub(crate) fn add(&mut self, table: &SetRows, row: usize, frame: &FrameId) -> Result<()> {
        let Some(column) = self.column else {
            return Ok(());
        };
        self.frames.insert(frame.clone());
        let scene = column.text(&table.rows[row]).unwrap_or_default();
        let scene = scene.trim();
        if scene.is_empty() {
            return Ok(());
        }
        let known = self.names.entry(frame.clone()).or_insert_with(|| scene.to_owned());
        if known == scene {
            return Ok(());
        }
        let problem = format!("the image {:?} is of the scene {scene:?} here and of {known:?} before", frame.0);
        if self.is_required {
            let remedy = map_flag(ColumnRole::Scene, "", None);
            let problem = format!("{problem}; an image has one scene ({remedy} ignores scenes)");
            return Err(Error::data(table.place(row), problem));
        }
        self.contradiction.get_or_insert(problem);
        Ok(())
    }

    /// Takes the scenes out; none if the column has contradictions.
    pub(crate) fn take(&mut self) -> SceneNames {
        match self.contradiction {
            None => std::mem::take(&mut self.names),
            Some(_) => SceneNames::new(),
        }
    }

    /// Note about the column and the number of scenes; `None` without a column.
    pub(crate) fn note(&self) -> Option<String> {
        let name = &self.column?.name;
        if let Some(problem) = &self.contradiction {
            return Some(format!("{name} is not used as the scene: {problem}"));
        }
        let scenes: BTreeSet<&String> = self.names.values().collect();
        let without = match self.frames.len() - self.names.len() {
            0 => String::new(),
            some => format!(", {} without a scene", count(some, "image", "images")),
        };
        Some(format!(
            "scene = {name}: {} of {}{without}",
            count(scenes.len(), "scene", "scenes"),
            count(self.frames.len(), "image", "images")
        ))
    }
}
