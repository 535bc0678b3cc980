//! Conversion of an image of bytes to a model's input tensor: [`InputEncoding`].
//!
//! Usually in one pass: a table of 256 values per channel combines range, mean and standard deviation. With an
//! expression, or for a model of the luma, the image is converted to floats first; then `input`, channels, range, mean
//! and deviation apply in this order.

use half::f16;

use super::tensor::{FedImage, Tensor, TensorData};
use crate::conventions::sidecar::ModelSidecar;
use crate::conventions::{ChannelOrder, Channels, ElementType, Padding, Signature, TensorLayout, ValueRange};
use crate::expressions::Expression;
use crate::outputs::round_to_u8;
use crate::planes::Planes;
use crate::sizing::TileWindow;
use darkqa_base::types::Rgb;

/// Conversion of an image to a tensor.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct InputEncoding {
    pub(crate) layout: TensorLayout,
    pub(crate) element: ElementType,
    pub(crate) channels: Channels,
    /// The model's input as an expression of `image`, the degraded image in 0..1; `None` for the image itself.
    pub(crate) input: Option<Expression>,
    pub(crate) color: ChannelOrder,
    pub(crate) range: ValueRange,
    /// Means subtracted from the channels, in the model's channel order and range.
    pub(crate) mean: [f32; 3],
    /// Standard deviations by which the channels are then divided.
    pub(crate) std: [f32; 3],
    pub(crate) pad: Padding,
}

impl InputEncoding {
    /// The encoding defined by signature and convention.
    pub(crate) fn new(signature: &Signature, convention: &ModelSidecar) -> Self {
        let element = signature.input.port.element.clone();
        Self {
            layout: signature.input.layout,
            range: convention.range_in.unwrap_or(element.usual_range()),
            element,
            channels: convention.channels.unwrap_or_default(),
            input: convention.input.clone(),
            color: convention.color.unwrap_or_default(),
            mean: convention.mean.unwrap_or([0.0; 3]),
            std: convention.std.unwrap_or([1.0; 3]),
            pad: convention.pad.unwrap_or_default(),
        }
    }

    /// Encodes an image; `None` if the sidecar's expression gives values that are not finite.
    pub(crate) fn tensor(&self, fed: &FedImage<'_>) -> Option<Tensor> {
        match fed {
            FedImage::Window { dark, window, .. } if self.input.is_none() && self.channels == Channels::Rgb => {
                Some(self.encode_window(dark.rgb, *window))
            }
            _ => {
                let dark = fed.planes();
                match &self.input {
                    None => Some(self.encode_planes(&dark.into_owned().with_channels(self.channels))),
                    Some(expression) => {
                        let image = expression.evaluate(&vec![&*dark; expression.names().len()], fed.size());
                        let is_finite = image.samples.iter().all(|sample| sample.is_finite());
                        let image = image.spread().with_channels(self.channels);
                        is_finite.then(|| self.encode_planes(&image))
                    }
                }
            }
        }
    }

    /// Encodes a window of an image, padded beyond the image's edges.
    fn encode_window(&self, image: &Rgb, window: TileWindow) -> Tensor {
        let rows: Vec<Option<usize>> =
            (window.top..window.bottom).map(|row| self.pad.source(row, image.height())).collect();
        let columns: Vec<Option<usize>> =
            (window.left..window.right).map(|column| self.pad.source(column, image.width())).collect();
        let (samples, width) = (image.samples(), image.width());
        // Without padded columns, the pixels of a row are contiguous.
        let is_inside = window.right <= image.width();
        let row_codes = |row: Option<usize>, channel: usize| {
            let channel = self.color.rgb_channel(channel);
            let row = row.map(|row| &samples[row * width * 3..][..width * 3]);
            let columns = &columns;
            columns.iter().enumerate().map(move |(i, column)| match row {
                Some(row) if is_inside => row[(window.left + i) * 3 + channel],
                Some(row) => column.map_or(0, |column| row[column * 3 + channel]),
                None => 0,
            })
        };
        let order = if self.layout.is_planar() { SampleOrder::Planar } else { SampleOrder::Packed };
        let size = window.size();
        match self.element {
            ElementType::Uint8 => {
                let mut data = vec![0; 3 * size[0] * size[1]];
                fill_tensor(&mut data, order, &rows, size[1], row_codes, |_, code| code);
                self.tensor_of_size(size, TensorData::Uint8(data))
            }
            ElementType::Float16 => {
                let table = self.code_table().map(|values| values.map(f16::from_f32));
                let mut data = vec![f16::ZERO; 3 * size[0] * size[1]];
                fill_tensor(&mut data, order, &rows, size[1], row_codes, |channel, code| {
                    table[channel][usize::from(code)]
                });
                self.tensor_of_size(size, TensorData::Float16(data))
            }
            _ => {
                let table = self.code_table();
                let mut data = vec![0.0; 3 * size[0] * size[1]];
                fill_tensor(&mut data, order, &rows, size[1], row_codes, |channel, code| {
                    table[channel][usize::from(code)]
                });
                self.tensor_of_size(size, TensorData::Float32(data))
            }
        }
    }

    /// Encodes an image of floats that has the model's channels.
    fn encode_planes(&self, planes: &Planes) -> Tensor {
        let size = planes.size();
        let (channels, pixels) = (self.channels.count(), size[0] * size[1]);
        let channels_and_pixels: Vec<(usize, usize)> = if self.layout.is_planar() {
            (0..channels).flat_map(|channel| (0..pixels).map(move |pixel| (channel, pixel))).collect()
        } else {
            (0..pixels).flat_map(|pixel| (0..channels).map(move |channel| (channel, pixel))).collect()
        };
        let samples = channels_and_pixels.into_iter().map(|(channel, pixel)| {
            let plane = match self.channels {
                Channels::Rgb => self.color.rgb_channel(channel),
                Channels::Y => channel,
            };
            (channel, planes.samples[plane * pixels + pixel])
        });
        let data = match self.element {
            ElementType::Uint8 => TensorData::Uint8(samples.map(|(_, sample)| round_to_u8(sample * 255.0)).collect()),
            ElementType::Float16 => TensorData::Float16(
                samples.map(|(channel, sample)| f16::from_f32(self.encode_sample(channel, sample))).collect(),
            ),
            _ => TensorData::Float32(samples.map(|(channel, sample)| self.encode_sample(channel, sample)).collect()),
        };
        self.tensor_of_size(size, data)
    }

    /// Encodes a sample in 0..1 of the model's `channel`.
    fn encode_sample(&self, channel: usize, sample: f32) -> f32 {
        let value = match self.range {
            ValueRange::Unit => sample,
            ValueRange::Bytes | ValueRange::Signed => self.range.scale_code(sample * 255.0),
        };
        (value - self.mean[channel]) / self.std[channel]
    }

    fn tensor_of_size(&self, size: [usize; 2], data: TensorData) -> Tensor {
        Tensor { dims: self.layout.dims(size, self.channels.count()), data }
    }

    /// Encoded value of each 8-bit code, for each channel of the model.
    fn code_table(&self) -> [[f32; 256]; 3] {
        [0, 1, 2].map(|channel: usize| {
            std::array::from_fn(|byte| {
                let value = self.range.scale_code(byte as f32);
                (value - self.mean[channel]) / self.std[channel]
            })
        })
    }
}

/// Order of the samples of a tensor.
#[derive(Clone, Copy)]
enum SampleOrder {
    /// Channel by channel.
    Planar,
    /// Pixel by pixel.
    Packed,
}

/// Fills a tensor row by row. `row_codes` gives the codes of one channel of a source row (`None` for black padding),
/// `value` the encoded value of a code of a channel.
fn fill_tensor<T, I: Iterator<Item = u8>>(
    data: &mut [T],
    order: SampleOrder,
    rows: &[Option<usize>],
    width: usize,
    row_codes: impl Fn(Option<usize>, usize) -> I,
    value: impl Fn(usize, u8) -> T,
) {
    match order {
        SampleOrder::Planar => {
            for (channel, plane) in data.chunks_exact_mut(rows.len() * width).enumerate() {
                for (row, line) in rows.iter().zip(plane.chunks_exact_mut(width)) {
                    for (sample, code) in line.iter_mut().zip(row_codes(*row, channel)) {
                        *sample = value(channel, code);
                    }
                }
            }
        }
        SampleOrder::Packed => {
            for (row, line) in rows.iter().zip(data.chunks_exact_mut(3 * width)) {
                for channel in 0..3 {
                    for (sample, code) in line.iter_mut().skip(channel).step_by(3).zip(row_codes(*row, channel)) {
                        *sample = value(channel, code);
                    }
                }
            }
        }
    }
}
