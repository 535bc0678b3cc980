//! PNG files of dark and noisy photographs: [`encode`].
//!
//! Noise repeats nothing but zeros, so no matches are searched. The whole image has one filter and one Huffman code,
//! both chosen from a sample of its rows. Formats: PNG (ISO/IEC 15948), zlib (RFC 1950), deflate (RFC 1951).

#![expect(clippy::inline_always, reason = "only inlined code is compiled for a kernel's instruction set, see isa")]

mod huffman;
mod tokens;

use simd_adler32::Adler32;

use darkqa_base::types::Rgb;
use darkqa_base::types::images::{Isa, Kernel};

use huffman::{BitWriter, Code, RowCode, SymbolCounts};
use tokens::divide;

/// Samples above which an image is not encoded here: its compressed data might not fit in one chunk.
pub(crate) const MAX_SAMPLES: usize = 1 << 30;

/// Pairs of rows from which the filter is chosen.
const FILTER_PAIRS: usize = 12;

/// Pairs of rows from which the Huffman code is made.
const CODE_PAIRS: usize = 32;

/// The golden ratio less 1. Fractions of its multiples are spread evenly.
const GOLDEN_RATIO: f64 = 0.618_033_988_749_894_8;

/// Bytes per pixel, the distance to the sample at the left.
const PIXEL: usize = 3;

const SIGNATURE: &[u8] = b"\x89PNG\r\n\x1a\n";

/// Header of a zlib stream: deflate with a window of 32 KiB, no dictionary, fastest compression (RFC 1950, 2.2).
const ZLIB: [u8; 2] = [0x78, 0x01];

/// A filter of PNG (ISO/IEC 15948, 9.2): what is subtracted from each sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Filter {
    None,
    /// The sample at the left.
    Sub,
    /// The sample above.
    Up,
    /// The mean of both, rounded down.
    Average,
    /// Left, above, or above left: whichever is nearest to left + above − above left.
    Paeth,
}

impl Filter {
    const ALL: [Self; 5] = [Self::None, Self::Sub, Self::Up, Self::Average, Self::Paeth];

    /// The number in a file.
    fn number(self) -> u8 {
        self as u8
    }
}

/// Encodes an image of at most [`MAX_SAMPLES`] samples, with its width and height in pixels, as a PNG file.
pub(crate) fn encode(image: &Rgb, width: u32, height: u32) -> Vec<u8> {
    encode_with(image, width, height, Isa::best())
}

fn encode_with(image: &Rgb, width: u32, height: u32, isa: Isa) -> Vec<u8> {
    let mut rows = FilteredRows::new(image, isa);
    let filter = rows.best_filter(&rows.sampled_rows(FILTER_PAIRS));
    let sample = rows.sampled_rows(CODE_PAIRS);
    let counts = rows.counts(filter, &sample);
    let code = Code::new(&counts);
    let row_bits = code.cost(&counts) as usize / sample.len();
    // A few percent more than expected, so that the file is rarely moved while it grows.
    let expected = row_bits / 8 * image.height() * 17 / 16;
    let (start, content_at) = start_of_file(width, height);
    let mut out = BitWriter::new(&start, expected);
    code.write_header(&mut out);
    let row_code = RowCode::new(&code);
    let mut checksum = Adler32::new();
    for y in 0..image.height() {
        let row = rows.filtered(filter, y);
        checksum.write(row);
        out.reserve(row.len());
        isa.run(WriteRow { row, code: &row_code, out: &mut out });
    }
    code.write_end(&mut out);
    let mut file = out.into_bytes();
    file.extend(checksum.finish().to_be_bytes());
    let content = (file.len() - content_at) as u32;
    file[content_at - 8..content_at - 4].copy_from_slice(&content.to_be_bytes());
    let checksum = crc32fast::hash(&file[content_at - 4..]);
    file.extend(checksum.to_be_bytes());
    file.extend(chunk(*b"IEND", &[]));
    file
}

/// A file up to the header of its zlib stream, and where the content of that chunk begins. The length of the chunk, in
/// the eight bytes before its content, is still 0.
fn start_of_file(width: u32, height: u32) -> (Vec<u8>, usize) {
    let mut header = [width.to_be_bytes(), height.to_be_bytes()].concat();
    // 8 bits, RGB, the only compression and filter methods, no interlacing.
    header.extend([8, 2, 0, 0, 0]);
    let mut file = [SIGNATURE, &*chunk(*b"IHDR", &header), &[0; 4], b"IDAT"].concat();
    let content_at = file.len();
    file.extend(ZLIB);
    (file, content_at)
}

/// A whole chunk: length, type, content, checksum.
fn chunk(kind: [u8; 4], content: &[u8]) -> Vec<u8> {
    let checked = [&kind, content].concat();
    [&(content.len() as u32).to_be_bytes(), &*checked, &crc32fast::hash(&checked).to_be_bytes()].concat()
}

/// The rows of an image after a filter, one at a time.
struct FilteredRows<'a> {
    image: &'a Rgb,
    isa: Isa,
    /// The row above the first one: zeros.
    zeros: Vec<u8>,
    /// The number of the filter, and the filtered row.
    row: Vec<u8>,
}

impl<'a> FilteredRows<'a> {
    fn new(image: &'a Rgb, isa: Isa) -> Self {
        let length = PIXEL * image.width();
        Self { image, isa, zeros: vec![0; length], row: vec![0; length + 1] }
    }

    /// Row `y` as it is compressed: the number of the filter, then the filtered samples.
    fn filtered(&mut self, filter: Filter, y: usize) -> &[u8] {
        let (samples, length) = (self.image.samples(), self.zeros.len());
        let row = &samples[y * length..][..length];
        let above = match y {
            0 => &*self.zeros,
            _ => &samples[(y - 1) * length..][..length],
        };
        self.row[0] = filter.number();
        self.isa.run(FilterRow { filter, row, above, filtered: &mut self.row[1..] });
        &self.row
    }

    /// Indices of adjacent pairs of rows, one pair from each of `number` equal parts of the image; without the first row,
    /// which has nothing above. Even rows of a photograph differ from odd ones, because colours are interpolated from a
    /// mosaic.
    fn sampled_rows(&self, number: usize) -> Vec<usize> {
        let height = self.image.height();
        let pairs = (height - 1).div_ceil(2);
        let number = number.min(pairs);
        let rows = (0..number).flat_map(|part| {
            // Places in the parts differ, because rows of scaled images repeat a pattern.
            let place = (part as f64 * GOLDEN_RATIO).fract();
            let first = 1 + 2 * ((part as f64 + place) / number as f64 * pairs as f64) as usize;
            first..height.min(first + 2)
        });
        if height == 1 { vec![0] } else { rows.collect() }
    }

    /// How often each symbol occurs in these rows.
    fn counts(&mut self, filter: Filter, rows: &[usize]) -> SymbolCounts {
        let mut counts = SymbolCounts::default();
        for y in rows {
            let isa = self.isa;
            let row = self.filtered(filter, *y);
            isa.run(CountRow { row, counts: &mut counts });
        }
        counts
    }

    /// The filter after which these rows take the fewest bits.
    fn best_filter(&mut self, sample: &[usize]) -> Filter {
        let cost = |filter: &Filter| {
            let counts = self.counts(*filter, sample);
            Code::new(&counts).cost(&counts)
        };
        Filter::ALL.into_iter().min_by_key(cost).unwrap_or(Filter::Up)
    }
}

/// Filters a row.
struct FilterRow<'a> {
    filter: Filter,
    row: &'a [u8],
    above: &'a [u8],
    filtered: &'a mut [u8],
}

impl Kernel for FilterRow<'_> {
    #[inline(always)]
    fn run(self) {
        let Self { filter, row, above, filtered } = self;
        // The first pixel has zeros at its left.
        let (first, rest) = filtered.split_at_mut(PIXEL);
        let left_end = row.len() - PIXEL;
        let samples = rest.iter_mut().zip(&row[PIXEL..]).zip(&row[..left_end]).zip(&above[PIXEL..]).zip(above);
        match filter {
            Filter::None => {
                first.copy_from_slice(&row[..PIXEL]);
                rest.copy_from_slice(&row[PIXEL..]);
            }
            Filter::Sub => {
                first.copy_from_slice(&row[..PIXEL]);
                samples.for_each(|((((out, sample), left), _), _)| *out = sample.wrapping_sub(*left));
            }
            Filter::Up => {
                for i in 0..PIXEL {
                    first[i] = row[i].wrapping_sub(above[i]);
                }
                samples.for_each(|((((out, sample), _), up), _)| *out = sample.wrapping_sub(*up));
            }
            Filter::Average => {
                for i in 0..PIXEL {
                    first[i] = row[i].wrapping_sub(above[i] / 2);
                }
                samples.for_each(|((((out, sample), left), up), _)| {
                    *out = sample.wrapping_sub(u8::midpoint(*left, *up));
                });
            }
            Filter::Paeth => {
                for i in 0..PIXEL {
                    first[i] = row[i].wrapping_sub(above[i]);
                }
                samples.for_each(|((((out, sample), left), up), corner)| {
                    *out = sample.wrapping_sub(paeth(*left, *up, *corner));
                });
            }
        }
    }
}

/// The nearest of three samples to left + up − corner; of equal distances the first one (ISO/IEC 15948, 9.4).
#[inline(always)]
fn paeth(left: u8, up: u8, corner: u8) -> u8 {
    let [a, b, c] = [left, up, corner].map(i16::from);
    let (to_left, to_up) = ((b - c).abs(), (a - c).abs());
    let to_corner = (a + b - 2 * c).abs();
    if to_left <= to_up && to_left <= to_corner {
        left
    } else if to_up <= to_corner {
        up
    } else {
        corner
    }
}

/// Counts the symbols of a row.
struct CountRow<'a> {
    row: &'a [u8],
    counts: &'a mut SymbolCounts,
}

impl Kernel for CountRow<'_> {
    #[inline(always)]
    fn run(self) {
        divide(self.row, self.counts);
    }
}

/// Compresses a row.
struct WriteRow<'a> {
    row: &'a [u8],
    code: &'a RowCode,
    out: &'a mut BitWriter,
}

impl Kernel for WriteRow<'_> {
    #[inline(always)]
    fn run(self) {
        let mut writer = self.out.row_writer(self.code);
        divide(self.row, &mut writer);
        let state = writer.state();
        self.out.resume(state);
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// The pixels and size of a file, by the `png` crate, which checks all checksums.
    fn decoded(file: &[u8]) -> (u32, u32, Vec<u8>) {
        let mut reader = png::Decoder::new(std::io::Cursor::new(file)).read_info().unwrap();
        let mut samples = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut samples).unwrap();
        reader.finish().unwrap();
        assert_eq!((info.color_type, info.bit_depth), (png::ColorType::Rgb, png::BitDepth::Eight));
        (info.width, info.height, samples)
    }

    fn check(width: usize, height: usize, samples: Vec<u8>) -> usize {
        let image = Rgb::new(height, width, samples).unwrap();
        let files: Vec<Vec<u8>> =
            Isa::available().into_iter().map(|isa| encode_with(&image, width as u32, height as u32, isa)).collect();
        assert!(files.iter().all(|file| *file == files[0]), "instruction sets give other bytes");
        assert_eq!(decoded(&files[0]), (width as u32, height as u32, image.into_samples()));
        files[0].len()
    }

    /// Noise with a share of zeros, by a linear congruential generator.
    fn noise(length: usize, seed: u64, top: u64) -> Vec<u8> {
        let mut state = seed;
        (0..length)
            .map(|_| {
                state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                ((state >> 33) % (top + 1)) as u8
            })
            .collect()
    }

    #[test]
    fn images_without_contrast_are_small() {
        for code in [0, 1, 7, 255] {
            assert!(check(640, 480, vec![code; 640 * 480 * 3]) < 6_000);
        }
    }

    #[test]
    fn random_codes_grow_by_less_than_a_percent() {
        let samples = noise(300 * 200 * 3, 5, 255);
        assert!(check(300, 200, samples) < 300 * 200 * 3 * 101 / 100 + 300);
    }

    #[test]
    fn runs_of_every_length_are_kept() {
        // A code in each place after zeros, so that runs of all lengths begin and end at any offset.
        for length in (1..40).chain(250..300).chain(510..530) {
            let width: usize = 400;
            let samples = (0..width * 3 * 3).map(|i| u8::from(i % (length + 1) == 0) * 9);
            check(width, 3, samples.collect());
        }
    }

    #[test]
    fn codes_that_no_sampled_row_has_are_kept() {
        let mut samples = vec![0; 8 * 1000 * 3];
        for (row, samples) in samples.chunks_exact_mut(8 * 3).enumerate() {
            if row % 17 == 3 {
                samples.copy_from_slice(&noise(8 * 3, row as u64, 255));
            }
        }
        check(8, 1000, samples);
    }

    #[test]
    fn rows_that_are_never_sampled_may_be_incompressible() {
        let (width, height) = (500, 640);
        let mut samples = vec![0; width * height * 3];
        for y in (0..height).filter(|y| y % 10 != 5) {
            samples[y * width * 3..][..width * 3].copy_from_slice(&noise(width * 3, y as u64, 255));
        }
        check(width, height, samples);
    }

    proptest! {
        #[test]
        fn pixels_are_kept(
            width in 1..70_usize,
            height in 1..70_usize,
            seed: u64,
            top in prop::sample::select(vec![0_u64, 1, 2, 5, 40, 255]),
            sparse in 1..60_usize,
        ) {
            let mut samples = noise(width * height * 3, seed, top);
            for (i, sample) in samples.iter_mut().enumerate() {
                if !(i / sparse).is_multiple_of(3) {
                    *sample = 0;
                }
            }
            check(width, height, samples);
        }
    }
}
