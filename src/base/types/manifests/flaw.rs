//! [`Flaw`]: a reason to distrust an enhanced image.

use serde::{Deserialize, Serialize};

use crate::types::text::words::words;

/// A fault of an enhancer's image of a dark frame, in the order of the checks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Flaw {
    /// Values that are NaN.
    Nan,
    /// Values far outside the expected range.
    Range,
    /// No structure.
    Flat,
    /// Hardly brighter than the frame.
    Unlit,
    /// Almost all white.
    White,
    /// Bright where the frame is dark.
    Inverted,
    /// Edges that differ from those of the frame.
    Shuffled,
    /// Blue where the frame is red.
    Hue,
    /// Three equal channels where the frame has colours.
    Grey,
    /// No dark pixel at all.
    Haze,
}

words!(Flaw {
    Nan = "nan",
    Range = "range",
    Flat = "flat",
    Unlit = "unlit",
    White = "white",
    Inverted = "inverted",
    Shuffled = "shuffled",
    Hue = "hue",
    Grey = "grey",
    Haze = "haze",
});

impl Flaw {
    /// Predicate that describes the flaw, to follow "the enhanced images".
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::Nan => "have values that are not numbers",
            Self::Range => "have values far outside the range in which they are read",
            Self::Flat => "are flat",
            Self::Unlit => "are not brighter than the dark frames",
            Self::White => "are almost all white",
            Self::Inverted => "are bright where the frames are dark",
            Self::Shuffled => "have edges that are not those of the frames",
            Self::Hue => "are blue where the frames are red",
            Self::Grey => "have no colour, unlike the frames",
            Self::Haze => "have no dark pixel",
        }
    }
}
