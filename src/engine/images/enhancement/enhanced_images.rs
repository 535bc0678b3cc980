//! Images that another program enhanced, from the dark images of `synthesize`: [`EnhancedImages`], the folder of
//! `--enhanced NAME=DIR`.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use serde_json::{Value, json};

use crate::images::frames::SourceFrame;
use crate::images::recipes::ImageRecipe;
use crate::images::stored::{Sidecar, differing_fields};
use darkqa_base::error::{Error, Result};
use darkqa_base::files;
use darkqa_base::types::{Condition, DepthNote, Digest, EnhancerName, FrameId, Rgb};
use darkqa_data::inputs::stem;
use darkqa_enhance::{EnhancedFolder, ImageUse, Implausible, Usage};
use darkqa_pictures::image_file::format::FileFormat;
use darkqa_pictures::{DecodeRule, ImageFile};
use darkqa_report::text::words::first_names;

/// Maximum number of files named per fault in a message; chosen.
const NAMED: usize = 4;

/// Maximum depth of subfolders that are searched; chosen as protection against cyclic links.
const MAX_DEPTH: usize = 16;

/// The images of one folder. Each has the name of its dark image, and next to it the JSON file that `synthesize` wrote
/// for the dark image.
#[derive(Debug)]
pub struct EnhancedImages {
    name: EnhancerName,
    folder: PathBuf,
    /// Image files by their path below the folder.
    files: BTreeMap<String, EnhancedFile>,
    usage: Usage,
}

/// A file of the folder.
#[derive(Debug)]
struct EnhancedFile {
    digest: Digest,
    /// Width and height of an 8-bit PNG file, in pixels; the error describes a file of another format.
    size: std::result::Result<(u32, u32), String>,
}

/// A dark image of a run with its recipe, as `synthesize` would write it.
pub struct DarkImage<'a> {
    pub frame: &'a SourceFrame,
    pub condition: &'a Condition,
    pub recipe: ImageRecipe,
}

/// A reason why an image cannot be used. Images with the same `words` are reported together.
struct ImageFault {
    words: &'static str,
    /// Details about this file; may be empty.
    detail: String,
}

impl ImageFault {
    fn new(words: &'static str, detail: impl Into<String>) -> Self {
        Self { words, detail: detail.into() }
    }
}

impl EnhancedImages {
    /// Opens the images of these folders. Names must differ from each other and from the names of `models`.
    ///
    /// # Errors
    /// If a folder cannot be read or has no image, or a name is used twice.
    pub fn open_all<'a>(
        folders: &[EnhancedFolder],
        models: impl IntoIterator<Item = &'a EnhancerName>,
    ) -> Result<Vec<Self>> {
        let mut names: BTreeSet<&EnhancerName> = models.into_iter().collect();
        if let Some(repeated) = folders.iter().find(|folder| !names.insert(&folder.name)) {
            let problem = format_args!("two enhancers are named {}; choose another NAME", repeated.name);
            return Err(Error::usage("--enhanced", problem));
        }
        folders.iter().map(Self::open).collect()
    }

    fn open(args: &EnhancedFolder) -> Result<Self> {
        let mut paths = Vec::new();
        add_files(&args.folder, "", 0, &mut paths).map_err(|e| e.usage_at("--enhanced"))?;
        let files = paths
            .into_par_iter()
            .map(|path| {
                let file = EnhancedFile::open(&args.folder.join(&path))?;
                Ok((path, file))
            })
            .collect::<Result<BTreeMap<_, _>>>()?;
        if files.is_empty() {
            let problem = format_args!("{} contains no images", args.folder.display());
            return Err(Error::usage("--enhanced", problem));
        }
        Ok(Self { name: args.name.clone(), folder: args.folder.clone(), files, usage: Usage::for_external() })
    }

    pub fn name(&self) -> &EnhancerName {
        &self.name
    }

    /// The usage note, which every read image extends.
    pub fn usage(&self) -> &Usage {
        &self.usage
    }

    /// Path of the folder, as given by the flag.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Digest of the names and contents of all images.
    pub fn digest(&self) -> Digest {
        let parts = self.files.iter().flat_map(|(path, file)| [path.as_bytes(), file.digest.as_bytes()]);
        Digest::from_parts(std::iter::once(&b"darkqa.enhanced-folder/1"[..]).chain(parts))
    }

    /// Digest of the image of a frame in a condition.
    ///
    /// # Errors
    /// If it is missing.
    pub fn image_digest(&self, frame: &FrameId, condition: &Condition) -> Result<Digest> {
        let path = path(frame, condition)?;
        let file = self.files.get(&path).ok_or_else(|| Error::data(self.folder.join(&path).display(), "missing"))?;
        Ok(file.digest)
    }

    /// Reads the enhanced image of a frame in a condition and adds it to the usage note. `degraded` is its input.
    ///
    /// # Errors
    /// If the file was changed during the run, cannot be decoded, or has another size than its input.
    pub fn image(
        &self,
        degraded: &Rgb,
        frame: &FrameId,
        condition: &Condition,
        implausible: Implausible,
    ) -> Result<(Rgb, ImageUse)> {
        let place = self.folder.join(path(frame, condition)?);
        let file = ImageFile::open(&place, DecodeRule::default())?;
        if Digest::from_bytes(file.bytes()) != self.image_digest(frame, condition)? {
            let problem = "was changed during the run; restore it, or start a new run";
            return Err(Error::data(place.display(), problem));
        }
        let image = file.decode()?;
        if (image.height(), image.width()) != (degraded.height(), degraded.width()) {
            let problem = "has another size than its dark image; nothing is resized";
            return Err(Error::data(place.display(), problem));
        }
        let used = ImageUse::for_external([degraded, &image]);
        used.record_external(&self.usage, &self.folder, [frame, condition], implausible)?;
        Ok((image, used))
    }

    /// Checks that each of these dark images has an enhanced image. Logs images that are missing, have another size or
    /// format, or were made from other dark images, and files that no dark image needs.
    ///
    /// # Errors
    /// If an image cannot be used, or all images are identical to the dark images.
    pub fn check(&self, dark: &[DarkImage<'_>]) -> Result<()> {
        let mut faults: BTreeMap<&str, Vec<String>> = BTreeMap::new();
        let mut wanted = BTreeSet::new();
        let mut unchanged = 0;
        for image in dark {
            let path = path(&image.frame.id, image.condition)?;
            match self.check_image(&path, image) {
                Ok(is_unchanged) => unchanged += usize::from(is_unchanged),
                Err(ImageFault { words, detail }) => {
                    let named = match &*detail {
                        "" => path.clone(),
                        detail => format!("{path} ({detail})"),
                    };
                    faults.entry(words).or_default().push(named);
                }
            }
            wanted.insert(path);
        }
        if !faults.is_empty() {
            for (words, names) in &faults {
                tracing::error!("{}: {words}: {}", self.folder.display(), first_names(names, NAMED));
            }
            let count: usize = faults.values().map(Vec::len).sum();
            let problem =
                format_args!("{count} of the {} images of {} cannot be used; nothing was asked", dark.len(), self.name);
            return Err(Error::data(self.folder.display(), problem));
        }
        if unchanged == dark.len() && !dark.is_empty() {
            let problem = "all images are the dark images themselves; name the folder of the enhanced ones";
            return Err(Error::data(self.folder.display(), problem));
        }
        let surplus: Vec<String> = self.files.keys().filter(|path| !wanted.contains(*path)).cloned().collect();
        if !surplus.is_empty() {
            tracing::warn!(
                "{}: {} of {} images are not used, because no question is about their frames or conditions: {}",
                self.folder.display(),
                surplus.len(),
                self.files.len(),
                first_names(&surplus, NAMED)
            );
        }
        Ok(())
    }

    /// Checks one image; returns true if it is byte for byte its dark image.
    ///
    /// # Errors
    /// The fault of the image.
    fn check_image(&self, path: &str, dark: &DarkImage<'_>) -> std::result::Result<bool, ImageFault> {
        if dark.condition.pair().is_some() {
            let words = "`synthesize` does not write dark photographs or their matches; see --llie-on";
            return Err(ImageFault::new(words, ""));
        }
        let Some(file) = self.files.get(path) else {
            let other = self.other_format(path).unwrap_or_default();
            return Err(ImageFault::new("missing", other));
        };
        let (width, height) =
            *file.size.as_ref().map_err(|problem| ImageFault::new("not an 8-bit PNG file", &**problem))?;
        if (width, height) != dark.frame.size {
            let (w, h) = dark.frame.size;
            let words = "another size than the dark image, and nothing is resized";
            return Err(ImageFault::new(words, format!("{width}×{height}, not {w}×{h}")));
        }
        let json = self.folder.join(path).with_extension("json");
        if !json.exists() {
            let words =
                "the JSON file of the dark image, from `synthesize`, is missing; copy it next to the enhanced one";
            return Err(ImageFault::new(words, ""));
        }
        let words = "the JSON file next to it is not from `synthesize`";
        let sidecar = Sidecar::<ImageRecipe>::read(&json).map_err(|e| ImageFault::new(words, e.to_string()))?;
        if sidecar.recipe != dark.recipe {
            let words = "made from another dark image than this run's; call `synthesize` with the same data and the same light flags";
            return Err(ImageFault::new(words, recipe_differences(&sidecar.recipe, &dark.recipe)));
        }
        Ok(sidecar.has_digest(file.digest))
    }

    /// A note about a file with the name of an image but another extension; `None` if there is no such file.
    fn other_format(&self, path: &str) -> Option<String> {
        let bare = path.strip_suffix("png")?;
        let (other, _) = self.files.range(bare.to_owned()..).next()?;
        let ending = other.strip_prefix(bare)?;
        (!ending.contains(['/', '.'])).then(|| format!("only {other} exists"))
    }
}

impl EnhancedFile {
    fn open(path: &Path) -> Result<Self> {
        let file = ImageFile::open(path, DecodeRule::default())?;
        Ok(Self { digest: Digest::from_bytes(file.bytes()), size: png_size(&file) })
    }
}

/// Width and height of a PNG file with 8 bits per channel.
///
/// # Errors
/// A description of the file if it is not an 8-bit PNG image.
fn png_size(file: &ImageFile) -> std::result::Result<(u32, u32), String> {
    match FileFormat::detect(file.bytes())? {
        FileFormat::Png => {}
        other => return Err(other.name().to_owned()),
    }
    let size = file.check().map_err(|e| e.to_string())?;
    let note = file.note();
    if note.depth == Some(DepthNote::Rgb16Image) {
        return Err("16 bits".to_owned());
    }
    if note.depth.is_some() || note.orientation.is_some() {
        return Err("linear light or an orientation tag".to_owned());
    }
    Ok(size)
}

/// The fields in which two recipes differ. The sensor state follows from other fields, so it is named only if nothing
/// else differs.
fn recipe_differences(one: &ImageRecipe, other: &ImageRecipe) -> String {
    let without_state = [one, other].map(|recipe| {
        let mut fields = json!(recipe);
        if let Some(sensor) = fields.get_mut("sensor").and_then(Value::as_object_mut) {
            sensor.remove("state");
        }
        fields
    });
    match differing_fields(&without_state[0], &without_state[1]) {
        fields if fields.is_empty() => "other sensor state".to_owned(),
        fields => format!("other {}", fields.join(", ")),
    }
}

/// The path of an image below its folder, as named by `synthesize`.
fn path(frame: &FrameId, condition: &Condition) -> Result<String> {
    let raw = Condition::raw(condition.treatment.clone());
    Ok(format!("{}_{raw}.png", stem(frame)?))
}

/// Adds the files of a folder and its subfolders except JSON and hidden files. `below` is the path of the folder below
/// the first one.
fn add_files(folder: &Path, below: &str, depth: usize, files: &mut Vec<String>) -> Result<()> {
    for path in files::entries(folder)? {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if name.starts_with('.') || name.ends_with(".json") {
            continue;
        }
        if path.is_dir() && depth < MAX_DEPTH {
            add_files(&path, &format!("{below}{name}/"), depth + 1, files)?;
        } else if path.is_file() {
            files.push(format!("{below}{name}"));
        }
    }
    Ok(())
}
