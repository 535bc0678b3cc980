//! The image of a frame before decoding: [`Picture`].

use crate::error::Result;
use crate::picture::ImageFile;
use crate::picture::ReadingRule;
use crate::rooms::Room;
use crate::types::{Digest, InputNote, Pixels, Rgb};

/// An image as stored: a file, or a built-in room.
#[derive(Debug)]
pub enum Picture {
    /// The bytes of a file.
    Encoded(ImageFile),
    /// A built-in room, drawn when its pixels are needed, and the rule by which its light is scaled.
    Drawn(Room, ReadingRule),
}

impl Picture {
    /// The digest of the file and of the rule by which it is read, or of everything that decides the pixels of a room.
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

    /// Changes that reading the picture makes besides decoding its codes.
    #[must_use]
    pub fn note(&self) -> InputNote {
        match self {
            Self::Encoded(file) => file.note(),
            Self::Drawn(room, rule) => rule.note_of(room.is_light()),
        }
    }

    /// The width and height in pixels, after a check that the picture can be decoded.
    ///
    /// # Errors
    /// If it cannot; the error names the file.
    pub fn check(&self) -> Result<(u32, u32)> {
        match self {
            Self::Encoded(file) => file.check(),
            Self::Drawn(room, _) => Ok(room.size().map(|side| side as u32).into()),
        }
    }

    /// The pixels in the depth in which they are known.
    ///
    /// # Errors
    /// If the file is broken, or cannot be shown as it is; the error names the file.
    pub fn pixels(&self) -> Result<Pixels> {
        match self {
            Self::Encoded(file) => file.pixels(),
            Self::Drawn(room, rule) => Ok(match room.pixels() {
                Pixels::Light(light) => Pixels::Light(rule.scaled(light)),
                codes => codes,
            }),
        }
    }

    /// The pixels as 8-bit sRGB, as they are shown undarkened.
    ///
    /// # Errors
    /// If the file is broken, or cannot be shown as it is; the error names the file.
    pub fn decode(&self) -> Result<Rgb> {
        match self {
            Self::Encoded(file) => file.decode(),
            Self::Drawn(..) => Ok(Rgb::clone(&self.pixels()?.codes())),
        }
    }
}
