//! [`FileFacts`]: the properties of an image file other than its pixels; unsupported, cut and damaged files.

use image::metadata::Orientation;

use super::exr_layers::ExrFile;
use super::format::FileFormat;
use super::jpeg_markers::{self, JpegProperties};
use super::png_chunks::{self, PngFault, PngOutline};
use super::tiff_tags::TiffProperties;
use super::webp_chunks::{self, WebpOutline};
use crate::colour::ColourTag;
use crate::reading_rule::ReadingRule;
use darkqa_ground::files::guarded::guarded;

/// The facts of a file beside its pixels.
#[derive(Debug)]
pub(super) struct FileFacts {
    /// The orientation that the file states; no turn if it states none, or none of the eight values.
    pub(super) orientation: Orientation,
    /// Kind of the file, if it has several pictures; only the first is read.
    pub(super) first_of: Option<&'static str>,
    pub(super) colour: ColourTag,
    pub(super) depth: Depth,
    /// The form of the inks of a JPEG of four components or a TIFF of four inks; `None` for other files.
    pub(super) inks: Option<InkForm>,
    /// Why the file cannot be shown as it is; `None` if nothing is known before it is decoded.
    pub(super) unshowable: Option<String>,
    /// The bytes that the file has at least if it is whole; `None` if its header does not tell.
    whole: Option<u64>,
}

/// The numbers that the samples of a file are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Depth {
    /// Codes of at most 8 bits.
    Eight,
    /// Codes of 16 bits.
    Sixteen,
    /// Floats, which are linear light.
    Float,
}

/// How a file holds amounts of ink.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum InkForm {
    /// A JPEG in which 0 is no ink.
    Plain,
    /// A JPEG in which 255 is no ink, as Adobe's programs write it.
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
        unshowable: None,
        whole: None,
    };

    pub(super) fn read(file: &[u8], format: FileFormat) -> Self {
        let of_exif = |exif: Option<&[u8]>| exif.and_then(Orientation::from_exif_chunk);
        let several = |pictures: usize, kind| (pictures > 1).then_some(kind);
        let profile =
            |profile: Option<Vec<u8>>| profile.map_or(ColourTag::None, ColourTag::Profile);
        let turn = |stated: Option<Orientation>| stated.unwrap_or(Orientation::NoTransforms);
        let deep = |bits| {
            if bits == 16 {
                Depth::Sixteen
            } else {
                Depth::Eight
            }
        };
        match format {
            FileFormat::Png => {
                let outline = PngOutline::parse(file);
                Self {
                    orientation: turn(of_exif(outline.exif)),
                    first_of: several(outline.frames, "animated PNG"),
                    colour: outline.colour,
                    depth: deep(outline.bits.into()),
                    ..Self::NONE
                }
            }
            FileFormat::Jpeg => {
                let outline = JpegProperties::parse(file);
                let form = if outline.is_adobe {
                    InkForm::Adobe
                } else {
                    InkForm::Plain
                };
                Self {
                    orientation: turn(of_exif(outline.exif)),
                    inks: (outline.components == Some(4)).then_some(form),
                    colour: profile(outline.profile()),
                    ..Self::NONE
                }
            }
            FileFormat::WebP => {
                let outline = WebpOutline::parse(file);
                Self {
                    orientation: turn(of_exif(outline.exif)),
                    first_of: several(outline.frames, "animated WebP"),
                    colour: profile(outline.profile.map(<[u8]>::to_vec)),
                    ..Self::NONE
                }
            }
            FileFormat::Tiff => {
                let outline = TiffProperties::parse(file);
                let stated = u8::try_from(outline.orientation).ok();
                Self {
                    orientation: turn(stated.and_then(Orientation::from_exif)),
                    first_of: several(outline.pages, "TIFF of several pages"),
                    colour: profile(outline.profile.map(<[u8]>::to_vec)),
                    depth: deep(outline.bits),
                    inks: outline.is_cmyk.then_some(InkForm::Tiff),
                    unshowable: unshowable(&outline),
                    whole: Some(outline.end),
                }
            }
            FileFormat::Bmp => Self::NONE,
            FileFormat::OpenExr => {
                let opened = guarded(|| ExrFile::open(file, &ReadingRule::UNBOUNDED)).ok();
                let layers = opened.as_ref().map_or(0, |file| file.layers);
                let primaries = opened.and_then(|file| file.primaries);
                Self {
                    first_of: several(layers, "OpenEXR of several layers"),
                    colour: primaries.map_or(ColourTag::None, ColourTag::Primaries),
                    depth: Depth::Float,
                    ..Self::NONE
                }
            }
        }
    }
}

/// Why a TIFF cannot be shown as it is; `None` if nothing is known before it is decoded.
fn unshowable(outline: &TiffProperties<'_>) -> Option<String> {
    if outline.is_raw {
        let problem = "a camera's RAW file: only its preview could be read; develop it to a 16-bit TIFF or PNG first";
        return Some(problem.to_owned());
    }
    if outline.is_float {
        let problem = "a TIFF of floating-point samples; 8 or 16 bits expected, or OpenEXR for linear light: convert it first";
        return Some(problem.to_owned());
    }
    let colours = outline.colours?;
    Some(format!("{colours}; convert it to RGB first"))
}

/// The first fault of a file that is cut or damaged; `None` if there is none.
pub(super) fn fault(file: &[u8], format: FileFormat, facts: &FileFacts) -> Option<String> {
    let cut = || format!("the file ends before its end mark, at byte {}", file.len());
    let short = |whole: u64| format!("the file ends at byte {} of {whole}", file.len());
    match format {
        FileFormat::Png => png_chunks::fault(file).map(|fault| match fault {
            PngFault::Cut => cut(),
            PngFault::Checksum => "a checksum in it is wrong".to_owned(),
        }),
        FileFormat::Jpeg => (!jpeg_markers::ends(file)).then(cut),
        FileFormat::WebP => webp_chunks::missing(file).map(short),
        FileFormat::Tiff => {
            let whole = facts.whole?;
            (whole > file.len() as u64).then(|| short(whole))
        }
        FileFormat::Bmp => {
            // The length of the file stands behind its mark; some programs leave it at 0.
            let length = file.get(2..6).and_then(|bytes| bytes.try_into().ok());
            let length = u64::from(length.map_or(0, u32::from_le_bytes));
            (length > file.len() as u64).then(|| short(length))
        }
        // The OpenEXR reader names the missing part.
        FileFormat::OpenExr => None,
    }
}
