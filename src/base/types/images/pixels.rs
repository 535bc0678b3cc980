//! The pixels of a clean frame in the bit depth of its file: [`Pixels`].

use std::sync::Arc;

use super::display_codes::{from_linear, from_rgb16};
use super::image::{Light, Rgb, Rgb16Image};

/// The pixels of a clean frame in the bit depth of its file. Clones share the pixels.
#[derive(Debug, Clone)]
pub enum Pixels {
    /// 8-bit sRGB codes.
    Codes8(Arc<Rgb>),
    /// 16-bit sRGB codes.
    Rgb16Image(Arc<Rgb16Image>),
    /// Linear light of the scene, with the primaries of sRGB. White is 1; brighter light is above 1.
    Light(Arc<Light>),
}

impl Pixels {
    /// The height in pixels.
    #[must_use]
    pub fn height(&self) -> usize {
        match self {
            Self::Codes8(codes) => codes.height(),
            Self::Rgb16Image(codes) => codes.height(),
            Self::Light(light) => light.height(),
        }
    }

    /// The width in pixels.
    #[must_use]
    pub fn width(&self) -> usize {
        match self {
            Self::Codes8(codes) => codes.width(),
            Self::Rgb16Image(codes) => codes.width(),
            Self::Light(light) => light.width(),
        }
    }

    /// The 8-bit codes of the undarkened frame, L0.
    #[must_use]
    pub fn codes(&self) -> Arc<Rgb> {
        match self {
            Self::Codes8(codes) => Arc::clone(codes),
            Self::Rgb16Image(codes) => Arc::new(from_rgb16(codes)),
            Self::Light(light) => Arc::new(from_linear(light)),
        }
    }
}
