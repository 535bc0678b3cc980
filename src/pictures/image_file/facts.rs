//! Facts in the headers of an image file ([`FileFacts`]), and detection of truncated and damaged files ([`fault`]).

use image::metadata::Orientation;

use super::exr_layers::ExrFile;
use super::format::FileFormat;
use super::jpeg_markers::{self, JpegProperties};
use super::png_chunks::{self, PngFault, PngProperties};
use super::tiff_tags::TiffProperties;
use super::webp_chunks::{self, WebpProperties};
use crate::colour::ColourTag;
use crate::decode_rule::DecodeRule;
use darkqa_base::files::guarded::guarded;

/// Facts in the headers of an image file that decide how it is decoded.
#[derive(Debug)]
pub(super) struct FileFacts {
    /// EXIF orientation; no transform if it is missing or invalid.
    pub(super) orientation: Orientation,
    /// Kind of a file with several pictures, of which only the first is read; else `None`.
    pub(super) first_of: Option<&'static str>,
    pub(super) colour: ColourTag,
    pub(super) depth: Depth,
    /// Form of the ink amounts of a CMYK file; `None` for other files.
    pub(super) inks: Option<InkForm>,
    /// Reason why the file is not supported; `None` if the headers show none.
    pub(super) unsupported: Option<String>,
    /// Minimum length of the complete file, in bytes; `None` if the headers do not tell.
    complete_length: Option<u64>,
}

/// Number type of the samples of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Depth {
    /// Codes of at most 8 bits.
    Eight,
    /// Codes of 16 bits.
    Sixteen,
    /// Floats, which are linear light.
    Float,
}

/// Form of the ink amounts of a CMYK file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum InkForm {
    /// A JPEG in which 0 is no ink.
    Plain,
    /// A JPEG in which 255 is no ink, as written by Adobe's programs.
    Adobe,
    /// A TIFF, in which 0 is no ink.
    Tiff,
}

impl FileFacts {
    pub(super) const NONE: Self = Self {
        orientation: Orientation::NoTransforms,
        first_of: None,
        colour: ColourTag::None,
        depth: Depth::Eight,
        inks: None,
        unsupported: None,
        complete_length: None,
    };

    pub(super) fn read(file: &[u8], format: FileFormat) -> Self {
        match format {
            FileFormat::Png => {
                let properties = PngProperties::parse(file);
                Self {
                    orientation: exif_orientation(properties.exif),
                    first_of: kind_if_several(properties.frames, "animated PNG"),
                    colour: properties.colour,
                    depth: code_depth(properties.bits.into()),
                    ..Self::NONE
                }
            }
            FileFormat::Jpeg => {
                let properties = JpegProperties::parse(file);
                let form = if properties.is_adobe { InkForm::Adobe } else { InkForm::Plain };
                Self {
                    orientation: exif_orientation(properties.exif),
                    inks: (properties.components == Some(4)).then_some(form),
                    colour: profile_tag(properties.profile()),
                    ..Self::NONE
                }
            }
            FileFormat::WebP => {
                let properties = WebpProperties::parse(file);
                Self {
                    orientation: exif_orientation(properties.exif),
                    first_of: kind_if_several(properties.frames, "animated WebP"),
                    colour: profile_tag(properties.profile.map(<[u8]>::to_vec)),
                    ..Self::NONE
                }
            }
            FileFormat::Tiff => {
                let properties = TiffProperties::parse(file);
                let stated = u8::try_from(properties.orientation).ok();
                Self {
                    orientation: stated.and_then(Orientation::from_exif).unwrap_or(Orientation::NoTransforms),
                    first_of: kind_if_several(properties.pages, "TIFF of several pages"),
                    colour: profile_tag(properties.profile.map(<[u8]>::to_vec)),
                    depth: code_depth(properties.bits),
                    inks: properties.is_cmyk.then_some(InkForm::Tiff),
                    unsupported: unsupported_tiff(&properties),
                    complete_length: Some(properties.end),
                }
            }
            FileFormat::Bmp => Self::NONE,
            FileFormat::OpenExr => {
                let opened = guarded(|| ExrFile::open(file, &DecodeRule::UNBOUNDED)).ok();
                let layers = opened.as_ref().map_or(0, |file| file.layers);
                let primaries = opened.and_then(|file| file.primaries);
                Self {
                    first_of: kind_if_several(layers, "OpenEXR of several layers"),
                    colour: primaries.map_or(ColourTag::None, ColourTag::Primaries),
                    depth: Depth::Float,
                    ..Self::NONE
                }
            }
        }
    }
}

fn exif_orientation(exif: Option<&[u8]>) -> Orientation {
    exif.and_then(Orientation::from_exif_chunk).unwrap_or(Orientation::NoTransforms)
}

fn kind_if_several(pictures: usize, kind: &'static str) -> Option<&'static str> {
    (pictures > 1).then_some(kind)
}

fn profile_tag(profile: Option<Vec<u8>>) -> ColourTag {
    profile.map_or(ColourTag::None, ColourTag::Profile)
}

fn code_depth(bits: u64) -> Depth {
    if bits == 16 { Depth::Sixteen } else { Depth::Eight }
}

/// Reason why a TIFF file is not supported; `None` if its tags show none.
fn unsupported_tiff(properties: &TiffProperties<'_>) -> Option<String> {
    if properties.is_raw {
        let problem = "a camera's RAW file: only its preview could be read; develop it to a 16-bit TIFF or PNG first";
        return Some(problem.to_owned());
    }
    if let Some(compression) = &properties.unread_compression {
        return Some(format!(
            "a TIFF of the compression {compression}, which is not read; save it with LZW or deflate first"
        ));
    }
    if properties.is_float {
        let problem =
            "a TIFF of floating-point samples; 8 or 16 bits expected, or OpenEXR for linear light: convert it first";
        return Some(problem.to_owned());
    }
    let colours = properties.colours?;
    Some(format!("{colours}; convert it to RGB first"))
}

/// The first fault of a truncated or damaged file; `None` for a complete one.
pub(super) fn fault(file: &[u8], format: FileFormat, facts: &FileFacts) -> Option<String> {
    match format {
        FileFormat::Png => png_chunks::fault(file).map(|fault| match fault {
            PngFault::Cut => no_end_mark(file),
            PngFault::Checksum => "a checksum in it is wrong".to_owned(),
        }),
        FileFormat::Jpeg => (!jpeg_markers::has_end(file)).then(|| no_end_mark(file)),
        FileFormat::WebP => truncation(file, webp_chunks::stated_length(file)?),
        FileFormat::Tiff => truncation(file, facts.complete_length?),
        FileFormat::Bmp => {
            // The header states the length of the file; some programs leave it at 0.
            let length = file.get(2..6).and_then(|bytes| bytes.try_into().ok())?;
            truncation(file, u64::from(u32::from_le_bytes(length)))
        }
        // The OpenEXR reader names the missing part.
        FileFormat::OpenExr => None,
    }
}

fn no_end_mark(file: &[u8]) -> String {
    format!("the file ends before its end mark, at byte {}", file.len())
}

/// The fault of a file that is shorter than `complete_length` bytes; `None` if it is not.
fn truncation(file: &[u8], complete_length: u64) -> Option<String> {
    (complete_length > file.len() as u64).then(|| format!("the file ends at byte {} of {complete_length}", file.len()))
}
