//! A frame of a plan, [`PlannedFrame`], with its cost, [`FrameCost`].

use std::path::PathBuf;
use std::time::SystemTime;

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

use crate::dataset::Dataset;
use crate::images::frames::Source;
use crate::types::{Digest, FrameId};

/// The estimated cost of all that is made and asked about a frame. It follows from the plan alone, so that every shard divides a run
/// alike.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(crate) struct FrameCost {
    /// Processor seconds.
    pub(crate) seconds: f64,
    /// Number of requests.
    pub(crate) requests: usize,
    /// Tokens of all requests and replies, if each reply is short; `None` if it is not known how a model counts images.
    pub(crate) tokens: Option<f64>,
    /// US dollars, if each reply is short; `None` if a price or a number of tokens is not known.
    pub(crate) dollars: Option<f64>,
}

impl FrameCost {
    /// The cost by which a run is divided, in millionths of a second.
    pub(super) fn weight(&self) -> u64 {
        (self.seconds * 1e6).round() as u64
    }
}

/// One line of `frames.jsonl`: a frame that questions are about, or several that a question shows together.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct PlannedFrame {
    /// Name of the frame, or of several together.
    pub(crate) frame: FrameId,
    /// Its scene; empty if the data name no scenes.
    pub(crate) scene: String,
    /// Its file; `None` for rooms, images within a file, and several frames.
    pub(crate) path: Option<PathBuf>,
    /// Size of the file in bytes when the plan was written. It reveals nothing about the content, and is not checked.
    pub(crate) size: Option<u64>,
    /// Time of the file's last change, in UTC, when the plan was written. It is not checked.
    pub(crate) mtime: Option<String>,
    /// Width of the image in pixels, of several that of the one in the middle; `None` if no model sees images.
    pub(crate) width: Option<u32>,
    /// Height of the image in pixels.
    pub(crate) height: Option<u32>,
    /// Digest of the file and of the rule by which it is read, or of all files together.
    pub(crate) digest: Option<Digest>,
    /// Estimated cost of what is made and asked of it.
    pub(crate) cost: FrameCost,
    /// Place among the frames of the run, from 0.
    pub(crate) place: usize,
}

impl PlannedFrame {
    /// The plan of a source of a data set.
    pub(crate) fn new(place: usize, source: &Source, dataset: &Dataset, cost: FrameCost) -> Self {
        let path = dataset.image_file(&source.name);
        let facts = path.and_then(|path| path.metadata().ok());
        let modified = facts.as_ref().and_then(|facts| facts.modified().ok());
        let size = source.middle().map(|frame| frame.size);
        Self {
            frame: source.name.clone(),
            scene: dataset.scene(&source.name),
            path: path.map(ToOwned::to_owned),
            size: facts.map(|facts| facts.len()),
            mtime: modified.and_then(utc),
            width: size.map(|(width, _)| width),
            height: size.map(|(_, height)| height),
            digest: source.digest(),
            cost,
            place,
        }
    }

    /// Whether two plans have the same frame of the same content at the same place.
    pub(super) fn is_same(&self, other: &Self) -> bool {
        let facts = |frame: &Self| {
            (
                frame.frame.clone(),
                frame.scene.clone(),
                frame.digest,
                frame.place,
            )
        };
        facts(self) == facts(other)
    }
}

/// A time in UTC, to the second.
fn utc(time: SystemTime) -> Option<String> {
    let time = Timestamp::try_from(time).ok()?;
    Some(time.strftime("%Y-%m-%dT%H:%M:%SZ").to_string())
}
