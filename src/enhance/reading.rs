//! From the tensor that a model gives to an image of bytes: [`OutputReading`].
//!
//! One pass of clamping and rounding, after one that looks for what cannot be.

use half::f16;

use super::convention::{ChannelOrder, ElementType, Rounding, TensorLayout, ValueRange};
use super::planes::Planes;
use super::sidecar::ModelSidecar;
use super::signature::Signature;
use super::tiles::TileWindow;

/// How a tensor becomes an image.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct OutputReading {
    /// `None` where only a run shows it.
    pub(super) layout: Option<TensorLayout>,
    /// The layout that is taken where two fit.
    pub(super) likely: TensorLayout,
    pub(super) color: ChannelOrder,
    pub(super) range: ValueRange,
    /// Whether somebody said the range; else it is checked against what comes.
    pub(super) certainty: Certainty,
    pub(super) rounding: Rounding,
}

/// Whether the range of an output is known.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Certainty {
    /// A sidecar, a preset or the type says it.
    Known,
    /// It is the usual one.
    Assumed,
}

/// What is wrong with the values of an output.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum OutOfRange {
    /// Some are not numbers.
    NotNumbers,
    /// They are of another range than the one that was assumed.
    Beyond {
        /// The smallest.
        least: f32,
        /// The largest.
        most: f32,
        /// The range that they look like.
        likely: ValueRange,
    },
}

/// A view of the elements of an output.
#[derive(Debug, Clone, Copy)]
pub(super) enum TensorSamples<'a> {
    Float32(&'a [f32]),
    Float16(&'a [f16]),
    Uint8(&'a [u8]),
}

impl OutputReading {
    /// What graph and statements say.
    pub(super) fn of(signature: &Signature, stated: &ModelSidecar) -> Self {
        let output = &signature.output;
        let (range, certainty) = match (stated.range_out, &output.port.element) {
            (Some(range), _) => (range, Certainty::Known),
            (None, ElementType::Uint8) => (ValueRange::Bytes, Certainty::Known),
            // What is not said of the output is as in the input.
            (None, _) => (
                stated
                    .range_in
                    .unwrap_or(signature.input.port.element.usual_range()),
                Certainty::Assumed,
            ),
        };
        Self {
            layout: stated.layout_out.or(output.layout),
            likely: signature.input.layout,
            color: stated.color.unwrap_or_default(),
            range,
            certainty,
            rounding: stated.rounding.unwrap_or_default(),
        }
    }

    /// The layout of an output of such dimensions for an image of such a size; `None` where it is no such image.
    pub(super) fn layout(&self, dims: &[i64], size: [usize; 2]) -> Option<TensorLayout> {
        let fits = |layout: &TensorLayout| {
            let wanted = layout.dims(size);
            wanted.len() == dims.len()
                && wanted
                    .iter()
                    .zip(dims)
                    .all(|(a, b)| usize::try_from(*b) == Ok(*a))
        };
        match self.layout {
            Some(layout) => Some(layout).filter(fits),
            None => std::iter::once(self.likely)
                .chain(TensorLayout::ALL)
                .find(fits),
        }
    }

    /// The bytes of a part of an output, red, green and blue of each pixel; `size` is that of the whole output.
    pub(super) fn bytes(
        &self,
        samples: TensorSamples<'_>,
        layout: TensorLayout,
        size: [usize; 2],
        part: TileWindow,
    ) -> Result<Vec<u8>, OutOfRange> {
        match samples {
            TensorSamples::Uint8(bytes) => Ok(self.gather(bytes, layout, size, part, |byte| byte)),
            TensorSamples::Float16(values) => {
                let values: Vec<f32> = values.iter().map(|value| value.to_f32()).collect();
                self.bytes(TensorSamples::Float32(&values), layout, size, part)
            }
            TensorSamples::Float32(values) => {
                self.check(values)?;
                let (range, rounding) = (self.range, self.rounding);
                Ok(self.gather(values, layout, size, part, |value| {
                    let code = range.code(value).clamp(0.0, 255.0);
                    match rounding {
                        Rounding::Round => nearest(code),
                        Rounding::Truncate => code as u8,
                    }
                }))
            }
        }
    }

    /// The whole output as floats of 0..1.
    pub(super) fn planes(
        &self,
        samples: TensorSamples<'_>,
        layout: TensorLayout,
        [height, width]: [usize; 2],
    ) -> Result<Planes, OutOfRange> {
        let values: Vec<f32> = match samples {
            TensorSamples::Uint8(bytes) => bytes.iter().map(|byte| f32::from(*byte)).collect(),
            TensorSamples::Float16(values) => values.iter().map(|value| value.to_f32()).collect(),
            TensorSamples::Float32(values) => values.to_vec(),
        };
        self.check(&values)?;
        let at = |channel: usize, pixel: usize| {
            let channel = self.color.of(channel);
            let value = if layout.is_planar() {
                values[channel * height * width + pixel]
            } else {
                values[3 * pixel + channel]
            };
            match self.range {
                ValueRange::Unit => value,
                ValueRange::Bytes | ValueRange::Signed => self.range.code(value) / 255.0,
            }
        };
        let channels = 0..3;
        let samples = channels.flat_map(|channel| (0..height * width).map(move |i| (channel, i)));
        Ok(Planes {
            height,
            width,
            samples: samples.map(|(channel, pixel)| at(channel, pixel)).collect(),
        })
    }

    fn gather<T: Copy>(
        &self,
        samples: &[T],
        layout: TensorLayout,
        [height, width]: [usize; 2],
        part: TileWindow,
        byte: impl Fn(T) -> u8,
    ) -> Vec<u8> {
        let mut out = vec![0; 3 * part.size()[0] * part.size()[1]];
        let lines = out.chunks_exact_mut(3 * part.size()[1]);
        for (y, line) in (part.top..part.bottom).zip(lines) {
            for channel in 0..3 {
                let place = self.color.of(channel);
                let pixels = line.iter_mut().skip(channel).step_by(3);
                if layout.is_planar() {
                    let row = &samples[place * height * width + y * width..][..width];
                    for (out, sample) in pixels.zip(&row[part.left..part.right]) {
                        *out = byte(*sample);
                    }
                } else {
                    let row = &samples[3 * y * width..][..3 * width];
                    let row = row[3 * part.left..3 * part.right].iter();
                    for (out, sample) in pixels.zip(row.skip(place).step_by(3)) {
                        *out = byte(*sample);
                    }
                }
            }
        }
        out
    }

    /// Refuses what is no number, and what cannot be of the range that was assumed.
    ///
    /// Models that do not clamp overshoot by a little: it takes one sample in 20 beyond all overshooting to tell another range.
    fn check(&self, values: &[f32]) -> Result<(), OutOfRange> {
        let (mut strange, mut below, mut above) = (0_usize, 0_usize, 0_usize);
        let mut most = f32::NEG_INFINITY;
        for value in values {
            most = if *value > most { *value } else { most };
            strange += usize::from(value.is_nan());
            below += usize::from(*value < -0.2);
            above += usize::from(*value > 8.0);
        }
        if strange > 0 {
            return Err(OutOfRange::NotNumbers);
        }
        let many = values.len() / 20;
        let likely = match (self.certainty, self.range) {
            (Certainty::Assumed, ValueRange::Unit) if above > many => ValueRange::Bytes,
            (Certainty::Assumed, ValueRange::Unit) if below > many => ValueRange::Signed,
            (Certainty::Assumed, ValueRange::Bytes) if most <= 1.5 => ValueRange::Unit,
            _ => return Ok(()),
        };
        Err(OutOfRange::Beyond {
            least: values.iter().copied().fold(f32::INFINITY, f32::min),
            most,
            likely,
        })
    }
}

/// The code nearest to a value of 0..255, half away from zero.
pub(super) fn nearest(code: f32) -> u8 {
    let below = code as u8;
    below + u8::from(code - f32::from(below) >= 0.5)
}

#[cfg(test)]
mod tests;
