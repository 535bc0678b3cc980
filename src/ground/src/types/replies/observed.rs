//! [`Observed`]: the observer's view of a frame when it answered.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// The observer's view of a frame, and whether its answer follows from it.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Observed {
    /// Where the answer comes from.
    pub from: AnswerSource,
    /// The number of things of the frame: segments that are not tiny.
    pub things: usize,
    /// The number of things that are seen. Answers follow from these alone.
    pub seen: usize,
    /// The number of things whose whole outline is detected. No answer follows from these.
    pub detected: usize,
    /// The share of the image's variance that the untouched frame explains (R²), in millionths.
    pub explained_ppm: u32,
    /// For each thing by its number, the share of its outline that is confirmed, in percent, rounded down. It is seen from 50 on.
    pub outlines: BTreeMap<u32, u8>,
}

/// Where an answer of the observer comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum AnswerSource {
    /// From the things that are seen.
    Evidence,
    /// Nothing that is seen bears on the question: each choice was equally likely.
    Guess,
}
