//! The estimated cost of a frame: [`FrameCost`].

use serde::{Deserialize, Serialize};

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
