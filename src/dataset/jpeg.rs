//! The number of components and the end of a JPEG file, read from its markers: [`JpegOutline`].
//!
//! The decoder converts CMYK to RGB without an error, and fills the missing part of a truncated file with grey. Models
//! would be asked about either as if it were the image.

/// The facts of a JPEG file that its markers hold (ITU-T T.81, annex B).
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct JpegOutline {
    /// The components of a pixel: 1 for grey, 3 for colour, 4 for CMYK or YCCK; `None` without a frame header.
    pub(super) components: Option<u8>,
    /// Whether the file has its end marker (EOI).
    pub(super) ends: bool,
}

impl JpegOutline {
    /// Reads the markers one after another; a truncated file is read up to its end.
    pub(super) fn of(file: &[u8]) -> Self {
        let mut outline = Self::default();
        let mut rest = file;
        while let Some((marker, after)) = next_marker(rest) {
            rest = after;
            match marker {
                0xD9 => {
                    outline.ends = true;
                    break;
                }
                // Markers without a segment: the start, a restart within the samples, private use.
                0x01 | 0xD0..=0xD8 => {}
                _ => {
                    let Some((segment, after)) = segment(rest) else {
                        break;
                    };
                    if is_frame_header(marker) && outline.components.is_none() {
                        // It follows the precision (1 byte), the height and the width (2 bytes each).
                        outline.components = segment.get(5).copied();
                    }
                    rest = after;
                }
            }
        }
        outline
    }
}

/// The code of the next marker, and the bytes after it. In coded samples, 0xFF is followed by 0.
fn next_marker(bytes: &[u8]) -> Option<(u8, &[u8])> {
    let at = bytes
        .windows(2)
        .position(|two| two[0] == 0xFF && !matches!(two[1], 0 | 0xFF))?;
    Some((bytes[at + 1], &bytes[at + 2..]))
}

/// The content of the first segment, and the bytes after it. Its length field counts its own two bytes.
fn segment(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    let (length, rest) = bytes.split_first_chunk::<2>()?;
    rest.split_at_checked(usize::from(u16::from_be_bytes(*length)).checked_sub(2)?)
}

/// Whether a marker is one of SOF0 to SOF15. Three codes in that range mean something else (DHT, JPG, DAC).
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
        assert_eq!(
            JpegOutline::of(&file),
            JpegOutline {
                components: Some(1),
                ends: true
            }
        );
        for length in 0..file.len() {
            let components = (length >= file.len() - TAIL.len()).then_some(1);
            assert_eq!(
                JpegOutline::of(&file[..length]),
                JpegOutline {
                    components,
                    ends: false
                },
                "cut at {length}"
            );
        }
    }

    #[test]
    fn a_wrong_length_ends_the_reading() {
        for length in [[0, 0], [0, 1], [0xFF, 0xFF]] {
            let file = [&[0xFF, 0xD8, 0xFF, 0xC0][..], &length, &TAIL].concat();
            assert_eq!(JpegOutline::of(&file), JpegOutline::default());
        }
    }
}
