//! Facts of a JPEG file from its markers: [`JpegProperties`], and the check for its end marker: [`has_end`].
//!
//! The decoder converts CMYK to RGB without the ICC profile, and fills the missing part of a truncated file with grey.
//! Both must be detected here, because models would be asked about the wrong image.

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
pub(super) const START_OF_SCAN: u8 = 0xDA;

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
}
