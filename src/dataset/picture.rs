//! The image of a frame before decoding: [`Picture`].

use std::io::Cursor;

use image::{ColorType, DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};

use super::jpeg::JpegOutline;
use crate::error::{Error, Result};
use crate::rooms::Room;
use crate::types::{Digest, Rgb};

/// The first eight bytes of every PNG file.
const PNG: &[u8] = b"\x89PNG\r\n\x1a\n";

/// The default of the maximum number of pixels in an image (chosen).
pub const MOST_PIXELS: u64 = 100_000_000;

/// An image as stored: the bytes of a file, or a built-in room.
#[derive(Debug)]
pub enum Picture {
    /// A PNG or JPEG file.
    Encoded {
        /// The bytes of the file.
        bytes: Vec<u8>,
        /// The file and line that it came from, for messages.
        place: String,
        /// The maximum number of pixels. A larger image is refused before it is decompressed.
        most_pixels: u64,
    },
    /// A built-in room, drawn when its pixels are needed.
    Drawn(Room),
}

impl Picture {
    /// The digest of the file, or of everything that decides the pixels of a room.
    #[must_use]
    pub fn digest(&self) -> Digest {
        match self {
            Self::Encoded { bytes, .. } => Digest::of(bytes),
            Self::Drawn(room) => room.digest(),
        }
    }

    /// The width and height in pixels, after a check that the picture can be decoded.
    ///
    /// For an RGB PNG the checksums are enough: they find any damage at a hundredth of the cost of decompressing. Every
    /// other file is decoded, because JPEG has no checksums and an alpha channel may be transparent.
    pub fn check(&self) -> Result<(u32, u32)> {
        let (bytes, place, most_pixels) = match self {
            Self::Drawn(room) => return Ok(room.size().map(|side| side as u32).into()),
            Self::Encoded {
                bytes,
                place,
                most_pixels,
            } => (bytes, place, *most_pixels),
        };
        let decoder = decoder(bytes, place, most_pixels)?;
        if bytes.starts_with(PNG) && decoder.color_type() == ColorType::Rgb8 {
            check_complete(bytes, place)?;
        } else {
            self.decode()?;
        }
        Ok(decoder.dimensions())
    }

    /// The pixels as 8-bit sRGB. A truncated file, or a PNG with a wrong checksum, is refused.
    ///
    /// Grey becomes three equal channels, a palette becomes its colours, and 16 bits are rounded to 8. An alpha channel
    /// is dropped if it is opaque everywhere. CMYK and transparency are refused: there is no one right way to show them.
    /// EXIF orientation is ignored, because label maps are not rotated with it.
    pub fn decode(&self) -> Result<Rgb> {
        let (bytes, place, most_pixels) = match self {
            Self::Drawn(room) => return Ok(room.frame()?.rgb.clone()),
            Self::Encoded {
                bytes,
                place,
                most_pixels,
            } => (bytes, place, *most_pixels),
        };
        let decoder = decoder(bytes, place, most_pixels)?;
        // The PNG decoder stops after the last sample, and the JPEG decoder accepts fewer samples than it should.
        check_complete(bytes, place)?;
        let image = DynamicImage::from_decoder(decoder)
            .map_err(|e| Error::data(place, format_args!("not a whole image: {e}")))?;
        if image.color().has_alpha()
            && !image.to_rgba8().pixels().all(|pixel| pixel.0[3] == u8::MAX)
        {
            return Err(Error::data(
                place,
                "the image is transparent in places; flatten it first",
            ));
        }
        let rgb = image.into_rgb8();
        Rgb::new(rgb.height() as usize, rgb.width() as usize, rgb.into_raw())
            .map_err(|e| e.at(place.clone()))
    }
}

fn decoder<'a>(bytes: &'a [u8], place: &str, most_pixels: u64) -> Result<impl ImageDecoder + 'a> {
    let wrong = |problem: String| Error::data(place, problem);
    let mut reader = ImageReader::new(Cursor::new(bytes))
        .with_guessed_format()
        .map_err(|e| wrong(format!("cannot be read: {e}")))?;
    if !matches!(reader.format(), Some(ImageFormat::Png | ImageFormat::Jpeg)) {
        return Err(wrong("not an image: PNG or JPEG expected".to_owned()));
    }
    let mut limits = Limits::default();
    limits.max_alloc = Some(most_pixels.saturating_mul(8));
    reader.limits(limits);
    let decoder = reader
        .into_decoder()
        .map_err(|e| wrong(format!("not a readable image: {e}")))?;
    let (width, height) = decoder.dimensions();
    if u64::from(width) * u64::from(height) > most_pixels {
        return Err(wrong(format!(
            "{width} × {height} pixels are more than the {most_pixels} that are read; shrink it first, or raise --max-pixels"
        )));
    }
    if !bytes.starts_with(PNG) && JpegOutline::of(bytes).components == Some(4) {
        return Err(wrong(
            "a CMYK image (four components: CMYK or YCCK); convert it to RGB first".to_owned(),
        ));
    }
    Ok(decoder)
}

/// Checks that a PNG or JPEG file reaches its end mark, and that the checksums of a PNG are right.
fn check_complete(file: &[u8], place: &str) -> Result<()> {
    let fault = match file.strip_prefix(PNG) {
        Some(chunks) => png_fault(chunks),
        None if JpegOutline::of(file).ends => None,
        None => Some(TRUNCATED),
    };
    let problem = match fault {
        None => return Ok(()),
        Some(TRUNCATED) => format!("not a whole image: {TRUNCATED}, at byte {}", file.len()),
        Some(fault) => format!("not a whole image: {fault}"),
    };
    Err(Error::data(place, problem + "; copy or export it again"))
}

const TRUNCATED: &str = "the file ends before its end mark";

/// The first fault in the chunks of a PNG file, up to the last chunk, `IEND`; `None` if there is none.
fn png_fault(mut chunks: &[u8]) -> Option<&'static str> {
    while let Some((length, rest)) = chunks.split_first_chunk::<4>()
        && let Some((body, rest)) =
            rest.split_at_checked((u32::from_be_bytes(*length) as usize).saturating_add(4))
        && let Some((checksum, rest)) = rest.split_first_chunk::<4>()
    {
        if crc32fast::hash(body) != u32::from_be_bytes(*checksum) {
            return Some("a checksum in it is wrong");
        }
        if body.starts_with(b"IEND") {
            return None;
        }
        chunks = rest;
    }
    Some(TRUNCATED)
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{GrayImage, RgbImage, RgbaImage};

    fn encoded(bytes: Vec<u8>, place: impl Into<String>) -> Picture {
        Picture::Encoded {
            bytes,
            place: place.into(),
            most_pixels: MOST_PIXELS,
        }
    }

    fn png(image: &DynamicImage) -> Picture {
        let mut bytes = Vec::new();
        image
            .write_to(&mut Cursor::new(&mut bytes), ImageFormat::Png)
            .unwrap();
        Picture::Encoded {
            bytes,
            place: "test.png".into(),
            most_pixels: MOST_PIXELS,
        }
    }

    #[test]
    fn grey_and_opaque_alpha_become_rgb() {
        let grey = png(&GrayImage::from_raw(2, 1, vec![7, 9]).unwrap().into());
        assert_eq!(grey.decode().unwrap().samples(), [7, 7, 7, 9, 9, 9]);
        let opaque = png(&RgbaImage::from_raw(1, 1, vec![1, 2, 3, 255])
            .unwrap()
            .into());
        assert_eq!(opaque.decode().unwrap().samples(), [1, 2, 3]);
    }

    #[test]
    fn sixteen_bits_become_the_nearest_eight() {
        let deep =
            image::ImageBuffer::<image::Luma<u16>, _>::from_raw(3, 1, vec![0, 32_896, 65_535])
                .unwrap();
        assert_eq!(
            png(&deep.into()).decode().unwrap().samples(),
            [0, 0, 0, 128, 128, 128, 255, 255, 255]
        );
    }

    #[test]
    fn what_cannot_be_shown_is_refused_by_name() {
        let clear = png(&RgbaImage::from_raw(1, 1, vec![1, 2, 3, 9]).unwrap().into());
        assert!(
            clear
                .decode()
                .unwrap_err()
                .to_string()
                .contains("transparent")
        );
        let text = Picture::Encoded {
            bytes: b"no image".to_vec(),
            place: "a.png".into(),
            most_pixels: MOST_PIXELS,
        };
        assert!(
            text.check()
                .unwrap_err()
                .to_string()
                .starts_with("a.png: not an image")
        );
    }

    #[test]
    fn a_truncated_file_is_named() {
        let mut picture = png(&GrayImage::new(64, 64).into());
        if let Picture::Encoded { bytes, .. } = &mut picture {
            bytes.truncate(bytes.len() / 2);
        }
        let error = picture.decode().unwrap_err().to_string();
        assert!(error.starts_with("test.png: not a whole image"), "{error}");
        assert!(error.contains("at byte"), "{error}");
    }

    #[test]
    fn the_limit_on_pixels_can_be_moved() {
        let mut picture = png(&GrayImage::new(64, 64).into());
        picture.decode().unwrap();
        if let Picture::Encoded { most_pixels, .. } = &mut picture {
            *most_pixels = 4095;
        }
        let error = picture.decode().unwrap_err().to_string();
        assert!(
            error.contains("64 × 64 pixels") && error.contains("--max-pixels"),
            "{error}"
        );
    }

    /// The error for bytes that are not a complete picture. It is one line and begins with the file.
    fn fault(bytes: Vec<u8>) -> String {
        let place = "a.png";
        let error = encoded(bytes, place).decode().unwrap_err();
        let error = error.to_string();
        assert!(error.starts_with("a.png: "), "{error}");
        assert_eq!(error.lines().count(), 1, "{error}");
        error
    }

    #[test]
    fn a_corrupt_png_is_named() {
        let image = RgbImage::from_fn(64, 64, |x, y| image::Rgb([x as u8, y as u8, (x * y) as u8]));
        let Picture::Encoded { bytes, .. } = png(&image.into()) else {
            unreachable!()
        };
        let data = bytes.windows(4).position(|four| four == b"IDAT").unwrap() + 4;
        let end = bytes.len() - 12;
        for at in [data, data + 40, end - 5] {
            let mut flipped = bytes.clone();
            flipped[at] ^= 0x10;
            assert!(fault(flipped).contains("not a "), "data at {at}");
        }
        for at in end - 4..end {
            let mut flipped = bytes.clone();
            flipped[at] ^= 1;
            assert!(fault(flipped).contains("checksum"), "checksum at {at}");
        }
        for length in [data + 9, end - 4, end, end + 4, end + 8, end + 11] {
            let cut = fault(bytes[..length].to_vec());
            assert!(cut.contains("not a whole image"), "{length}: {cut}");
        }
        assert!(encoded(bytes, "").decode().is_ok());
    }

    fn jpeg(color: jpeg_encoder::ColorType, channels: usize) -> Vec<u8> {
        let mut bytes = Vec::new();
        let samples: Vec<u8> = (0..32 * 32 * channels).map(|i| (i * 7) as u8).collect();
        jpeg_encoder::Encoder::new(&mut bytes, 90)
            .encode(&samples, 32, 32, color)
            .unwrap();
        bytes
    }

    #[test]
    fn cmyk_is_refused_by_name() {
        for color in [
            jpeg_encoder::ColorType::Cmyk,
            jpeg_encoder::ColorType::CmykAsYcck,
        ] {
            let error = fault(jpeg(color, 4));
            assert!(
                error.contains("CMYK") && error.contains("convert it"),
                "{error}"
            );
        }
        for (color, channels) in [
            (jpeg_encoder::ColorType::Rgb, 3),
            (jpeg_encoder::ColorType::Luma, 1),
        ] {
            let (bytes, place) = (jpeg(color, channels), String::new());
            assert!(encoded(bytes, place).decode().is_ok());
        }
    }

    #[test]
    fn a_truncated_jpeg_is_named() {
        let bytes = jpeg(jpeg_encoder::ColorType::Rgb, 3);
        for length in [bytes.len() / 2, bytes.len() - 40, bytes.len() - 2] {
            let cut = fault(bytes[..length].to_vec());
            assert!(cut.contains("not a "), "{length}: {cut}");
        }
    }

    #[test]
    fn a_bomb_is_refused_before_it_is_decompressed() {
        let Picture::Encoded {
            mut bytes, place, ..
        } = png(&GrayImage::new(1, 1).into())
        else {
            unreachable!()
        };
        bytes[16..24].copy_from_slice(&[0, 1, 0, 0, 0, 1, 0, 0]);
        assert!(encoded(bytes, place).check().is_err());
    }
}
