//! The files that a calibration was made from: [`Inputs`].

use std::collections::BTreeMap;
use std::path::Path;

use super::mosaic::FrameFacts;
use crate::error::{Error, Result};
use crate::types::Digest;

/// All frames that were read, in the order of the recording.
#[derive(Debug, Default)]
pub(super) struct Inputs {
    /// Path and digest of each frame.
    list: Vec<(String, Digest)>,
    /// The bias frame, flat or dark frame of each digest.
    places: BTreeMap<Digest, String>,
    /// The first and the last date that the files state.
    dates: Option<[String; 2]>,
}

impl Inputs {
    /// Adds a frame.
    pub(super) fn add(&mut self, path: &Path, facts: &FrameFacts) {
        self.list.push((path.display().to_string(), facts.digest));
        if let Some(taken) = &facts.taken {
            let [first, last] = self
                .dates
                .get_or_insert_with(|| [taken.clone(), taken.clone()]);
            if taken < first {
                first.clone_from(taken);
            }
            if taken > last {
                last.clone_from(taken);
            }
        }
    }

    /// Adds a frame of which no copy may be used, for another purpose neither.
    ///
    /// # Errors
    /// See [`once`](Self::once).
    pub(super) fn add_once(&mut self, path: &Path, facts: &FrameFacts) -> Result<()> {
        self.once(&path.display().to_string(), facts.digest)?;
        self.add(path, facts);
        Ok(())
    }

    /// Checks that the frame at a place is no copy of another one. Overexposed frames are not checked: they may well be equal.
    ///
    /// # Errors
    /// If the same frame was used before: copies have no noise between them.
    pub(super) fn once(&mut self, place: &str, digest: Digest) -> Result<()> {
        match self.places.insert(digest, place.to_owned()) {
            Some(first) => Err(Error::data(
                place,
                format_args!(
                    "the same frame as {first}; copies have no noise between them, use each frame once"
                ),
            )),
            None => Ok(()),
        }
    }

    /// Number of frames.
    pub(super) fn count(&self) -> usize {
        self.list.len()
    }

    /// The digest of the names of all frames, from `folder`, and of their contents.
    ///
    /// # Errors
    /// None for texts; the type of the digest allows for numbers that cannot be written.
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

    /// The first and the last date of the frames, as the files state them.
    pub(super) fn dates(&self) -> Option<&[String; 2]> {
        self.dates.as_ref()
    }
}
