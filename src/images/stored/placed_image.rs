//! An image in the output folder with the JSON file that vouches for it: [`Placed`].
//!
//! A JSON file holds the recipe of its image and the digest of the image's bytes. What lies in the folder is judged by both, in this
//! order: bytes, then pixels, then refusal. An image is in its place before its JSON file is, so that no JSON file vouches for an
//! image that is not there.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::error::{Error, Result};
use crate::files::{reading, write};
use crate::picture::png;
use crate::picture::{ImageFile, ReadingRule};
use crate::types::{Digest, Rgb};

/// The origin of an image, as its JSON file holds it.
pub(crate) trait ImageOrigin: Clone + PartialEq + Serialize + DeserializeOwned {
    /// The values of `schema` that are read; the first is written.
    const SCHEMAS: &'static [&'static str];
    /// Whether an intact image with other settings is replaced; else it is refused.
    const IS_REPLACED: bool;

    /// How an image of this origin differs from the one that is asked for, as `made with --seed 0, now 9`.
    fn difference(&self, wanted: &Self) -> String {
        let fields = differing(&json!(self), &json!(wanted));
        format!("{OTHER} ({})", fields.join(", "))
    }
}

/// The content of a JSON file beside an image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Sidecar<R> {
    schema: String,
    /// The version of this program, for information only.
    darkqa_eval: String,
    #[serde(flatten)]
    pub(crate) recipe: R,
    /// Why the image may be wrong although it was made (`--allow bad-enhancer`). It follows from all images of a call, and decides no pixel.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    overruled_problem: Option<String>,
    /// The image file; `None` in files of the first schema.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    output: Option<OutputFile>,
}

/// An image file as it was written.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct OutputFile {
    /// The name of the file, in the folder of the JSON file.
    pub(crate) file: String,
    /// Its length.
    bytes: u64,
    /// The BLAKE3 digest of its bytes.
    digest: String,
}

impl OutputFile {
    fn new(path: &Path, bytes: &[u8]) -> Self {
        let name = path.file_name().unwrap_or_default();
        Self {
            file: name.to_string_lossy().into_owned(),
            bytes: bytes.len() as u64,
            digest: Digest::from_bytes(bytes).to_string(),
        }
    }

    /// The fault of a file with these bytes; `None` if they are those that were written.
    pub(crate) fn fault(&self, bytes: &[u8]) -> Option<String> {
        if bytes.len() as u64 != self.bytes {
            let found = bytes.len();
            return Some(format!(
                "has {found} bytes, was written with {}",
                self.bytes
            ));
        }
        let is_same = Digest::from_bytes(bytes).to_string() == self.digest;
        (!is_same).then(|| "has other bytes than were written".to_owned())
    }
}

impl<R: ImageOrigin> Sidecar<R> {
    /// Reads a JSON file.
    ///
    /// # Errors
    /// If it cannot be read, is not of this form, or has a schema that this program does not know.
    pub(crate) fn read(path: &Path) -> Result<Self> {
        let text = reading::text(path)?;
        let wrong = |problem: String| Error::data(path.display(), problem);
        let read: Self = serde_json::from_str(&text)
            .map_err(|e| wrong(format!("not a JSON file of an image: {e}")))?;
        if !R::SCHEMAS.contains(&&*read.schema) {
            let expected = R::SCHEMAS.join(" or ");
            return Err(wrong(format!(
                "schema {:?}; {expected} expected",
                read.schema
            )));
        }
        Ok(read)
    }

    /// The version of the program that wrote the file.
    pub(crate) fn program(&self) -> &str {
        &self.darkqa_eval
    }

    /// Whether the image of the file was written with these bytes; false for files of the first schema.
    pub(crate) fn vouches_for(&self, image: Digest) -> bool {
        let output = self.output.as_ref();
        output.is_some_and(|output| output.digest == image.to_string())
    }

    fn new(recipe: R, place: &Placed, bytes: &[u8]) -> Self {
        Self {
            schema: R::SCHEMAS[0].to_owned(),
            darkqa_eval: env!("CARGO_PKG_VERSION").to_owned(),
            recipe,
            overruled_problem: place.overruled_problem.clone(),
            output: Some(OutputFile::new(&place.image, bytes)),
        }
    }

    fn write(&self, path: &Path) -> Result<()> {
        let text = format!("{:#}\n", json!(self));
        write(path, text.as_bytes())
    }
}

/// The outcome of one output file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum ImageOutcome {
    /// The image was made.
    Written,
    /// The image was there.
    Unchanged,
    /// Another image is there.
    Refused(Refusal),
}

/// The reason why an image was not made.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Refusal {
    /// The image in its place.
    pub(crate) image: PathBuf,
    /// How it differs, and the remedy.
    pub(crate) problem: String,
}

impl Refusal {
    /// The error of a command that makes one image.
    pub(crate) fn into_error(self) -> Error {
        Error::data(self.image.display(), self.problem)
    }
}

/// The numbers of images by outcome.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct ImageCounts {
    pub(crate) written: usize,
    pub(crate) unchanged: usize,
    pub(crate) failed: usize,
}

impl ImageCounts {
    /// Counts an image. One that was refused counts as failed; the reason is returned.
    #[must_use]
    pub(crate) fn add(&mut self, outcome: ImageOutcome) -> Option<Refusal> {
        match outcome {
            ImageOutcome::Written => self.written += 1,
            ImageOutcome::Unchanged => self.unchanged += 1,
            ImageOutcome::Refused(refusal) => {
                self.failed += 1;
                return Some(refusal);
            }
        }
        None
    }

    /// The images that were not written, as words to append; empty if there are none.
    pub(crate) fn unwritten(self) -> String {
        let part = |number: usize, what: &str| match number {
            0 => String::new(),
            _ => format!(", {number} {what}"),
        };
        part(
            self.unchanged,
            "left as they were (--force makes them again)",
        ) + &part(self.failed, "failed")
    }
}

/// The treatment of an existing file in the folder.
enum Verdict {
    /// It is the image; nothing is to be done.
    Keep,
    /// It must be made. The text states why, if something else was there.
    Make(Option<&'static str>),
    /// It is the image if its pixels are, and then gets its JSON file; else the text states what is wrong.
    Compare(Rgb, String),
    /// It is another image, which the text describes.
    Refuse(String),
}

/// The place of an image and of its JSON file.
pub(crate) struct Placed {
    image: PathBuf,
    json: PathBuf,
    /// Whether to write over whatever is there.
    is_forced: bool,
    /// Why the image may be wrong although it is made.
    overruled_problem: Option<String>,
}

impl Placed {
    /// The place of the image `name` in a folder.
    pub(crate) fn new(folder: &Path, name: &str, is_forced: bool) -> Self {
        let [image, json] = [".png", ".json"].map(|end| folder.join(name.to_owned() + end));
        Self {
            image,
            json,
            is_forced,
            overruled_problem: None,
        }
    }

    /// The same place, whose JSON file gives the reason the image may be wrong.
    pub(crate) fn overruled_problem(self, overruled_problem: Option<String>) -> Self {
        Self {
            overruled_problem,
            ..self
        }
    }

    /// Puts the image of a recipe in its place, unless it is there.
    ///
    /// # Errors
    /// If a file cannot be read or written.
    pub(crate) fn put<R: ImageOrigin>(
        &self,
        recipe: &R,
        make: impl FnOnce() -> Result<Rgb>,
    ) -> Result<ImageOutcome> {
        match self.verdict(recipe)? {
            Verdict::Keep => Ok(ImageOutcome::Unchanged),
            Verdict::Make(why) => {
                if let Some(why) = why {
                    tracing::warn!("{}: {why}; it is made again", self.image.display());
                }
                self.write(recipe, &png(&make()?)?)
            }
            Verdict::Compare(there, problem) => {
                if there != make()? {
                    return Ok(self.refused(&problem));
                }
                let bytes = reading::bytes(&self.image)?;
                Sidecar::new(recipe.clone(), self, &bytes).write(&self.json)?;
                Ok(ImageOutcome::Unchanged)
            }
            Verdict::Refuse(problem) => Ok(self.refused(&problem)),
        }
    }

    fn write<R: ImageOrigin>(&self, recipe: &R, bytes: &[u8]) -> Result<ImageOutcome> {
        write(&self.image, bytes)?;
        Sidecar::new(recipe.clone(), self, bytes).write(&self.json)?;
        Ok(ImageOutcome::Written)
    }

    fn verdict<R: ImageOrigin>(&self, recipe: &R) -> Result<Verdict> {
        if self.is_forced || !self.image.exists() {
            return Ok(Verdict::Make(None));
        }
        let bytes = reading::bytes(&self.image)?;
        if !self.json.exists() {
            let problem = "no JSON file describes it, and its pixels differ";
            let problem = problem.to_owned();
            return Ok(match decoded(&self.image, &bytes) {
                Some(there) => Verdict::Compare(there, problem),
                None => Verdict::Refuse(problem),
            });
        }
        let stored = Sidecar::<R>::read(&self.json)?;
        let fault = stored.output.as_ref().map(|output| output.fault(&bytes));
        if stored.recipe != *recipe {
            if R::IS_REPLACED && fault == Some(None) {
                return Ok(Verdict::Make(Some(OTHER)));
            }
            return Ok(Verdict::Refuse(stored.recipe.difference(recipe)));
        }
        Ok(match (fault, decoded(&self.image, &bytes)) {
            (Some(None), _) => Verdict::Keep,
            (_, None) => Verdict::Make(Some("cut or damaged")),
            (fault, Some(there)) => {
                let fault = fault.flatten();
                let fault = fault.unwrap_or_else(|| "its JSON file has no digest".to_owned());
                Verdict::Compare(there, format!("{fault}, and its pixels differ"))
            }
        })
    }

    fn refused(&self, problem: &str) -> ImageOutcome {
        ImageOutcome::Refused(Refusal {
            image: self.image.clone(),
            problem: format!("{problem}; --force overwrites it, another --out keeps both"),
        })
    }
}

/// Why an image is not the one that is asked for.
const OTHER: &str = "made from another image or with other settings";

/// The names of the fields that differ, with those of objects in them.
pub(crate) fn differing(one: &Value, other: &Value) -> Vec<String> {
    let (Some(one), Some(other)) = (one.as_object(), other.as_object()) else {
        return Vec::new();
    };
    let names: BTreeSet<&String> = one.keys().chain(other.keys()).collect();
    names
        .into_iter()
        .filter(|name| one.get(*name) != other.get(*name))
        .map(|name| {
            let inner = one.get(name).zip(other.get(name));
            match inner.map_or_else(Vec::new, |(one, other)| differing(one, other)) {
                inner if inner.is_empty() => name.clone(),
                inner => format!("{name}: {}", inner.join(" and ")),
            }
        })
        .collect()
}

/// The pixels of a PNG; `None` if it cannot be decoded.
fn decoded(path: &Path, bytes: &[u8]) -> Option<Rgb> {
    let rule = ReadingRule {
        most_pixels: u64::MAX / 8,
        ..ReadingRule::default()
    };
    let file = ImageFile::new(bytes.to_vec(), path.display().to_string(), rule);
    file.decode().ok()
}
