//! Broken images: thousands of mutated files, none of which may bring the program down or make it take memory without
//! bound.
//!
//! The long form is `cargo test --release --test program mutations:: -- --ignored`.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::io::Cursor;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use darkqa_pictures::DecodeRule;
use darkqa_pictures::ImageFile;
use darkqa_pictures::decode_rule::MAX_PIXELS;
use image::{DynamicImage, ImageFormat, Rgb};

use exr::prelude::Compression;

use crate::support::exr_files::compressed;
use crate::support::icc_files::{DISPLAY_P3, rgb_profile, srgb_curve};
use crate::support::image_files::{
    checksum, packed_chunk, png, png_with_profile, turned_png, webp_with_profile, with_chunks,
};

/// The system's allocator, which remembers the largest single request of each thread.
struct Watched;

thread_local! {
    static LARGEST: Cell<usize> = const { Cell::new(0) };
}

/// Counts a request. Threads that are ending have no counter.
fn count(size: usize) {
    let _ = LARGEST.try_with(|largest| largest.set(largest.get().max(size)));
}

#[expect(unsafe_code, reason = "an allocator is unsafe to write")]
// SAFETY: every request is handed on as it came.
unsafe impl GlobalAlloc for Watched {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size());
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count(layout.size());
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, block: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count(size);
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

/// One file of each kind that is read: colour, grey, 16 bits, alpha; PNG, WebP and TIFF; JPEG, baseline and
/// progressive; a lossy WebP file of libwebp; files with a profile and with an orientation; OpenEXR in its
/// compressions.
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
    let formats = [ImageFormat::Png, ImageFormat::WebP, ImageFormat::Tiff];
    let mut files: Vec<Vec<u8>> = kinds
        .iter()
        .flat_map(|image| {
            formats.map(|format| {
                let mut file = Cursor::new(Vec::new());
                let written = image.write_to(&mut file, format);
                // WebP has no 16 bits, and TIFF no alpha channel beside grey.
                written.is_ok().then(|| file.into_inner())
            })
        })
        .flatten()
        .collect();
    assert!(files.len() > 10);
    let lossy = "UklGRloAAABXRUJQVlA4IE4AAADQAgCdASoQABAAAMASJbACdHMBMAH6ALEAE3ctuVroAP7/25Ju3CH22WwE6y5cQSCFn/xykcgP6B0+y8YTRif/7lC9F//3pm9Ank0AAAA=";
    files.push(STANDARD.decode(lossy).unwrap());
    let pixels = colour.to_rgb8();
    let profile = rgb_profile("Display P3", DISPLAY_P3, &srgb_curve());
    files.push(png_with_profile(&pixels, &profile));
    files.push(webp_with_profile(&pixels, &profile));
    files.push(turned_png(&pixels, 6));
    let light: Vec<f32> = pixels.iter().map(|code| f32::from(*code) / 64.0).collect();
    for compression in [
        Compression::Uncompressed,
        Compression::RLE,
        Compression::ZIP16,
        Compression::PIZ,
        Compression::PXR24,
        Compression::B44,
    ] {
        files.push(compressed([37, 21], &light, compression));
    }
    for progressive in [false, true] {
        let mut file = Vec::new();
        let mut encoder = jpeg_encoder::Encoder::new(&mut file, 80);
        encoder.set_progressive(progressive);
        let pixels = colour.to_rgb8();
        encoder.encode(&pixels, 37, 21, jpeg_encoder::ColorType::Rgb).unwrap();
        files.push(file);
    }
    files
}

/// Damages a file in one to four places. Half of the PNG files get valid checksums afterwards, so that the damage
/// reaches what lies behind them.
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
        let Some((sum, rest)) = rest.split_first_chunk_mut::<4>() else {
            return;
        };
        *sum = checksum(body);
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
        let picture = ImageFile::new(bytes, place, DecodeRule::default());
        // What passes the check may still not decode: an error, no more.
        let _ = picture.check();
        match picture.decode() {
            Ok(rgb) => {
                assert!((rgb.height() * rgb.width()) as u64 <= MAX_PIXELS);
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

/// What a whole image of the most pixels takes, at 12 bytes a pixel: three floats.
const MOST_BYTES: usize = MAX_PIXELS as usize * 12;

#[test]
fn unbounded_profile_takes_no_memory() {
    let pixels = image::RgbImage::new(4, 4);
    let bytes = png_with_profile(&pixels, &vec![0; 256 << 20]);
    let file = ImageFile::new(bytes, "a bomb".to_owned(), DecodeRule::default());
    LARGEST.set(0);
    let (digest, error) = (file.digest(), file.decode().unwrap_err());
    assert_eq!(digest, file.digest());
    assert!(error.to_string().contains("ICC profile"), "{error}");
    assert!(LARGEST.get() <= 16 << 20);
}

#[test]
fn unbounded_texts_take_no_memory() {
    let pixels = image::RgbImage::new(4, 4);
    let bomb = vec![b'a'; 256 << 20];
    for (kind, head) in [(*b"zTXt", &b"Comment\0\0"[..]), (*b"iTXt", b"Comment\0\x01\0\0\0")] {
        let chunks = [packed_chunk(kind, head, &bomb)];
        let bytes = with_chunks(&png(&pixels), &chunks);
        let file = ImageFile::new(bytes, "a bomb".to_owned(), DecodeRule::default());
        LARGEST.set(0);
        assert_eq!(file.decode().unwrap().width(), 4);
        assert!(LARGEST.get() <= 16 << 20);
    }
}

#[test]
fn ten_thousand_images_survive_damage() {
    LARGEST.set(0);
    let [read, refused] = read_mutated(10_000);
    assert!(read > 500 && refused > 5000, "{read} read, {refused} refused");
    assert!(LARGEST.get() <= MOST_BYTES);
}

#[test]
#[ignore = "a million files"]
fn million_images_survive_damage() {
    LARGEST.set(0);
    read_mutated(1_000_000);
    assert!(LARGEST.get() <= MOST_BYTES);
}
