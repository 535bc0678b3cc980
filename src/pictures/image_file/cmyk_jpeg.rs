//! Ink amounts of a CMYK JPEG file: [`inks`].

use zune_core::bytestream::ZCursor;
use zune_core::colorspace::ColorSpace;
use zune_core::options::DecoderOptions;
use zune_jpeg::JpegDecoder;
use zune_jpeg::errors::DecodeErrors;

/// Decodes the amounts of cyan, magenta, yellow and black of each pixel, row by row: 0 for none, 255 for full.
///
/// A file with Adobe's marker stores inverted amounts, and luma and chroma if the marker states YCCK (ITU-T T.872,
/// section 6.5.3). The default output of the decoder is not used, because it is RGB converted without the ICC profile.
///
/// # Errors
/// If the file is broken.
pub(super) fn inks(file: &[u8], has_adobe_marker: bool) -> Result<Vec<u8>, String> {
    let options = DecoderOptions::default().set_strict_mode(false).set_max_width(usize::MAX).set_max_height(usize::MAX);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(file), options);
    decoder.decode_headers().map_err(|e| decoding_error(&e))?;
    let stored = decoder.input_colorspace().unwrap_or(ColorSpace::CMYK);
    if stored.num_components() != 4 {
        return Err(format!("four components expected, not {stored:?}"));
    }
    decoder.set_options(options.jpeg_set_out_colorspace(stored));
    let mut samples = decoder.decode().map_err(|e| decoding_error(&e))?;
    if stored == ColorSpace::YCCK {
        for pixel in samples.as_chunks_mut::<4>().0 {
            let [y, cb, cr, black] = *pixel;
            let [red, green, blue] = rgb_from_ycbcr([y, cb, cr]);
            *pixel = [255 - red, 255 - green, 255 - blue, black];
        }
    }
    if has_adobe_marker {
        for sample in &mut samples {
            *sample = 255 - *sample;
        }
    }
    Ok(samples)
}

fn decoding_error(e: &DecodeErrors) -> String {
    format!("not a whole image: {e}")
}

/// Converts luma and chroma to red, green and blue (JFIF 1.02).
fn rgb_from_ycbcr([y, cb, cr]: [u8; 3]) -> [u8; 3] {
    let [y, cb, cr] = [f64::from(y), f64::from(cb) - 128.0, f64::from(cr) - 128.0];
    [y + 1.402 * cr, y - 0.344_136 * cb - 0.714_136 * cr, y + 1.772 * cb]
        .map(|code| code.round().clamp(0.0, 255.0) as u8)
}
