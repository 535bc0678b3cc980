//! Huffman tables of JPEG frames without their own: [`with_standard_tables`].

use std::borrow::Cow;

use super::jpeg_markers::{START_OF_SCAN, Segments};

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

#[cfg(test)]
mod tests {
    use super::*;

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
