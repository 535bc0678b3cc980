//! Between an image of bytes and the tensors a model takes and gives: [`Feeding`], [`Reading`].
//!
//! One pass each way: a table of 256 values a channel on the way in, which holds range, mean and deviation; clamping and
//! rounding on the way out.

use half::f16;

use super::convention::{Color, Element, Layout, Pad, Range, Rounding};
use super::planes::Planes;
use crate::types::Rgb;

/// How an image becomes a tensor.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Feeding {
    pub(super) layout: Layout,
    pub(super) element: Element,
    pub(super) color: Color,
    pub(super) range: Range,
    /// Taken from each channel, then divided by, in the model's order.
    pub(super) mean: [f32; 3],
    pub(super) std: [f32; 3],
    pub(super) pad: Pad,
}

/// How a tensor becomes an image.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Reading {
    /// `None` where only a run shows it.
    pub(super) layout: Option<Layout>,
    /// The layout that is taken where two fit.
    pub(super) likely: Layout,
    pub(super) color: Color,
    pub(super) range: Range,
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

/// A part of an image: left, top, right, bottom, the latter two exclusive; right and bottom may lie outside of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Window {
    pub(super) left: usize,
    pub(super) top: usize,
    pub(super) right: usize,
    pub(super) bottom: usize,
}

impl Window {
    /// Height and width.
    pub(super) fn size(self) -> [usize; 2] {
        [self.bottom - self.top, self.right - self.left]
    }
}

/// A tensor for a model.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Input {
    pub(super) dims: Vec<usize>,
    pub(super) data: Data,
}

/// The elements of a tensor.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Data {
    Float32(Vec<f32>),
    Float16(Vec<f16>),
    Uint8(Vec<u8>),
}

/// The source of a pixel beyond the end of a side, or `None` for black.
fn source(at: usize, side: usize, pad: Pad) -> Option<usize> {
    if at < side {
        return Some(at);
    }
    match pad {
        Pad::Zero => None,
        Pad::Replicate | Pad::Crop => Some(side - 1),
        Pad::Reflect => {
            // Mirrored at the last pixel and, where the image is smaller than what is missing, at the first again.
            let period = (2 * (side - 1)).max(1);
            let within = at % period;
            Some(within.min(period - within).min(side - 1))
        }
    }
}

impl Feeding {
    /// A window of an image, padded where it goes beyond.
    pub(super) fn window(&self, image: &Rgb, window: Window) -> Input {
        let sources = |from: usize, to: usize, side: usize| -> Vec<Option<usize>> {
            (from..to).map(|at| source(at, side, self.pad)).collect()
        };
        let rows = sources(window.top, window.bottom, image.height());
        let columns = sources(window.left, window.right, image.width());
        let (samples, width) = (image.samples(), image.width());
        // Where no column is padded, they follow each other.
        let inside = window.right <= image.width();
        let row_of = |row: Option<usize>, channel: usize| {
            let channel = self.color.of(channel);
            let row = row.map(|row| &samples[row * width * 3..][..width * 3]);
            let columns = &columns;
            columns
                .iter()
                .enumerate()
                .map(move |(i, column)| match row {
                    Some(row) if inside => row[(window.left + i) * 3 + channel],
                    Some(row) => column.map_or(0, |column| row[column * 3 + channel]),
                    None => 0,
                })
        };
        let order = if self.layout.is_planar() {
            Order::Planar
        } else {
            Order::Packed
        };
        let size = window.size();
        match self.element {
            Element::Uint8 => {
                let mut data = vec![0; 3 * size[0] * size[1]];
                fill(&mut data, order, &rows, size[1], row_of, |_, byte| byte);
                self.tensor(size, Data::Uint8(data))
            }
            Element::Float16 => {
                let table = self.table().map(|values| values.map(f16::from_f32));
                let mut data = vec![f16::ZERO; 3 * size[0] * size[1]];
                let value = |channel: usize, byte: u8| table[channel][usize::from(byte)];
                fill(&mut data, order, &rows, size[1], row_of, value);
                self.tensor(size, Data::Float16(data))
            }
            _ => {
                let table = self.table();
                let mut data = vec![0.0; 3 * size[0] * size[1]];
                let value = |channel: usize, byte: u8| table[channel][usize::from(byte)];
                fill(&mut data, order, &rows, size[1], row_of, value);
                self.tensor(size, Data::Float32(data))
            }
        }
    }

    /// A whole image of floats.
    pub(super) fn planes(&self, planes: &Planes) -> Input {
        let [height, width] = [planes.height, planes.width];
        let value = |channel: usize, pixel: usize| {
            let unit = planes.samples[self.color.of(channel) * height * width + pixel];
            (channel, unit)
        };
        let order: Vec<(usize, f32)> = if self.layout.is_planar() {
            (0..3)
                .flat_map(|channel| (0..height * width).map(move |pixel| value(channel, pixel)))
                .collect()
        } else {
            (0..height * width)
                .flat_map(|pixel| (0..3).map(move |channel| value(channel, pixel)))
                .collect()
        };
        let values = order.into_iter();
        let float = |(channel, unit): (usize, f32)| {
            let value = match self.range {
                Range::Unit => unit,
                Range::Bytes | Range::Signed => self.range.of_code(unit * 255.0),
            };
            (value - self.mean[channel]) / self.std[channel]
        };
        let data = match self.element {
            Element::Uint8 => Data::Uint8(values.map(|(_, unit)| nearest(unit * 255.0)).collect()),
            Element::Float16 => Data::Float16(values.map(float).map(f16::from_f32).collect()),
            _ => Data::Float32(values.map(float).collect()),
        };
        self.tensor([height, width], data)
    }

    fn tensor(&self, size: [usize; 2], data: Data) -> Input {
        Input {
            dims: self.layout.dims(size),
            data,
        }
    }

    /// The value of each byte by channel of the model.
    fn table(&self) -> [[f32; 256]; 3] {
        [0, 1, 2].map(|channel: usize| {
            std::array::from_fn(|byte| {
                let value = self.range.of_code(byte as f32);
                (value - self.mean[channel]) / self.std[channel]
            })
        })
    }
}

/// The order of samples.
#[derive(Clone, Copy)]
enum Order {
    Planar,
    Packed,
}

/// Fills a tensor row by row.
fn fill<T, I: Iterator<Item = u8>>(
    data: &mut [T],
    order: Order,
    rows: &[Option<usize>],
    width: usize,
    row_of: impl Fn(Option<usize>, usize) -> I,
    value: impl Fn(usize, u8) -> T,
) {
    match order {
        Order::Planar => {
            for (channel, plane) in data.chunks_exact_mut(rows.len() * width).enumerate() {
                for (row, line) in rows.iter().zip(plane.chunks_exact_mut(width)) {
                    for (sample, byte) in line.iter_mut().zip(row_of(*row, channel)) {
                        *sample = value(channel, byte);
                    }
                }
            }
        }
        Order::Packed => {
            for (row, line) in rows.iter().zip(data.chunks_exact_mut(3 * width)) {
                for channel in 0..3 {
                    let samples = line.iter_mut().skip(channel).step_by(3);
                    for (sample, byte) in samples.zip(row_of(*row, channel)) {
                        *sample = value(channel, byte);
                    }
                }
            }
        }
    }
}

/// What is wrong with the values of an output.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Wild {
    /// Some are not numbers.
    NotNumbers,
    /// They are of another range than the one that was assumed.
    Beyond {
        /// The smallest.
        least: f32,
        /// The largest.
        most: f32,
        /// The range that they look like.
        likely: Range,
    },
}

/// A view of the elements of an output.
#[derive(Debug, Clone, Copy)]
pub(super) enum Samples<'a> {
    Float32(&'a [f32]),
    Float16(&'a [f16]),
    Uint8(&'a [u8]),
}

impl Reading {
    /// The layout of an output of such dimensions for an image of such a size; `None` where it is no such image.
    pub(super) fn layout(&self, dims: &[i64], size: [usize; 2]) -> Option<Layout> {
        let fits = |layout: &Layout| {
            let wanted = layout.dims(size);
            wanted.len() == dims.len()
                && wanted
                    .iter()
                    .zip(dims)
                    .all(|(a, b)| usize::try_from(*b) == Ok(*a))
        };
        match self.layout {
            Some(layout) => Some(layout).filter(fits),
            None => std::iter::once(self.likely).chain(Layout::ALL).find(fits),
        }
    }

    /// The bytes of a part of an output, red, green and blue of each pixel; `size` is that of the whole output.
    pub(super) fn bytes(
        &self,
        samples: Samples<'_>,
        layout: Layout,
        size: [usize; 2],
        part: Window,
    ) -> Result<Vec<u8>, Wild> {
        match samples {
            Samples::Uint8(bytes) => Ok(self.gather(bytes, layout, size, part, |byte| byte)),
            Samples::Float16(values) => {
                let values: Vec<f32> = values.iter().map(|value| value.to_f32()).collect();
                self.bytes(Samples::Float32(&values), layout, size, part)
            }
            Samples::Float32(values) => {
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
        samples: Samples<'_>,
        layout: Layout,
        [height, width]: [usize; 2],
    ) -> Result<Planes, Wild> {
        let values: Vec<f32> = match samples {
            Samples::Uint8(bytes) => bytes.iter().map(|byte| f32::from(*byte)).collect(),
            Samples::Float16(values) => values.iter().map(|value| value.to_f32()).collect(),
            Samples::Float32(values) => values.to_vec(),
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
                Range::Unit => value,
                Range::Bytes | Range::Signed => self.range.code(value) / 255.0,
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
        layout: Layout,
        [height, width]: [usize; 2],
        part: Window,
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
    fn check(&self, values: &[f32]) -> Result<(), Wild> {
        let (mut strange, mut below, mut above) = (0_usize, 0_usize, 0_usize);
        let mut most = f32::NEG_INFINITY;
        for value in values {
            most = if *value > most { *value } else { most };
            strange += usize::from(value.is_nan());
            below += usize::from(*value < -0.2);
            above += usize::from(*value > 8.0);
        }
        if strange > 0 {
            return Err(Wild::NotNumbers);
        }
        let many = values.len() / 20;
        let likely = match (self.certainty, self.range) {
            (Certainty::Assumed, Range::Unit) if above > many => Range::Bytes,
            (Certainty::Assumed, Range::Unit) if below > many => Range::Signed,
            (Certainty::Assumed, Range::Bytes) if most <= 1.5 => Range::Unit,
            _ => return Ok(()),
        };
        Err(Wild::Beyond {
            least: values.iter().copied().fold(f32::INFINITY, f32::min),
            most,
            likely,
        })
    }
}

/// The code nearest to a value of 0..255, half away from zero.
fn nearest(code: f32) -> u8 {
    let below = code as u8;
    below + u8::from(code - f32::from(below) >= 0.5)
}

#[cfg(test)]
mod tests;
