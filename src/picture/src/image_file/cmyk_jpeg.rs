//! The amounts of ink in a JPEG file of four components: [`inks`].

use zune_core::bytestream::ZCursor;
use zune_core::colorspace::ColorSpace;
use zune_core::options::DecoderOptions;
use zune_jpeg::JpegDecoder;

/// The amounts of cyan, magenta, yellow and black of each pixel, row by row, 0 for none and 255 for full.
///
/// A file with Adobe's marker holds them inverted, and as luma and chroma if the marker states YCCK (ITU-T T.872, section 6.5.3).
/// The decoder would make RGB of them without regard to a profile.
///
/// # Errors
/// If the file is broken.
pub(super) fn inks(file: &[u8], has_adobe_marker: bool) -> Result<Vec<u8>, String> {
    let wrong = |e: zune_jpeg::errors::DecodeErrors| format!("not a whole image: {e}");
    let options = DecoderOptions::default()
        .set_strict_mode(false)
        .set_max_width(usize::MAX)
        .set_max_height(usize::MAX);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(file), options);
    decoder.decode_headers().map_err(wrong)?;
    let stored = decoder.input_colorspace().unwrap_or(ColorSpace::CMYK);
    if stored.num_components() != 4 {
        return Err(format!("four components expected, not {stored:?}"));
    }
    decoder.set_options(options.jpeg_set_out_colorspace(stored));
    let mut samples = decoder.decode().map_err(wrong)?;
    if stored == ColorSpace::YCCK {
        for pixel in samples.as_chunks_mut::<4>().0 {
            let [y, cb, cr, black] = *pixel;
            let [red, green, blue] = rgb([y, cb, cr]);
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

/// Red, green and blue of luma and chroma (JFIF 1.02).
fn rgb([y, cb, cr]: [u8; 3]) -> [u8; 3] {
    let [y, cb, cr] = [f64::from(y), f64::from(cb) - 128.0, f64::from(cr) - 128.0];
    [
        y + 1.402 * cr,
        y - 0.344_136 * cb - 0.714_136 * cr,
        y + 1.772 * cb,
    ]
    .map(|code| code.round().clamp(0.0, 255.0) as u8)
}
