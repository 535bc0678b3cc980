//! An image encoded for a request: [`Payload`], in a [`PayloadFormat`].

use std::borrow::Cow;
use std::fmt;
use std::io::Cursor;
use std::num::NonZeroU32;
use std::str::FromStr;
use std::sync::Arc;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use bytes::Bytes;
use clap::Args;
use image::codecs::png::{CompressionType, FilterType as RowFilter, PngEncoder};
use image::{
    ExtendedColorType, ImageBuffer, ImageEncoder as _, ImageFormat, ImageReader, Limits, imageops,
};

use super::plain_png;
use crate::error::{Error, Result};
use crate::types::{Decides, Digest, ExposureFacts, ImageFacts, PairFacts, Rgb};

/// The file format in which images are sent: PNG or JPEG, because servers refuse others.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PayloadFormat {
    /// Lossless: the model receives exactly the pixels that were made.
    Png,
    /// Smaller, without chroma subsampling; it loses the noise in dark areas first.
    Jpeg(Quality),
}

/// The quality of a JPEG, 1 to 100.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Quality(u8);

/// The flag for the file format of images.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Sending")]
pub(crate) struct ImageArgs {
    /// How images are sent: png (lossless) or jpeg:QUALITY
    #[arg(long, value_name = "FORMAT", default_value_t = PayloadFormat::Png, add = Decides::Pixels)]
    pub image: PayloadFormat,
}

impl Quality {
    /// Checks a quality; `None` outside 1 to 100.
    #[must_use]
    pub fn new(quality: u8) -> Option<Self> {
        (1..=100).contains(&quality).then_some(Self(quality))
    }
}

impl PayloadFormat {
    fn name(self) -> &'static str {
        match self {
            Self::Png => "png",
            Self::Jpeg(_) => "jpeg",
        }
    }
}

impl fmt::Display for PayloadFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Png => f.write_str("png"),
            Self::Jpeg(Quality(quality)) => write!(f, "jpeg:{quality}"),
        }
    }
}

impl FromStr for PayloadFormat {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "png" {
            return Ok(Self::Png);
        }
        text.strip_prefix("jpeg:")
            .and_then(|quality| Quality::new(quality.parse().ok()?))
            .map(Self::Jpeg)
            .ok_or_else(|| {
                "png, or jpeg:QUALITY with a quality from 1 to 100, as jpeg:95, expected".to_owned()
            })
    }
}

/// An encoded image for any number of requests; cloning it copies no pixels.
#[derive(Clone)]
pub struct Payload {
    facts: ImageFacts,
    data_url: Bytes,
}

impl Payload {
    /// Encodes an image after [`Self::scaled`].
    ///
    /// # Errors
    /// If the image is larger than the format allows.
    pub fn encode(
        image: &Rgb,
        format: PayloadFormat,
        max_side: Option<NonZeroU32>,
    ) -> Result<Self> {
        let image = Self::scaled(image, max_side)?;
        let (width, height) = (side(image.width())?, side(image.height())?);
        let file = match format {
            PayloadFormat::Png => png(&image)?,
            PayloadFormat::Jpeg(quality) => jpeg(image.samples(), width, height, quality)?,
        };
        Ok(Self::of_file(&file, width, height, format))
    }

    /// The pixels that are encoded: the image, reduced (Lanczos3) if its longer side is more than `max_side` pixels.
    ///
    /// # Errors
    /// If a side is too long for any format.
    pub fn scaled(image: &Rgb, max_side: Option<NonZeroU32>) -> Result<Cow<'_, Rgb>> {
        let from = (side(image.width())?, side(image.height())?);
        let Some((width, height)) = fitted(from.0, from.1, max_side) else {
            return Ok(Cow::Borrowed(image));
        };
        let source = ImageBuffer::<image::Rgb<u8>, _>::from_raw(from.0, from.1, image.samples());
        let source = source.ok_or_else(|| image_error("its samples do not fill its sides"))?;
        let smaller = imageops::resize(&source, width, height, imageops::FilterType::Lanczos3);
        Rgb::new(height as usize, width as usize, smaller.into_raw()).map(Cow::Owned)
    }

    /// The bytes of a PNG file, without decoding or encoding. The file must have plain 8-bit RGB, nothing that changes how it
    /// is shown or says more than its pixels, and no side of more than `max_side` pixels. `None` for every other file.
    ///
    /// The file is not checked for damage: it must have been decoded before.
    #[must_use]
    pub fn of_plain_png(file: &[u8], max_side: Option<NonZeroU32>) -> Option<Self> {
        let (width, height) = plain_png::size(file)?;
        if fitted(width, height, max_side).is_some() {
            return None;
        }
        Some(Self::of_file(file, width, height, PayloadFormat::Png))
    }

    /// The width and height in which an image of this size is sent, in pixels: unchanged, or reduced to fit `max_side`.
    #[must_use]
    pub fn fitted(width: u32, height: u32, max_side: Option<NonZeroU32>) -> (u32, u32) {
        fitted(width, height, max_side).unwrap_or((width, height))
    }

    /// The same payload, of a frame that was turned by this EXIF orientation when its file was read.
    #[must_use]
    pub(crate) fn turned_by(mut self, orientation: Option<u8>) -> Self {
        self.facts.orientation = orientation;
        self
    }

    /// The image with what the camera did for it.
    #[must_use]
    pub(crate) fn exposed_by(mut self, exposure: Option<ExposureFacts>) -> Self {
        self.facts.exposure = exposure;
        self
    }

    /// The image with the darkness of the photograph of its frame.
    #[must_use]
    pub(crate) fn paired_by(mut self, pair: Option<PairFacts>) -> Self {
        self.facts.pair = pair;
        self
    }

    /// The facts for the record: digest and size of the encoded file, width, height and format.
    #[must_use]
    pub fn facts(&self) -> &ImageFacts {
        &self.facts
    }

    /// The digest of images that are sent together, as in a record; `None` of none.
    pub(crate) fn joint_digest(images: &[Arc<Self>]) -> Option<Digest> {
        Digest::of_files(images.iter().map(|image| image.facts.digest))
    }

    /// Extension of a name for the file, without the dot.
    #[must_use]
    pub fn extension(&self) -> &'static str {
        if self.facts.format == PayloadFormat::Png.name() {
            "png"
        } else {
            "jpg"
        }
    }

    /// The bytes of the encoded file.
    ///
    /// # Errors
    /// None in practice: the base64 text was made here.
    pub fn file(&self) -> Result<Vec<u8>> {
        let base64 = self.data_url.splitn(2, |byte| *byte == b',').nth(1);
        STANDARD
            .decode(base64.unwrap_or_default())
            .map_err(image_error)
    }

    /// The pixels as the receiver of the image decodes them.
    ///
    /// # Errors
    /// Only if memory is short: the file was encoded here.
    pub fn decode(&self) -> Result<Rgb> {
        let image = image::load_from_memory(&self.file()?)
            .map_err(image_error)?
            .into_rgb8();
        let (height, width) = (image.height() as usize, image.width() as usize);
        Rgb::new(height, width, image.into_raw())
    }

    /// The pixels as by [`Self::decode`]; a lossless payload whose pixels are passed in is not decoded.
    pub(crate) fn received<'a>(&self, encoded: Option<&'a Rgb>) -> Result<Cow<'a, Rgb>> {
        match encoded {
            Some(pixels) if self.facts.format == PayloadFormat::Png.name() => {
                Ok(Cow::Borrowed(pixels))
            }
            _ => self.decode().map(Cow::Owned),
        }
    }

    /// The image as `data:image/png;base64,…`; the bytes are shared, not copied.
    #[must_use]
    pub fn data_url(&self) -> Bytes {
        self.data_url.clone()
    }

    /// The payload of a file that was encoded in this format, with its width and height in pixels.
    pub(crate) fn of_file(file: &[u8], width: u32, height: u32, format: PayloadFormat) -> Self {
        let mut url = format!("data:image/{};base64,", format.name());
        url.reserve_exact(file.len().div_ceil(3) * 4);
        STANDARD.encode_string(file, &mut url);
        Self {
            facts: ImageFacts {
                digest: Digest::of(file),
                bytes: file.len(),
                width: width as usize,
                height: height as usize,
                format: format.name().to_owned(),
                orientation: None,
                exposure: None,
                pair: None,
            },
            data_url: url.into(),
        }
    }
}

impl fmt::Debug for Payload {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Payload({:?})", self.facts)
    }
}

fn image_error(problem: impl fmt::Display) -> Error {
    Error::data("image", problem)
}

fn side(pixels: usize) -> Result<u32> {
    u32::try_from(pixels)
        .map_err(|_| image_error(format_args!("a side of {pixels} pixels is too long")))
}

/// The sides of an image reduced to fit `max_side`; `None` if it fits already.
fn fitted(width: u32, height: u32, max_side: Option<NonZeroU32>) -> Option<(u32, u32)> {
    let (longer, max) = (u64::from(width.max(height)), u64::from(max_side?.get()));
    let scaled = |side: u32| ((u64::from(side) * max + longer / 2) / longer).max(1) as u32;
    (longer > max).then(|| (scaled(width), scaled(height)))
}

/// An image as a lossless PNG file, at the lowest compression effort: 26 times faster than the default, files are 2 % larger.
///
/// # Errors
/// If a side is too long for the format.
pub(crate) fn png(image: &Rgb) -> Result<Vec<u8>> {
    let (width, height) = (side(image.width())?, side(image.height())?);
    let mut file = Vec::new();
    PngEncoder::new_with_quality(&mut file, CompressionType::Fast, RowFilter::Adaptive)
        .write_image(image.samples(), width, height, ExtendedColorType::Rgb8)
        .map_err(image_error)?;
    Ok(file)
}

/// The pixels of a JPEG in a `data:` URL, as a run stores small copies.
///
/// # Errors
/// If the text is no such URL, the file is no whole JPEG, or a side has more than `most` pixels.
pub(crate) fn pixels_of_url(url: &str, most: u32) -> Result<Rgb> {
    let base64 = url.strip_prefix("data:image/jpeg;base64,");
    let base64 = base64.ok_or_else(|| image_error("no JPEG as a run stores it"))?;
    let file = STANDARD.decode(base64).map_err(image_error)?;
    let mut reader = ImageReader::with_format(Cursor::new(file), ImageFormat::Jpeg);
    let mut limits = Limits::default();
    (limits.max_image_width, limits.max_image_height) = (Some(most), Some(most));
    reader.limits(limits);
    let image = reader.decode().map_err(image_error)?.into_rgb8();
    let (height, width) = (image.height() as usize, image.width() as usize);
    Rgb::new(height, width, image.into_raw())
}

fn jpeg(samples: &[u8], width: u32, height: u32, quality: Quality) -> Result<Vec<u8>> {
    let (Ok(width), Ok(height)) = (u16::try_from(width), u16::try_from(height)) else {
        return Err(image_error(format_args!(
            "{width} × {height} pixels are too many for a JPEG; set --max-side, or --image png"
        )));
    };
    let mut file = Vec::new();
    let mut encoder = jpeg_encoder::Encoder::new(&mut file, quality.0);
    // 4:4:4 keeps colour noise at full resolution, as far as the quality allows.
    encoder.set_sampling_factor(jpeg_encoder::SamplingFactor::R_4_4_4);
    encoder
        .encode(samples, width, height, jpeg_encoder::ColorType::Rgb)
        .map_err(image_error)?;
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(height: usize, width: usize) -> Rgb {
        let samples = (0..height * width * 3).map(|i| (i * i % 251) as u8);
        Rgb::new(height, width, samples.collect()).unwrap()
    }

    fn file(payload: &Payload) -> Vec<u8> {
        let url = std::str::from_utf8(&payload.data_url).unwrap();
        let (head, base64) = url.split_once(',').unwrap();
        assert_eq!(
            head,
            format!("data:image/{};base64", payload.facts().format)
        );
        STANDARD.decode(base64).unwrap()
    }

    #[test]
    fn formats_read_back() {
        for text in ["png", "jpeg:1", "jpeg:95", "jpeg:100"] {
            assert_eq!(text.parse::<PayloadFormat>().unwrap().to_string(), text);
        }
        for wrong in [
            "", "PNG", "jpeg", "jpeg:", "jpeg:0", "jpeg:101", "jpeg:-1", "webp",
        ] {
            assert!(wrong.parse::<PayloadFormat>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn png_is_lossless_and_its_facts_are_right() {
        let image = noise(5, 7);
        let payload = Payload::encode(&image, PayloadFormat::Png, None).unwrap();
        let file = file(&payload);
        let read = image::load_from_memory_with_format(&file, image::ImageFormat::Png).unwrap();
        assert_eq!(read.to_rgb8().as_raw(), image.samples());
        let facts = payload.facts();
        assert_eq!((facts.width, facts.height, facts.bytes), (7, 5, file.len()));
        assert_eq!(facts.digest, Digest::of(&file));
    }

    #[test]
    fn jpeg_keeps_colour_at_full_resolution() {
        let red_and_blue: Vec<u8> = [[255, 0, 0], [0, 0, 255]].repeat(128).concat();
        let image = Rgb::new(16, 16, red_and_blue).unwrap();
        let format = PayloadFormat::Jpeg(Quality::new(100).unwrap());
        let payload = Payload::encode(&image, format, None).unwrap();
        let read =
            image::load_from_memory_with_format(&file(&payload), image::ImageFormat::Jpeg).unwrap();
        let (a, b) = (image.samples(), read.to_rgb8());
        let worst = a.iter().zip(b.as_raw()).map(|(a, b)| a.abs_diff(*b)).max();
        assert!(worst < Some(10), "{worst:?}");
    }

    #[test]
    fn images_shrink_to_the_side_and_never_grow() {
        let image = noise(30, 60);
        for (most, expected) in [(60, (60, 30)), (100, (60, 30)), (20, (20, 10)), (1, (1, 1))] {
            let payload =
                Payload::encode(&image, PayloadFormat::Png, NonZeroU32::new(most)).unwrap();
            let facts = payload.facts();
            assert_eq!((facts.width, facts.height), expected);
        }
        let grey = Rgb::new(40, 40, vec![128; 4800]).unwrap();
        let payload = Payload::encode(&grey, PayloadFormat::Png, NonZeroU32::new(13)).unwrap();
        let read = image::load_from_memory(&file(&payload)).unwrap().to_rgb8();
        assert!(read.as_raw().iter().all(|sample| *sample == 128));
    }

    #[test]
    fn an_image_too_large_for_the_format_is_an_error() {
        let wide = Rgb::new(1, 65_536, vec![0; 65_536 * 3]).unwrap();
        let jpeg = "jpeg:95".parse().unwrap();
        let error = Payload::encode(&wide, jpeg, None).unwrap_err();
        assert!(error.to_string().contains("--image png"), "{error}");
    }

    #[test]
    fn plain_files_are_sent_as_they_are() {
        let image = noise(8, 9);
        let encoded = Payload::encode(&image, PayloadFormat::Png, None).unwrap();
        let bytes = file(&encoded);
        let plain = Payload::of_plain_png(&bytes, None).unwrap();
        assert_eq!(plain.facts(), encoded.facts());
        assert_eq!(plain.data_url, encoded.data_url);
        assert!(Payload::of_plain_png(&bytes, NonZeroU32::new(9)).is_some());
        assert!(Payload::of_plain_png(&bytes, NonZeroU32::new(8)).is_none());
    }
}
