//! The facts of a TIFF file in the tags of its first picture: [`TiffOutline`].
//!
//! They are read here because the decoder of the crate `tiff` hands out no tags of a first picture that it cannot decode (a camera's
//! RAW file, a mask, a broken file), none longer than 1 MiB, as some profiles are, and takes the missing part of a truncated file for
//! samples in some compressions (TIFF 6.0, section 2; BigTIFF as in libtiff).

/// Most directories of a file that are counted; chosen. It also ends a chain that goes in a circle.
const MOST_PAGES: usize = 10_000;

/// Most values of a tag that are read; chosen. Strips of one row of the tallest image are fewer.
const MOST_VALUES: u64 = 1 << 20;

// Tags (TIFF 6.0, appendix A; DNG 1.7).
const NEW_SUBFILE_TYPE: u16 = 254;
const BITS_PER_SAMPLE: u16 = 258;
const PHOTOMETRIC: u16 = 262;
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

/// Photometric interpretation of amounts of ink.
const SEPARATED: u64 = 5;

/// Sample format of IEEE floats.
const FLOAT: u64 = 3;

/// The facts of a TIFF file that decide how it is read.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct TiffOutline<'a> {
    /// The orientation, 1 to 8, as in EXIF; 0 if it is not stated.
    pub(super) orientation: u64,
    /// The number of pictures. Smaller copies of others are not counted.
    pub(super) pages: usize,
    /// Whether the samples are amounts of cyan, magenta, yellow and black in 8 bits, pixel by pixel.
    pub(super) is_cmyk: bool,
    /// The colours that cannot be shown as they are; `None` for grey, RGB and the inks of `is_cmyk`.
    pub(super) colours: Option<&'static str>,
    /// The ICC profile; `None` if there is none.
    pub(super) profile: Option<&'a [u8]>,
    /// True for a camera's RAW file, whose first picture is a preview.
    pub(super) is_raw: bool,
    /// The number of bits of a sample.
    pub(super) bits: u64,
    /// Whether the samples are floats.
    pub(super) is_float: bool,
    /// The number of bytes up to the end of the samples.
    pub(super) end: u64,
}

impl<'a> TiffOutline<'a> {
    /// Reads the tags; of a broken file those that can be read.
    pub(super) fn parse(file: &'a [u8]) -> Self {
        let mut outline = Self::default();
        let Some((reader, first)) = Reader::open(file) else {
            return outline;
        };
        let Some((directory, mut next)) = reader.directory(first) else {
            return outline;
        };
        let value = |tag| reader.values(&directory, tag).first().copied();
        outline.pages = 1;
        outline.orientation = value(ORIENTATION).unwrap_or(0);
        outline.bits = value(BITS_PER_SAMPLE).unwrap_or(1);
        outline.is_cmyk = value(PHOTOMETRIC) == Some(SEPARATED)
            && outline.bits == 8
            && value(SAMPLES_PER_PIXEL) == Some(4)
            && value(INK_SET).is_none_or(|set| set == 1)
            && value(PLANAR_CONFIGURATION).is_none_or(|planes| planes == 1);
        if !outline.is_cmyk {
            outline.colours = colours(value(PHOTOMETRIC));
        }
        outline.profile = reader.bytes(&directory, ICC_PROFILE);
        let is_preview = value(NEW_SUBFILE_TYPE).is_some_and(is_reduced);
        outline.is_raw = is_preview || directory.iter().any(|entry| entry.tag == DNG_VERSION);
        outline.is_float = value(SAMPLE_FORMAT) == Some(FLOAT);
        for (offsets, counts) in [
            (STRIP_OFFSETS, STRIP_BYTE_COUNTS),
            (TILE_OFFSETS, TILE_BYTE_COUNTS),
        ] {
            let offsets = reader.values(&directory, offsets);
            let counts = reader.values(&directory, counts);
            let end = offsets
                .iter()
                .zip(&counts)
                .map(|(offset, count)| offset.saturating_add(*count));
            outline.end = outline.end.max(end.max().unwrap_or(0));
        }
        for _ in 0..MOST_PAGES {
            let Some((directory, following)) = reader.directory(next) else {
                break;
            };
            let kind = reader.values(&directory, NEW_SUBFILE_TYPE);
            outline.pages += usize::from(!kind.first().copied().is_some_and(is_reduced));
            next = following;
        }
        outline
    }
}

/// Whether a picture is a smaller copy of another.
fn is_reduced(subfile_type: u64) -> bool {
    subfile_type & 1 == 1
}

/// The name of colours that cannot be shown as they are.
fn colours(photometric: Option<u64>) -> Option<&'static str> {
    match photometric? {
        // White is 0, black is 0, RGB, YCbCr.
        0..=2 | 6 => None,
        3 => Some("a TIFF of palette colours"),
        4 => Some("a mask"),
        SEPARATED => Some("a CMYK image of another form than four inks of 8 bits, pixel by pixel"),
        8..=10 => Some("a Lab image"),
        32803 | 34892 => Some("a camera's RAW file"),
        _ => Some("an image of unknown colours"),
    }
}

/// One tag of a directory.
struct Entry {
    tag: u16,
    kind: u16,
    count: u64,
    /// The place of the values in the file.
    at: u64,
}

/// A TIFF structure in a byte order.
struct Reader<'a> {
    file: &'a [u8],
    is_big_endian: bool,
    /// Whether offsets have 8 bytes (BigTIFF).
    is_big: bool,
}

impl<'a> Reader<'a> {
    /// The reader of a file, and the place of its first directory.
    fn open(file: &'a [u8]) -> Option<(Self, u64)> {
        let is_big_endian = file.starts_with(b"MM");
        let mut reader = Self {
            file,
            is_big_endian,
            is_big: false,
        };
        reader.is_big = reader.number(2, 2)? == 43;
        let first = if reader.is_big {
            reader.number(8, 8)?
        } else {
            reader.number(4, 4)?
        };
        Some((reader, first))
    }

    /// A whole number of 1, 2, 4 or 8 bytes.
    fn number(&self, at: u64, bytes: usize) -> Option<u64> {
        let at = usize::try_from(at).ok()?;
        let bytes = self.file.get(at..at.checked_add(bytes)?)?;
        let add = |sum: u64, byte: &u8| sum << 8 | u64::from(*byte);
        Some(if self.is_big_endian {
            bytes.iter().fold(0, add)
        } else {
            bytes.iter().rev().fold(0, add)
        })
    }

    /// The entries of a directory, and the place of the next; `None` at its end.
    fn directory(&self, at: u64) -> Option<(Vec<Entry>, u64)> {
        if at == 0 {
            return None;
        }
        let (counted, offset) = if self.is_big { (8, 8) } else { (2, 4) };
        let count = self.number(at, counted)?;
        let size = 4 + 2 * offset as u64;
        // An entry takes at least 12 bytes of the file.
        let count = count.min(self.file.len() as u64 / 12);
        let mut entries = Vec::new();
        let mut place = at.checked_add(counted as u64)?;
        for _ in 0..count {
            let (tag, kind) = (
                self.number(place, 2)? as u16,
                self.number(place + 2, 2)? as u16,
            );
            let count = self.number(place + 4, offset)?;
            let value = place + 4 + offset as u64;
            let length = count.saturating_mul(bytes_of(kind));
            let at = if length <= offset as u64 {
                value
            } else {
                self.number(value, offset)?
            };
            entries.push(Entry {
                tag,
                kind,
                count,
                at,
            });
            place = place.checked_add(size)?;
        }
        Some((entries, self.number(place, offset).unwrap_or(0)))
    }

    /// The bytes of a tag; `None` if the directory does not have it, or the file ends before they do.
    fn bytes(&self, directory: &[Entry], tag: u16) -> Option<&'a [u8]> {
        let entry = directory.iter().find(|entry| entry.tag == tag)?;
        let at = usize::try_from(entry.at).ok()?;
        let end = at.checked_add(usize::try_from(entry.count).ok()?)?;
        self.file.get(at..end)
    }

    /// The values of a tag as whole numbers; empty if the directory does not have it.
    fn values(&self, directory: &[Entry], tag: u16) -> Vec<u64> {
        let Some(entry) = directory.iter().find(|entry| entry.tag == tag) else {
            return Vec::new();
        };
        let bytes = bytes_of(entry.kind);
        let places =
            (0..entry.count.min(MOST_VALUES)).map(|index| entry.at.checked_add(index * bytes));
        places
            .map_while(|at| self.number(at?, bytes as usize))
            .collect()
    }
}

/// The bytes of a value of a type: whole numbers of 1, 2, 4 and 8 bytes. All other types count as bytes.
fn bytes_of(kind: u16) -> u64 {
    match kind {
        3 => 2,
        4 | 13 => 4,
        16 | 18 => 8,
        _ => 1,
    }
}
