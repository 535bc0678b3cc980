//! Charts of thresholds with one row for each curve: [`ThresholdChart`].

use crate::types::degradations::Axis;
use darkqa_score::threshold::Threshold;

/// Horizontal scale, from 0 to the end of a ladder of levels: 9 EV for light (L5), 140 ms for motion blur.
#[derive(Debug, Clone)]
pub(crate) struct Scale {
    pub end: f64,
    /// Distance between two ticks.
    pub step: i32,
    /// Name of the threshold.
    pub title: &'static str,
    pub unit: &'static str,
}

impl Scale {
    pub(crate) fn for_axis(axis: Axis) -> Self {
        let (end, step, title) =
            if axis == Axis::MOTION { (140.0, 20, "threshold of motion blur") } else { (9.0, 1, "darkness threshold") };
        Self { end, step, title, unit: axis.unit }
    }
}

/// The threshold of one curve.
#[derive(Debug, Clone)]
pub(crate) struct ThresholdRow {
    /// Model and condition.
    pub name: String,
    pub threshold: Threshold,
    /// Threshold with its interval, formatted.
    pub text: String,
}

/// A figure of the thresholds on one axis.
#[derive(Debug, Clone)]
pub(crate) struct ThresholdChart {
    pub rows: Vec<ThresholdRow>,
    pub scale: Scale,
    /// The unit of the intervals: scenes or frames.
    pub unit: String,
}
