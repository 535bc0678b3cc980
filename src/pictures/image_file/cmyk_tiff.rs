//! Ink amounts of a CMYK TIFF file: [`inks`].

use std::io::Cursor;

use tiff::decoder::{Decoder, DecodingResult, Limits};
use tiff::{ColorType, TiffError};

/// Decodes the amounts of cyan, magenta, yellow and black of each pixel, row by row: 0 for none, 255 for full (TIFF
/// 6.0, section 16). `pixels` is the number of pixels in the image.
///
/// # Errors
/// If the file is broken, or its compression is not supported.
pub(super) fn inks(file: &[u8], pixels: usize) -> Result<Vec<u8>, String> {
    let mut limits = Limits::unlimited();
    limits.decoding_buffer_size = pixels.saturating_mul(4);
    // A strip is no larger than the image, with some room for poor compression.
    limits.intermediate_buffer_size = pixels.saturating_mul(8).max(1 << 20);
    let mut decoder = Decoder::new(Cursor::new(file)).map_err(decoding_error)?.with_limits(limits);
    match decoder.colortype().map_err(decoding_error)? {
        ColorType::CMYK(8) => {}
        other => return Err(format!("four inks of 8 bits expected, not {other:?}")),
    }
    match decoder.read_image().map_err(decoding_error)? {
        DecodingResult::U8(inks) => Ok(inks),
        _ => Err("amounts of ink of 8 bits expected".to_owned()),
    }
}

fn decoding_error(e: TiffError) -> String {
    match e {
        TiffError::UnsupportedError(e) => {
            format!("a CMYK image in a form that is not read ({e}); convert it to RGB first")
        }
        e => format!("not a whole image: {e}"),
    }
}
