//! The size in which images are sent: [`Scaling`].

use std::num::NonZeroU32;

use serde::Serialize;

use super::bilinear;
use crate::ask::Payload;

/// The size in which an image is sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Scaling {
    /// The size of the frame.
    Never,
    /// Made smaller, if a side is longer than this number of pixels.
    MaxSide(NonZeroU32),
    /// Made larger or smaller, so that the longer side has this number of pixels.
    LongerSide(usize),
}

impl Scaling {
    /// The width and height in which an image of this size is sent.
    pub(crate) fn of(self, (width, height): (u32, u32)) -> (usize, usize) {
        match self {
            Self::Never => (width as usize, height as usize),
            Self::MaxSide(side) => {
                let (width, height) = Payload::fitted(width, height, Some(side));
                (width as usize, height as usize)
            }
            Self::LongerSide(side) => {
                let [height, width] = bilinear::size(height as usize, width as usize, side);
                (width, height)
            }
        }
    }
}
