//! A clean frame in one of four pixel formats: [`Clean`].

use darkqa_base::types::{Light, Pixels, Rgb, Rgb16Image};

/// A clean frame, from which degraded images are made.
#[derive(Debug, Clone, Copy)]
pub enum Clean<'a> {
    /// 8-bit sRGB codes.
    Codes(&'a Rgb),
    /// 16-bit sRGB codes.
    Rgb16Image(&'a Rgb16Image),
    /// Linear light of a display, not rounded to codes; a code is 255 · L^(1/2.2). Light above 1 counts as 1.
    Light(&'a Light),
    /// Linear light in front of the camera, before any tone curve. White is 1; light may be brighter.
    Scene(&'a Light),
}

impl Clean<'_> {
    /// The height in pixels.
    #[must_use]
    pub fn height(self) -> usize {
        match self {
            Self::Codes(codes) => codes.height(),
            Self::Rgb16Image(codes) => codes.height(),
            Self::Light(light) | Self::Scene(light) => light.height(),
        }
    }

    /// The width in pixels.
    #[must_use]
    pub fn width(self) -> usize {
        match self {
            Self::Codes(codes) => codes.width(),
            Self::Rgb16Image(codes) => codes.width(),
            Self::Light(light) | Self::Scene(light) => light.width(),
        }
    }
}

impl Clean<'_> {
    /// Replaces the pixels by light of the same kind: scene light if this is scene light, else display light.
    #[must_use]
    pub fn with_light(self, light: &Light) -> Clean<'_> {
        match self {
            Self::Scene(_) => Clean::Scene(light),
            Self::Codes(_) | Self::Rgb16Image(_) | Self::Light(_) => Clean::Light(light),
        }
    }
}

impl<'a> From<&'a Rgb> for Clean<'a> {
    fn from(codes: &'a Rgb) -> Self {
        Self::Codes(codes)
    }
}

impl<'a> From<&'a Pixels> for Clean<'a> {
    fn from(pixels: &'a Pixels) -> Self {
        match pixels {
            Pixels::Codes8(codes) => Self::Codes(codes),
            Pixels::Rgb16Image(codes) => Self::Rgb16Image(codes),
            Pixels::Light(light) => Self::Scene(light),
        }
    }
}

impl<'a> From<&'a Light> for Clean<'a> {
    fn from(light: &'a Light) -> Self {
        Self::Light(light)
    }
}
