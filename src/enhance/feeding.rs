//! Conversion of an image of bytes to the tensor that a model takes: [`Feeding`].
//!
//! It takes one pass: a table of 256 values per channel combines range, mean and deviation.

use half::f16;

use super::convention::{ChannelOrder, ElementType, Padding, TensorLayout, ValueRange};
use super::planes::Planes;
use super::reading::nearest;
use super::sidecar::ModelSidecar;
use super::signature::Signature;
use super::tiles::TileWindow;
use crate::types::Rgb;

/// Conversion of an image to a tensor.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Feeding {
    pub(super) layout: TensorLayout,
    pub(super) element: ElementType,
    pub(super) color: ChannelOrder,
    pub(super) range: ValueRange,
    /// Subtracted from each channel, in the model's channel order and range; then `std` divides it.
    pub(super) mean: [f32; 3],
    pub(super) std: [f32; 3],
    pub(super) pad: Padding,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) struct Input {
    pub(super) dims: Vec<usize>,
    pub(super) data: TensorData,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) enum TensorData {
    Float32(Vec<f32>),
    Float16(Vec<f16>),
    Uint8(Vec<u8>),
}

/// Index of the pixel that is copied to position `at`, which may be beyond the end of the side; `None` for black.
fn source(at: usize, side: usize, pad: Padding) -> Option<usize> {
    if at < side {
        return Some(at);
    }
    match pad {
        Padding::Zero => None,
        Padding::Replicate | Padding::Crop => Some(side - 1),
        Padding::Reflect => {
            // Mirrored at the last pixel, and again at the first if the padding is larger than the image.
            let period = (2 * (side - 1)).max(1);
            let within = at % period;
            Some(within.min(period - within).min(side - 1))
        }
    }
}

impl Feeding {
    /// The conversion that signature and convention define.
    pub(super) fn of(signature: &Signature, convention: &ModelSidecar) -> Self {
        let element = signature.input.port.element.clone();
        Self {
            layout: signature.input.layout,
            range: convention.range_in.unwrap_or(element.usual_range()),
            element,
            color: convention.color.unwrap_or_default(),
            mean: convention.mean.unwrap_or([0.0; 3]),
            std: convention.std.unwrap_or([1.0; 3]),
            pad: convention.pad.unwrap_or_default(),
        }
    }

    /// The tensor of a window of an image, padded beyond the image's edges.
    pub(super) fn window(&self, image: &Rgb, window: TileWindow) -> Input {
        let sources = |from: usize, to: usize, side: usize| -> Vec<Option<usize>> {
            (from..to).map(|at| source(at, side, self.pad)).collect()
        };
        let rows = sources(window.top, window.bottom, image.height());
        let columns = sources(window.left, window.right, image.width());
        let (samples, width) = (image.samples(), image.width());
        // Without padded columns, the pixels of a row are contiguous.
        let inside = window.right <= image.width();
        let row_of = |row: Option<usize>, channel: usize| {
            let channel = self.color.rgb_channel(channel);
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

    /// The tensor of a whole image of floats.
    pub(super) fn planes(&self, planes: &Planes) -> Input {
        let [height, width] = [planes.height, planes.width];
        let value = |channel: usize, pixel: usize| {
            let unit = planes.samples[self.color.rgb_channel(channel) * height * width + pixel];
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

    /// Value of each byte, for each channel of the model.
    fn table(&self) -> [[f32; 256]; 3] {
        [0, 1, 2].map(|channel: usize| {
            std::array::from_fn(|byte| {
                let value = self.range.of_code(byte as f32);
                (value - self.mean[channel]) / self.std[channel]
            })
        })
    }
}

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
