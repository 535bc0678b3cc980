//! [`Observed`]: the observer's view of a frame when it answered.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// The observer's view of a frame, and whether its answer follows from it.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Observed {
    /// Basis of the answer.
    pub from: AnswerSource,
    /// The number of things of the frame: segments that are not tiny.
    pub things: usize,
    /// The number of things that the observer sees. It answers from these alone.
    pub seen: usize,
    /// The number of things whose whole outline is detected. It is not used for answers.
    pub detected: usize,
    /// The share of the image's variance that the untouched frame explains (R²), in millionths.
    pub explained_ppm: u32,
    /// The confirmed share of each thing's outline, in percent, rounded down, by the thing's number. A thing is seen
    /// from 50 on.
    pub outlines: BTreeMap<u32, u8>,
}

/// Basis of an answer of the observer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum AnswerSource {
    /// The things that the observer sees.
    Evidence,
    /// A random choice, each equally likely, because nothing that the observer sees bears on the question.
    Guess,
}
