//! The observer's name, and its controls: [`Control`].

use std::fmt;
use std::str::FromStr;

/// Name of the observer in records and tables.
pub const OBSERVER: &str = "observer";

/// A control of the observer: a change of the image after which the observer should know less.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Control {
    /// The unchanged image of a frame from another scene in the same condition; the plan of the run chooses it.
    OtherRoom,
    /// Each square of 12 pixels filled with its mean. The score may stay above chance, because large things are still
    /// visible.
    Mosaic12,
    /// Each square of 40 pixels filled with its mean.
    Mosaic40,
    /// Left and right exchanged.
    Mirrored,
    /// Top and bottom exchanged.
    UpsideDown,
    /// Squares of 80 pixels, each moved to another place.
    Tiles,
    /// All pixels black.
    Black,
    /// All pixels the mean colour of the image.
    Flat,
    /// An independent, uniformly distributed code for each sample.
    WhiteNoise,
    /// Noise with the same power in each octave, like that of natural images.
    PinkNoise,
    /// Each code subtracted from 255.
    Negative,
    /// Blurred by about σ = 20 pixels.
    Blur,
    /// Shifted by 32 pixels to the right and down; pixels wrap around the edges.
    Shift32,
    /// Shifted by 4 pixels to the right and down. The score may stay above chance, because some outlines still agree.
    Shift4,
    /// Each mask filled with a random colour.
    RandomMasks,
    /// The outlines of the masks, black on grey.
    Outlines,
}

impl Control {
    /// All controls, in the order in which they are asked.
    pub const ALL: [Self; 16] = [
        Self::OtherRoom,
        Self::Mosaic12,
        Self::Mosaic40,
        Self::Mirrored,
        Self::UpsideDown,
        Self::Tiles,
        Self::Black,
        Self::Flat,
        Self::WhiteNoise,
        Self::PinkNoise,
        Self::Negative,
        Self::Blur,
        Self::Shift32,
        Self::Shift4,
        Self::RandomMasks,
        Self::Outlines,
    ];

    /// True if the image carries no information about the question, so that the score must be at chance.
    #[must_use]
    pub fn removes_all_information(self) -> bool {
        !matches!(self, Self::Shift4 | Self::Mosaic12)
    }

    /// Controls that a run with the observer asks by default: the first that is possible, which is `other-room`, or
    /// `tiles` if all frames are from one scene.
    pub const DEFAULTS: [Self; 2] = [Self::OtherRoom, Self::Tiles];

    /// The control in a model name such as `observer:tiles`, or `observer:tiles (night)` with the name of a run; `None`
    /// for other models.
    pub fn from_model_name(model: &str) -> Option<Self> {
        let name = model.strip_prefix(OBSERVER)?.strip_prefix(':')?;
        name.split_once(" (").map_or(name, |(name, _)| name).parse().ok()
    }

    /// The name as a model, `observer:NAME`.
    pub fn model_name(self) -> String {
        format!("{OBSERVER}:{self}")
    }

    /// The name, as in `observer:NAME`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::OtherRoom => "other-room",
            Self::Mosaic12 => "mosaic-12",
            Self::Mosaic40 => "mosaic-40",
            Self::Mirrored => "mirrored",
            Self::UpsideDown => "upside-down",
            Self::Tiles => "tiles",
            Self::Black => "black",
            Self::Flat => "flat",
            Self::WhiteNoise => "white-noise",
            Self::PinkNoise => "pink-noise",
            Self::Negative => "negative",
            Self::Blur => "blur",
            Self::Shift32 => "shift-32",
            Self::Shift4 => "shift-4",
            Self::RandomMasks => "random-masks",
            Self::Outlines => "outlines",
        }
    }
}

impl fmt::Display for Control {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Control {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Self::ALL.into_iter().find(|control| control.name() == text).ok_or_else(|| {
            let names = Self::ALL.map(Self::name).join(", ");
            format!("observer:{text} is not a control; there are: {names}")
        })
    }
}
