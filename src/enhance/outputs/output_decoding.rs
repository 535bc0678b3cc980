//! Conversion of a model's output tensor to an image: [`OutputDecoding`].
//!
//! A first pass checks the values, a second one clamps and rounds them.

use std::borrow::Cow;

use half::f16;

use super::output::Output;
use crate::conventions::sidecar::ModelSidecar;
use crate::conventions::{ChannelOrder, ElementType, ImageInput, Rounding, TensorLayout, ValueRange};
use crate::expressions::ChannelSlice;
use crate::planes::Planes;
use crate::sizing::TileWindow;

/// Conversion of an output tensor to an image.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct OutputDecoding {
    /// Order of the dimensions; `None` if it is known only after a run.
    pub(crate) layout: Option<TensorLayout>,
    /// Layout of the input, preferred if several fit.
    pub(crate) preferred: TensorLayout,
    /// Possible numbers of channels, the most likely one first.
    pub(super) channels: Vec<usize>,
    /// Channels that are used; `None` for all.
    pub(super) slice: Option<ChannelSlice>,
    pub(crate) color: ChannelOrder,
    pub(crate) range: ValueRange,
    /// Means and standard deviations: each channel is multiplied by its deviation, then its mean is added. `None` for
    /// neither.
    pub(crate) mean_and_std: Option<[[f32; 3]; 2]>,
    /// Whether `range` is known or must be checked against the values.
    pub(super) certainty: Certainty,
    pub(super) rounding: Rounding,
}

/// Whether the range of an output is known.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Certainty {
    /// Stated by a sidecar or preset, or implied by the element type.
    Known,
    /// Assumed to be the range of the input.
    Assumed,
}

/// Problem with the values of an input or output.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum InvalidValues {
    /// The output contains NaN.
    NanOutput,
    /// The expressions for inputs in the sidecar give values that are not finite.
    NonFiniteInput,
    /// The output has another range than the assumed one.
    OutOfRange {
        min: f32,
        max: f32,
        /// Range that the values seem to have.
        likely: ValueRange,
    },
}

/// Elements of an output tensor.
#[derive(Debug, Clone, Copy)]
pub(crate) enum TensorSamples<'a> {
    Float32(&'a [f32]),
    Float16(&'a [f16]),
    Float64(&'a [f64]),
    Int32(&'a [i32]),
    Int64(&'a [i64]),
    Uint8(&'a [u8]),
}

impl<'a> TensorSamples<'a> {
    /// The elements as 32-bit floats.
    fn floats(self) -> Cow<'a, [f32]> {
        match self {
            Self::Float32(values) => Cow::Borrowed(values),
            Self::Float16(values) => values.iter().map(|value| value.to_f32()).collect(),
            Self::Float64(values) => values.iter().map(|value| *value as f32).collect(),
            Self::Int32(values) => values.iter().map(|value| *value as f32).collect(),
            Self::Int64(values) => values.iter().map(|value| *value as f32).collect(),
            Self::Uint8(values) => values.iter().map(|value| f32::from(*value)).collect(),
        }
    }
}

impl OutputDecoding {
    /// The decoding defined by an output, the image input and the convention.
    pub(super) fn new(output: &Output, input: &ImageInput, convention: &ModelSidecar) -> Self {
        let mean_and_std = convention.mean_and_std_out();
        let (range, certainty) = match (convention.range_out, &output.port.element) {
            (Some(range), _) => (range, Certainty::Known),
            (None, _) if mean_and_std.is_some() => (ValueRange::Unit, Certainty::Known),
            (None, ElementType::Uint8 | ElementType::Int32 | ElementType::Int64) => {
                (ValueRange::Bytes, Certainty::Known)
            }
            // An unstated range is assumed to be that of the input.
            (None, _) => (convention.range_in.unwrap_or(input.port.element.usual_range()), Certainty::Assumed),
        };
        Self {
            layout: convention.layout_out.or(output.layout),
            preferred: input.layout,
            channels: output.channels.clone(),
            slice: output.slice,
            mean_and_std,
            color: convention.color_out.or(convention.color).unwrap_or_default(),
            range,
            certainty,
            rounding: convention.rounding.unwrap_or_default(),
        }
    }

    /// Layout and number of channels of an output with dimensions `dims`; `None` if it is not an image of this size.
    pub(super) fn layout(&self, dims: &[i64], size: [usize; 2]) -> Option<(TensorLayout, usize)> {
        let layouts: Vec<TensorLayout> = match self.layout {
            Some(layout) => vec![layout],
            None => std::iter::once(self.preferred).chain(TensorLayout::ALL).collect(),
        };
        self.channels.iter().flat_map(|count| layouts.iter().map(move |layout| (*layout, *count))).find(
            |(layout, count)| {
                let expected = layout.dims(size, *count);
                expected.len() == dims.len() && expected.iter().zip(dims).all(|(a, b)| usize::try_from(*b) == Ok(*a))
            },
        )
    }

    /// Decodes a part of an output of three channels to packed RGB bytes; `size` is the size of the whole output.
    pub(super) fn bytes(
        &self,
        samples: TensorSamples<'_>,
        layout: TensorLayout,
        size: [usize; 2],
        part: TileWindow,
    ) -> Result<Vec<u8>, InvalidValues> {
        if let TensorSamples::Uint8(bytes) = samples {
            return Ok(self.gather_bytes(bytes, layout, size, part, |byte| byte));
        }
        let values = samples.floats();
        check_values(&values, self.range, self.certainty)?;
        let (range, rounding) = (self.range, self.rounding);
        Ok(self.gather_bytes(&values, layout, size, part, |value| {
            let code = range.to_code(value).clamp(0.0, 255.0);
            match rounding {
                Rounding::Round => round_to_u8(code),
                Rounding::Truncate => code as u8,
            }
        }))
    }

    /// Decodes a part of an output to planes in 0..1. The output has `all_channels` channels, and `size` is its whole
    /// size. `certainty` overrides that of the decoding.
    pub(super) fn planes(
        &self,
        samples: TensorSamples<'_>,
        layout: TensorLayout,
        all_channels: usize,
        [height, width]: [usize; 2],
        part: TileWindow,
        certainty: Certainty,
    ) -> Result<Planes, InvalidValues> {
        let values = samples.floats();
        // Unused channels may have any values.
        if self.slice.is_none() {
            check_values(&values, self.range, certainty)?;
        }
        let (first, channels) = match self.slice {
            None => (0, all_channels),
            Some(slice) => (slice.first, slice.count()),
        };
        let mut samples = Vec::with_capacity(channels * part.size()[0] * part.size()[1]);
        for channel in 0..channels {
            let channel = match channels {
                3 => self.color.rgb_channel(channel),
                _ => channel,
            };
            let source = first + channel;
            for row in part.top..part.bottom {
                samples.extend((part.left..part.right).map(|column| {
                    let pixel = row * width + column;
                    let mut value = if layout.is_planar() {
                        values[source * height * width + pixel]
                    } else {
                        values[all_channels * pixel + source]
                    };
                    if let (Some([mean, std]), 3) = (self.mean_and_std, channels) {
                        value = value * std[channel] + mean[channel];
                    }
                    match self.range {
                        ValueRange::Unit => value,
                        ValueRange::Bytes | ValueRange::Signed => self.range.to_code(value) / 255.0,
                    }
                }));
            }
        }
        if samples.iter().any(|sample| sample.is_nan()) {
            return Err(InvalidValues::NanOutput);
        }
        Ok(Planes { height: part.size()[0], width: part.size()[1], samples })
    }

    /// Packed RGB bytes of a part of an output, each computed from its sample by `byte`.
    fn gather_bytes<T: Copy>(
        &self,
        samples: &[T],
        layout: TensorLayout,
        [height, width]: [usize; 2],
        part: TileWindow,
        byte: impl Fn(T) -> u8,
    ) -> Vec<u8> {
        let mut bytes = vec![0; 3 * part.size()[0] * part.size()[1]];
        let lines = bytes.chunks_exact_mut(3 * part.size()[1]);
        for (y, line) in (part.top..part.bottom).zip(lines) {
            for channel in 0..3 {
                let source = self.color.rgb_channel(channel);
                let pixels = line.iter_mut().skip(channel).step_by(3);
                if layout.is_planar() {
                    let row = &samples[source * height * width + y * width..][..width];
                    for (target, sample) in pixels.zip(&row[part.left..part.right]) {
                        *target = byte(*sample);
                    }
                } else {
                    let row = &samples[3 * y * width..][..3 * width];
                    let row = row[3 * part.left..3 * part.right].iter();
                    for (target, sample) in pixels.zip(row.skip(source).step_by(3)) {
                        *target = byte(*sample);
                    }
                }
            }
        }
        bytes
    }
}

/// Refuses NaN, and values that do not fit the assumed range.
///
/// Models that do not clamp their output overshoot a little. So the range counts as wrong only if more than one sample
/// in 20 is far outside.
pub(super) fn check_values(values: &[f32], range: ValueRange, certainty: Certainty) -> Result<(), InvalidValues> {
    let (mut nans, mut below, mut above) = (0_usize, 0_usize, 0_usize);
    let mut max = f32::NEG_INFINITY;
    for value in values {
        max = if *value > max { *value } else { max };
        nans += usize::from(value.is_nan());
        below += usize::from(*value < -0.2);
        above += usize::from(*value > 8.0);
    }
    if nans > 0 {
        return Err(InvalidValues::NanOutput);
    }
    let tolerated = values.len() / 20;
    let likely = match (certainty, range) {
        (Certainty::Assumed, ValueRange::Unit) if above > tolerated => ValueRange::Bytes,
        (Certainty::Assumed, ValueRange::Unit) if below > tolerated => ValueRange::Signed,
        (Certainty::Assumed, ValueRange::Bytes) if max <= 1.5 => ValueRange::Unit,
        _ => return Ok(()),
    };
    Err(InvalidValues::OutOfRange { min: values.iter().copied().fold(f32::INFINITY, f32::min), max, likely })
}

/// Nearest code to a value in 0..255; halves are rounded up.
pub(crate) fn round_to_u8(code: f32) -> u8 {
    let below = code as u8;
    below + u8::from(code - f32::from(below) >= 0.5)
}

#[cfg(test)]
mod tests;
