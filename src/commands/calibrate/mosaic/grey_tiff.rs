//! Decoder of 16-bit greyscale TIFF files: uncompressed, LZW, deflate or PackBits, in strips or tiles.

use std::io::Cursor;

use tiff::decoder::{Decoder, DecodingResult, Limits};
use tiff::tags::{PhotometricInterpretation, Tag};
use tiff::{ColorType, TiffError};

use super::decoded::{Decoded, EXPORT, MosaicForm, developed, too_large};
use super::makers;

/// Tag of every DNG file (Adobe, Digital Negative Specification 1.7, DNGVersion).
const DNG_VERSION: Tag = Tag::Unknown(50706);

/// Decodes a file that starts with the signature of a TIFF.
pub(super) fn decode(bytes: &[u8], most_pixels: u64) -> Result<Decoded, String> {
    let mut limits = Limits::default();
    let most_bytes = usize::try_from(most_pixels.saturating_mul(2)).unwrap_or(usize::MAX);
    limits.decoding_buffer_size = most_bytes;
    limits.intermediate_buffer_size = most_bytes;
    let mut decoder = Decoder::new(Cursor::new(bytes)).map_err(|e| not_readable(&e))?.with_limits(limits);
    let mut tag = |tag: Tag| decoder.find_tag(tag).ok().flatten();
    if tag(DNG_VERSION).is_some() {
        return Err(makers::message("DNG"));
    }
    let photometric = tag(Tag::PhotometricInterpretation).and_then(|value| value.into_u16().ok());
    let [maker, model, taken] = [Tag::Make, Tag::Model, Tag::DateTime].map(|name| {
        let text = tag(name)?.into_string().ok()?;
        let text = text.trim_matches(['\0', ' ']).to_owned();
        (!text.is_empty()).then_some(text)
    });
    if photometric == Some(PhotometricInterpretation::WhiteIsZero.to_u16()) {
        return Err("a TIFF in which 0 is white; black is 0 in a mosaic".to_owned());
    }
    let color = decoder.colortype().map_err(|e| not_readable(&e))?;
    if color != ColorType::Gray(16) {
        return Err(developed(&describe(color)));
    }
    let (width, height) = decoder.dimensions().map_err(|e| not_readable(&e))?;
    let (width, height) = (width as usize, height as usize);
    if let Some(problem) = too_large(width, height, most_pixels) {
        return Err(problem);
    }
    let DecodingResult::U16(samples) = decoder.read_image().map_err(|e| not_readable(&e))? else {
        return Err("a TIFF of signed or fractional numbers; whole numbers from 0 expected".into());
    };
    if samples.len() != width * height {
        return Err("not a whole TIFF: samples are missing".to_owned());
    }
    if decoder.more_images() {
        return Err("a TIFF of several images; one mosaic alone expected".to_owned());
    }
    let camera = match (maker, model) {
        (Some(maker), Some(model)) if !model.starts_with(&maker) => Some(format!("{maker} {model}")),
        (maker, model) => model.or(maker),
    };
    Ok(Decoded { height, width, samples, form: MosaicForm::Tiff, camera, taken })
}

fn not_readable(error: &TiffError) -> String {
    match error {
        TiffError::UnsupportedError(e) => format!(
            "a TIFF of a kind that is not read ({e}); one channel of 16 bits expected, uncompressed, LZW or deflate: {EXPORT}"
        ),
        _ => format!("not a whole TIFF: {error}; copy or export it again"),
    }
}

/// Describes the color type of a TIFF.
fn describe(color: ColorType) -> String {
    match color {
        ColorType::Gray(bits) => format!("a grey TIFF of {bits} bits, where 16 are expected"),
        ColorType::RGB(bits) => format!("an RGB TIFF of {bits} bits"),
        ColorType::Palette(_) => "a palette TIFF".to_owned(),
        other => format!("a TIFF of {} channels", other.num_samples()),
    }
}
