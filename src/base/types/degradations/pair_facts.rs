//! The darkness of a frame's photograph: [`PairFacts`].

use serde::{Deserialize, Serialize};

/// How much darker a photograph is than its frame, in EV, for records. All numbers are finite.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PairFacts {
    /// Drop in EV computed from the exposure times and gains in the data; `None` if the data do not state them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stated: Option<f64>,
    /// Measured drop in EV: log₂ of the ratio of the mean linear luminances; `None` if one of the images is black.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mean: Option<f64>,
    /// Median over the pixels of log₂ of the luminance ratio, in EV; `None` if too many pixels are black.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub median: Option<f64>,
    /// The drop in EV with which synthesis makes the frame as dark as the photograph. It differs from `mean`, because
    /// synthesis computes light as codes to the power of 2.2.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub synthesis: Option<f64>,
}

impl PairFacts {
    /// The largest drop in EV that can be measured. Above it, noise clipped at black hides a part of the drop: on a dim
    /// frame with a noise deviation of 0.002 in linear light, 6 EV are measured as 5.9, 7.5 EV as 6.8 and 9 EV as 7.3.
    pub const MEASURABLE: f64 = 6.0;

    /// The stated drop in EV, otherwise the measured one; `None` if neither is known.
    #[must_use]
    pub fn ev(&self) -> Option<f64> {
        self.stated.or(self.mean)
    }

    /// The drop in EV with which synthesis matches the photograph: the stated one, otherwise `synthesis`.
    #[must_use]
    pub fn matching(&self) -> Option<f64> {
        self.stated.or(self.synthesis)
    }

    /// True if the drop is measured and the real one may be larger.
    #[must_use]
    pub fn is_lower_bound(&self) -> bool {
        self.stated.is_none() && self.mean.is_some_and(|ev| ev > Self::MEASURABLE)
    }
}

// No number is NaN.
impl Eq for PairFacts {}
