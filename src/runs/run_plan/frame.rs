//! A frame of a plan ([`PlannedFrame`]) with its cost ([`FrameCost`]).

use std::path::PathBuf;
use std::time::SystemTime;

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

use crate::data::Dataset;
use crate::types::{Digest, FrameId};

/// Estimated cost of all images and requests of a frame. It depends on the plan alone, so that every shard computes the
/// same division.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(crate) struct FrameCost {
    /// CPU time, in seconds.
    pub(crate) seconds: f64,
    /// Number of requests.
    pub(crate) requests: usize,
    /// Tokens of all requests and replies, assuming short replies; `None` if the image tokens of a model are unknown.
    pub(crate) tokens: Option<f64>,
    /// Cost in US dollars, assuming short replies; `None` if a price or a number of tokens is unknown.
    pub(crate) dollars: Option<f64>,
}

impl FrameCost {
    /// The cost by which a run is divided into shards: CPU time in microseconds.
    pub(super) fn weight(&self) -> u64 {
        (self.seconds * 1e6).round() as u64
    }
}

/// One line of `frames.jsonl`: a frame with questions, or several frames that a question shows together.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct PlannedFrame {
    /// Name of the frame, or of several together.
    pub(crate) frame: FrameId,
    /// Scene of the frame; empty if the data set has no scenes.
    pub(crate) scene: String,
    /// Image file; `None` for rooms, images inside a larger file, and several frames.
    pub(crate) path: Option<PathBuf>,
    /// Size of the file in bytes when the plan was written; for information only.
    pub(crate) size: Option<u64>,
    /// Modification time of the file in UTC when the plan was written; for information only.
    pub(crate) mtime: Option<String>,
    /// Width of the image in pixels (of the middle one if there are several); `None` if no model sees images.
    pub(crate) width: Option<u32>,
    /// Height of the image in pixels.
    pub(crate) height: Option<u32>,
    /// Digest of the file (or of all files) and of the decoding rule.
    pub(crate) digest: Option<Digest>,
    pub(crate) cost: FrameCost,
    /// Index among the frames of the run.
    pub(crate) place: usize,
}

impl PlannedFrame {
    /// A planned frame with its file. `image` is its size and digest, where models see images.
    pub(crate) fn new(
        place: usize,
        frame: &FrameId,
        image: (Option<(u32, u32)>, Option<Digest>),
        dataset: &Dataset,
        cost: FrameCost,
    ) -> Self {
        let path = dataset.image_file(frame);
        let metadata = path.and_then(|path| path.metadata().ok());
        let modified = metadata.as_ref().and_then(|metadata| metadata.modified().ok());
        let (size, digest) = image;
        Self {
            frame: frame.clone(),
            scene: dataset.scene(frame),
            path: path.map(ToOwned::to_owned),
            size: metadata.map(|metadata| metadata.len()),
            mtime: modified.and_then(format_utc),
            width: size.map(|(width, _)| width),
            height: size.map(|(_, height)| height),
            digest,
            cost,
            place,
        }
    }

    /// True if two plans have the same frame with the same content at the same index.
    pub(super) fn is_same(&self, other: &Self) -> bool {
        self.frame == other.frame
            && self.scene == other.scene
            && self.digest == other.digest
            && self.place == other.place
    }
}

/// Formats a time in UTC, to the second; `None` if it is out of range.
fn format_utc(time: SystemTime) -> Option<String> {
    let time = Timestamp::try_from(time).ok()?;
    Some(time.strftime("%Y-%m-%dT%H:%M:%SZ").to_string())
}
