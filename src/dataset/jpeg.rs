//! What the markers of a JPEG file say of it: [`JpegOutline`].
//!
//! The decoder turns four inks into RGB without a word, and fills what a cut file lacks with grey; both would be asked
//! about as if they were the image.

/// What stands in a JPEG file beside the coded samples (ITU-T T.81, annex B).
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct JpegOutline {
    /// The components of a pixel: 1 for grey, 3 for colour, 4 for CMYK or YCCK; `None` without a frame header.
    pub(super) components: Option<u8>,
    /// Whether the end marker (EOI) is there.
    pub(super) ends: bool,
}

impl JpegOutline {
    /// Walks from marker to marker; a file that breaks off is walked as far as it goes.
    pub(super) fn of(file: &[u8]) -> Self {
        let mut outline = Self::default();
        let mut rest = file;
        while let Some((marker, behind)) = next_marker(rest) {
            rest = behind;
            match marker {
                0xD9 => {
                    outline.ends = true;
                    break;
                }
                // The start, a restart within the samples, a private use: markers without a segment.
                0x01 | 0xD0..=0xD8 => {}
                _ => {
                    let Some((segment, behind)) = segment(rest) else {
                        break;
                    };
                    if is_frame_header(marker) && outline.components.is_none() {
                        // Behind the precision (1 byte), the height and the width (2 each).
                        outline.components = segment.get(5).copied();
                    }
                    rest = behind;
                }
            }
        }
        outline
    }
}

/// The code of the next marker and what is behind it: in coded samples, 0xFF is followed by 0.
fn next_marker(bytes: &[u8]) -> Option<(u8, &[u8])> {
    let at = bytes
        .windows(2)
        .position(|two| two[0] == 0xFF && !matches!(two[1], 0 | 0xFF))?;
    Some((bytes[at + 1], &bytes[at + 2..]))
}

/// The content of the segment at the beginning, whose length counts its own two bytes, and what is behind it.
fn segment(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    let (length, rest) = bytes.split_first_chunk::<2>()?;
    rest.split_at_checked(usize::from(u16::from_be_bytes(*length)).checked_sub(2)?)
}

/// SOF0 to SOF15, without the three codes among them that are something else (DHT, JPG, DAC).
fn is_frame_header(marker: u8) -> bool {
    matches!(marker, 0xC0..=0xCF) && !matches!(marker, 0xC4 | 0xC8 | 0xCC)
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD: [u8; 12] = [0xFF, 0xD8, 0xFF, 0xC2, 0, 8, 8, 0, 1, 0, 1, 4];
    const TAIL: [u8; 11] = [0xFF, 0xDA, 0, 3, 9, 0xFF, 0, 0xFF, 0xD3, 0xFF, 0xD9];

    #[test]
    fn a_file_is_walked_as_far_as_it_goes() {
        // A thumbnail in an application segment has a header and an end of its own.
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
    fn broken_lengths_end_the_walk() {
        for length in [[0, 0], [0, 1], [0xFF, 0xFF]] {
            let file = [&[0xFF, 0xD8, 0xFF, 0xC0][..], &length, &TAIL].concat();
            assert_eq!(JpegOutline::of(&file), JpegOutline::default());
        }
    }
}
