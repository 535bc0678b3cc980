//! Result of a decoder, [`Decoded`], and the errors of all decoders.

use std::fmt;

/// Advice on exporting the mosaic of a RAW file.
pub(super) const EXPORT: &str = "export the mosaic, for example as TIFF with `dcraw -D -4 -T -t 0 FILE` (`-t 0`: not turned), or rawpy's `raw_image_visible` as 16-bit PNG";

/// Form of a file, and the range of its samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum MosaicForm {
    /// 16-bit greyscale PNG.
    Png,
    /// 16-bit greyscale TIFF.
    Tiff,
    /// Binary PGM with this maximum.
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

/// Frame decoded from the bytes of a file. Errors of decoders are texts without the name of the file.
pub(super) struct Decoded {
    pub(super) height: usize,
    pub(super) width: usize,
    pub(super) samples: Vec<u16>,
    pub(super) form: MosaicForm,
    pub(super) camera: Option<String>,
    pub(super) taken: Option<String>,
}

/// Error for a developed image.
pub(super) fn developed(what: &str) -> String {
    format!("{what}: a developed image holds no sensor noise; {EXPORT}")
}

/// Error for a frame with too many samples; `None` within the limit.
pub(super) fn too_large(width: usize, height: usize, most_pixels: u64) -> Option<String> {
    let pixels = (width as u64).saturating_mul(height as u64);
    (pixels > most_pixels).then(|| {
        format!("{width} × {height} pixels are more than the {most_pixels} that are read; raise --decode max-pixels")
    })
}
