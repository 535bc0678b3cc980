//! JPEG files: facts of their markers, standard Huffman tables, and CMYK.
//!
//! Facts of a JPEG file from its markers: [`JpegProperties`], and the check for its end marker: [`has_end`].
//!
//! The decoder converts CMYK to RGB without the ICC profile, and fills the missing part of a truncated file with grey.
//! Both must be detected here, because models would be asked about the wrong image.
//!
//! Huffman tables of JPEG frames without their own: [`with_standard_tables`].
//!
//! Ink amounts of a CMYK JPEG file: [`inks`].

use std::borrow::Cow;

use zune_core::bytestream::ZCursor;
use zune_core::colorspace::ColorSpace;
use zune_core::options::DecoderOptions;
use zune_jpeg::JpegDecoder;
use zune_jpeg::errors::DecodeErrors;

/// Start of the segment with the EXIF data (EXIF 2.32, section 4.5.5).
const EXIF: &[u8] = b"Exif\0\0";

/// Start of a segment with a part of an ICC profile.
const PROFILE: &[u8] = b"ICC_PROFILE\0";

/// Start of the segment that Adobe's programs write; with it, ink amounts are inverted.
const ADOBE: &[u8] = b"Adobe";

/// Markers of application segments: EXIF data (APP1), ICC profile (APP2), Adobe (APP14).
const APP1: u8 = 0xE1;
const APP2: u8 = 0xE2;
const APP14: u8 = 0xEE;

/// Marker before the coded samples (SOS). No headers follow it.
const START_OF_SCAN: u8 = 0xDA;

/// Facts in the headers of a JPEG file (ITU-T T.81, annex B).
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct JpegProperties<'a> {
    /// Number of components per pixel: 1 for grey, 3 for colour, 4 for CMYK or YCCK; `None` without a frame header.
    pub(super) components: Option<u8>,
    /// EXIF data (a TIFF structure), if the file has any.
    pub(super) exif: Option<&'a [u8]>,
    /// True if the file has Adobe's marker.
    pub(super) is_adobe: bool,
    /// Parts of the ICC profile with their numbers, from 1 (ICC.1:2022, section B.4).
    profile_parts: Vec<(u8, &'a [u8])>,
}

impl<'a> JpegProperties<'a> {
    /// Reads the markers in order, up to the coded samples or the end of a truncated file.
    pub(super) fn parse(file: &'a [u8]) -> Self {
        let mut properties = Self::default();
        for (marker, segment) in Segments(file).take_while(|(marker, _)| *marker != START_OF_SCAN) {
            if is_frame_header(marker) && properties.components.is_none() {
                // The number of components follows the precision (1 byte), height and width (2 bytes each).
                properties.components = segment.get(5).copied();
            }
            if marker == APP1 && properties.exif.is_none() {
                properties.exif = segment.strip_prefix(EXIF);
            }
            properties.is_adobe |= marker == APP14 && segment.starts_with(ADOBE);
            let part = segment.strip_prefix(PROFILE).filter(|_| marker == APP2);
            if let Some([number, _, part @ ..]) = part {
                properties.profile_parts.push((*number, part));
            }
        }
        properties
    }

    /// ICC profile, if the file has one.
    pub(super) fn profile(mut self) -> Option<Vec<u8>> {
        if self.profile_parts.is_empty() {
            return None;
        }
        self.profile_parts.sort_by_key(|(number, _)| *number);
        let parts: Vec<&[u8]> = self.profile_parts.iter().map(|(_, part)| *part).collect();
        Some(parts.concat())
    }
}

/// True if the file has its end marker (EOI).
pub(super) fn has_end(file: &[u8]) -> bool {
    Segments(file).any(|(marker, _)| marker == END)
}

/// Marker at the end of the file (EOI).
const END: u8 = 0xD9;

/// Iterator over the markers of a file with their segments, up to the end marker or the end of a truncated file.
pub(super) struct Segments<'a>(pub(super) &'a [u8]);

impl<'a> Iterator for Segments<'a> {
    type Item = (u8, &'a [u8]);

    fn next(&mut self) -> Option<Self::Item> {
        let (marker, rest) = next_marker(self.0)?;
        // If the file ends within this segment, the iteration ends.
        self.0 = &[];
        match marker {
            END => {}
            // Markers without a segment: the start, a restart within the samples, private use.
            0x01 | 0xD0..=0xD8 => self.0 = rest,
            _ => {
                let (segment, rest) = segment(rest)?;
                self.0 = rest;
                return Some((marker, segment));
            }
        }
        Some((marker, &[]))
    }
}

/// The next marker, and the bytes after it. In coded samples, 0xFF is followed by 0.
fn next_marker(bytes: &[u8]) -> Option<(u8, &[u8])> {
    let at = bytes.windows(2).position(|two| two[0] == 0xFF && !matches!(two[1], 0 | 0xFF))?;
    Some((bytes[at + 1], &bytes[at + 2..]))
}

/// The content of the first segment, and the bytes after it. The length field includes its own two bytes.
fn segment(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    let (length, rest) = bytes.split_first_chunk::<2>()?;
    rest.split_at_checked(usize::from(u16::from_be_bytes(*length)).checked_sub(2)?)
}

/// True for the markers SOF0 to SOF15. Three codes in that range are other markers (DHT, JPG, DAC).
fn is_frame_header(marker: u8) -> bool {
    matches!(marker, 0xC0..=0xCF) && !matches!(marker, 0xC4 | 0xC8 | 0xCC)
}

/// Marker of Huffman tables (DHT).
const HUFFMAN_TABLES: u8 = 0xC4;

/// Frame headers of sequential Huffman coding (SOF0 and SOF1).
const SEQUENTIAL: [u8; 2] = [0xC0, 0xC1];

/// The file with the standard Huffman tables before its first scan, if the scan uses one that the file does not define.
/// Cameras that deliver Motion JPEG over USB leave them out.
pub(super) fn with_standard_tables(file: &[u8]) -> Cow<'_, [u8]> {
    let mut segments = Segments(file);
    let (mut is_sequential, mut defined) = (false, Vec::new());
    while let Some((marker, segment)) = segments.next() {
        is_sequential |= SEQUENTIAL.contains(&marker);
        if marker == HUFFMAN_TABLES {
            defined.extend(table_ids(segment));
        }
        if marker == START_OF_SCAN {
            let missing: Vec<&StandardTable> = STANDARD.iter().filter(|table| !defined.contains(&table.id)).collect();
            let used = used_tables(segment);
            if !is_sequential || !missing.iter().any(|table| used.contains(&table.id)) {
                break;
            }
            // The marker and the length have two bytes each.
            let scan = file.len() - segments.0.len() - segment.len() - 4;
            let tables: Vec<u8> = missing.iter().flat_map(|table| table.segment()).collect();
            return Cow::Owned([&file[..scan], &tables, &file[scan..]].concat());
        }
    }
    Cow::Borrowed(file)
}

/// Classes and numbers of the tables in a segment.
fn table_ids(mut segment: &[u8]) -> Vec<u8> {
    let mut ids = Vec::new();
    while let Some((id, rest)) = segment.split_first()
        && let Some((counts, rest)) = rest.split_first_chunk::<16>()
    {
        ids.push(*id);
        let values: usize = counts.iter().map(|count| usize::from(*count)).sum();
        segment = rest.get(values..).unwrap_or_default();
    }
    ids
}

/// Classes and numbers of the tables that a scan uses (ITU-T T.81, section B.2.3).
fn used_tables(scan: &[u8]) -> Vec<u8> {
    let components = usize::from(scan.first().copied().unwrap_or(0));
    scan.iter().skip(2).step_by(2).take(components).flat_map(|numbers| [numbers >> 4, AC | (numbers & 15)]).collect()
}

/// Class of the tables for AC coefficients; that for DC coefficients is 0.
const AC: u8 = 0x10;

/// A Huffman table of ITU-T T.81, annex K.3.
struct StandardTable {
    /// Class and number.
    id: u8,
    /// Number of codes of each length, from 1 to 16 bits.
    counts: [u8; 16],
    values: &'static [u8],
}

impl StandardTable {
    /// The segment that defines the table.
    fn segment(&self) -> Vec<u8> {
        let length = (2 + 1 + 16 + self.values.len() as u16).to_be_bytes();
        [&[0xFF, HUFFMAN_TABLES][..], &length, &[self.id], &self.counts, self.values].concat()
    }
}

/// Tables K.3 to K.6, for luminance (0) and chrominance (1).
#[rustfmt::skip]
const STANDARD: [StandardTable; 4] = [
    StandardTable {
        id: 0,
        counts: [0, 1, 5, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0, 0, 0, 0],
        values: &[
            0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11,
        ],
    },
    StandardTable {
        id: AC,
        counts: [0, 2, 1, 3, 3, 2, 4, 3, 5, 5, 4, 4, 0, 0, 1, 125],
        values: &[
            1, 2, 3, 0, 4, 17, 5, 18, 33, 49, 65, 6, 19, 81, 97, 7, 34, 113, 20, 50, 129, 145, 161, 8,
            35, 66, 177, 193, 21, 82, 209, 240, 36, 51, 98, 114, 130, 9, 10, 22, 23, 24, 25, 26, 37, 38, 39, 40,
            41, 42, 52, 53, 54, 55, 56, 57, 58, 67, 68, 69, 70, 71, 72, 73, 74, 83, 84, 85, 86, 87, 88, 89,
            90, 99, 100, 101, 102, 103, 104, 105, 106, 115, 116, 117, 118, 119, 120, 121, 122, 131, 132, 133, 134, 135, 136, 137,
            138, 146, 147, 148, 149, 150, 151, 152, 153, 154, 162, 163, 164, 165, 166, 167, 168, 169, 170, 178, 179, 180, 181, 182,
            183, 184, 185, 186, 194, 195, 196, 197, 198, 199, 200, 201, 202, 210, 211, 212, 213, 214, 215, 216, 217, 218, 225, 226,
            227, 228, 229, 230, 231, 232, 233, 234, 241, 242, 243, 244, 245, 246, 247, 248, 249, 250,
        ],
    },
    StandardTable {
        id: 1,
        counts: [0, 3, 1, 1, 1, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0, 0],
        values: &[
            0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11,
        ],
    },
    StandardTable {
        id: AC | 1,
        counts: [0, 2, 1, 2, 4, 4, 3, 4, 7, 5, 4, 4, 0, 1, 2, 119],
        values: &[
            0, 1, 2, 3, 17, 4, 5, 33, 49, 6, 18, 65, 81, 7, 97, 113, 19, 34, 50, 129, 8, 20, 66, 145,
            161, 177, 193, 9, 35, 51, 82, 240, 21, 98, 114, 209, 10, 22, 36, 52, 225, 37, 241, 23, 24, 25, 26, 38,
            39, 40, 41, 42, 53, 54, 55, 56, 57, 58, 67, 68, 69, 70, 71, 72, 73, 74, 83, 84, 85, 86, 87, 88,
            89, 90, 99, 100, 101, 102, 103, 104, 105, 106, 115, 116, 117, 118, 119, 120, 121, 122, 130, 131, 132, 133, 134, 135,
            136, 137, 138, 146, 147, 148, 149, 150, 151, 152, 153, 154, 162, 163, 164, 165, 166, 167, 168, 169, 170, 178, 179, 180,
            181, 182, 183, 184, 185, 186, 194, 195, 196, 197, 198, 199, 200, 201, 202, 210, 211, 212, 213, 214, 215, 216, 217, 218,
            226, 227, 228, 229, 230, 231, 232, 233, 234, 242, 243, 244, 245, 246, 247, 248, 249, 250,
        ],
    },
];

/// Decodes the amounts of cyan, magenta, yellow and black of each pixel, row by row: 0 for none, 255 for full.
///
/// A file with Adobe's marker stores inverted amounts, and luma and chroma if the marker states YCCK (ITU-T T.872,
/// section 6.5.3). The default output of the decoder is not used, because it is RGB converted without the ICC profile.
///
/// # Errors
/// If the file is broken.
pub(super) fn inks(file: &[u8], has_adobe_marker: bool) -> Result<Vec<u8>, String> {
    let options = DecoderOptions::default().set_strict_mode(false).set_max_width(usize::MAX).set_max_height(usize::MAX);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(file), options);
    decoder.decode_headers().map_err(|e| decoding_error(&e))?;
    let stored = decoder.input_colorspace().unwrap_or(ColorSpace::CMYK);
    if stored.num_components() != 4 {
        return Err(format!("four components expected, not {stored:?}"));
    }
    decoder.set_options(options.jpeg_set_out_colorspace(stored));
    let mut samples = decoder.decode().map_err(|e| decoding_error(&e))?;
    if stored == ColorSpace::YCCK {
        for pixel in samples.as_chunks_mut::<4>().0 {
            let [y, cb, cr, black] = *pixel;
            let [red, green, blue] = rgb_from_ycbcr([y, cb, cr]);
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

fn decoding_error(e: &DecodeErrors) -> String {
    format!("not a whole image: {e}")
}

/// Converts luma and chroma to red, green and blue (JFIF 1.02).
fn rgb_from_ycbcr([y, cb, cr]: [u8; 3]) -> [u8; 3] {
    let [y, cb, cr] = [f64::from(y), f64::from(cb) - 128.0, f64::from(cr) - 128.0];
    [y + 1.402 * cr, y - 0.344_136 * cb - 0.714_136 * cr, y + 1.772 * cb]
        .map(|code| code.round().clamp(0.0, 255.0) as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD: [u8; 12] = [0xFF, 0xD8, 0xFF, 0xC2, 0, 8, 8, 0, 1, 0, 1, 4];

    const TAIL: [u8; 11] = [0xFF, 0xDA, 0, 3, 9, 0xFF, 0, 0xFF, 0xD3, 0xFF, 0xD9];

    #[test]
    fn a_truncated_file_is_read_up_to_its_end() {
        // A thumbnail in an application segment has its own header and end.
        let inner = [&[0xFF, 0xE1, 0, 16][..], &HEAD, &[0xFF, 0xD9]].concat();
        let mut grey = HEAD;
        grey[11] = 1;
        let file = [&grey[..2], &inner[..], &grey[2..], &TAIL].concat();
        assert_eq!(JpegProperties::parse(&file).components, Some(1));
        assert!(has_end(&file));
        for length in 0..file.len() {
            let expected = (length >= file.len() - TAIL.len()).then_some(1);
            let cut = &file[..length];
            let components = JpegProperties::parse(cut).components;
            assert_eq!(components, expected, "cut at {length}");
            assert!(!has_end(cut), "cut at {length}");
        }
    }

    #[test]
    fn a_wrong_segment_length_ends_parsing() {
        for length in [[0, 0], [0, 1], [0xFF, 0xFF]] {
            let file = [&[0xFF, 0xD8, 0xFF, 0xC0][..], &length, &TAIL].concat();
            assert_eq!(JpegProperties::parse(&file), JpegProperties::default());
            assert!(!has_end(&file));
        }
    }

    #[test]
    fn exif_data_are_found_only_before_the_samples() {
        let exif = [0xFF, 0xE1, 0, 10, b'E', b'x', b'i', b'f', 0, 0, 7, 9];
        let other = [0xFF, 0xE1, 0, 6, b'h', b't', b't', b'p'];
        let file = [&HEAD[..2], &other, &exif, &HEAD[2..], &TAIL].concat();
        assert_eq!(JpegProperties::parse(&file).exif, Some(&[7, 9][..]));
        let late = [&HEAD[..], &TAIL[..5], &exif, &TAIL[5..]].concat();
        assert_eq!(JpegProperties::parse(&late).exif, None);
    }

    /// A baseline JPEG of 32 × 24 pixels with the standard tables.
    fn jpeg(color: jpeg_encoder::ColorType, channels: usize) -> Vec<u8> {
        let mut bytes = Vec::new();
        let samples: Vec<u8> = (0..32 * 24 * channels).map(|i| (i * 7 % 251) as u8).collect();
        jpeg_encoder::Encoder::new(&mut bytes, 90).encode(&samples, 32, 24, color).unwrap();
        bytes
    }

    /// The file without its Huffman tables for which `is_kept` is false.
    fn without_tables(file: &[u8], is_kept: impl Fn(u8) -> bool) -> Vec<u8> {
        let (mut kept, mut rest) = (file[..2].to_vec(), &file[2..]);
        while rest[1] != START_OF_SCAN {
            let end = 2 + usize::from(u16::from_be_bytes([rest[2], rest[3]]));
            if rest[1] != HUFFMAN_TABLES || is_kept(rest[4]) {
                kept.extend(&rest[..end]);
            }
            rest = &rest[end..];
        }
        kept.extend(rest);
        kept
    }

    fn decoded(file: &[u8]) -> Vec<u8> {
        image::load_from_memory(file).unwrap().into_bytes()
    }

    #[test]
    fn missing_tables_are_the_standard_ones() {
        use jpeg_encoder::ColorType::{Luma, Rgb};
        for (color, channels) in [(Rgb, 3), (Luma, 1)] {
            let whole = jpeg(color, channels);
            for kept in [None, Some(0), Some(AC | 1)] {
                let cut = without_tables(&whole, |id| Some(id) == kept);
                assert!(cut.len() < whole.len());
                let completed = with_standard_tables(&cut);
                assert_eq!(decoded(&completed), decoded(&whole), "{channels} {kept:?}");
            }
        }
    }

    #[test]
    fn complete_and_progressive_files_are_not_changed() {
        let whole = jpeg(jpeg_encoder::ColorType::Rgb, 3);
        assert!(matches!(with_standard_tables(&whole), Cow::Borrowed(_)));
        // A grey scan uses the first two tables alone.
        let grey = jpeg(jpeg_encoder::ColorType::Luma, 1);
        let grey = without_tables(&grey, |id| matches!(id, 0 | AC));
        assert!(matches!(with_standard_tables(&grey), Cow::Borrowed(_)));
        let mut progressive = without_tables(&whole, |_| false);
        let frame = progressive.windows(2).position(|two| two == [0xFF, 0xC0]).unwrap();
        progressive[frame + 1] = 0xC2;
        assert!(matches!(with_standard_tables(&progressive), Cow::Borrowed(_)));
    }

    #[test]
    fn damaged_files_are_not_changed() {
        let whole = without_tables(&jpeg(jpeg_encoder::ColorType::Rgb, 3), |_| false);
        let scan = whole.windows(2).position(|two| two == [0xFF, START_OF_SCAN]).unwrap();
        for length in 0..scan + 4 {
            assert!(matches!(with_standard_tables(&whole[..length]), Cow::Borrowed(_)));
        }
    }
}
