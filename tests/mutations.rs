//! Broken images: thousands of mutated files, none of which may bring the program down or make it take memory without
//! bound.
//!
//! The long form is `cargo test --release --test mutations -- --ignored`.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::io::Cursor;
use std::sync::atomic::{AtomicUsize, Ordering};

use darkqa_eval::internals::dataset::{MOST_PIXELS, Picture};
use image::{DynamicImage, ImageFormat, Rgb};

/// The system's allocator, with the largest single request remembered.
struct Watched;

static LARGEST: AtomicUsize = AtomicUsize::new(0);

#[expect(unsafe_code, reason = "an allocator is unsafe to write")]
// SAFETY: every request is handed on as it came.
unsafe impl GlobalAlloc for Watched {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        LARGEST.fetch_max(layout.size(), Ordering::Relaxed);
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        LARGEST.fetch_max(layout.size(), Ordering::Relaxed);
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, block: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        LARGEST.fetch_max(size, Ordering::Relaxed);
        unsafe { System.realloc(block, layout, size) }
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        unsafe { System.dealloc(block, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Watched = Watched;

/// Steele, Lea and Flood's SplitMix64.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    fn below(&mut self, bound: usize) -> usize {
        (self.next() % bound.max(1) as u64) as usize
    }
}

/// One file of each kind that is read: colour, grey, 16 bits, alpha; PNG and JPEG, baseline and progressive.
fn corpus() -> Vec<Vec<u8>> {
    let colour = DynamicImage::ImageRgb8(image::ImageBuffer::from_fn(37, 21, |x, y| {
        Rgb([(x * 7) as u8, (y * 11) as u8, (x * y) as u8])
    }));
    let kinds = [
        colour.clone(),
        DynamicImage::ImageLuma8(colour.to_luma8()),
        DynamicImage::ImageRgb16(colour.to_rgb16()),
        DynamicImage::ImageRgba8(colour.to_rgba8()),
        DynamicImage::ImageLumaA8(colour.to_luma_alpha8()),
    ];
    let mut files: Vec<Vec<u8>> = kinds
        .iter()
        .map(|image| {
            let mut file = Cursor::new(Vec::new());
            image.write_to(&mut file, ImageFormat::Png).unwrap();
            file.into_inner()
        })
        .collect();
    for progressive in [false, true] {
        let mut file = Vec::new();
        let mut encoder = jpeg_encoder::Encoder::new(&mut file, 80);
        encoder.set_progressive(progressive);
        let pixels = colour.to_rgb8();
        encoder
            .encode(&pixels, 37, 21, jpeg_encoder::ColorType::Rgb)
            .unwrap();
        files.push(file);
    }
    files
}

/// Damages a file in one to four places. Half of the PNG files get valid checksums afterwards, so that the damage reaches
/// what lies behind them.
fn mutate(file: &[u8], random: &mut Random) -> Vec<u8> {
    let mut file = file.to_vec();
    for _ in 0..=random.below(4) {
        let at = random.below(file.len());
        match random.below(7) {
            0 => file[at] ^= 1 << random.below(8),
            1 => file[at] = random.next() as u8,
            2 => file[at] = [0, 1, 0x7F, 0x80, 0xFF][random.below(5)],
            3 => file.truncate(at.max(1)),
            4 => file.insert(at, random.next() as u8),
            5 => {
                let end = (at + 1 + random.below(64)).min(file.len());
                let part = file[at..end].to_vec();
                let to = random.below(file.len());
                file.splice(to..to, part);
            }
            // The sizes in the headers lie near the beginning.
            _ => {
                let at = at % 40.min(file.len());
                file[at] = random.next() as u8;
            }
        }
    }
    if random.below(2) == 0 {
        mend_checksums(&mut file);
    }
    file
}

/// Gives each chunk of a PNG file the checksum of what it holds.
fn mend_checksums(file: &mut [u8]) {
    if !file.starts_with(b"\x89PNG\r\n\x1a\n") {
        return;
    }
    let mut chunks = &mut file[8..];
    while let Some((length, rest)) = chunks.split_first_chunk_mut::<4>() {
        let length = (u32::from_be_bytes(*length) as usize).saturating_add(4);
        let Some((body, rest)) = rest.split_at_mut_checked(length) else {
            return;
        };
        let Some((checksum, rest)) = rest.split_first_chunk_mut::<4>() else {
            return;
        };
        *checksum = crc32fast::hash(body).to_be_bytes();
        chunks = rest;
    }
}

/// Reads `rounds` mutated files; the counts of those that were read and of those that were refused.
fn read_mutated(rounds: usize) -> [usize; 2] {
    let corpus = corpus();
    let mut random = Random(20);
    let mut counts = [0; 2];
    for round in 0..rounds {
        let bytes = mutate(&corpus[round % corpus.len()], &mut random);
        let place = format!("mutation {round}");
        let picture = Picture::Encoded {
            bytes,
            place,
            most_pixels: MOST_PIXELS,
        };
        // What passes the check may still not decode: an error, no more.
        let _ = picture.check();
        match picture.decode() {
            Ok(rgb) => {
                assert!((rgb.height() * rgb.width()) as u64 <= MOST_PIXELS);
                counts[0] += 1;
            }
            Err(error) => {
                assert!(error.to_string().starts_with("mutation"), "{error}");
                counts[1] += 1;
            }
        }
    }
    counts
}

/// What a whole image of the most pixels takes, at 8 bytes a pixel.
const MOST_BYTES: usize = MOST_PIXELS as usize * 8;

#[test]
fn ten_thousand_broken_images_are_read_or_refused() {
    let [read, refused] = read_mutated(10_000);
    assert!(
        read > 500 && refused > 5000,
        "{read} read, {refused} refused"
    );
    assert!(LARGEST.load(Ordering::Relaxed) <= MOST_BYTES);
}

#[test]
#[ignore = "a million files"]
fn a_million_broken_images_are_read_or_refused() {
    read_mutated(1_000_000);
    assert!(LARGEST.load(Ordering::Relaxed) <= MOST_BYTES);
}
