//! Facts in the headers of an image file ([`FileFacts`]), and detection of truncated and damaged files ([`fault`]).
//!
//! Parser for the tags of the first image in a TIFF file: [`TiffProperties`].
//!
//! The decoder of the crate `tiff` is not enough here. It returns no tags if it cannot decode the first image (a
//! camera's RAW file, a mask, a broken file). It returns no tag longer than 1 MiB, and some ICC profiles are longer.
//! For some compressions it decodes the missing part of a truncated file as if it were samples.
//!
//! The format is that of TIFF 6.0, section 2, and BigTIFF as in libtiff.

use std::collections::BTreeSet;

use image::metadata::Orientation;

use super::exr_layers::ExrFile;
use super::format::FileFormat;
use super::jpeg::{self, JpegProperties};
use super::png_chunks::{self, PngFault, PngProperties, WebpProperties};
use crate::colour::ColourTag;
use crate::decode_rule::DecodeRule;
use darkqa_base::files::guarded;

/// Facts in the headers of an image file that decide how it is decoded.
#[derive(Debug)]
pub(super) struct FileFacts {
    /// EXIF orientation; no transform if it is missing or invalid.
    pub(super) orientation: Orientation,
    /// Exposure value at ISO 100 of the camera's settings in the EXIF data; `None` if they are missing or invalid.
    pub(super) exposure_value: Option<f64>,
    /// Kind of a file with several pictures, of which only the first is read; else `None`.
    pub(super) first_of: Option<&'static str>,
    pub(super) colour: ColourTag,
    pub(super) depth: SampleType,
    /// Form of the ink amounts of a CMYK file; `None` for other files.
    pub(super) inks: Option<InkForm>,
    /// Reason why the file is not supported; `None` if the headers show none.
    pub(super) unsupported: Option<String>,
    /// Minimum length of the complete file, in bytes; `None` if the headers do not tell.
    complete_length: Option<u64>,
}

/// Number type of the samples of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum SampleType {
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
        exposure_value: None,
        first_of: None,
        colour: ColourTag::None,
        depth: SampleType::Eight,
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
                    exposure_value: properties.exif.and_then(exposure_value),
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
                    exposure_value: properties.exif.and_then(exposure_value),
                    inks: (properties.components == Some(4)).then_some(form),
                    colour: profile_tag(properties.profile()),
                    ..Self::NONE
                }
            }
            FileFormat::WebP => {
                let properties = WebpProperties::parse(file);
                Self {
                    orientation: exif_orientation(properties.exif),
                    exposure_value: properties.exif.and_then(exposure_value),
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
                    exposure_value: None,
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
                    depth: SampleType::Float,
                    ..Self::NONE
                }
            }
        }
    }
}

fn exif_orientation(exif: Option<&[u8]>) -> Orientation {
    exif.and_then(Orientation::from_exif_chunk).unwrap_or(Orientation::NoTransforms)
}

/// Exposure value at ISO 100 of the settings in EXIF data: log₂(N² / t) − log₂(S / 100), with the aperture N (`FNumber`),
/// the exposure time t in seconds (`ExposureTime`) and the sensitivity S (`PhotographicSensitivity`), as in APEX (EXIF
/// 2.32, annex C); `None` if one of them is missing or not above 0.
fn exposure_value(exif: &[u8]) -> Option<f64> {
    let fields = guarded(|| exif::Reader::new().read_raw(exif.to_vec()).map_err(|e| e.to_string())).ok()?;
    let number = |tag| {
        let value = &fields.get_field(tag, exif::In::PRIMARY)?.value;
        let number = match value {
            exif::Value::Rational(values) => values.first()?.to_f64(),
            value => f64::from(value.get_uint(0)?),
        };
        Some(number).filter(|number| number.is_finite() && *number > 0.0)
    };
    let aperture = number(exif::Tag::FNumber)?;
    let (time, sensitivity) = (number(exif::Tag::ExposureTime)?, number(exif::Tag::PhotographicSensitivity)?);
    Some(libm::log2(aperture * aperture / time) - libm::log2(sensitivity / 100.0))
}

fn kind_if_several(pictures: usize, kind: &'static str) -> Option<&'static str> {
    (pictures > 1).then_some(kind)
}

fn profile_tag(profile: Option<Vec<u8>>) -> ColourTag {
    profile.map_or(ColourTag::None, ColourTag::Profile)
}

fn code_depth(bits: u64) -> SampleType {
    if bits == 16 { SampleType::Sixteen } else { SampleType::Eight }
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
    // The crate `tiff` 0.11.3 takes the bits of 32-bit integers for floats.
    if properties.bits > 16 {
        return Some(format!("a TIFF of {}-bit integers; 8 or 16 bits expected: convert it first", properties.bits));
    }
    let layout = properties.unread_layout.map(|layout| format!("a TIFF {layout}, which is not read; save it again"));
    layout.or_else(|| Some(format!("{}; convert it to RGB first", properties.colours?)))
}

/// The first fault of a truncated or damaged file; `None` for a complete one.
pub(super) fn fault(file: &[u8], format: FileFormat, facts: &FileFacts) -> Option<String> {
    match format {
        FileFormat::Png => png_chunks::fault(file).map(|fault| match fault {
            PngFault::Cut => no_end_mark(file),
            PngFault::Checksum => "a checksum in it is wrong".to_owned(),
        }),
        FileFormat::Jpeg => (!jpeg::has_end(file)).then(|| no_end_mark(file)),
        FileFormat::WebP => truncation(file, png_chunks::stated_length(file)?),
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

/// Maximum number of directories counted after the first (chosen). The limit also ends a circular chain.
const MAX_PAGES: usize = 10_000;

/// Maximum number of entries of a directory that are read (chosen): real ones have fewer than 100. A stated count may
/// be any number.
const MAX_ENTRIES: u64 = 4096;

/// Maximum number of values read from a tag (chosen). The tallest image has fewer strips, even at one row per strip.
const MAX_VALUES: u64 = 1 << 20;

// Tags (TIFF 6.0, appendix A; DNG 1.7).
const NEW_SUBFILE_TYPE: u16 = 254;
const BITS_PER_SAMPLE: u16 = 258;
const COMPRESSION: u16 = 259;
const PHOTOMETRIC: u16 = 262;
const FILL_ORDER: u16 = 266;
const STRIP_OFFSETS: u16 = 273;
const ORIENTATION: u16 = 274;
const SAMPLES_PER_PIXEL: u16 = 277;
const STRIP_BYTE_COUNTS: u16 = 279;
const PLANAR_CONFIGURATION: u16 = 284;
const TILE_OFFSETS: u16 = 324;
const TILE_BYTE_COUNTS: u16 = 325;
const INK_SET: u16 = 332;
const SAMPLE_FORMAT: u16 = 339;
const ICC_PROFILE: u16 = 34675;
const DNG_VERSION: u16 = 50706;

/// Photometric interpretation for ink amounts, usually CMYK.
const SEPARATED: u64 = 5;

/// Sample format for IEEE floats.
const FLOAT: u64 = 3;

/// Properties of a TIFF file that decide how it is decoded.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct TiffProperties<'a> {
    /// Orientation, 1 to 8, as in EXIF; 0 without the tag.
    pub(super) orientation: u64,
    /// Number of pages. Reduced-resolution copies after the first page are not counted.
    pub(super) pages: usize,
    /// True for interleaved samples of cyan, magenta, yellow and black with 8 bits each.
    pub(super) is_cmyk: bool,
    /// Description of an unsupported colour space; `None` for grey, RGB and the inks of `is_cmyk`.
    pub(super) colours: Option<&'static str>,
    /// ICC profile, if the file has one.
    pub(super) profile: Option<&'a [u8]>,
    /// True for a camera's RAW file: its first image is a preview, or it is a DNG file.
    pub(super) is_raw: bool,
    /// Bits per sample.
    pub(super) bits: u64,
    /// True if the samples are floats.
    pub(super) is_float: bool,
    /// Description of an arrangement of the pixels that is not read; `None` for one that is.
    pub(super) unread_layout: Option<&'static str>,
    /// Name of a compression that is not read; `None` for one that is.
    pub(super) unread_compression: Option<String>,
    /// Byte offset at which the last strip or tile of the first image ends.
    pub(super) end: u64,
}

impl<'a> TiffProperties<'a> {
    /// Parses the tags. Fields whose tags cannot be read have default values.
    pub(super) fn parse(file: &'a [u8]) -> Self {
        let mut properties = Self::default();
        let Some((reader, first)) = Reader::open(file) else {
            return properties;
        };
        let Some((directory, mut next)) = reader.directory(first) else {
            return properties;
        };
        let value = |tag| reader.first_value(&directory, tag);
        properties.pages = 1;
        properties.orientation = value(ORIENTATION).unwrap_or(0);
        properties.bits = value(BITS_PER_SAMPLE).unwrap_or(1);
        properties.is_cmyk = value(PHOTOMETRIC) == Some(SEPARATED)
            && properties.bits == 8
            && value(SAMPLES_PER_PIXEL) == Some(4)
            && value(INK_SET).is_none_or(|set| set == 1)
            && value(PLANAR_CONFIGURATION).is_none_or(|planes| planes == 1);
        if !properties.is_cmyk {
            properties.colours = unsupported_colours(value(PHOTOMETRIC));
        }
        properties.profile = reader.bytes(&directory, ICC_PROFILE);
        let is_preview = value(NEW_SUBFILE_TYPE).is_some_and(is_reduced);
        properties.is_raw = is_preview || directory.iter().any(|entry| entry.tag == DNG_VERSION);
        properties.is_float = value(SAMPLE_FORMAT) == Some(FLOAT);
        let has_planes_in_tiles = value(PLANAR_CONFIGURATION) == Some(2) && value(TILE_OFFSETS).is_some();
        // The crate `tiff` 0.11.3 ignores the order of bits, and fails on tiles with separate planes.
        properties.unread_layout = if value(FILL_ORDER) == Some(2) {
            Some("whose bytes begin with their lowest bit (FillOrder 2)")
        } else {
            has_planes_in_tiles.then_some("of tiles with separate colour planes")
        };
        properties.unread_compression = value(COMPRESSION).and_then(unread_compression);
        for (offsets, counts) in [(STRIP_OFFSETS, STRIP_BYTE_COUNTS), (TILE_OFFSETS, TILE_BYTE_COUNTS)] {
            let end = reader
                .values(&directory, offsets)
                .zip(reader.values(&directory, counts))
                .map(|(offset, count)| offset.saturating_add(count))
                .max()
                .unwrap_or(0);
            properties.end = properties.end.max(end);
        }
        let mut visited = BTreeSet::from([first]);
        while visited.len() < MAX_PAGES
            && visited.insert(next)
            && let Some((directory, following)) = reader.directory(next)
        {
            let kind = reader.first_value(&directory, NEW_SUBFILE_TYPE);
            properties.pages += usize::from(!kind.is_some_and(is_copy_or_mask));
            next = following;
        }
        properties
    }
}

/// True if the subfile type marks a reduced-resolution copy of another image.
fn is_reduced(subfile_type: u64) -> bool {
    subfile_type & 1 == 1
}

/// True if the subfile type marks a copy of reduced resolution or a transparency mask of another image.
fn is_copy_or_mask(subfile_type: u64) -> bool {
    subfile_type & 0b101 != 0
}

/// Name of a compression without a decoder here; `None` for one that is read.
fn unread_compression(method: u64) -> Option<String> {
    Some(match method {
        // In this order: none, fax group 4, LZW, JPEG, deflate, PackBits, deflate by its first number.
        1 | 4 | 5 | 7 | 8 | 32773 | 32946 => return None,
        2 | 3 => "fax (CCITT group 3)".to_owned(),
        6 => "JPEG in the form of TIFF 6.0".to_owned(),
        33003..=33005 | 34712 => "JPEG 2000".to_owned(),
        22610 | 34934 => "JPEG XR".to_owned(),
        34887 => "LERC".to_owned(),
        34925 => "LZMA".to_owned(),
        34933 => "PNG".to_owned(),
        50000 => "ZSTD".to_owned(),
        50001 => "WebP".to_owned(),
        50002 | 52546 => "JPEG XL".to_owned(),
        other => format!("method {other}"),
    })
}

/// Description of an unsupported colour space; `None` for a supported one or without the tag.
fn unsupported_colours(photometric: Option<u64>) -> Option<&'static str> {
    match photometric? {
        // In this order: grey with 0 as white, grey with 0 as black, RGB.
        0..=2 => None,
        3 => Some("a TIFF of palette colours"),
        4 => Some("a mask"),
        6 => Some("a TIFF of YCbCr colours"),
        SEPARATED => Some("a CMYK image of another form than four inks of 8 bits, pixel by pixel"),
        8..=10 => Some("a Lab image"),
        32803 | 34892 => Some("a camera's RAW file"),
        _ => Some("an image of unknown colours"),
    }
}

/// One tag of an image file directory.
struct DirectoryEntry {
    tag: u16,
    value_type: u16,
    /// Number of values.
    count: u64,
    /// Byte offset of the values in the file.
    offset: u64,
}

/// Reader of a TIFF file in its byte order.
struct Reader<'a> {
    file: &'a [u8],
    is_big_endian: bool,
    /// True for BigTIFF, whose offsets have 8 bytes.
    is_big_tiff: bool,
}

impl<'a> Reader<'a> {
    /// Opens a file. Returns its reader and the offset of the first directory; `None` if the header is truncated.
    fn open(file: &'a [u8]) -> Option<(Self, u64)> {
        let is_big_endian = file.starts_with(b"MM");
        let mut reader = Self { file, is_big_endian, is_big_tiff: false };
        reader.is_big_tiff = reader.read_uint(2, 2)? == 43;
        let first = if reader.is_big_tiff { reader.read_uint(8, 8)? } else { reader.read_uint(4, 4)? };
        Some((reader, first))
    }

    /// Reads an unsigned integer of 1, 2, 4 or 8 bytes; `None` past the end of the file.
    fn read_uint(&self, offset: u64, size: usize) -> Option<u64> {
        let start = usize::try_from(offset).ok()?;
        let bytes = self.file.get(start..start.checked_add(size)?)?;
        let mut padded = [0; 8];
        Some(if self.is_big_endian {
            padded[8 - size..].copy_from_slice(bytes);
            u64::from_be_bytes(padded)
        } else {
            padded[..size].copy_from_slice(bytes);
            u64::from_le_bytes(padded)
        })
    }

    /// Reads the entries of a directory and the offset of the next one (0 after the last); `None` at offset 0 or if an
    /// entry is truncated.
    fn directory(&self, at: u64) -> Option<(Vec<DirectoryEntry>, u64)> {
        if at == 0 {
            return None;
        }
        let (count_size, offset_size) = if self.is_big_tiff { (8, 8) } else { (2, 4) };
        let count = self.read_uint(at, count_size)?;
        let entry_size = 4 + 2 * offset_size as u64;
        let count = count.min(MAX_ENTRIES);
        let mut entries = Vec::new();
        let mut entry = at.checked_add(count_size as u64)?;
        for _ in 0..count {
            let (tag, value_type) = (self.read_uint(entry, 2)? as u16, self.read_uint(entry + 2, 2)? as u16);
            let count = self.read_uint(entry + 4, offset_size)?;
            let inline = entry + 4 + offset_size as u64;
            let length = count.saturating_mul(size_of_type(value_type));
            let offset = if length <= offset_size as u64 { inline } else { self.read_uint(inline, offset_size)? };
            entries.push(DirectoryEntry { tag, value_type, count, offset });
            entry = entry.checked_add(entry_size)?;
        }
        Some((entries, self.read_uint(entry, offset_size).unwrap_or(0)))
    }

    /// Returns the bytes of a tag; `None` if the directory lacks it or the file ends too early.
    fn bytes(&self, directory: &[DirectoryEntry], tag: u16) -> Option<&'a [u8]> {
        let entry = directory.iter().find(|entry| entry.tag == tag)?;
        let start = usize::try_from(entry.offset).ok()?;
        let end = start.checked_add(usize::try_from(entry.count).ok()?)?;
        self.file.get(start..end)
    }

    /// Reads the values of a tag as unsigned integers, up to the end of the file; none if the directory lacks the tag.
    fn values(&self, directory: &[DirectoryEntry], tag: u16) -> impl Iterator<Item = u64> {
        let entry = directory.iter().find(|entry| entry.tag == tag);
        let (offset, count, size) =
            entry.map_or((0, 0, 1), |entry| (entry.offset, entry.count, size_of_type(entry.value_type)));
        (0..count.min(MAX_VALUES))
            .map(move |index| offset.checked_add(index * size))
            .map_while(move |offset| self.read_uint(offset?, size as usize))
    }

    /// Reads the first value of a tag; `None` if the directory lacks the tag.
    fn first_value(&self, directory: &[DirectoryEntry], tag: u16) -> Option<u64> {
        self.values(directory, tag).next()
    }
}

/// Size in bytes of one value of an unsigned integer type; 1 for every other type.
fn size_of_type(value_type: u16) -> u64 {
    match value_type {
        3 => 2,
        4 | 13 => 4,
        16 | 18 => 8,
        _ => 1,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Size of a directory with only a subfile type, in bytes.
    const DIRECTORY_SIZE: u32 = 18;

    /// A TIFF file whose directories have these subfile types and indexes of their next directory.
    fn file(directories: &[(u32, Option<u32>)]) -> Vec<u8> {
        let mut file = [&b"II*\0"[..], &8_u32.to_le_bytes()].concat();
        for (subfile_type, next) in directories {
            let next = next.map_or(0, |index| 8 + index * DIRECTORY_SIZE);
            for number in [1_u16, NEW_SUBFILE_TYPE, 4] {
                file.extend(number.to_le_bytes());
            }
            for number in [1, *subfile_type, next] {
                file.extend(number.to_le_bytes());
            }
        }
        file
    }

    #[test]
    fn parsing_ends_for_cyclic_directories() {
        let circle = file(&[(0, Some(1)), (0, Some(2)), (0, Some(1))]);
        assert_eq!(TiffProperties::parse(&circle).pages, 3);
    }

    #[test]
    fn copies_and_masks_are_no_pages() {
        let masked = file(&[(0, Some(1)), (4, Some(2)), (1, None)]);
        assert_eq!(TiffProperties::parse(&masked).pages, 1);
    }

    /// EXIF data in Intel order with an aperture, an exposure time (fractions) and a sensitivity.
    fn camera(aperture: [u32; 2], time: [u32; 2], sensitivity: u16) -> Vec<u8> {
        let entry = |tag: u16, kind: u16, value: u32| {
            [&tag.to_le_bytes()[..], &kind.to_le_bytes(), &1_u32.to_le_bytes(), &value.to_le_bytes()].concat()
        };
        let (exif, values) = (8 + 2 + 12 + 4, 8 + 2 + 12 + 4 + 2 + 3 * 12 + 4);
        [
            &b"II*\0"[..],
            &8_u32.to_le_bytes(),
            &1_u16.to_le_bytes(),
            // The directory of the camera's settings.
            &entry(0x8769, 4, exif),
            &[0; 4],
            &3_u16.to_le_bytes(),
            &entry(0x829A, 5, values),
            &entry(0x829D, 5, values + 8),
            &entry(0x8827, 3, sensitivity.into()),
            &[0; 4],
            &[time, aperture].concat().iter().flat_map(|number| number.to_le_bytes()).collect::<Vec<u8>>(),
        ]
        .concat()
    }

    #[test]
    fn exposure_values_follow_apex() {
        // f/1 for 1 s at ISO 100 is the zero of the scale; each stop of the three settings is one value.
        for (aperture, time, sensitivity, expected) in [
            ([1, 1], [1, 1], 100, 0.0),
            ([2, 1], [1, 1], 100, 2.0),
            ([1, 1], [1, 8], 100, 3.0),
            ([1, 1], [1, 1], 1600, -4.0),
            ([28, 10], [1, 50], 400, 6.615),
        ] {
            let found = exposure_value(&camera(aperture, time, sensitivity)).unwrap();
            assert!((found - expected).abs() < 0.001, "{found} for {expected}");
        }
        for (aperture, time, sensitivity) in
            [([0, 1], [1, 1], 100), ([1, 0], [1, 1], 100), ([1, 1], [0, 1], 100), ([1, 1], [1, 1], 0)]
        {
            assert_eq!(exposure_value(&camera(aperture, time, sensitivity)), None);
        }
        let complete = camera([2, 1], [1, 1], 100);
        for length in 0..complete.len() {
            assert_eq!(exposure_value(&complete[..length]), None, "{length} bytes");
        }
    }
}
