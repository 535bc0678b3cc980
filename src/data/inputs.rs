//! Images of a command that takes files and folders as arguments: [`Inputs`].

use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};

use super::dataset::Dataset;
use super::frames::open_images;
use super::maps::Picture;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::FrameId;
use darkqa_pictures::DecodeRule;

/// Frames of all input files and folders.
pub struct Inputs {
    sets: Vec<Dataset>,
    pub entries: Vec<InputFrame>,
}

/// Frame with the name of its output files.
pub struct InputFrame {
    /// Index of its data set in [`Inputs`].
    set: usize,
    pub id: FrameId,
    /// Path relative to the output folder, without the file extension.
    pub stem: String,
}

impl Inputs {
    /// Opens the inputs. Paths in them may also lead into the folders in `further`. No image is read.
    ///
    /// # Errors
    /// If an input is missing, two frames would have the same output name, or a name leads outside the output folder.
    pub fn open(inputs: &[PathBuf], further: &[PathBuf], rule: DecodeRule) -> Result<Self> {
        let sets: Vec<Dataset> =
            inputs.iter().map(|path| Ok(open_images(path, further)?.with_rule(rule))).collect::<Result<_>>()?;
        let mut entries = Vec::new();
        let mut used_names: BTreeMap<String, String> = BTreeMap::new();
        for (set, (dataset, input)) in sets.iter().zip(inputs).enumerate() {
            for id in dataset.frames() {
                let stem = stem(id)?;
                let described = format!("{:?} of {}", id.0, input.display());
                if let Some(other) = used_names.insert(stem.clone(), described.clone()) {
                    let problem = format!(
                        "{described} and {other} would both be written as {stem}; rename one of them, or give each folder its own --out"
                    );
                    return Err(Error::usage("INPUT", problem));
                }
                let id = id.clone();
                entries.push(InputFrame { set, id, stem });
            }
        }
        Ok(Self { sets, entries })
    }

    pub fn picture(&self, entry: &InputFrame) -> Result<Picture> {
        self.sets[entry.set].picture(&entry.id)
    }

    /// Horizontal focal length of a frame, in pixels of its image; `None` if unknown.
    pub fn focal(&self, entry: &InputFrame) -> Option<f64> {
        self.sets[entry.set].focal(&entry.id)
    }
}

/// Name of the output files of a frame: the name of the frame, without an image extension.
///
/// # Errors
/// If the name leads outside the output folder.
pub fn stem(id: &FrameId) -> Result<String> {
    let path = Path::new(&id.0);
    if !path.components().all(|part| matches!(part, Component::Normal(_))) {
        let problem = "this name of a frame leads out of the output folder";
        return Err(Error::data(format_args!("{:?}", id.0), problem));
    }
    Ok(id.bare().to_owned())
}
