//! Image of a frame before decoding: [`Picture`].

use crate::error::Result;
use crate::pictures::DecodeRule;
use crate::pictures::ImageFile;
use crate::rooms::Room;
use crate::types::{Digest, InputNote, Pixels, Rgb};

/// Image that is not decoded yet: a file, or a built-in room.
#[derive(Debug)]
pub enum Picture {
    /// Bytes of an image file.
    Encoded(ImageFile),
    /// A built-in room, drawn on demand, and the rule that scales its light.
    Drawn(Room, DecodeRule),
}

impl Picture {
    /// Digest of everything that decides the pixels: the file and its decoding rule, or the settings of a room.
    #[must_use]
    pub fn digest(&self) -> Digest {
        match self {
            Self::Encoded(file) => file.digest(),
            Self::Drawn(room, _) => match self.note().exposure_ev {
                None => room.digest(),
                Some(ev) => Digest::from_parts([
                    &b"darkqa.reading/1"[..],
                    room.digest().as_bytes(),
                    format!("exposure {ev}").as_bytes(),
                ]),
            },
        }
    }

    /// Changes made to the samples while decoding, such as color conversion.
    #[must_use]
    pub fn note(&self) -> InputNote {
        match self {
            Self::Encoded(file) => file.note(),
            Self::Drawn(room, rule) => rule.input_note(room.is_light()),
        }
    }

    /// Checks that the image can be decoded, and returns its width and height in pixels.
    ///
    /// # Errors
    /// If it cannot be decoded; the error names the file.
    pub fn check(&self) -> Result<(u32, u32)> {
        match self {
            Self::Encoded(file) => file.check(),
            Self::Drawn(room, _) => Ok(room.size().map(|side| side as u32).into()),
        }
    }

    /// Decodes the pixels at their full bit depth.
    ///
    /// # Errors
    /// If the file is broken or not supported; the error names the file.
    pub fn pixels(&self) -> Result<Pixels> {
        match self {
            Self::Encoded(file) => file.pixels(),
            Self::Drawn(room, rule) => Ok(match room.pixels() {
                Pixels::Light(light) => Pixels::Light(rule.scale_exposure(light)),
                codes => codes,
            }),
        }
    }

    /// Decodes the clean image as 8-bit sRGB.
    ///
    /// # Errors
    /// If the file is broken or not supported; the error names the file.
    pub fn decode(&self) -> Result<Rgb> {
        match self {
            Self::Encoded(file) => file.decode(),
            Self::Drawn(..) => Ok(Rgb::clone(&self.pixels()?.codes())),
        }
    }
}
