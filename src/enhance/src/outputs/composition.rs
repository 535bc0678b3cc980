//! The enhanced image, made of the outputs of a run: [`Composition`].
//!
//! Most models give the image itself, and its bytes are read in one pass. An expression of several outputs, or the luma alone,
//! goes through floats: range, `image`, chroma, in this order; then all is clamped and rounded.

use super::output::INPUT;
use super::output_decoding::{
    Certainty, InvalidValues, OutputDecoding, TensorSamples, check_values,
};
use crate::conventions::sidecar::ModelSidecar;
use crate::conventions::{Channels, Rounding, Signature, TensorLayout, ValueRange};
use crate::expressions::Expression;
use crate::failure::RunFailure;
use crate::planes::Planes;
use crate::sizing::TileWindow;

/// How the outputs of a run become an image.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Composition {
    /// How each output is read.
    pub(crate) outputs: Vec<OutputDecoding>,
    /// The image as an expression of the outputs; `None` for the only output itself.
    image: Option<Expression>,
    channels: Channels,
    pub(crate) rounding: Rounding,
}

/// An output of a run.
#[derive(Debug, Clone)]
pub(crate) struct OutputTensor<'a> {
    pub(crate) dims: Vec<i64>,
    pub(crate) samples: TensorSamples<'a>,
}

/// An output with the order of its dimensions and its number of channels.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ImageTensor<'a> {
    samples: TensorSamples<'a>,
    layout: (TensorLayout, usize),
}

/// An output that cannot be an image of the size that was fed.
pub(crate) struct WrongSize {
    /// Order of its dimensions, if it is an image.
    layout: TensorLayout,
    dims: Vec<i64>,
}

impl WrongSize {
    /// The failure of the run on an image of this size.
    pub(crate) fn failure(self, fed: [usize; 2]) -> RunFailure {
        let [_, height, width] = self.layout.axes();
        let side = |place: usize| usize::try_from(*self.dims.get(place)?).ok();
        let given = side(height)
            .zip(side(width))
            .map(|(height, width)| [height, width]);
        RunFailure::WrongSize {
            fed,
            given: given.filter(|_| self.dims.len() == self.layout.rank()),
            dims: self.dims,
        }
    }
}

impl Composition {
    /// The conversion that signature and convention define.
    ///
    /// # Errors
    /// If the expression gives three channels where only the luma is wanted; the message follows the file's name.
    pub(crate) fn new(signature: &Signature, convention: &ModelSidecar) -> Result<Self, String> {
        let channels = convention.channels.unwrap_or_default();
        let image = convention.image.clone();
        let outputs = signature.outputs.iter();
        let composition = Self {
            outputs: outputs
                .map(|output| OutputDecoding::new(output, &signature.input, convention))
                .collect(),
            image,
            channels,
            rounding: convention.rounding.unwrap_or_default(),
        };
        if let (Channels::Y, Some(image)) = (channels, &composition.image) {
            let names: Vec<usize> = image
                .names()
                .iter()
                .map(|name| if name == INPUT { 3 } else { 1 })
                .collect();
            if image.channels(&names) != 1 {
                return Err(format!(
                    "takes one channel (channels = \"y\"), but image = \"{image}\" has three; wrap the expression in mean(…) or max(…)"
                ));
            }
        }
        Ok(composition)
    }

    /// Range of the values of the first output.
    pub(crate) fn range(&self) -> ValueRange {
        self.outputs[0].range
    }

    /// Whether the only output is the image, all of it in a plain range.
    fn is_plain(&self) -> bool {
        let output = &self.outputs[0];
        self.image.is_none()
            && self.channels == Channels::Rgb
            && output.slice.is_none()
            && output.mean_and_std.is_none()
    }

    /// Whether the dark image is a part of the result.
    pub(crate) fn needs_dark(&self) -> bool {
        let names = self.image.iter().flat_map(Expression::names);
        self.channels == Channels::Y || names.into_iter().any(|name| name == INPUT)
    }

    /// The outputs of a run on an image of this size; the error is one that cannot be an image of it.
    pub(crate) fn assign_layouts<'a>(
        &self,
        outputs: &[OutputTensor<'a>],
        size: [usize; 2],
    ) -> Result<Vec<ImageTensor<'a>>, WrongSize> {
        self.outputs
            .iter()
            .zip(outputs)
            .map(|(decoding, output)| {
                let layout = decoding
                    .layout(&output.dims, size)
                    .ok_or_else(|| WrongSize {
                        layout: decoding.layout.unwrap_or(decoding.preferred),
                        dims: output.dims.clone(),
                    })?;
                Ok(ImageTensor {
                    samples: output.samples,
                    layout,
                })
            })
            .collect()
    }

    /// The bytes of a part of the result; `size` is that of the outputs, `dark` that part of the dark image, if it is needed.
    pub(crate) fn bytes(
        &self,
        outputs: &[ImageTensor<'_>],
        size: [usize; 2],
        part: TileWindow,
        dark: Option<&Planes>,
    ) -> Result<Vec<u8>, InvalidValues> {
        if self.is_plain() {
            let ImageTensor { samples, layout } = outputs[0];
            return self.outputs[0].bytes(samples, layout.0, size, part);
        }
        let image = self.planes(outputs, size, part, dark)?;
        let rgb = image.to_rgb(self.rounding);
        Ok(rgb.map_or_else(Vec::new, |rgb| rgb.samples().to_vec()))
    }

    /// A part of the result as floats, red, green and blue.
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
                // The operands of an expression may have any range.
                let certainty = match self.image {
                    None => decoding.certainty,
                    Some(_) => Certainty::Known,
                };
                decoding.planes(output.samples, output.layout, size, part, certainty)
            })
            .collect::<Result<Vec<_>, _>>()?;
        let made = match &self.image {
            None => planes.swap_remove(0),
            Some(image) => self.evaluate_image(image, &planes, dark)?,
        };
        Ok(match (self.channels, dark) {
            (Channels::Y, Some(dark)) => dark.with_luma(&made),
            _ => made.spread(),
        })
    }

    /// The expression of the image.
    fn evaluate_image(
        &self,
        image: &Expression,
        outputs: &[Planes],
        dark: Option<&Planes>,
    ) -> Result<Planes, InvalidValues> {
        let mut outputs = outputs.iter();
        let size = outputs.as_slice()[0].size();
        let images = image.names().iter().filter_map(|name| match name.as_str() {
            INPUT => dark,
            _ => outputs.next(),
        });
        let made = image.evaluate(&images.collect::<Vec<_>>(), size);
        let certainty = match self.range() {
            ValueRange::Unit => self.outputs[0].certainty,
            ValueRange::Bytes | ValueRange::Signed => Certainty::Known,
        };
        check_values(&made.samples, ValueRange::Unit, certainty)?;
        Ok(made)
    }
}
