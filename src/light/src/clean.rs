//! The clean frame in any of the forms that images are made from: [`Clean`].

use darkqa_ground::types::{Light, Pixels, Rgb, Rgb16Image};

/// A clean frame, in the form in which its pixels are known.
#[derive(Debug, Clone, Copy)]
pub enum Clean<'a> {
    /// 8-bit sRGB codes.
    Codes(&'a Rgb),
    /// 16-bit sRGB codes.
    Rgb16Image(&'a Rgb16Image),
    /// Light as a display shows it; codes are its power 1/2.2. Above 1 it counts as 1. It is not rounded to codes.
    Light(&'a Light),
    /// Light in front of the camera, which no tone curve has changed. It may be more than 1, the light of white.
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
    /// Light that was made from this frame, in the same sense: of a scene if the frame is one, else as a display shows it.
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
