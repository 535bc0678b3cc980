//! Undeveloped frame of a sensor: [`Mosaic`], read from a 16-bit PNG, a TIFF or a binary PGM. The values are ADU,
//! unchanged from the file.

mod decoded;
mod grey_tiff;
mod makers;
mod pgm;

use std::path::Path;

use crate::error::{Error, Result};
use crate::files::reading;
use crate::pictures::raw_png::{RawPng, RawPngError, SampleForm};
use crate::types::Digest;
use decoded::{Decoded, EXPORT, MosaicForm, developed};

/// Frame of a sensor: one number for each site.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Mosaic {
    pub(super) height: usize,
    pub(super) width: usize,
    /// Samples in ADU, row by row.
    pub(super) samples: Vec<u16>,
    pub(super) facts: FrameFacts,
}

/// Metadata of a frame.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct FrameFacts {
    pub(super) form: MosaicForm,
    /// Maker and model of the camera, if the file names them.
    pub(super) camera: Option<String>,
    /// Date of the frame, as in the file.
    pub(super) taken: Option<String>,
    /// Digest of the file.
    pub(super) digest: Digest,
}

impl Mosaic {
    /// Reads a file of at most `most_pixels` samples. The content decides the form, not the name.
    ///
    /// # Errors
    /// If the file cannot be read, is incomplete, or is not a mosaic: a RAW file of a maker, or an image with several
    /// channels, 8 bits, or a palette.
    pub(super) fn read(path: &Path, most_pixels: u64) -> Result<Self> {
        let bytes = reading::bytes(path)?;
        let decoded = decode(path, &bytes, most_pixels).map_err(|problem| Error::data(path.display(), problem))?;
        Ok(Self {
            height: decoded.height,
            width: decoded.width,
            samples: decoded.samples,
            facts: FrameFacts {
                form: decoded.form,
                camera: decoded.camera,
                taken: decoded.taken,
                digest: Digest::from_bytes(&bytes),
            },
        })
    }
}

fn decode(path: &Path, bytes: &[u8], most_pixels: u64) -> Result<Decoded, String> {
    if bytes.is_empty() {
        return Err("the file is empty".to_owned());
    }
    if let Some(problem) = makers::problem(path, bytes) {
        return Err(problem);
    }
    match bytes {
        [0x89, b'P', b'N', b'G', ..] => png(bytes, most_pixels),
        [b'P', b'1'..=b'7', ..] => pgm::decode(bytes, most_pixels),
        [b'I', b'I', 42 | 43, 0, ..] | [b'M', b'M', 0, 42 | 43, ..] => grey_tiff::decode(bytes, most_pixels),
        [0xFF, 0xD8, ..] => Err(developed("a JPEG file")),
        _ => Err(format!("not a mosaic: a 16-bit PNG, a TIFF or a binary PGM expected; {EXPORT}")),
    }
}

fn png(bytes: &[u8], most_pixels: u64) -> Result<Decoded, String> {
    let png = RawPng::open(bytes, &[SampleForm::Grey16], most_pixels).map_err(|error| match error {
        RawPngError::Broken(problem) => format!("{problem}; copy or export it again"),
        RawPngError::TooLarge(problem) => format!("{problem}; raise --decode max-pixels"),
        RawPngError::OtherForm(problem) => developed(&problem),
    })?;
    let (height, width) = png.size;
    let samples = png.samples(|sample| sample).map_err(|problem| format!("{problem}; copy or export it again"))?;
    Ok(Decoded { height, width, samples, form: MosaicForm::Png, camera: None, taken: None })
}

#[cfg(test)]
mod tests;
