//! Input files of a calibration: [`Inputs`].

use std::collections::BTreeMap;
use std::path::Path;

use super::mosaic::FrameFacts;
use crate::error::{Error, Result};
use crate::types::Digest;

/// All frames read so far, in the order of the recording.
#[derive(Debug, Default)]
pub(super) struct Inputs {
    /// Path and digest of each frame.
    list: Vec<(String, Digest)>,
    /// Path of the bias, flat or dark frame with each digest.
    places: BTreeMap<Digest, String>,
    /// First and last date in the files.
    dates: Option<[String; 2]>,
}

impl Inputs {
    /// Adds a frame.
    pub(super) fn add(&mut self, path: &Path, facts: &FrameFacts) {
        self.list.push((path.display().to_string(), facts.digest));
        if let Some(taken) = &facts.taken {
            let [first, last] = self.dates.get_or_insert_with(|| [taken.clone(), taken.clone()]);
            if taken < first {
                first.clone_from(taken);
            }
            if taken > last {
                last.clone_from(taken);
            }
        }
    }

    /// Adds a frame that may be used only once.
    ///
    /// # Errors
    /// See [`check_unique`](Self::check_unique).
    pub(super) fn add_unique(&mut self, path: &Path, facts: &FrameFacts) -> Result<()> {
        self.check_unique(&path.display().to_string(), facts.digest)?;
        self.add(path, facts);
        Ok(())
    }

    /// Checks that a frame is not a copy of an earlier one. Overexposed frames need no check, because they may be
    /// identical.
    ///
    /// # Errors
    /// If the same frame was used before: copies have no independent noise.
    pub(super) fn check_unique(&mut self, place: &str, digest: Digest) -> Result<()> {
        match self.places.insert(digest, place.to_owned()) {
            Some(first) => Err(Error::data(
                place,
                format_args!("the same frame as {first}; copies have no noise between them, use each frame once"),
            )),
            None => Ok(()),
        }
    }

    /// Number of frames.
    pub(super) fn count(&self) -> usize {
        self.list.len()
    }

    /// Digest of the paths of all frames, relative to `folder`, and of their contents.
    ///
    /// # Errors
    /// Never for strings; only numbers that are not finite have no canonical form.
    pub(super) fn digest(&self, folder: &Path) -> Result<Digest> {
        let prefix = folder.display().to_string();
        let list: Vec<(String, String)> = self
            .list
            .iter()
            .map(|(place, digest)| {
                let inner = place.strip_prefix(&prefix).unwrap_or(place);
                let inner = inner.trim_start_matches(['/', '\\']).replace('\\', "/");
                (inner, digest.to_string())
            })
            .collect();
        Digest::canonical("darkqa.calibration-frames/1", &list)
    }

    /// First and last date in the files.
    pub(super) fn dates(&self) -> Option<&[String; 2]> {
        self.dates.as_ref()
    }
}
