//! A figure of thresholds, a row for each curve: [`ThresholdChart`].

use crate::types::degradations::Axis;
use darkqa_score::threshold::Threshold;

/// The scale of an axis: the exposure drops to L5, the darkest named level, or the exposure times of the ladder.
#[derive(Debug, Clone)]
pub(crate) struct Scale {
    pub end: f64,
    /// Distance of two ticks.
    pub step: i32,
    /// Name of the threshold.
    pub title: &'static str,
    pub unit: &'static str,
}

impl Scale {
    pub(crate) fn new(axis: Axis) -> Self {
        let (end, step, title) = if axis == Axis::MOTION {
            (140.0, 20, "threshold of motion blur")
        } else {
            (9.0, 1, "darkness threshold")
        };
        Self {
            end,
            step,
            title,
            unit: axis.unit,
        }
    }
}

/// The threshold of one curve.
#[derive(Debug, Clone)]
pub(crate) struct ThresholdRow {
    /// The model and its light.
    pub name: String,
    pub threshold: Threshold,
    /// The threshold with its interval, in words.
    pub words: String,
}

/// A figure of the thresholds on one axis.
#[derive(Debug, Clone)]
pub(crate) struct ThresholdChart {
    pub rows: Vec<ThresholdRow>,
    pub scale: Scale,
    /// The unit of the intervals: scenes or frames.
    pub unit: String,
}
