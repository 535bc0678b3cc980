//! Parts of a model's convention, which its graph may not state: [`TensorLayout`], [`Channels`], [`ChannelOrder`],
//! [`ValueRange`], [`ValueScale`], [`Padding`], [`Tile`], [`Rounding`].
//!
//! The words are those of the sidecar, `MODEL.onnx.toml`.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use darkqa_ground::types::text::words::{as_text, words};

/// Order of a tensor's dimensions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum TensorLayout {
    /// Batch, channels, height, width.
    Nchw,
    /// Batch, height, width, channels.
    Nhwc,
    /// Channels, height, width, without a batch.
    Chw,
    /// Height, width, channels, without a batch.
    Hwc,
}

impl TensorLayout {
    pub(crate) const ALL: [Self; 4] = [Self::Nchw, Self::Nhwc, Self::Chw, Self::Hwc];

    /// Whether each channel is a separate plane.
    pub(crate) fn is_planar(self) -> bool {
        matches!(self, Self::Nchw | Self::Chw)
    }

    /// Dimensions of one image with `channels` channels.
    pub(crate) fn dims(self, [height, width]: [usize; 2], channels: usize) -> Vec<usize> {
        match self {
            Self::Nchw => vec![1, channels, height, width],
            Self::Nhwc => vec![1, height, width, channels],
            Self::Chw => vec![channels, height, width],
            Self::Hwc => vec![height, width, channels],
        }
    }

    /// Indices of channels, height and width among the dimensions.
    pub(crate) fn places(self) -> [usize; 3] {
        match self {
            Self::Nchw => [1, 2, 3],
            Self::Nhwc => [3, 1, 2],
            Self::Chw => [0, 1, 2],
            Self::Hwc => [2, 0, 1],
        }
    }

    pub(crate) fn rank(self) -> usize {
        match self {
            Self::Nchw | Self::Nhwc => 4,
            Self::Chw | Self::Hwc => 3,
        }
    }
}

words!(TensorLayout { Nchw = "NCHW", Nhwc = "NHWC", Chw = "CHW", Hwc = "HWC" });

/// Channels of an image that a model takes and gives.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Channels {
    /// Red, green and blue.
    #[default]
    Rgb,
    /// The luma alone ([`LUMA`]), 0..1. The image keeps its chroma: the change of its luma is added to each channel.
    Y,
}

/// Weights of red, green and blue in the luma: ITU-R BT.601, full range.
pub(crate) const LUMA: [f64; 3] = [0.299, 0.587, 0.114];

impl Channels {
    /// Their number in words, for messages.
    pub(crate) fn words(self) -> &'static str {
        match self {
            Self::Rgb => "three channels",
            Self::Y => "one channel (channels = \"y\")",
        }
    }

    /// Number of the channels.
    pub(crate) fn count(self) -> usize {
        match self {
            Self::Rgb => 3,
            Self::Y => 1,
        }
    }
}

words!(Channels { Rgb = "RGB", Y = "Y" });

/// Order of the colour channels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum ChannelOrder {
    /// Red first, as in all published models.
    #[default]
    #[serde(alias = "RGB")]
    Rgb,
    /// Blue first, as in OpenCV.
    #[serde(alias = "BGR")]
    Bgr,
}

impl ChannelOrder {
    /// Channel of an RGB image that corresponds to the model's `channel`.
    pub(crate) fn rgb_channel(self, channel: usize) -> usize {
        match self {
            Self::Rgb => channel,
            Self::Bgr => 2 - channel,
        }
    }
}

words!(ChannelOrder { Rgb = "RGB", Bgr = "BGR" });

/// Values of black and white.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum ValueRange {
    /// Black 0, white 1.
    #[serde(rename = "0..1")]
    Unit,
    /// Black 0, white 255.
    #[serde(rename = "0..255")]
    Bytes,
    /// Black −1, white 1.
    #[serde(rename = "-1..1")]
    Signed,
}

impl ValueRange {
    pub(crate) const ALL: [Self; 3] = [Self::Unit, Self::Bytes, Self::Signed];

    /// Value of a code of 0..255 in this range, divided as the models' own scripts do.
    pub(crate) fn scale_code(self, code: f32) -> f32 {
        match self {
            Self::Unit => code / 255.0,
            Self::Bytes => code,
            Self::Signed => code / 255.0 * 2.0 - 1.0,
        }
    }

    /// Code of a value in this range, not clamped to 0..255.
    pub(crate) fn code(self, value: f32) -> f32 {
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

/// Mean and deviation that networks for other tasks were trained with, on values of 0..1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Normalisation {
    /// ImageNet's mean and standard deviation, as in `torchvision.models`.
    ImageNet,
    /// Mean 0.5, deviation 1: values of −0.5..0.5.
    Centred,
    /// Mean and standard deviation of CLIP, as in its `clip.load` (<https://github.com/openai/CLIP>, `clip/clip.py`).
    Clip,
}

impl Normalisation {
    /// Mean and deviation of red, green and blue.
    pub(super) fn mean_and_std(self) -> [[f32; 3]; 2] {
        match self {
            Self::ImageNet => [[0.485, 0.456, 0.406], [0.229, 0.224, 0.225]],
            Self::Centred => [[0.5; 3], [1.0; 3]],
            Self::Clip => [
                [0.481_454_66, 0.457_827_5, 0.408_210_73],
                [0.268_629_54, 0.261_302_6, 0.275_777_1],
            ],
        }
    }
}

/// Values of an image in a tensor: a range, or 0..1 with a mean and a deviation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ValueScale {
    Range(ValueRange),
    Normalised(Normalisation),
}

impl ValueScale {
    pub(crate) const ALL: [Self; 6] = [
        Self::Range(ValueRange::Unit),
        Self::Range(ValueRange::Bytes),
        Self::Range(ValueRange::Signed),
        Self::Normalised(Normalisation::ImageNet),
        Self::Normalised(Normalisation::Centred),
        Self::Normalised(Normalisation::Clip),
    ];

    /// The range that a mean and a deviation, if any, are applied to.
    pub(crate) fn range(self) -> ValueRange {
        match self {
            Self::Range(range) => range,
            Self::Normalised(_) => ValueRange::Unit,
        }
    }

    /// Mean and deviation; `None` for a plain range.
    pub(crate) fn mean_and_std(self) -> Option<[[f32; 3]; 2]> {
        match self {
            Self::Range(_) => None,
            Self::Normalised(normalisation) => Some(normalisation.mean_and_std()),
        }
    }
}

impl fmt::Display for ValueScale {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Range(range) => range.fmt(f),
            Self::Normalised(Normalisation::ImageNet) => {
                f.write_str("0..1 with the mean and std of ImageNet")
            }
            Self::Normalised(Normalisation::Clip) => {
                f.write_str("0..1 with the mean and std of CLIP")
            }
            Self::Normalised(Normalisation::Centred) => f.write_str("-0.5..0.5 (mean 0.5, std 1)"),
        }
    }
}

/// Pixels that fill an image up to the model's multiple, to the right and below.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Padding {
    /// The image, mirrored at its last pixel.
    #[default]
    Reflect,
    /// Black, code 0 in each channel.
    Zero,
    /// The last pixel, repeated.
    Replicate,
    /// No padding: the model gets the largest part that fits. The rest comes from another run on a part that ends at the
    /// image's edge.
    Crop,
}

impl Padding {
    /// Index of the pixel that is copied to position `at`, which may be beyond the end of the side; `None` for black.
    pub(crate) fn source(self, at: usize, side: usize) -> Option<usize> {
        if at < side {
            return Some(at);
        }
        match self {
            Self::Zero => None,
            Self::Replicate | Self::Crop => Some(side - 1),
            Self::Reflect => {
                // Mirrored at the last pixel, and again at the first if the padding is larger than the image.
                let period = (2 * (side - 1)).max(1);
                let within = at % period;
                Some(within.min(period - within).min(side - 1))
            }
        }
    }
}

impl fmt::Display for Padding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}

/// Conversion of a value between two codes to a code.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Rounding {
    /// The nearest code; halves are rounded away from zero.
    #[default]
    Round,
    /// The next lower code.
    Truncate,
}

impl fmt::Display for Rounding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}

/// How far a pixel of the result depends on the image around it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Tile {
    /// It depends on the whole image.
    None,
    /// It depends on the given number of pixels on each side, so that tiles with that context are exact.
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
                "tile is {text:?}; expected \"none\", or \"exact:N\" with N pixels of context, at most 4096"
            )),
        }
    }
}

as_text!(Tile);

/// Type of a tensor's elements.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum ElementType {
    Bool,
    Int8,
    Int16,
    Int32,
    Int64,
    Uint8,
    Uint16,
    Uint32,
    Uint64,
    Float16,
    Bfloat16,
    Float32,
    Float64,
    /// Any other type, by its name; not supported.
    Other(String),
}

impl ElementType {
    /// Value range that the type states: bytes are 0..255.
    pub(crate) fn certain_range(&self) -> Option<ValueRange> {
        (*self == Self::Uint8).then_some(ValueRange::Bytes)
    }

    /// Value range that images of this type usually have.
    pub(crate) fn usual_range(&self) -> ValueRange {
        match self {
            Self::Uint8 | Self::Int32 | Self::Int64 => ValueRange::Bytes,
            _ => ValueRange::Unit,
        }
    }

    /// Whether images of this type can be fed.
    pub(super) fn is_fed(&self) -> bool {
        matches!(self, Self::Float32 | Self::Float16 | Self::Uint8)
    }

    /// Whether images of this type can be read.
    pub(crate) fn is_read(&self) -> bool {
        self.is_fed() || matches!(self, Self::Float64 | Self::Int32 | Self::Int64)
    }
}

impl fmt::Display for ElementType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Bool => "bool",
            Self::Int8 => "int8",
            Self::Int16 => "int16",
            Self::Int32 => "int32",
            Self::Int64 => "int64",
            Self::Uint8 => "uint8",
            Self::Uint16 => "uint16",
            Self::Uint32 => "uint32",
            Self::Uint64 => "uint64",
            Self::Float16 => "float16",
            Self::Bfloat16 => "bfloat16",
            Self::Float32 => "float32",
            Self::Float64 => "float64",
            Self::Other(name) => name,
        })
    }
}
