//! The ids of the questions of a set: [`Ids`].

use std::collections::{HashMap, HashSet};

use super::frames::{Found, Frames};
use crate::dataset::ready_made::choices::Answered;
use crate::dataset::ready_made::columns::Column;
use crate::dataset::ready_made::omissions::contradictory;
use crate::error::Result;
use crate::files::reading;
use crate::types::{Digest, FrameId, QuestionId};

/// The ids of questions.
#[derive(Debug)]
pub(in crate::dataset::ready_made) struct Ids {
    texts: Vec<String>,
    /// The column, or that they follow from the content.
    name: String,
    note: Option<String>,
    /// The places of two questions that differ in their answers alone.
    contradictory: Vec<[usize; 2]>,
}

impl Ids {
    /// The pairs of questions that differ in their answers alone, by their places.
    pub(in crate::dataset::ready_made) fn contradictory(&self) -> &[[usize; 2]] {
        &self.contradictory
    }

    pub(in crate::dataset::ready_made) fn id(&self, question: usize) -> QuestionId {
        QuestionId(self.texts[question].clone())
    }

    /// The column, or `content`.
    pub(in crate::dataset::ready_made) fn name(&self) -> String {
        self.name.clone()
    }

    /// A note to the user about the identifiers.
    pub(in crate::dataset::ready_made) fn note(&self) -> Option<String> {
        self.note.clone()
    }
}

/// Ids by content, and the number of repeats.
type ContentIds = (Vec<String>, usize);

/// By what images are told apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum ImagesBy {
    /// The bytes of each; every file is read.
    Content,
    /// The bytes of those in cells, of which the digests are known, and the names of files. Nothing is read.
    Name,
}

impl Frames<'_> {
    /// The ids of the questions: those of the first column in which all differ, or by content.
    pub(in crate::dataset::ready_made) fn ids(&self, answered: &[Answered]) -> Result<Ids> {
        let texts = |column: &Column| -> Option<Vec<String>> {
            answered
                .iter()
                .map(|answered| &self.table.rows[answered.row])
                .map(|row| Some(column.text(row)?.trim().to_owned()))
                .collect()
        };
        for column in &self.roles.ids {
            let Some(texts) = texts(column) else {
                continue;
            };
            let mut seen = HashSet::new();
            if texts.iter().all(|text| seen.insert(text)) {
                drop(seen);
                let digests = self.digests(answered, ImagesBy::Name)?;
                return Ok(Ids {
                    texts,
                    name: column.name.clone(),
                    note: None,
                    contradictory: contradictory(answered, &digests),
                });
            }
        }
        let digests = self.digests(answered, ImagesBy::Content)?;
        let (texts, repeats) = ids_by_content(&digests);
        let name = match &*self.roles.ids {
            [] => "content".to_owned(),
            [column, ..] => format!("content ({} does not tell all rows apart)", column.name),
        };
        let note = (repeats > 0).then(|| {
            format!("questions that repeat an earlier one, with its image and options: {repeats}; each is asked again")
        });
        Ok(Ids {
            texts,
            name,
            note,
            contradictory: contradictory(answered, &digests),
        })
    }

    /// The digest of each question over its images, its text and its options.
    fn digests(&self, answered: &[Answered], by: ImagesBy) -> Result<Vec<Digest>> {
        let mut files: HashMap<FrameId, Digest> = HashMap::new();
        answered
            .iter()
            .map(|question| {
                let images: Vec<Digest> = self
                    .in_row(question.row)
                    .map(|found| match (found?, by) {
                        (Found::Member(name) | Found::File(name, _), ImagesBy::Name) => {
                            Ok(Digest::from_bytes(name.0.as_bytes()))
                        }
                        (found, _) => self.image_digest(found, &mut files),
                    })
                    .collect::<Result<_>>()?;
                let options = question.choices.texts().iter().map(String::as_bytes);
                let images = images.iter().map(|image| &image.as_bytes()[..]);
                let text = question.text.as_bytes();
                Ok(Digest::from_parts(images.chain([text]).chain(options)))
            })
            .collect()
    }

    /// The digest of an image. Files that were read are kept in `files`.
    fn image_digest(&self, found: Found, files: &mut HashMap<FrameId, Digest>) -> Result<Digest> {
        let (name, digest) = match found {
            Found::Cell { facts, .. } => return Ok(facts.digest),
            Found::Frame(name) => return Ok(Digest::from_bytes(name.0.as_bytes())),
            Found::Member(name) | Found::File(name, _) if files.contains_key(&name) => {
                return Ok(files[&name]);
            }
            Found::Member(name) => {
                let image = self.archive.map(|archive| archive.read_image(&name.0));
                let digest = Digest::from_bytes(&image.transpose()?.unwrap_or_default());
                (name, digest)
            }
            Found::File(name, path) => {
                let digest = Digest::from_bytes(&reading::bytes(&path)?);
                (name, digest)
            }
        };
        files.insert(name, digest);
        Ok(digest)
    }
}

/// The first 12 hexadecimal digits of the digest of each question over images, text and options. The k-th repeat gets `-k`. So an id
/// depends neither on the order of rows nor on the name of a file.
fn ids_by_content(digests: &[Digest]) -> ContentIds {
    let mut seen: HashMap<String, usize> = HashMap::new();
    let mut repeats = 0;
    let texts = digests.iter().map(|digest| {
        let id = digest.to_string()[..12].to_owned();
        let count = seen.entry(id.clone()).or_insert(0);
        *count += 1;
        repeats += usize::from(*count > 1);
        match *count - 1 {
            0 => id,
            earlier => format!("{id}-{earlier}"),
        }
    });
    (texts.collect(), repeats)
}
