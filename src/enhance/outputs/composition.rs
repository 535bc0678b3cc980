//! Computation of the enhanced image from the outputs of a run: [`Composition`].
//!
//! Most models return the image itself, which is decoded to bytes in one pass. For an expression of outputs, or a model
//! of the luma, outputs are decoded to floats; then `image` is evaluated, the chroma added, and the result clamped and
//! rounded.

use super::output::INPUT;
use super::output_decoding::{Certainty, InvalidValues, OutputDecoding, TensorSamples, check_values};
use crate::conventions::sidecar::ModelSidecar;
use crate::conventions::{Channels, Rounding, Signature, TensorLayout, ValueRange};
use crate::expressions::Expression;
use crate::failure::RunFailure;
use crate::planes::Planes;
use crate::sizing::TileWindow;

/// Conversion of the outputs of a run to an image.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Composition {
    /// Decoding of each output.
    pub(crate) outputs: Vec<OutputDecoding>,
    /// The image as an expression of the outputs; `None` if the only output is the image.
    image: Option<Expression>,
    channels: Channels,
    pub(crate) rounding: Rounding,
}

/// An output tensor of a run.
#[derive(Debug, Clone)]
pub(crate) struct OutputTensor<'a> {
    pub(crate) dims: Vec<i64>,
    pub(crate) samples: TensorSamples<'a>,
}

/// An output tensor with its layout and number of channels.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ImageTensor<'a> {
    samples: TensorSamples<'a>,
    layout: TensorLayout,
    channels: usize,
}

/// Error about an output that is not an image of the input's size.
pub(crate) struct WrongSize {
    /// Assumed order of the dimensions.
    layout: TensorLayout,
    dims: Vec<i64>,
}

impl WrongSize {
    /// Failure of the run on an input of height and width `fed`.
    pub(crate) fn failure(self, fed: [usize; 2]) -> RunFailure {
        let [_, height, width] = self.layout.axes();
        let sides = [height, width].map(|axis| usize::try_from(*self.dims.get(axis)?).ok());
        let given = match sides {
            [Some(height), Some(width)] if self.dims.len() == self.layout.rank() => Some([height, width]),
            _ => None,
        };
        RunFailure::WrongSize { fed, given, dims: self.dims }
    }
}

impl Composition {
    /// The conversion defined by signature and convention.
    ///
    /// # Errors
    /// If the expression gives three channels for a model of the luma; the message follows the file's name.
    pub(crate) fn new(signature: &Signature, convention: &ModelSidecar) -> Result<Self, String> {
        let channels = convention.channels.unwrap_or_default();
        if let (Channels::Y, Some(image)) = (channels, &convention.image) {
            let name_channels: Vec<usize> =
                image.names().iter().map(|name| if name == INPUT { 3 } else { 1 }).collect();
            if image.channels(&name_channels) != 1 {
                return Err(format!(
                    "takes one channel (channels = \"y\"), but image = \"{image}\" has three; wrap the expression in mean(…) or max(…)"
                ));
            }
        }
        Ok(Self {
            outputs: signature
                .outputs
                .iter()
                .map(|output| OutputDecoding::new(output, &signature.input, convention))
                .collect(),
            image: convention.image.clone(),
            channels,
            rounding: convention.rounding.unwrap_or_default(),
        })
    }

    /// Value range of the first output.
    pub(crate) fn range(&self) -> ValueRange {
        self.outputs[0].range
    }

    /// True if all channels of the only output are the image, in a plain range.
    fn is_plain(&self) -> bool {
        let output = &self.outputs[0];
        self.image.is_none()
            && self.channels == Channels::Rgb
            && output.slice.is_none()
            && output.mean_and_std.is_none()
    }

    /// True if the result depends on the degraded image.
    pub(crate) fn needs_dark(&self) -> bool {
        self.channels == Channels::Y || self.image.iter().flat_map(Expression::names).any(|name| name == INPUT)
    }

    /// Assigns layouts to the outputs of a run on an input of this size.
    ///
    /// # Errors
    /// If an output is not an image of this size.
    pub(crate) fn assign_layouts<'a>(
        &self,
        outputs: &[OutputTensor<'a>],
        size: [usize; 2],
    ) -> Result<Vec<ImageTensor<'a>>, WrongSize> {
        self.outputs
            .iter()
            .zip(outputs)
            .map(|(decoding, output)| {
                let (layout, channels) = decoding.layout(&output.dims, size).ok_or_else(|| WrongSize {
                    layout: decoding.layout.unwrap_or(decoding.preferred),
                    dims: output.dims.clone(),
                })?;
                Ok(ImageTensor { samples: output.samples, layout, channels })
            })
            .collect()
    }

    /// Bytes of a part of the result. `size` is the size of the outputs; `dark` is the same part of the degraded image,
    /// if [`Self::needs_dark`].
    pub(crate) fn bytes(
        &self,
        outputs: &[ImageTensor<'_>],
        size: [usize; 2],
        part: TileWindow,
        dark: Option<&Planes>,
    ) -> Result<Vec<u8>, InvalidValues> {
        if self.is_plain() {
            let ImageTensor { samples, layout, .. } = outputs[0];
            return self.outputs[0].bytes(samples, layout, size, part);
        }
        let image = self.planes(outputs, size, part, dark)?;
        Ok(match image.to_rgb(self.rounding) {
            Some(rgb) => rgb.samples().to_vec(),
            None => Vec::new(),
        })
    }

    /// A part of the result as red, green and blue planes; for the parameters see [`Self::bytes`].
    pub(crate) fn planes(
        &self,
        outputs: &[ImageTensor<'_>],
        size: [usize; 2],
        part: TileWindow,
        dark: Option<&Planes>,
    ) -> Result<Planes, InvalidValues> {
        let mut planes = self
            .outputs
            .iter()
            .zip(outputs)
            .map(|(decoding, output)| {
                // Outputs that an expression combines may have any range.
                let certainty = match self.image {
                    None => decoding.certainty,
                    Some(_) => Certainty::Known,
                };
                decoding.planes(output.samples, output.layout, output.channels, size, part, certainty)
            })
            .collect::<Result<Vec<_>, _>>()?;
        let image = match &self.image {
            None => planes.swap_remove(0),
            Some(expression) => self.evaluate_image(expression, &planes, dark)?,
        };
        Ok(match (self.channels, dark) {
            (Channels::Y, Some(dark)) => dark.with_luma(&image),
            _ => image.spread(),
        })
    }

    /// Evaluates the expression of the image, and checks its values.
    fn evaluate_image(
        &self,
        image: &Expression,
        outputs: &[Planes],
        dark: Option<&Planes>,
    ) -> Result<Planes, InvalidValues> {
        let size = outputs[0].size();
        let mut outputs = outputs.iter();
        let operands: Vec<&Planes> = image
            .names()
            .iter()
            .filter_map(|name| match name.as_str() {
                INPUT => dark,
                _ => outputs.next(),
            })
            .collect();
        let result = image.evaluate(&operands, size);
        let certainty = match self.range() {
            ValueRange::Unit => self.outputs[0].certainty,
            ValueRange::Bytes | ValueRange::Signed => Certainty::Known,
        };
        check_values(&result.samples, ValueRange::Unit, certainty)?;
        Ok(result)
    }
}
