//! From an image of bytes to the tensor that a model takes: [`Feeding`].
//!
//! One pass: a table of 256 values a channel holds range, mean and deviation.

use half::f16;

use super::convention::{ChannelOrder, ElementType, Padding, TensorLayout, ValueRange};
use super::planes::Planes;
use super::reading::nearest;
use super::sidecar::ModelSidecar;
use super::signature::Signature;
use super::tiles::TileWindow;
use crate::types::Rgb;

/// How an image becomes a tensor.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Feeding {
    pub(super) layout: TensorLayout,
    pub(super) element: ElementType,
    pub(super) color: ChannelOrder,
    pub(super) range: ValueRange,
    /// Taken from each channel, then divided by, in the model's order.
    pub(super) mean: [f32; 3],
    pub(super) std: [f32; 3],
    pub(super) pad: Padding,
}

/// A tensor for a model.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Input {
    pub(super) dims: Vec<usize>,
    pub(super) data: TensorData,
}

/// The elements of a tensor.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum TensorData {
    Float32(Vec<f32>),
    Float16(Vec<f16>),
    Uint8(Vec<u8>),
}

/// The source of a pixel beyond the end of a side, or `None` for black.
fn source(at: usize, side: usize, pad: Padding) -> Option<usize> {
    if at < side {
        return Some(at);
    }
    match pad {
        Padding::Zero => None,
        Padding::Replicate | Padding::Crop => Some(side - 1),
        Padding::Reflect => {
            // Mirrored at the last pixel and, where the image is smaller than what is missing, at the first again.
            let period = (2 * (side - 1)).max(1);
            let within = at % period;
            Some(within.min(period - within).min(side - 1))
        }
    }
}

impl Feeding {
    /// What graph and statements say.
    pub(super) fn of(signature: &Signature, stated: &ModelSidecar) -> Self {
        let element = signature.input.port.element.clone();
        Self {
            layout: signature.input.layout,
            range: stated.range_in.unwrap_or(element.usual_range()),
            element,
            color: stated.color.unwrap_or_default(),
            mean: stated.mean.unwrap_or([0.0; 3]),
            std: stated.std.unwrap_or([1.0; 3]),
            pad: stated.pad.unwrap_or_default(),
        }
    }

    /// A window of an image, padded where it goes beyond.
    pub(super) fn window(&self, image: &Rgb, window: TileWindow) -> Input {
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
            SampleOrder::Planar
        } else {
            SampleOrder::Packed
        };
        let size = window.size();
        match self.element {
            ElementType::Uint8 => {
                let mut data = vec![0; 3 * size[0] * size[1]];
                fill(&mut data, order, &rows, size[1], row_of, |_, byte| byte);
                self.tensor(size, TensorData::Uint8(data))
            }
            ElementType::Float16 => {
                let table = self.table().map(|values| values.map(f16::from_f32));
                let mut data = vec![f16::ZERO; 3 * size[0] * size[1]];
                let value = |channel: usize, byte: u8| table[channel][usize::from(byte)];
                fill(&mut data, order, &rows, size[1], row_of, value);
                self.tensor(size, TensorData::Float16(data))
            }
            _ => {
                let table = self.table();
                let mut data = vec![0.0; 3 * size[0] * size[1]];
                let value = |channel: usize, byte: u8| table[channel][usize::from(byte)];
                fill(&mut data, order, &rows, size[1], row_of, value);
                self.tensor(size, TensorData::Float32(data))
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
                ValueRange::Unit => unit,
                ValueRange::Bytes | ValueRange::Signed => self.range.of_code(unit * 255.0),
            };
            (value - self.mean[channel]) / self.std[channel]
        };
        let data = match self.element {
            ElementType::Uint8 => {
                TensorData::Uint8(values.map(|(_, unit)| nearest(unit * 255.0)).collect())
            }
            ElementType::Float16 => {
                TensorData::Float16(values.map(float).map(f16::from_f32).collect())
            }
            _ => TensorData::Float32(values.map(float).collect()),
        };
        self.tensor([height, width], data)
    }

    fn tensor(&self, size: [usize; 2], data: TensorData) -> Input {
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
enum SampleOrder {
    Planar,
    Packed,
}

/// Fills a tensor row by row.
fn fill<T, I: Iterator<Item = u8>>(
    data: &mut [T],
    order: SampleOrder,
    rows: &[Option<usize>],
    width: usize,
    row_of: impl Fn(Option<usize>, usize) -> I,
    value: impl Fn(usize, u8) -> T,
) {
    match order {
        SampleOrder::Planar => {
            for (channel, plane) in data.chunks_exact_mut(rows.len() * width).enumerate() {
                for (row, line) in rows.iter().zip(plane.chunks_exact_mut(width)) {
                    for (sample, byte) in line.iter_mut().zip(row_of(*row, channel)) {
                        *sample = value(channel, byte);
                    }
                }
            }
        }
        SampleOrder::Packed => {
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
