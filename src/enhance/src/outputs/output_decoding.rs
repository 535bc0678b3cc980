//! Conversion of a model's output tensor to an image of bytes: [`OutputDecoding`].
//!
//! One pass checks the values, another clamps and rounds them.

use std::borrow::Cow;

use half::f16;

use super::output::Output;
use crate::conventions::sidecar::ModelSidecar;
use crate::conventions::{
    ChannelOrder, ElementType, ImageInput, Rounding, TensorLayout, ValueRange,
};
use crate::expressions::ChannelSlice;
use crate::planes::Planes;
use crate::sizing::TileWindow;

/// Conversion of an output tensor to an image.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct OutputDecoding {
    /// Order of the dimensions; `None` if only a run shows it.
    pub(crate) layout: Option<TensorLayout>,
    /// Layout that is chosen if several fit: that of the input.
    pub(crate) preferred: TensorLayout,
    /// Numbers of channels that it may have, the likely one first.
    pub(super) channels: Vec<usize>,
    /// The channels that are read; `None` for all.
    pub(super) slice: Option<ChannelSlice>,
    pub(crate) color: ChannelOrder,
    pub(crate) range: ValueRange,
    /// Added to each channel after it was multiplied by the second; `None` for neither.
    pub(crate) mean_and_std: Option<[[f32; 3]; 2]>,
    /// Whether the range is known or must be checked against the values.
    pub(super) certainty: Certainty,
    pub(super) rounding: Rounding,
}

/// Whether the range of an output is known.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Certainty {
    /// A sidecar, a preset or the type states it.
    Known,
    /// It is the input's or the usual range.
    Assumed,
}

/// Problem with the values of an output, or of an input.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum InvalidValues {
    /// Some values are not numbers (NaN).
    NanOutput,
    /// The expressions in the sidecar make values that are not finite of the image, which are not fed.
    NonFiniteInput,
    /// The values have another range than the assumed one.
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
    /// The conversion that an output, the input and the convention define.
    pub(super) fn new(output: &Output, input: &ImageInput, convention: &ModelSidecar) -> Self {
        let mean_and_std = convention.mean_and_std_out();
        let (range, certainty) = match (convention.range_out, &output.port.element) {
            (Some(range), _) => (range, Certainty::Known),
            (None, _) if mean_and_std.is_some() => (ValueRange::Unit, Certainty::Known),
            (None, ElementType::Uint8 | ElementType::Int32 | ElementType::Int64) => {
                (ValueRange::Bytes, Certainty::Known)
            }
            // Without a statement, the output has the range of the input.
            (None, _) => (
                convention
                    .range_in
                    .unwrap_or(input.port.element.usual_range()),
                Certainty::Assumed,
            ),
        };
        Self {
            layout: convention.layout_out.or(output.layout),
            preferred: input.layout,
            channels: output.channels.clone(),
            slice: output.slice,
            mean_and_std,
            color: convention
                .color_out
                .or(convention.color)
                .unwrap_or_default(),
            range,
            certainty,
            rounding: convention.rounding.unwrap_or_default(),
        }
    }

    /// Layout and number of channels of an output with dimensions `dims` for an image of this size; `None` if it cannot be one.
    pub(super) fn layout(&self, dims: &[i64], size: [usize; 2]) -> Option<(TensorLayout, usize)> {
        let fits = |layout: TensorLayout, channels: usize| {
            let wanted = layout.dims(size, channels);
            wanted.len() == dims.len()
                && wanted
                    .iter()
                    .zip(dims)
                    .all(|(a, b)| usize::try_from(*b) == Ok(*a))
        };
        let layouts: Vec<TensorLayout> = match self.layout {
            Some(layout) => vec![layout],
            None => std::iter::once(self.preferred)
                .chain(TensorLayout::ALL)
                .collect(),
        };
        self.channels
            .iter()
            .flat_map(|count| layouts.iter().map(move |layout| (*layout, *count)))
            .find(|(layout, count)| fits(*layout, *count))
    }

    /// The bytes of a part of an output of three channels, as red, green and blue of each pixel; `size` is that of the whole output.
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

    /// A part of an output as floats in 0..1; `size` is that of the whole output. Of the values nothing is checked but `certainty`.
    pub(super) fn planes(
        &self,
        samples: TensorSamples<'_>,
        (layout, channels): (TensorLayout, usize),
        [height, width]: [usize; 2],
        part: TileWindow,
        certainty: Certainty,
    ) -> Result<Planes, InvalidValues> {
        let values = samples.floats();
        // Other channels than those that are read may have any values.
        if self.slice.is_none() {
            check_values(&values, self.range, certainty)?;
        }
        let all = channels;
        let (first, channels) = self
            .slice
            .map_or((0, all), |slice| (slice.first, slice.count()));
        let at = |channel: usize, row: usize, column: usize| {
            let pixel = row * width + column;
            let channel = match channels {
                3 => self.color.rgb_channel(channel),
                _ => channel,
            };
            let place = first + channel;
            let mut value = if layout.is_planar() {
                values[place * height * width + pixel]
            } else {
                values[all * pixel + place]
            };
            if let (Some([mean, std]), 3) = (self.mean_and_std, channels) {
                value = value * std[channel] + mean[channel];
            }
            match self.range {
                ValueRange::Unit => value,
                ValueRange::Bytes | ValueRange::Signed => self.range.to_code(value) / 255.0,
            }
        };
        let mut samples = Vec::with_capacity(channels * part.size()[0] * part.size()[1]);
        for channel in 0..channels {
            for row in part.top..part.bottom {
                samples.extend((part.left..part.right).map(|column| at(channel, row, column)));
            }
        }
        if samples.iter().any(|sample| sample.is_nan()) {
            return Err(InvalidValues::NanOutput);
        }
        Ok(Planes {
            height: part.size()[0],
            width: part.size()[1],
            samples,
        })
    }

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

/// Refuses values that are not numbers, and values that do not fit the assumed range.
///
/// Models that do not clamp overshoot by a little. So the range counts as wrong only if more than one sample in 20 is far
/// outside.
pub(super) fn check_values(
    values: &[f32],
    range: ValueRange,
    certainty: Certainty,
) -> Result<(), InvalidValues> {
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
    Err(InvalidValues::OutOfRange {
        min: values.iter().copied().fold(f32::INFINITY, f32::min),
        max,
        likely,
    })
}

/// The code nearest to a value of 0..255; halves are rounded away from zero.
pub(crate) fn round_to_u8(code: f32) -> u8 {
    let below = code as u8;
    below + u8::from(code - f32::from(below) >= 0.5)
}

#[cfg(test)]
mod tests;
