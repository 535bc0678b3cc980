//! Undeveloped frame of a sensor: [`Mosaic`], read from a 16-bit PNG, a TIFF or a binary PGM. The values are ADU,
//! unchanged from the file.
//!
//! Result of a decoder, [`Decoded`], and the errors of all decoders.
//!
//! Decoder of 16-bit greyscale TIFF files: uncompressed, LZW, deflate or PackBits, in strips or tiles.
//!
//! Decoder of 16-bit binary PGM files (Netpbm, format P5): a text header, then big-endian samples.
//!
//! Recognition of RAW files of camera makers, which are not supported: [`problem`].

#[cfg(test)]
mod tests;

use std::fmt;
use std::io::Cursor;
use std::path::Path;

use tiff::decoder::{Decoder, DecodingResult, Limits};
use tiff::tags::{PhotometricInterpretation, Tag};
use tiff::{ColorType, TiffError};

use darkqa_base::error::{Error, Result};
use darkqa_base::files;
use darkqa_base::types::Digest;
use darkqa_pictures::raw_png::{RawPng, RawPngError, SampleForm};

/// Frame of a sensor: one number for each site.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Mosaic {
    pub(super) height: usize,
    pub(super) width: usize,
    /// Samples in ADU, row by row.
    pub(super) samples: Vec<u16>,
    pub(super) facts: FrameFacts,
}

/// Metadata of a frame.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct FrameFacts {
    pub(super) form: MosaicForm,
    /// Maker and model of the camera, if the file names them.
    pub(super) camera: Option<String>,
    /// Date of the frame, as in the file.
    pub(super) taken: Option<String>,
    /// Digest of the file.
    pub(super) digest: Digest,
}

impl Mosaic {
    /// Reads a file of at most `most_pixels` samples. The content decides the form, not the name.
    ///
    /// # Errors
    /// If the file cannot be read, is incomplete, or is not a mosaic: a RAW file of a maker, or an image with several
    /// channels, 8 bits, or a palette.
    pub(super) fn read(path: &Path, most_pixels: u64) -> Result<Self> {
        let bytes = files::bytes(path)?;
        let decoded = decode(path, &bytes, most_pixels).map_err(|problem| Error::data(path.display(), problem))?;
        Ok(Self {
            height: decoded.height,
            width: decoded.width,
            samples: decoded.samples,
            facts: FrameFacts {
                form: decoded.form,
                camera: decoded.camera,
                taken: decoded.taken,
                digest: Digest::from_bytes(&bytes),
            },
        })
    }
}

fn decode(path: &Path, bytes: &[u8], most_pixels: u64) -> Result<Decoded, String> {
    if bytes.is_empty() {
        return Err("the file is empty".to_owned());
    }
    if let Some(problem) = problem(path, bytes) {
        return Err(problem);
    }
    match bytes {
        [0x89, b'P', b'N', b'G', ..] => png(bytes, most_pixels),
        [b'P', b'1'..=b'7', ..] => decode_pgm(bytes, most_pixels),
        [b'I', b'I', 42 | 43, 0, ..] | [b'M', b'M', 0, 42 | 43, ..] => decode_tiff(bytes, most_pixels),
        [0xFF, 0xD8, ..] => Err(developed("a JPEG file")),
        _ => Err(format!("not a mosaic: a 16-bit PNG, a TIFF or a binary PGM expected; {EXPORT}")),
    }
}

fn png(bytes: &[u8], most_pixels: u64) -> Result<Decoded, String> {
    let png = RawPng::open(bytes, &[SampleForm::Grey16], most_pixels).map_err(|error| match error {
        RawPngError::Broken(problem) => format!("{problem}; copy or export it again"),
        RawPngError::TooLarge(problem) => format!("{problem}; raise --decode max-pixels"),
        RawPngError::OtherForm(problem) => developed(&problem),
    })?;
    let (height, width) = png.size;
    let samples = png.samples(|sample| sample).map_err(|problem| format!("{problem}; copy or export it again"))?;
    Ok(Decoded { height, width, samples, form: MosaicForm::Png, camera: None, taken: None })
}

/// Advice on exporting the mosaic of a RAW file.
const EXPORT: &str = "export the mosaic, for example as TIFF with `dcraw -D -4 -T -t 0 FILE` (`-t 0`: not turned), or rawpy's `raw_image_visible` as 16-bit PNG";

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
    height: usize,
    width: usize,
    samples: Vec<u16>,
    form: MosaicForm,
    camera: Option<String>,
    taken: Option<String>,
}

/// Error for a developed image.
fn developed(what: &str) -> String {
    format!("{what}: a developed image holds no sensor noise; {EXPORT}")
}

/// Error for a frame with too many samples; `None` within the limit.
fn too_large(width: usize, height: usize, most_pixels: u64) -> Option<String> {
    let pixels = (width as u64).saturating_mul(height as u64);
    (pixels > most_pixels).then(|| {
        format!("{width} × {height} pixels are more than the {most_pixels} that are read; raise --decode max-pixels")
    })
}

/// Tag of every DNG file (Adobe, Digital Negative Specification 1.7, DNGVersion).
const DNG_VERSION: Tag = Tag::Unknown(50706);

/// Decodes a file that starts with the signature of a TIFF.
fn decode_tiff(bytes: &[u8], most_pixels: u64) -> Result<Decoded, String> {
    let mut limits = Limits::default();
    let most_bytes = usize::try_from(most_pixels.saturating_mul(2)).unwrap_or(usize::MAX);
    limits.decoding_buffer_size = most_bytes;
    limits.intermediate_buffer_size = most_bytes;
    let mut decoder = Decoder::new(Cursor::new(bytes)).map_err(|e| not_readable(&e))?.with_limits(limits);
    let mut tag = |tag: Tag| decoder.find_tag(tag).ok().flatten();
    if tag(DNG_VERSION).is_some() {
        return Err(message("DNG"));
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

/// Decodes a file that starts with `P` and a digit.
fn decode_pgm(bytes: &[u8], most_pixels: u64) -> Result<Decoded, String> {
    let problem = match bytes[1] {
        b'5' => None,
        b'2' => Some("a PGM of text (P2); a binary one (P5) is read".to_owned()),
        b'3' | b'6' => Some(developed("a PPM of three channels")),
        _ => Some("a Netpbm file that is not a binary PGM (P5)".to_owned()),
    };
    if let Some(problem) = problem {
        return Err(problem);
    }
    let mut header = Header { bytes, at: 2 };
    let [width, height, maximum] = [header.number("width")?, header.number("height")?, header.number("maximum")?];
    if width == 0 || height == 0 {
        return Err(format!("{width} × {height} pixels are not an image"));
    }
    if let Some(problem) = too_large(width, height, most_pixels) {
        return Err(problem);
    }
    if maximum <= 255 {
        return Err(developed(&format!("a PGM of 8 bits (maximum {maximum})")));
    }
    let Ok(maximum) = u16::try_from(maximum) else {
        return Err(format!("the maximum {maximum} is above 65535, the largest of the format"));
    };
    // A single white-space character ends the header.
    let rest = bytes.get(header.at + 1..).unwrap_or_default();
    let expected = width * height * 2;
    if rest.len() != expected {
        let problem = if rest.len() < expected {
            "not a whole PGM: the file ends early"
        } else {
            "more than one image, or no PGM of 16 bits"
        };
        return Err(format!("{problem}: {} bytes of samples, {expected} expected", rest.len()));
    }
    let samples: Vec<u16> = rest.as_chunks::<2>().0.iter().map(|pair| u16::from_be_bytes(*pair)).collect();
    let largest = samples.iter().copied().max().unwrap_or(0);
    if largest > maximum {
        return Err(format!(
            "a sample of {largest} is above the maximum {maximum} of the header; samples are big-endian"
        ));
    }
    Ok(Decoded { height, width, samples, form: MosaicForm::Pgm(maximum), camera: None, taken: None })
}

/// Parser of the header of a file.
struct Header<'a> {
    bytes: &'a [u8],
    /// Offset of the next byte.
    at: usize,
}

impl Header<'_> {
    /// Parses the next number, after white space and comments.
    fn number(&mut self, name: &str) -> Result<usize, String> {
        let missing = || format!("not a readable PGM: no {name} in its header");
        loop {
            match self.bytes.get(self.at).ok_or_else(missing)? {
                b'#' => {
                    let rest = &self.bytes[self.at..];
                    let end = rest.iter().position(|byte| *byte == b'\n');
                    self.at += end.ok_or_else(missing)?;
                }
                byte if byte.is_ascii_whitespace() => self.at += 1,
                _ => break,
            }
        }
        let rest = &self.bytes[self.at..];
        // Ten digits are enough for any supported image.
        let length = rest.iter().take(10).take_while(|byte| byte.is_ascii_digit()).count();
        let number = std::str::from_utf8(&rest[..length]).ok().and_then(|digits| digits.parse().ok());
        self.at += length;
        let ends = self.bytes.get(self.at).is_some_and(u8::is_ascii_whitespace);
        number.filter(|_| ends).ok_or_else(missing)
    }
}

/// Extensions of RAW files, by maker: Adobe, Canon, Nikon, Sony, Olympus, Panasonic, Fujifilm, Pentax, Samsung, Leica,
/// Hasselblad, Phase One, Sigma, Kodak, Minolta, Epson.
const EXTENSIONS: [&str; 24] = [
    "dng", "cr2", "cr3", "crw", "nef", "nrw", "arw", "srf", "sr2", "orf", "rw2", "raw", "raf", "pef", "srw", "rwl",
    "3fr", "fff", "iiq", "x3f", "dcr", "kdc", "mrw", "erf",
];

/// Error for a RAW file of a maker, with advice on exporting its mosaic; `None` for other files.
fn problem(path: &Path, bytes: &[u8]) -> Option<String> {
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    let by_content = match bytes {
        [b'I', b'I', 42, 0, _, _, _, _, b'C', b'R', ..] => Some("cr2"),
        [_, _, _, _, b'f', b't', b'y', b'p', b'c', b'r', b'x', ..] => Some("cr3"),
        _ if bytes.starts_with(b"FUJIFILMCCD-RAW") => Some("raf"),
        _ => None,
    };
    let by_name = EXTENSIONS.into_iter().find(|known| extension == *known);
    let kind = by_content.or(by_name)?.to_ascii_uppercase();
    Some(message(&kind))
}

/// Error message for a RAW file of this kind.
fn message(kind: &str) -> String {
    format!("a {kind} file, the RAW format of a camera, is not read; {EXPORT}")
}
