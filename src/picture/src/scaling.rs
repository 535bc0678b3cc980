//! The size in which images are sent: [`Scaling`].

use std::borrow::Cow;
use std::num::NonZeroU32;

use serde::Serialize;

use crate::bilinear::{bilinear, bilinear_size};
use crate::fitting::{fit, fitted_size};
use darkqa_ground::error::Result;
use darkqa_ground::types::Rgb;

/// The size in which an image is sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Scaling {
    /// The size of the frame.
    Never,
    /// Made smaller, if a side is longer than this number of pixels.
    MaxSide(NonZeroU32),
    /// Made larger or smaller, so that the longer side has this number of pixels.
    LongerSide(usize),
}

impl Scaling {
    /// The width and height in which an image of this width and height is sent, in pixels.
    #[must_use]
    pub fn size(self, size: (u32, u32)) -> (usize, usize) {
        match self {
            Self::Never => (size.0 as usize, size.1 as usize),
            Self::MaxSide(side) => {
                let (width, height) = fitted_size(size, side);
                (width as usize, height as usize)
            }
            Self::LongerSide(side) => {
                let [height, width] = bilinear_size(size.1 as usize, size.0 as usize, side);
                (width, height)
            }
        }
    }

    /// The image in the size in which it is sent.
    ///
    /// # Errors
    /// If a side is too long for any format, or the result does not fit into memory.
    pub fn scale(self, image: &Rgb) -> Result<Cow<'_, Rgb>> {
        match self {
            Self::MaxSide(side) => fit(image, side),
            Self::LongerSide(side) if image.height().max(image.width()) != side => {
                bilinear(image, side).map(Cow::Owned)
            }
            Self::Never | Self::LongerSide(_) => Ok(Cow::Borrowed(image)),
        }
    }
}
