//! An image in the output folder with its JSON sidecar: [`OutputImage`].
//!
//! A sidecar contains the recipe of its image and the digest of the image file. An existing image is kept if its recipe
//! and bytes match, or else its pixels; other images are refused. The image is written before its sidecar, so that no
//! sidecar exists without its image.
//!
//! Images that were not made because other images exist in their place: [`ImageRefusals`].

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use darkqa_base::error::{Error, Result};
use darkqa_base::files::{self, write};
use darkqa_base::types::{Digest, Rgb};
use darkqa_pictures::{DecodeRule, ImageFile, png};

/// The origin of an image, as written in its JSON sidecar.
pub trait ImageOrigin: Clone + PartialEq + Serialize + DeserializeOwned {
    /// Accepted values of `schema`; the first one is written.
    const SCHEMAS: &'static [&'static str];
    /// True if an intact image with other settings is replaced; otherwise it is refused.
    const REPLACES_OTHER_SETTINGS: bool;

    /// How an existing image of this origin differs from the wanted one, such as `made with --seed 0, now 9`.
    fn difference(&self, wanted: &Self) -> String {
        let fields = differing_fields(&json!(self), &json!(wanted));
        format!("{OTHER} ({})", fields.join(", "))
    }
}

/// The JSON sidecar of an image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Sidecar<R> {
    schema: String,
    /// The version of this program, for information only.
    darkqa_eval: String,
    #[serde(flatten)]
    pub recipe: R,
    /// Why the image may be wrong (`--allow bad-enhancer`). Depends on all images of a call and does not affect the
    /// pixels.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    overruled_problem: Option<String>,
    /// The image file; `None` in sidecars of the first schema.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    output: Option<OutputFile>,
}

/// An image file as it was written.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OutputFile {
    /// Name of the file, in the folder of the sidecar.
    pub file: String,
    /// Length in bytes.
    bytes: u64,
    /// BLAKE3 digest of the file.
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

    /// How these bytes differ from the written file; `None` if they are the same.
    pub fn fault(&self, bytes: &[u8]) -> Option<String> {
        if bytes.len() as u64 != self.bytes {
            let found = bytes.len();
            return Some(format!("has {found} bytes, was written with {}", self.bytes));
        }
        let is_same = Digest::from_bytes(bytes).to_string() == self.digest;
        (!is_same).then(|| "has other bytes than were written".to_owned())
    }
}

impl<R: ImageOrigin> Sidecar<R> {
    /// Reads a sidecar.
    ///
    /// # Errors
    /// If it cannot be read or parsed, or has an unknown schema.
    pub fn read(path: &Path) -> Result<Self> {
        let text = files::text(path)?;
        let sidecar: Self = serde_json::from_str(&text)
            .map_err(|e| Error::data(path.display(), format_args!("not a JSON file of an image: {e}")))?;
        if !R::SCHEMAS.contains(&&*sidecar.schema) {
            let expected = R::SCHEMAS.join(" or ");
            let problem = format_args!("schema {:?}; {expected} expected", sidecar.schema);
            return Err(Error::data(path.display(), problem));
        }
        Ok(sidecar)
    }

    /// The version of the program that wrote the file.
    pub fn program(&self) -> &str {
        &self.darkqa_eval
    }

    /// True if the image was written with this digest; false for sidecars of the first schema.
    pub fn has_digest(&self, image: Digest) -> bool {
        self.output.as_ref().is_some_and(|output| output.digest == image.to_string())
    }

    fn new(recipe: R, place: &OutputImage, bytes: &[u8]) -> Self {
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
pub enum ImageOutcome {
    /// The image was made.
    Written,
    /// The image existed already.
    Unchanged,
    /// Another image exists in its place.
    Refused(ImageRefusal),
}

/// An image that was not made, because another one exists in its place.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ImageRefusal {
    /// Path of the existing image.
    pub image: PathBuf,
    /// How it differs, and the remedy.
    pub problem: String,
}

impl ImageRefusal {
    /// The error for a command that makes only one image.
    pub fn into_error(self) -> Error {
        Error::data(self.image.display(), self.problem)
    }
}

/// Number of images by outcome.
#[derive(Debug, Clone, Copy, Default)]
pub struct ImageCounts {
    pub written: usize,
    pub unchanged: usize,
    pub failed: usize,
}

impl ImageCounts {
    /// Counts an image. A refusal counts as failed and is returned.
    #[must_use]
    pub fn add(&mut self, outcome: ImageOutcome) -> Option<ImageRefusal> {
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

    /// Text about the images that were not written, to append to a line; empty if all were written.
    pub fn not_written_text(self) -> String {
        [(self.unchanged, "left as they were (--force makes them again)"), (self.failed, "failed")]
            .into_iter()
            .filter(|(number, _)| *number > 0)
            .map(|(number, what)| format!(", {number} {what}"))
            .collect()
    }
}

/// The action for one output image, depending on the existing files.
enum OutputAction {
    /// The image exists; do nothing.
    Keep,
    /// Make the image. The text is the reason to replace an existing file.
    Make(Option<&'static str>),
    /// Compare the pixels of the existing image: if equal, write its sidecar; otherwise refuse with this text.
    Compare(Rgb, String),
    /// Refuse, because another image exists; the text describes the difference.
    Refuse(String),
}

/// The paths of an output image and its JSON sidecar.
pub struct OutputImage {
    image: PathBuf,
    json: PathBuf,
    /// True if existing files are overwritten.
    is_forced: bool,
    /// Why the image may be wrong; written to the sidecar.
    overruled_problem: Option<String>,
}

impl OutputImage {
    /// The output image `name` in a folder.
    pub fn new(folder: &Path, name: &str, is_forced: bool) -> Self {
        let [image, json] = [".png", ".json"].map(|end| folder.join(name.to_owned() + end));
        Self { image, json, is_forced, overruled_problem: None }
    }

    /// Sets the reason why the image may be wrong.
    #[must_use]
    pub fn with_overruled_problem(self, overruled_problem: Option<String>) -> Self {
        Self { overruled_problem, ..self }
    }

    /// Makes and writes the image of a recipe, unless it exists.
    ///
    /// # Errors
    /// If a file cannot be read or written.
    pub fn write_unless_present<R: ImageOrigin>(
        &self,
        recipe: &R,
        make: impl FnOnce() -> Result<Rgb>,
    ) -> Result<ImageOutcome> {
        match self.action(recipe)? {
            OutputAction::Keep => Ok(ImageOutcome::Unchanged),
            OutputAction::Make(why) => {
                if let Some(why) = why {
                    tracing::warn!("{}: {why}; it is made again", self.image.display());
                }
                self.write(recipe, &png(&make()?)?)
            }
            OutputAction::Compare(existing, problem) => {
                if existing != make()? {
                    return Ok(self.refuse(&problem));
                }
                let bytes = files::bytes(&self.image)?;
                Sidecar::new(recipe.clone(), self, &bytes).write(&self.json)?;
                Ok(ImageOutcome::Unchanged)
            }
            OutputAction::Refuse(problem) => Ok(self.refuse(&problem)),
        }
    }

    fn write<R: ImageOrigin>(&self, recipe: &R, bytes: &[u8]) -> Result<ImageOutcome> {
        write(&self.image, bytes)?;
        Sidecar::new(recipe.clone(), self, bytes).write(&self.json)?;
        Ok(ImageOutcome::Written)
    }

    fn action<R: ImageOrigin>(&self, recipe: &R) -> Result<OutputAction> {
        if self.is_forced || !self.image.exists() {
            return Ok(OutputAction::Make(None));
        }
        let bytes = files::bytes(&self.image)?;
        if !self.json.exists() {
            let problem = "no JSON file describes it, and its pixels differ".to_owned();
            return Ok(match decode(&self.image, &bytes) {
                Some(existing) => OutputAction::Compare(existing, problem),
                None => OutputAction::Refuse(problem),
            });
        }
        let stored = Sidecar::<R>::read(&self.json)?;
        let fault = stored.output.as_ref().map(|output| output.fault(&bytes));
        if stored.recipe != *recipe {
            if R::REPLACES_OTHER_SETTINGS && fault == Some(None) {
                return Ok(OutputAction::Make(Some(OTHER)));
            }
            return Ok(OutputAction::Refuse(stored.recipe.difference(recipe)));
        }
        Ok(match (fault, decode(&self.image, &bytes)) {
            (Some(None), _) => OutputAction::Keep,
            (_, None) => OutputAction::Make(Some("cut or damaged")),
            (fault, Some(existing)) => {
                let fault = fault.flatten().unwrap_or_else(|| "its JSON file has no digest".to_owned());
                OutputAction::Compare(existing, format!("{fault}, and its pixels differ"))
            }
        })
    }

    fn refuse(&self, problem: &str) -> ImageOutcome {
        ImageOutcome::Refused(ImageRefusal {
            image: self.image.clone(),
            problem: format!("{problem}; --force overwrites it, another --out keeps both"),
        })
    }
}

/// Difference between an existing image and the wanted one.
const OTHER: &str = "made from another image or with other settings";

/// The names of the fields that differ between two JSON objects, including nested fields.
pub(crate) fn differing_fields(one: &Value, other: &Value) -> Vec<String> {
    let (Some(one), Some(other)) = (one.as_object(), other.as_object()) else {
        return Vec::new();
    };
    let names: BTreeSet<&String> = one.keys().chain(other.keys()).collect();
    names
        .into_iter()
        .filter(|name| one.get(*name) != other.get(*name))
        .map(|name| {
            let inner = one.get(name).zip(other.get(name));
            match inner.map_or_else(Vec::new, |(one, other)| differing_fields(one, other)) {
                inner if inner.is_empty() => name.clone(),
                inner => format!("{name}: {}", inner.join(" and ")),
            }
        })
        .collect()
}

/// The pixels of an image file; `None` if it cannot be decoded.
fn decode(path: &Path, bytes: &[u8]) -> Option<Rgb> {
    let rule = DecodeRule { max_pixels: u64::MAX / 8, ..DecodeRule::default() };
    let file = ImageFile::new(bytes.to_vec(), path.display().to_string(), rule);
    file.decode().ok()
}

/// The refused images of a command by reason; thread-safe.
#[derive(Debug, Default)]
pub struct ImageRefusals(Mutex<BTreeMap<String, BTreeSet<PathBuf>>>);

impl ImageRefusals {
    pub fn add(&self, ImageRefusal { image, problem }: ImageRefusal) {
        let mut refused = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        refused.entry(problem).or_default().insert(image);
    }

    /// Logs each reason once, with its first image and the number of the others.
    pub fn log(self) {
        let refused = self.0.into_inner().unwrap_or_else(PoisonError::into_inner);
        for (problem, images) in refused {
            let Some(first) = images.first() else {
                continue;
            };
            let more = match images.len() {
                1 => String::new(),
                n => format!(" and {} more", n - 1),
            };
            tracing::error!("{}{more}: {problem}", first.display());
        }
    }
}
