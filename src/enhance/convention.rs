//! How a model is fed and read, where its graph cannot say: [`TensorLayout`], [`ChannelOrder`], [`ValueRange`], [`Padding`], [`Tile`], [`Rounding`].
//!
//! The words are those of the sidecar, `MODEL.onnx.toml`.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::types::words::{as_text, words};

/// The order of a tensor's dimensions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum TensorLayout {
    /// Batch, channels, height, width.
    Nchw,
    /// Batch, height, width, channels.
    Nhwc,
    /// Channels, height, width.
    Chw,
    /// Height, width, channels.
    Hwc,
}

impl TensorLayout {
    pub(super) const ALL: [Self; 4] = [Self::Nchw, Self::Nhwc, Self::Chw, Self::Hwc];

    /// Whether a channel is a plane of its own.
    pub(super) fn is_planar(self) -> bool {
        matches!(self, Self::Nchw | Self::Chw)
    }

    /// The dimensions of one image of three channels.
    pub(super) fn dims(self, [height, width]: [usize; 2]) -> Vec<usize> {
        match self {
            Self::Nchw => vec![1, 3, height, width],
            Self::Nhwc => vec![1, height, width, 3],
            Self::Chw => vec![3, height, width],
            Self::Hwc => vec![height, width, 3],
        }
    }

    /// The places of channels, height and width among the dimensions.
    pub(super) fn places(self) -> [usize; 3] {
        match self {
            Self::Nchw => [1, 2, 3],
            Self::Nhwc => [3, 1, 2],
            Self::Chw => [0, 1, 2],
            Self::Hwc => [2, 0, 1],
        }
    }

    /// How many dimensions there are.
    pub(super) fn rank(self) -> usize {
        match self {
            Self::Nchw | Self::Nhwc => 4,
            Self::Chw | Self::Hwc => 3,
        }
    }
}

words!(TensorLayout { Nchw = "NCHW", Nhwc = "NHWC", Chw = "CHW", Hwc = "HWC" });

/// The order of channels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum ChannelOrder {
    /// Red first, as all published models.
    #[default]
    Rgb,
    /// Blue first, as OpenCV.
    Bgr,
}

impl ChannelOrder {
    /// The channel of an RGB image that is the model's `channel`.
    pub(super) fn of(self, channel: usize) -> usize {
        match self {
            Self::Rgb => channel,
            Self::Bgr => 2 - channel,
        }
    }
}

words!(ChannelOrder { Rgb = "RGB", Bgr = "BGR" });

/// What black and white are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum ValueRange {
    /// 0 and 1.
    #[serde(rename = "0..1")]
    Unit,
    /// 0 and 255.
    #[serde(rename = "0..255")]
    Bytes,
    /// −1 and 1.
    #[serde(rename = "-1..1")]
    Signed,
}

impl ValueRange {
    /// A code of 0..255 in this range; dividing as the models' own scripts do.
    pub(super) fn of_code(self, code: f32) -> f32 {
        match self {
            Self::Unit => code / 255.0,
            Self::Bytes => code,
            Self::Signed => code / 255.0 * 2.0 - 1.0,
        }
    }

    /// The code of a value in this range, unbounded.
    pub(super) fn code(self, value: f32) -> f32 {
        match self {
            Self::Unit => value * 255.0,
            Self::Bytes => value,
            Self::Signed => (value + 1.0) * 127.5,
        }
    }
}

impl fmt::Display for ValueRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}

/// What stands beside an image whose size is no multiple of the model's.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Padding {
    /// The image mirrored at its last pixel, to the right and below.
    #[default]
    Reflect,
    /// Black.
    Zero,
    /// The last pixel over and over.
    Replicate,
    /// Nothing: the model sees as much as fits. What is left of the image comes from a second look, shifted to its end.
    Crop,
}

impl fmt::Display for Padding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}

/// How a value between two codes becomes one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Rounding {
    /// The nearest, half away from zero.
    #[default]
    Round,
    /// The lower.
    Truncate,
}

impl fmt::Display for Rounding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}

/// Whether a pixel depends on its surroundings alone.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Tile {
    /// It depends on the whole image.
    None,
    /// It depends on so many pixels to each side, so that tiles with that much context are exact.
    Exact(usize),
}

impl fmt::Display for Tile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::None => f.write_str("none"),
            Self::Exact(context) => write!(f, "exact:{context}"),
        }
    }
}

impl FromStr for Tile {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let context = text.strip_prefix("exact:").map(str::parse);
        match (text, context) {
            ("none", _) => Ok(Self::None),
            (_, Some(Ok(context))) if context <= 4096 => Ok(Self::Exact(context)),
            _ => Err(format!(
                "tile is {text:?}; \"none\", or \"exact:8\" with the context in pixels expected"
            )),
        }
    }
}

as_text!(Tile);

/// What the elements of a tensor are.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum ElementType {
    /// 32-bit floats.
    Float32,
    /// 16-bit floats.
    Float16,
    /// Bytes.
    Uint8,
    /// Anything else, by its name.
    Other(String),
}

impl ElementType {
    /// The range that goes with a type.
    pub(super) fn usual_range(&self) -> ValueRange {
        match self {
            Self::Uint8 => ValueRange::Bytes,
            _ => ValueRange::Unit,
        }
    }
}

impl fmt::Display for ElementType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Float32 => "float32",
            Self::Float16 => "float16",
            Self::Uint8 => "uint8",
            Self::Other(name) => name,
        })
    }
}
