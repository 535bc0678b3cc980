//! An image encoded for a request: [`Payload`].
//!
//! The file format in which images are sent: [`PayloadFormat`], set by [`ImageArgs`].
//!
//! The check that a PNG file contains nothing but plain 8-bit RGB pixels: [`plain_size`].
//!
//! Encoders of image files: [`png()`] and [`jpeg`] for pixels, [`grey_png`] for maps, [`exr()`] for linear light.

use std::borrow::Cow;
use std::fmt;
use std::io::Cursor;
use std::str::FromStr;
#[cfg(any(target_arch = "x86_64", target_arch = "aarch64"))]
use std::sync::LazyLock;
use std::sync::{Arc, OnceLock};

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
#[cfg(any(target_arch = "x86_64", target_arch = "aarch64"))]
use base64::engine::{general_purpose::PAD, simd::Simd};
use bytes::Bytes;
use clap::Args;
use exr::prelude::{Encoding, Image, Layer, LayerAttributes, SpecificChannels, Vec2, WritableImage as _};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder as _, ImageFormat, ImageReader, Limits};

use crate::noise_png;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::manifests::PngForm;
use darkqa_base::types::{Decides, Digest, ExposureFacts, ImageFacts, Light, PairFacts, Rgb, Rgb16Image};

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
        Self::encode_as(image, format, PngForm::NEWEST)
    }

    /// Encodes an image without scaling; a PNG file in this form.
    ///
    /// # Errors
    /// If the image is larger than the format allows.
    pub fn encode_as(image: &Rgb, format: PayloadFormat, form: PngForm) -> Result<Self> {
        let (width, height) = (side(image.width())?, side(image.height())?);
        let file = match format {
            PayloadFormat::Png => png_in(image, form)?,
            PayloadFormat::Jpeg(quality) => jpeg(image.samples(), width, height, quality)?,
        };
        Ok(Self::from_file(file, width, height, format))
    }

    /// A file that was encoded in this format, with its width and height in pixels.
    #[must_use]
    pub fn from_file(file: Vec<u8>, width: u32, height: u32, format: PayloadFormat) -> Self {
        let digest = Digest::from_bytes(&file);
        Self::with_digest(file.into(), digest, (width, height), format)
    }

    /// A file with its digest, and its width and height in pixels.
    pub(crate) fn with_digest(file: Bytes, digest: Digest, (width, height): (u32, u32), format: PayloadFormat) -> Self {
        Self {
            facts: ImageFacts {
                digest,
                bytes: file.len(),
                width: width as usize,
                height: height as usize,
                format: format.name().to_owned(),
                orientation: None,
                exposure: None,
                pair: None,
            },
            file,
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
                BASE64.encode_string(&self.file, &mut url);
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

/// The file format in which images are sent: PNG or JPEG, because servers refuse other formats.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PayloadFormat {
    /// Lossless: the model receives exactly the pixels that were made.
    Png,
    /// Smaller, without chroma subsampling. Compression removes the noise of dark areas first.
    Jpeg(Quality),
}

/// The quality of a JPEG, 1 to 100.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Quality(pub(crate) u8);

/// The flag for the file format of images.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Sending")]
pub struct ImageArgs {
    /// Format of sent images: png (lossless) or jpeg:QUALITY
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
    /// The subtype of the media type `image/…`.
    pub fn name(self) -> &'static str {
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
            .ok_or_else(|| "png, or jpeg:QUALITY with a quality from 1 to 100, as jpeg:95, expected".to_owned())
    }
}

/// Encoder of data URLs.
#[cfg(any(target_arch = "x86_64", target_arch = "aarch64"))]
static BASE64: LazyLock<Simd> = LazyLock::new(|| Simd::standard(PAD));
#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
static BASE64: &base64::engine::GeneralPurpose = &STANDARD;

const SIGNATURE: &[u8] = b"\x89PNG\r\n\x1a\n";

/// Width and height of a PNG file that contains only plain 8-bit RGB pixels, in pixels; `None` for other files.
///
/// Besides header, image data and end, only chunks without effect are accepted (`sRGB`, and `pHYs` with square pixels).
/// Other chunks (transparency, gamma, profiles, orientation, frames, text) could change the display, or send more than
/// the pixels.
pub(crate) fn plain_size(file: &[u8]) -> Option<(u32, u32)> {
    let mut rest = file.strip_prefix(SIGNATURE)?;
    let (first, header, after) = chunk(rest)?;
    if &first != b"IHDR" {
        return None;
    }
    let size = plain_header(header)?;
    rest = after;
    let mut has_data = false;
    loop {
        let (kind, content, after) = chunk(rest)?;
        match &kind {
            b"IDAT" => has_data = has_data || !content.is_empty(),
            b"sRGB" if content.len() == 1 => {}
            b"pHYs" if content.len() == 9 && content[..4] == content[4..8] => {}
            // Bytes after the end are not part of the image, so such a file is not plain.
            b"IEND" if content.is_empty() && after.is_empty() && has_data => return Some(size),
            _ => return None,
        }
        rest = after;
    }
}

/// Width and height in pixels, if the header states 8-bit RGB without interlacing.
fn plain_header(header: &[u8]) -> Option<(u32, u32)> {
    let (width, rest) = header.split_first_chunk::<4>()?;
    let (height, rest) = rest.split_first_chunk::<4>()?;
    let size = (u32::from_be_bytes(*width), u32::from_be_bytes(*height));
    // Bit depth 8, colour type 2 (RGB), the only compression and filter methods that exist, no interlacing.
    let is_plain = rest == [8, 2, 0, 0, 0] && size.0 > 0 && size.1 > 0;
    is_plain.then_some(size)
}

/// The type and content of the first chunk, and the bytes after it; `None` if the file ends too early. Checksums are
/// not verified, because the caller has decoded the file before.
fn chunk(bytes: &[u8]) -> Option<([u8; 4], &[u8], &[u8])> {
    let (length, rest) = bytes.split_first_chunk::<4>()?;
    let (kind, rest) = rest.split_first_chunk::<4>()?;
    let (content, rest) = rest.split_at_checked(u32::from_be_bytes(*length) as usize)?;
    let (_checksum, rest) = rest.split_first_chunk::<4>()?;
    Some((*kind, content, rest))
}

/// An error about an image whose file name is unknown here.
pub(crate) fn image_error(problem: impl fmt::Display) -> Error {
    Error::data("image", problem)
}

/// The length of a side, in pixels, as a 32-bit number.
///
/// # Errors
/// If the side is too long for any file format.
pub(crate) fn side(pixels: usize) -> Result<u32> {
    u32::try_from(pixels).map_err(|_| image_error(format_args!("a side of {pixels} pixels is too long")))
}

/// Encodes an image as a PNG file, in the newest form.
///
/// # Errors
/// If a side is too long for the format.
pub fn png(image: &Rgb) -> Result<Vec<u8>> {
    png_in(image, PngForm::NEWEST)
}

/// Encodes an image as a PNG file in this form.
fn png_in(image: &Rgb, form: PngForm) -> Result<Vec<u8>> {
    let (width, height) = (side(image.width())?, side(image.height())?);
    if form == PngForm::Noise && image.samples().len() <= noise_png::MAX_SAMPLES {
        return Ok(noise_png::encode(image, width, height));
    }
    let mut file = Vec::new();
    PngEncoder::new_with_quality(&mut file, CompressionType::Fast, FilterType::Adaptive)
        .write_image(image.samples(), width, height, ExtendedColorType::Rgb8)
        .map_err(image_error)?;
    Ok(file)
}

/// Encodes an image of 16-bit codes as a PNG file.
///
/// # Errors
/// If a side is too long for the format.
pub(crate) fn png_16(image: &Rgb16Image) -> Result<Vec<u8>> {
    let (width, height) = (side(image.width())?, side(image.height())?);
    let samples: Vec<u8> = image.samples().iter().flat_map(|code| code.to_ne_bytes()).collect();
    let mut file = Vec::new();
    PngEncoder::new_with_quality(&mut file, CompressionType::Fast, FilterType::Adaptive)
        .write_image(&samples, width, height, ExtendedColorType::Rgb16)
        .map_err(image_error)?;
    Ok(file)
}

/// Encodes a map of one 16-bit number per pixel, row by row, as a grey PNG file.
///
/// # Errors
/// If a side is too long for the format, or the number of samples does not match the size.
pub fn grey_png(width: usize, height: usize, samples: &[u16]) -> Result<Vec<u8>> {
    if samples.len() != width * height {
        return Err(image_error("its samples do not fill its sides"));
    }
    let samples: Vec<u8> = samples.iter().flat_map(|value| value.to_ne_bytes()).collect();
    let mut file = Vec::new();
    PngEncoder::new_with_quality(&mut file, CompressionType::Fast, FilterType::Adaptive)
        .write_image(&samples, side(width)?, side(height)?, ExtendedColorType::L16)
        .map_err(image_error)?;
    Ok(file)
}

/// Encodes a JPEG file without chroma subsampling, to keep the resolution of colour noise.
///
/// # Errors
/// If a side is too long for the format.
pub(crate) fn jpeg(samples: &[u8], width: u32, height: u32, quality: Quality) -> Result<Vec<u8>> {
    let (Ok(width), Ok(height)) = (u16::try_from(width), u16::try_from(height)) else {
        return Err(image_error(format_args!(
            "{width} × {height} pixels are too many for a JPEG; set --image max-side=N, or --image png"
        )));
    };
    let mut file = Vec::new();
    let mut encoder = jpeg_encoder::Encoder::new(&mut file, quality.0);
    encoder.set_sampling_factor(jpeg_encoder::SamplingFactor::R_4_4_4);
    encoder.encode(samples, width, height, jpeg_encoder::ColorType::Rgb).map_err(image_error)?;
    Ok(file)
}

/// Encodes linear light as an OpenEXR file of 32-bit floats with lossless compression.
///
/// # Errors
/// If memory is insufficient.
pub fn exr(light: &Light) -> Result<Vec<u8>> {
    let (width, height) = (light.width(), light.height());
    let layer = Layer::new(
        (width, height),
        LayerAttributes::default(),
        Encoding::SMALL_LOSSLESS,
        SpecificChannels::rgb(|at: Vec2<usize>| {
            let samples = &light.samples()[3 * (at.y() * width + at.x())..];
            (samples[0], samples[1], samples[2])
        }),
    );
    let mut file = Cursor::new(Vec::new());
    Image::from_layer(layer).write().to_buffered(&mut file).map_err(image_error)?;
    Ok(file.into_inner())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{DecodeRule, ImageFile};

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
    fn forms_of_png_have_the_same_pixels_and_other_bytes() {
        let image = noise(50, 70);
        let [first, newest] = [PngForm::Adaptive, PngForm::Noise]
            .map(|form| Payload::encode_as(&image, PayloadFormat::Png, form).unwrap());
        assert_eq!(first.decode().unwrap(), newest.decode().unwrap());
        assert_ne!(first.facts().digest, newest.facts().digest);
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
        let read = |bytes: &[u8]| ImageFile::new(bytes.to_vec(), String::new(), DecodeRule::default());
        let plain = read(&bytes).plain_png().unwrap();
        assert_eq!(plain.facts(), encoded.facts());
        assert_eq!(plain.data_url(), encoded.data_url());
        assert!(read(&bytes[1..]).plain_png().is_none());
    }

    #[test]
    fn data_urls_are_standard_base64_at_every_length() {
        for length in (0..400).chain([99_999, 100_000, 100_001]) {
            let bytes: Vec<u8> = (0..length).map(|i: usize| (i * i + i / 7) as u8).collect();
            let url = Payload::from_file(bytes.clone(), 1, 1, PayloadFormat::Png).data_url();
            assert_eq!(url, format!("data:image/png;base64,{}", STANDARD.encode(&bytes)), "{length}");
        }
    }

    #[test]
    fn formats_parse_their_own_text() {
        for text in ["png", "jpeg:1", "jpeg:95", "jpeg:100"] {
            assert_eq!(text.parse::<PayloadFormat>().unwrap().to_string(), text);
        }
        for wrong in ["", "PNG", "jpeg", "jpeg:", "jpeg:0", "jpeg:101", "jpeg:-1", "webp"] {
            assert!(wrong.parse::<PayloadFormat>().is_err(), "{wrong}");
        }
    }

    fn header(rest: [u8; 5]) -> Vec<u8> {
        let mut header = [6_u32.to_be_bytes(), 4_u32.to_be_bytes()].concat();
        header.extend(rest);
        header
    }

    fn png(chunks: &[(&[u8; 4], &[u8])]) -> Vec<u8> {
        let mut file = SIGNATURE.to_vec();
        for (kind, content) in chunks {
            file.extend((content.len() as u32).to_be_bytes());
            file.extend_from_slice(*kind);
            file.extend_from_slice(content);
            file.extend([0; 4]);
        }
        file
    }

    #[test]
    fn plain_files_are_accepted() {
        let rgb = header([8, 2, 0, 0, 0]);
        let square = [1, 2, 3, 4, 1, 2, 3, 4, 1];
        let file = png(&[
            (b"IHDR", &rgb),
            (b"sRGB", &[0]),
            (b"pHYs", &square),
            (b"IDAT", &[1; 9]),
            (b"IDAT", &[2; 9]),
            (b"IEND", &[]),
        ]);
        assert_eq!(plain_size(&file), Some((6, 4)));
        for length in 0..file.len() {
            assert_eq!(plain_size(&file[..length]), None, "cut at {length}");
        }
        assert_eq!(plain_size(&[&file[..], b"x"].concat()), None);
    }

    #[test]
    fn everything_else_is_refused() {
        for other in [[16, 2, 0, 0, 0], [8, 6, 0, 0, 0], [8, 0, 0, 0, 0], [8, 3, 0, 0, 0], [8, 2, 0, 0, 1]] {
            let file = png(&[(b"IHDR", &header(other)), (b"IDAT", &[1; 9]), (b"IEND", &[])]);
            assert_eq!(plain_size(&file), None, "{other:?}");
        }
        let rgb = header([8, 2, 0, 0, 0]);
        for kind in
            [b"tRNS", b"gAMA", b"cHRM", b"iCCP", b"sBIT", b"eXIf", b"acTL", b"cICP", b"PLTE", b"tEXt", b"fcTL", b"IHDR"]
        {
            let file = png(&[(b"IHDR", &rgb), (kind, &[1, 2, 3]), (b"IDAT", &[1; 9]), (b"IEND", &[])]);
            assert_eq!(plain_size(&file), None, "{}", String::from_utf8_lossy(kind));
        }
        assert_eq!(plain_size(&png(&[(b"IHDR", &rgb), (b"IEND", &[])])), None);
        assert_eq!(plain_size(&png(&[(b"IDAT", &[1]), (b"IEND", &[])])), None);
        let mut endless = png(&[(b"IHDR", &rgb)]);
        endless.extend(b"\xff\xff\xff\xffIDAT");
        assert_eq!(plain_size(&endless), None);
    }
}
