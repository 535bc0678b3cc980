//! The result of a decoder, [`Decoded`], and the errors that decoders share.

use std::fmt;

/// How the mosaic of a RAW file is exported.
pub(super) const EXPORT: &str = "export the mosaic, for example as TIFF with `dcraw -D -4 -T -t 0 FILE` (`-t 0`: not turned), or rawpy's `raw_image` as 16-bit PNG";

/// The form of a file and the range of its samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in super::super) enum MosaicForm {
    /// A grey PNG of 16 bits.
    Png,
    /// A grey TIFF of 16 bits.
    Tiff,
    /// A binary PGM with this maximum.
    Pgm(u16),
}

impl fmt::Display for MosaicForm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Png => f.write_str("a 16-bit PNG"),
            Self::Tiff => f.write_str("a 16-bit TIFF"),
            Self::Pgm(maximum) => write!(f, "a PGM with the maximum {maximum}"),
        }
    }
}

/// The frame that a decoder reads from the bytes of a file. The error is a text without the name of the file.
pub(super) struct Decoded {
    pub(super) height: usize,
    pub(super) width: usize,
    pub(super) samples: Vec<u16>,
    pub(super) form: MosaicForm,
    pub(super) camera: Option<String>,
    pub(super) taken: Option<String>,
}

/// The error for an image that a camera or a program has developed.
pub(super) fn developed(what: &str) -> String {
    format!("{what}: a developed image holds no sensor noise; {EXPORT}")
}

/// The error for a frame with too many samples; `None` if it may be read.
pub(super) fn too_large(width: usize, height: usize, most_pixels: u64) -> Option<String> {
    let pixels = (width as u64).saturating_mul(height as u64);
    (pixels > most_pixels).then(|| {
        format!("{width} × {height} pixels are more than the {most_pixels} that are read; raise --decode max-pixels")
    })
}
