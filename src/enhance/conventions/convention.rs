//! Properties of a model's input and output that its graph may not declare: [`TensorLayout`], [`Channels`],
//! [`ChannelOrder`], [`ValueRange`], [`ValueScale`], [`Padding`], [`Locality`], [`Rounding`].
//!
//! The text form of each property is a value in the sidecar, `MODEL.onnx.toml`.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use darkqa_base::types::text::words::{as_text, words};

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

    /// True if each channel is a separate plane.
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

    /// Indices of the dimensions for channels, height and width.
    pub(crate) fn axes(self) -> [usize; 3] {
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

/// Channels of a model's input and output image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Channels {
    /// Red, green and blue.
    #[default]
    Rgb,
    /// Luma alone ([`LUMA`]), in 0..1. The change in luma is added to each channel of the image, which preserves the
    /// chroma.
    Y,
}

/// Weights of red, green and blue in the luma: ITU-R BT.601, full range.
pub(crate) const LUMA: [f64; 3] = [0.299, 0.587, 0.114];

impl Channels {
    /// Number of channels in words, for messages.
    pub(crate) fn description(self) -> &'static str {
        match self {
            Self::Rgb => "three channels",
            Self::Y => "one channel (channels = \"y\")",
        }
    }

    /// Number of channels.
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
    /// Index in RGB order of channel `channel` of the model. The mapping is its own inverse.
    pub(crate) fn rgb_channel(self, channel: usize) -> usize {
        match self {
            Self::Rgb => channel,
            Self::Bgr => 2 - channel,
        }
    }
}

words!(ChannelOrder { Rgb = "RGB", Bgr = "BGR" });

/// Values of black and white in a tensor.
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

    /// Maps a code of 0..255 to this range, by the same operations as the models' reference scripts.
    pub(crate) fn scale_code(self, code: f32) -> f32 {
        match self {
            Self::Unit => code / 255.0,
            Self::Bytes => code,
            Self::Signed => code / 255.0 * 2.0 - 1.0,
        }
    }

    /// Maps a value in this range to a code of 0..255, without clamping.
    pub(crate) fn to_code(self, value: f32) -> f32 {
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

/// Usual normalisation of values in 0..1 by a mean and a standard deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Normalisation {
    /// Mean and standard deviation of ImageNet, as in `torchvision.models`.
    ImageNet,
    /// Mean 0.5, deviation 1: values of −0.5..0.5.
    Centred,
    /// Mean and standard deviation of CLIP, as in its `clip.load` (<https://github.com/openai/CLIP>, `clip/clip.py`).
    Clip,
    /// Other means and standard deviations, those that are stated for the input.
    Stated([[f32; 3]; 2]),
}

impl Normalisation {
    /// Means and standard deviations of red, green and blue.
    pub(super) fn mean_and_std(self) -> [[f32; 3]; 2] {
        match self {
            Self::Stated(mean_and_std) => mean_and_std,
            Self::ImageNet => [[0.485, 0.456, 0.406], [0.229, 0.224, 0.225]],
            Self::Centred => [[0.5; 3], [1.0; 3]],
            Self::Clip => [[0.481_454_66, 0.457_827_5, 0.408_210_73], [0.268_629_54, 0.261_302_6, 0.275_777_1]],
        }
    }
}

/// Scale of the values of an image tensor: a plain range, or 0..1 normalised by a mean and a standard deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
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

    /// Range of the values before normalisation.
    pub(crate) fn range(self) -> ValueRange {
        match self {
            Self::Range(range) => range,
            Self::Normalised(_) => ValueRange::Unit,
        }
    }

    /// Means and standard deviations; `None` for a plain range.
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
            Self::Normalised(Normalisation::ImageNet) => f.write_str("0..1 with the mean and std of ImageNet"),
            Self::Normalised(Normalisation::Clip) => f.write_str("0..1 with the mean and std of CLIP"),
            Self::Normalised(Normalisation::Stated(_)) => f.write_str("0..1 with the mean and std that are set"),
            Self::Normalised(Normalisation::Centred) => f.write_str("-0.5..0.5 (mean 0.5, std 1)"),
        }
    }
}

/// Padding at the right and bottom, to make each side a multiple of the number that the model requires.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Padding {
    /// The image mirrored at its last pixel, which is not repeated.
    #[default]
    Reflect,
    /// Black, code 0 in each channel.
    Zero,
    /// The last pixel, repeated.
    Replicate,
    /// No padding: the model runs on overlapping crops of valid size. The last crops end at the edges of the image.
    Crop,
}

impl Padding {
    /// Index of the source pixel for `position` along a side of `side` pixels; `None` for black. Positions from `side`
    /// on are padding.
    pub(crate) fn source(self, position: usize, side: usize) -> Option<usize> {
        if position < side {
            return Some(position);
        }
        match self {
            Self::Zero => None,
            Self::Replicate | Self::Crop => Some(side - 1),
            Self::Reflect => {
                // Padding larger than the image is mirrored again at the first pixel, so the pattern is periodic.
                let period = (2 * (side - 1)).max(1);
                let within = position % period;
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

/// Rounding of a value between two 8-bit codes.
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

/// Receptive field: the neighbourhood in the input on which a pixel of the output depends (key `tile`).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Locality {
    /// The whole image, so that the image cannot be tiled.
    Global,
    /// This number of pixels on each side. Tiles with that context give exact results.
    Exact(usize),
}

impl fmt::Display for Locality {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Global => f.write_str("none"),
            Self::Exact(context) => write!(f, "exact:{context}"),
        }
    }
}

impl FromStr for Locality {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let context = text.strip_prefix("exact:").map(str::parse);
        match (text, context) {
            ("none", _) => Ok(Self::Global),
            (_, Some(Ok(context))) if context <= 4096 => Ok(Self::Exact(context)),
            _ => Err(format!(
                "tile is {text:?}; expected \"none\", or \"exact:N\" with N pixels of context, at most 4096"
            )),
        }
    }
}

as_text!(Locality);

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
    /// An unsupported type, by its name.
    Other(String),
}

impl ElementType {
    /// Value range implied by the type: 0..255 for `Uint8`, else `None`.
    pub(crate) fn implied_range(&self) -> Option<ValueRange> {
        (*self == Self::Uint8).then_some(ValueRange::Bytes)
    }

    /// Usual value range of images of this type.
    pub(crate) fn usual_range(&self) -> ValueRange {
        match self {
            Self::Uint8 | Self::Int32 | Self::Int64 => ValueRange::Bytes,
            _ => ValueRange::Unit,
        }
    }

    /// True if image inputs of this type are supported.
    pub(super) fn is_input_type(&self) -> bool {
        matches!(self, Self::Float32 | Self::Float16 | Self::Uint8)
    }

    /// True if image outputs of this type are supported.
    pub(crate) fn is_output_type(&self) -> bool {
        self.is_input_type() || matches!(self, Self::Float64 | Self::Int32 | Self::Int64)
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
