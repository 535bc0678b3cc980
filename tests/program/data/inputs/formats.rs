//! WebP and TIFF files, and files of formats that are not read.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use darkqa_pictures::DecodeRule;
use darkqa_pictures::ImageFile;
use image::{ImageFormat, Rgb, RgbImage};
use serde_json::json;

use crate::support::exr_files::exr;
use crate::support::image_files::{
    animated_webp, chunk, encoded, png, seen, turned_webp, webp_of, webp_samples, with_chunks,
};
use crate::support::run::{Bench, records, words};
use crate::support::snapshot::redacted;
use crate::support::tiff_files::{Order, Page, tiff};

fn image() -> RgbImage {
    RgbImage::from_fn(7, 4, |x, y| Rgb([(x * 30) as u8, (y * 60) as u8, 99]))
}

fn file(bytes: Vec<u8>) -> ImageFile {
    ImageFile::new(bytes, "a file".to_owned(), DecodeRule::default())
}

fn decoded(bytes: Vec<u8>) -> RgbImage {
    let pixels = file(bytes).decode().unwrap();
    let (width, height) = (pixels.width() as u32, pixels.height() as u32);
    RgbImage::from_raw(width, height, pixels.samples().to_vec()).unwrap()
}

fn fault(bytes: Vec<u8>) -> String {
    let file = file(bytes);
    let error = file.decode().unwrap_err().to_string();
    assert!(error.starts_with("a file: "), "{error}");
    assert_eq!(error.lines().count(), 1, "{error}");
    assert_eq!(file.check().unwrap_err().to_string(), error);
    error
}

#[test]
fn lossless_files_have_pixels_of_png() {
    let image = image();
    for bytes in [
        encoded(&image, ImageFormat::WebP),
        encoded(&image, ImageFormat::Tiff),
        tiff(Order::Little, &[Page::rgb(&image)]),
        tiff(Order::Big, &[Page::rgb(&image)]),
    ] {
        let digest = blake3::hash(&bytes).to_hex().to_string();
        assert_eq!(file(bytes.clone()).digest().to_string(), digest);
        assert_eq!(file(bytes.clone()).check().unwrap(), (7, 4));
        assert_eq!(decoded(bytes), image);
    }
}

/// A lossy file of libwebp 1.6, quality 90, with what it decodes it to at three places.
#[test]
fn lossy_webp_is_read() {
    let text = "UklGRloAAABXRUJQVlA4IE4AAADQAgCdASoQABAAAMASJbACdHMBMAH6ALEAE3ctuVroAP7/25Ju3CH22WwE6y5cQSCFn/xykcgP6B0+y8YTRif/7lC9F//3pm9Ank0AAAA=";
    let pixels = decoded(STANDARD.decode(text).unwrap());
    for ([x, y], expected) in [([5, 3], [62, 35, 78]), ([15, 15], [179, 178, 87]), ([0, 0], [1, 3, 75])] {
        let found = pixels.get_pixel(x, y).0;
        let close = found.iter().zip(expected).all(|(a, b)| a.abs_diff(b) <= 1);
        assert!(close, "{x}, {y}: {found:?}");
    }
}

#[test]
fn webp_and_tiff_orientation_is_applied() {
    let stored = image();
    for orientation in 1..=8 {
        let expected = seen(&stored, orientation);
        let page = || Page::rgb(&stored).with(274, orientation.into());
        for bytes in [turned_webp(&stored, orientation), tiff(Order::Little, &[page()]), tiff(Order::Big, &[page()])] {
            let stated = (orientation > 1).then_some(orientation as u8);
            assert_eq!(file(bytes.clone()).note().orientation, stated);
            assert_eq!(file(bytes.clone()).check().unwrap(), expected.dimensions());
            assert_eq!(decoded(bytes), expected, "{orientation}");
        }
    }
}

#[test]
fn of_several_pictures_first_is_read() {
    let first = image();
    let second = RgbImage::from_pixel(7, 4, Rgb([9; 3]));
    let pages = || [Page::rgb(&first), Page::rgb(&second)];
    for (bytes, kind) in [
        (animated_webp(&[first.clone(), second.clone()]), Some("animated WebP")),
        (tiff(Order::Big, &pages()), Some("TIFF of several pages")),
        (animated_webp(std::slice::from_ref(&first)), None),
        (tiff(Order::Big, &pages()[..1]), None),
    ] {
        assert_eq!(decoded(bytes.clone()), first);
        assert_eq!(file(bytes).note().first_of.as_deref(), kind);
    }
    // A smaller copy of the first picture is no second one.
    let copy = Page::rgb(&second).with(254, 1);
    let with_copy = tiff(Order::Little, &[Page::rgb(&first), copy]);
    assert_eq!(file(with_copy).note().first_of, None);
    let frames = [&2_u32.to_be_bytes()[..], &[0; 4]].concat();
    let animated_png = with_chunks(&png(&first), &[chunk(*b"acTL", &frames)]);
    assert_eq!(decoded(animated_png.clone()), first);
    let note = file(animated_png).note();
    assert_eq!(note.first_of.as_deref(), Some("animated PNG"));
}

/// A chain of directories that goes in a circle ends, and its picture counts once.
#[test]
fn a_circle_of_pages_ends() {
    let mut bytes = tiff(Order::Little, &[Page::rgb(&image())]);
    let end = bytes.len() - 4;
    let first: [u8; 4] = bytes[4..8].try_into().unwrap();
    bytes[end..].copy_from_slice(&first);
    assert_eq!(file(bytes).note().first_of, None);
}

#[test]
fn a_cut_file_is_named() {
    let image = RgbImage::from_fn(64, 48, |x, y| Rgb([x as u8, y as u8, (x * y) as u8]));
    for format in [ImageFormat::WebP, ImageFormat::Tiff] {
        let whole = encoded(&image, format);
        for length in [whole.len() / 2, whole.len() - 3] {
            let error = fault(whole[..length].to_vec());
            assert!(error.contains("not a "), "{length}: {error}");
        }
    }
    let whole = encoded(&image, ImageFormat::WebP);
    let error = fault(whole[..100].to_vec());
    insta::assert_snapshot!(redacted(&error), @"a file: not a whole image: the file ends at byte 100 of 3170; copy or export it again");
    // The directory is there, and the samples behind it are not.
    let late = {
        let page = Page::rgb(&image).with(278, 48);
        let mut bytes = tiff(Order::Little, &[page]);
        let strip = 12 + bytes.windows(4).position(|four| four == [0x11, 1, 4, 0]).unwrap() - 4;
        let at = bytes.len() as u32;
        bytes[strip..strip + 4].copy_from_slice(&at.to_le_bytes());
        bytes.extend(vec![7; 64 * 48 * 3]);
        bytes
    };
    assert_eq!(decoded(late.clone()), RgbImage::from_pixel(64, 48, Rgb([7; 3])));
    let error = fault(late[..late.len() - 1].to_vec());
    insta::assert_snapshot!(redacted(&error), @"a file: not a whole image: the file ends at byte 18559 of 18560; copy or export it again");
}

#[test]
fn inks_in_a_tiff_become_rgb() {
    let inks = [[0, 0, 0, 0], [255, 0, 0, 0], [40, 90, 200, 60]];
    let page = Page { size: [3, 1], channels: 4, samples: inks.as_flattened().to_vec(), ..Page::rgb(&image()) };
    let read = decoded(tiff(Order::Big, &[page.with(262, 5)]));
    let codes = [[255, 255, 255], [0, 255, 255], [164, 126, 42]];
    assert_eq!(read.as_raw().as_slice(), codes.as_flattened());
}

#[test]
fn unsupported_images_are_refused_by_name() {
    let rgb = |tag, value| tiff(Order::Little, &[Page::rgb(&image()).with(tag, value)]);
    let four = Page { channels: 4, samples: vec![9; 7 * 4 * 4], ..Page::rgb(&image()) };
    let mut clear = image::RgbaImage::new(2, 2);
    clear.put_pixel(1, 1, image::Rgba([1, 2, 3, 4]));
    let mut transparent = std::io::Cursor::new(Vec::new());
    clear.write_to(&mut transparent, ImageFormat::WebP).unwrap();
    for (bytes, says) in [
        (
            tiff(Order::Little, &[four.with(262, 5).with(332, 2)]),
            "a CMYK image of another form than four inks of 8 bits, pixel by pixel; convert it to RGB first",
        ),
        (rgb(262, 3), "palette colours; convert it"),
        (rgb(262, 6), "a TIFF of YCbCr colours; convert it"),
        (rgb(262, 8), "a Lab image; convert it"),
        (rgb(254, 1), "a camera's RAW file: only its preview"),
        (rgb(50706, 1), "a camera's RAW file: only its preview"),
        (rgb(262, 32803), "a camera's RAW file"),
        (rgb(339, 3), "floating-point samples"),
        (rgb(258, 32), "a TIFF of 32-bit integers; 8 or 16 bits expected"),
        (rgb(266, 2), "whose bytes begin with their lowest bit (FillOrder 2)"),
        (
            tiff(Order::Little, &[Page::rgb(&image()).with(284, 2).with(324, 8)]),
            "a TIFF of tiles with separate colour planes",
        ),
        (transparent.into_inner(), "transparent in places; flatten it"),
        (b"\0\0\0\x18ftypheic\0\0\0\0".to_vec(), "a HEIC image, which is not read; convert it to PNG"),
        (b"\0\0\0\x1cftypavif\0\0\0\0".to_vec(), "an AVIF image, which is not read; convert it to PNG"),
    ] {
        let error = fault(bytes);
        assert!(error.contains(says), "{error}");
    }
}

/// What newer writers save, with the way out. The pixels behind the header do not matter.
#[test]
fn unread_compressions_are_named() {
    let tiff_of = |method| tiff(Order::Little, &[Page::rgb(&image()).with(259, method)]);
    for (method, name) in [
        (50000, "ZSTD"),
        (50001, "WebP"),
        (50002, "JPEG XL"),
        (34887, "LERC"),
        (34925, "LZMA"),
        (34712, "JPEG 2000"),
        (61234, "method 61234"),
    ] {
        let error = fault(tiff_of(method));
        let expected =
            format!("a TIFF of the compression {name}, which is not read; save it with LZW or deflate first");
        assert!(error.ends_with(&expected), "{error}");
    }
    assert_eq!(decoded(tiff_of(1)), image());
    let attribute = b"compression\0compression\0\x01\0\0\0";
    let light: Vec<f32> = (0..7 * 4 * 3).map(|at| at as f32 / 100.0).collect();
    let mut exr = exr([7, 4], &light);
    let at = exr.windows(attribute.len()).position(|part| part == attribute);
    let at = at.unwrap() + attribute.len();
    for (method, name) in [(10, "HTJ2K"), (11, "HTJ2K"), (12, "LJ2K"), (13, "ZSTD"), (77, "number 77")] {
        exr[at] = method;
        let error = fault(exr.clone());
        let expected =
            format!("an OpenEXR image of the compression {name}, which is not read; save it with ZIP or PIZ");
        assert!(error.ends_with(&expected), "{error}");
    }
}

#[test]
fn decompression_bomb_is_refused_early() {
    let mut webp = webp_of(&[webp_samples(&image())]);
    // 16383 × 16383 pixels: 14 bits each behind the signature of the samples.
    webp[21..25].copy_from_slice(&[0xFE, 0xBF, 0xFF, 0x0F]);
    let tall = Page { size: [100_000, 100_000], ..Page::rgb(&image()) };
    for bytes in [webp, tiff(Order::Big, &[tall])] {
        let error = fault(bytes);
        assert!(error.contains("pixels are more than") && error.contains("--decode max-pixels"), "{error}");
    }
    let rule = DecodeRule { max_pixels: 27, ..DecodeRule::default() };
    let limited = |bytes| ImageFile::new(bytes, "a file".to_owned(), rule).check();
    for format in [ImageFormat::WebP, ImageFormat::Tiff] {
        let error = limited(encoded(&image(), format)).unwrap_err().to_string();
        assert!(error.contains("7 × 4 pixels"), "{error}");
    }
}

#[test]
fn run_reads_all_formats_of_folder() {
    let bench = Bench::new();
    let frames = [
        ("a.webp", encoded(&image(), ImageFormat::WebP)),
        ("b.TIF", tiff(Order::Big, &[Page::rgb(&image()), Page::rgb(&image())])),
        ("c.png", png(&image())),
    ];
    let questions: Vec<String> = frames
        .iter()
        .map(|(name, bytes)| {
            bench.file(&format!("set/{name}"), bytes);
            json!({"id": name, "frame": name, "question": "Is it?", "choices": ["yes", "no"], "answer": "no"})
                .to_string()
        })
        .collect();
    bench.file("set/questions.jsonl", questions.join("\n"));
    bench.file("set/IMG_2.HEIC", "x");
    bench.file("set/IMG_1.HEIC", "x");
    bench.file("set/notes.txt", "x");
    let called = bench.call(&words("--data set --model random --levels L0,L2 --variant ev --out run"));
    assert_eq!(called.code, Some(0), "{called:?}");
    let unread = "set: 2 files look like images and are not read, as IMG_1.HEIC; PNG, JPEG, WebP, TIFF, BMP or OpenEXR expected, so convert them first";
    assert_eq!(called.stderr.matches(unread).count(), 1, "{called:?}");
    let first = "1 image is the first picture of a file with several (TIFF of several pages: 1; for example b.TIF)";
    assert_eq!(called.stderr.matches(first).count(), 1, "{called:?}");
    let records = records(&bench.path("run"));
    let digests = |condition: &str| {
        let mut digests: Vec<String> = records
            .iter()
            .filter(|record| record["condition"] == condition)
            .map(|record| record["image"]["digest"].to_string())
            .collect();
        digests.dedup();
        digests
    };
    // The PNG file is sent as it is, and the others are written by this program.
    assert_eq!((digests("L0").len(), digests("L2-ev").len()), (2, 1));
    let made = bench.call(&words("synthesize set/a.webp set/b.TIF --out dark --levels L0"));
    assert_eq!(made.code, Some(0), "{made:?}");
    let pixels = image::open(bench.path("dark/a_L0.png")).unwrap();
    assert_eq!(pixels.into_rgb8(), image());
    assert!(bench.path("dark/b_L0.png").exists());
}

#[test]
fn unread_image_folder_names_remedy() {
    let bench = Bench::new();
    bench.file("photos/IMG_1.HEIC", "x");
    let called = bench.call(&words("synthesize photos --out dark"));
    assert_eq!(called.code, Some(2), "{called:?}");
    insta::assert_snapshot!(called.messages(), @"
    exit code: 2
    error: photos: neither a frames.jsonl nor any PNG, JPEG, WebP, TIFF, BMP or OpenEXR image in this folder; 1
        file looks like an image and is not read, as IMG_1.HEIC; PNG, JPEG, WebP, TIFF, BMP or OpenEXR expected,
        so convert them first
    ");
    let called = bench.call(&words("realism photos --out r"));
    insta::assert_snapshot!(called.messages(), @"
    exit code: 2
     WARN photos: 1 file looks like an image and is not read, as IMG_1.HEIC; PNG, JPEG, WebP, TIFF, BMP or OpenEXR
        expected, so convert them first
    error: photos: no pairs in it; expected are folders normal and low (or high and low, val_rgb_h and val_rgb_l),
        or files like normal1.png and low1.png; --normal DIR and --low DIR name any two folders, instead of PAIRS
    ");
}
