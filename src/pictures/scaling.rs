//! Scaling of images before they are sent: [`Scaling`].

use std::borrow::Cow;
use std::num::NonZeroU32;

use serde::Serialize;

use crate::bilinear::{bilinear, bilinear_size};
use crate::fitting::{fit, fitted_size};
use darkqa_base::error::Result;
use darkqa_base::types::Rgb;

/// How an image is scaled before it is sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Scaling {
    /// Not scaled.
    Never,
    /// Reduced to this many pixels on the longer side, if it has more.
    MaxSide(NonZeroU32),
    /// Enlarged or reduced to this many pixels on the longer side.
    LongerSide(usize),
}

impl Scaling {
    /// Width and height of an image after scaling, from its original width and height, in pixels.
    #[must_use]
    pub fn size(self, width: u32, height: u32) -> (usize, usize) {
        match self {
            Self::Never => (width as usize, height as usize),
            Self::MaxSide(side) => {
                let (width, height) = fitted_size(width, height, side);
                (width as usize, height as usize)
            }
            Self::LongerSide(side) => {
                let [height, width] = bilinear_size(height as usize, width as usize, side);
                (width, height)
            }
        }
    }

    /// Scales an image.
    ///
    /// # Errors
    /// If a side is too long for any image format, or the result does not fit into memory.
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
