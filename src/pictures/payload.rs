//! An image encoded for a request: [`Payload`].

use std::borrow::Cow;
use std::fmt;
use std::io::Cursor;
use std::sync::{Arc, OnceLock};

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use bytes::Bytes;
use image::{ImageFormat, ImageReader, Limits};

use crate::encoding::{image_error, jpeg, png, side};
use crate::payload_format::PayloadFormat;
use crate::plain_png;
use darkqa_base::error::Result;
use darkqa_base::types::{Digest, ExposureFacts, ImageFacts, PairFacts, Rgb};

/// An encoded image for any number of requests; cloning it copies no pixels.
#[derive(Clone)]
pub struct Payload {
    facts: ImageFacts,
    file: Bytes,
    /// The file as a data URL, encoded on first use.
    data_url: OnceLock<Bytes>,
    /// The pixels, decoded when a model of this process first looks at them; `Some(None)` if that failed.
    pixels: OnceLock<Option<Arc<Rgb>>>,
}

impl Payload {
    /// Encodes an image without scaling.
    ///
    /// # Errors
    /// If the image is larger than the format allows.
    pub fn encode(image: &Rgb, format: PayloadFormat) -> Result<Self> {
        let (width, height) = (side(image.width())?, side(image.height())?);
        let file = match format {
            PayloadFormat::Png => png(image)?,
            PayloadFormat::Jpeg(quality) => jpeg(image.samples(), width, height, quality)?,
        };
        Ok(Self::from_file(file, width, height, format))
    }

    /// Takes a PNG file unchanged if it contains only plain 8-bit RGB pixels and no chunk that changes their display or
    /// adds information; otherwise returns `None`. The file is not checked for damage: it must have been decoded
    /// before.
    #[must_use]
    pub fn from_plain_png(file: &[u8]) -> Option<Self> {
        let (width, height) = plain_png::plain_size(file)?;
        Some(Self::from_file(file.to_vec(), width, height, PayloadFormat::Png))
    }

    /// A file that was encoded in this format, with its width and height in pixels.
    #[must_use]
    pub fn from_file(file: Vec<u8>, width: u32, height: u32, format: PayloadFormat) -> Self {
        Self {
            facts: ImageFacts {
                digest: Digest::from_bytes(&file),
                bytes: file.len(),
                width: width as usize,
                height: height as usize,
                format: format.name().to_owned(),
                orientation: None,
                exposure: None,
                pair: None,
            },
            file: file.into(),
            data_url: OnceLock::new(),
            pixels: OnceLock::new(),
        }
    }

    /// Adds the EXIF orientation that was applied when the frame was read.
    #[must_use]
    pub fn with_orientation(mut self, orientation: Option<u8>) -> Self {
        self.facts.orientation = orientation;
        self
    }

    /// Adds the camera's exposure.
    #[must_use]
    pub fn with_exposure(mut self, exposure: Option<ExposureFacts>) -> Self {
        self.facts.exposure = exposure;
        self
    }

    /// Adds how dark the photograph of the frame is.
    #[must_use]
    pub fn with_pair(mut self, pair: Option<PairFacts>) -> Self {
        self.facts.pair = pair;
        self
    }

    /// Facts for the record: digest and length of the file, width, height, format, and the added facts.
    #[must_use]
    pub fn facts(&self) -> &ImageFacts {
        &self.facts
    }

    /// The digest of images that are sent together, as in a record; `None` without images.
    pub fn joint_digest(images: &[Arc<Self>]) -> Option<Digest> {
        Digest::from_file_digests(images.iter().map(|image| image.facts.digest))
    }

    /// The width and height in pixels.
    #[must_use]
    pub fn size(&self) -> (usize, usize) {
        (self.facts.width, self.facts.height)
    }

    /// Extension for a file name, without the dot.
    #[must_use]
    pub fn extension(&self) -> &'static str {
        if self.facts.format == PayloadFormat::Png.name() { "png" } else { "jpg" }
    }

    /// The bytes of the encoded file.
    #[must_use]
    pub fn file(&self) -> &[u8] {
        &self.file
    }

    /// Decodes the file, as its receiver does.
    ///
    /// # Errors
    /// If memory is insufficient, or the file of [`Self::from_file`] is damaged.
    pub fn decode(&self) -> Result<Rgb> {
        let image = image::load_from_memory(&self.file).map_err(image_error)?.into_rgb8();
        let (height, width) = (image.height() as usize, image.width() as usize);
        Rgb::new(height, width, image.into_raw())
    }

    /// The pixels that the receiver gets, decoded once and kept as long as the payload, for several models of this
    /// process.
    ///
    /// # Errors
    /// See [`Self::decode`].
    pub fn shared_pixels(&self) -> Result<Arc<Rgb>> {
        let decode = || self.decode().map(Arc::new);
        match self.pixels.get_or_init(|| decode().ok()) {
            Some(pixels) => Ok(Arc::clone(pixels)),
            None => decode(),
        }
    }

    /// The pixels that the receiver gets. If the encoded pixels are passed in, a lossless payload is not decoded.
    ///
    /// # Errors
    /// See [`Self::decode`].
    pub fn received_pixels<'a>(&self, encoded: Option<&'a Rgb>) -> Result<Cow<'a, Rgb>> {
        match encoded {
            Some(pixels) if self.facts.format == PayloadFormat::Png.name() => Ok(Cow::Borrowed(pixels)),
            _ => self.decode().map(Cow::Owned),
        }
    }

    /// The image as `data:image/png;base64,…`; the bytes are shared, not copied.
    #[must_use]
    pub fn data_url(&self) -> Bytes {
        self.data_url
            .get_or_init(|| {
                let mut url = format!("data:image/{};base64,", self.facts.format);
                url.reserve_exact(self.file.len().div_ceil(3) * 4);
                STANDARD.encode_string(&self.file, &mut url);
                url.into()
            })
            .clone()
    }
}

impl fmt::Debug for Payload {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Payload({:?})", self.facts)
    }
}

/// Decodes a JPEG in a `data:` URL, the form in which a run stores thumbnails.
///
/// # Errors
/// If the text is not such a URL, the file is not a complete JPEG, or a side has more than `max_side` pixels.
pub fn decode_data_url(url: &str, max_side: u32) -> Result<Rgb> {
    let base64 =
        url.strip_prefix("data:image/jpeg;base64,").ok_or_else(|| image_error("no JPEG as a run stores it"))?;
    let file = STANDARD.decode(base64).map_err(image_error)?;
    let mut reader = ImageReader::with_format(Cursor::new(file), ImageFormat::Jpeg);
    let mut limits = Limits::default();
    (limits.max_image_width, limits.max_image_height) = (Some(max_side), Some(max_side));
    reader.limits(limits);
    let image = reader.decode().map_err(image_error)?.into_rgb8();
    let (height, width) = (image.height() as usize, image.width() as usize);
    Rgb::new(height, width, image.into_raw())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::payload_format::Quality;

    fn noise(height: usize, width: usize) -> Rgb {
        let samples = (0..height * width * 3).map(|i| (i * i % 251) as u8);
        Rgb::new(height, width, samples.collect()).unwrap()
    }

    /// The file in the data URL of a payload.
    fn file(payload: &Payload) -> Vec<u8> {
        let url = payload.data_url();
        let url = std::str::from_utf8(&url).unwrap();
        let (head, base64) = url.split_once(',').unwrap();
        assert_eq!(head, format!("data:image/{};base64", payload.facts().format));
        STANDARD.decode(base64).unwrap()
    }

    #[test]
    fn png_is_lossless_with_correct_facts() {
        let image = noise(5, 7);
        let payload = Payload::encode(&image, PayloadFormat::Png).unwrap();
        let file = file(&payload);
        let read = image::load_from_memory_with_format(&file, image::ImageFormat::Png).unwrap();
        assert_eq!(read.to_rgb8().as_raw(), image.samples());
        assert_eq!(payload.file(), file);
        let facts = payload.facts();
        assert_eq!((facts.width, facts.height, facts.bytes), (7, 5, file.len()));
        assert_eq!(facts.digest, Digest::from_bytes(&file));
    }

    #[test]
    fn jpeg_keeps_colour_at_full_resolution() {
        let red_and_blue: Vec<u8> = [[255, 0, 0], [0, 0, 255]].repeat(128).concat();
        let image = Rgb::new(16, 16, red_and_blue).unwrap();
        let format = PayloadFormat::Jpeg(Quality::new(100).unwrap());
        let payload = Payload::encode(&image, format).unwrap();
        let read = image::load_from_memory_with_format(&file(&payload), image::ImageFormat::Jpeg).unwrap();
        let (a, b) = (image.samples(), read.to_rgb8());
        let worst = a.iter().zip(b.as_raw()).map(|(a, b)| a.abs_diff(*b)).max();
        assert!(worst < Some(10), "{worst:?}");
    }

    #[test]
    fn an_image_too_large_for_the_format_is_an_error() {
        let wide = Rgb::new(1, 65_536, vec![0; 65_536 * 3]).unwrap();
        let jpeg = "jpeg:95".parse().unwrap();
        let error = Payload::encode(&wide, jpeg).unwrap_err();
        assert!(error.to_string().contains("--image png"), "{error}");
    }

    #[test]
    fn plain_files_are_sent_unchanged() {
        let image = noise(8, 9);
        let encoded = Payload::encode(&image, PayloadFormat::Png).unwrap();
        let bytes = file(&encoded);
        let plain = Payload::from_plain_png(&bytes).unwrap();
        assert_eq!(plain.facts(), encoded.facts());
        assert_eq!(plain.data_url(), encoded.data_url());
        assert!(Payload::from_plain_png(&bytes[1..]).is_none());
    }
}
