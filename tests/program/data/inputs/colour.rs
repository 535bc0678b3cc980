//! Colours other than sRGB: converted as littleCMS does, or refused by name.

use std::fs;

use crate::support::icc_files::{DISPLAY_P3, SRGB, grey_profile, rgb_profile, srgb_curve, table};
use crate::support::image_files::{
    chunk, jpeg, jpeg_with_profile, png, png_with_profile, profile_chunk, webp_with_profile, with_chunks,
};
use crate::support::run::{Bench, words};
use crate::support::snapshot::redacted;
use crate::support::tiff_files::{Order, Page, tiff};
use darkqa_pictures::DecodeRule;
use darkqa_pictures::ImageFile;
use darkqa_pictures::decode_rule::ColourRule;
use image::{Rgb, RgbImage};
use serde_json::{Value, json};

/// The XYZ of the colours of Adobe RGB (1998), and of a space that is wider than the eye.
const ADOBE_RGB: [[f64; 3]; 3] =
    [[0.60974, 0.31111, 0.01947], [0.20528, 0.62567, 0.06087], [0.14919, 0.06322, 0.74457]];
const WIDE_GAMUT: [[f64; 3]; 3] = [[0.79767, 0.28802, 0.0], [0.13519, 0.71187, 0.0], [0.03134, 0.00009, 0.8249]];

/// The colours that are converted.
#[rustfmt::skip]
const COLOURS: [[u8; 3]; 56] = [
    [0, 0, 0], [0, 0, 77], [0, 0, 255], [0, 77, 0], [0, 77, 77], [0, 77, 255], [0, 255, 0], [0, 255, 77], [0, 255, 255],
    [77, 0, 0], [77, 0, 77], [77, 0, 255], [77, 77, 0], [77, 77, 77], [77, 77, 255], [77, 255, 0], [77, 255, 77],
    [77, 255, 255], [255, 0, 0], [255, 0, 77], [255, 0, 255], [255, 77, 0], [255, 77, 77], [255, 77, 255], [255, 255, 0],
    [255, 255, 77], [255, 255, 255], [130, 183, 14], [238, 127, 26], [80, 57, 190], [240, 126, 194], [52, 127, 6],
    [110, 208, 143], [93, 199, 81], [36, 71, 227], [64, 67, 0], [2, 107, 110], [84, 85, 148], [160, 101, 104],
    [93, 100, 196], [152, 11, 184], [212, 84, 74], [135, 33, 169], [154, 1, 173], [33, 158, 181], [156, 246, 161],
    [94, 246, 241], [90, 29, 131], [1, 1, 1], [5, 5, 5], [10, 10, 10], [20, 20, 20], [40, 40, 40], [128, 128, 128],
    [200, 200, 200], [254, 254, 254],
];

#[rustfmt::skip]
const OF_DISPLAY_P3: [[u8; 3]; 56] = [
    [0, 0, 0], [0, 0, 81], [0, 0, 255], [0, 79, 0], [0, 79, 78], [0, 79, 255], [0, 255, 0], [0, 255, 9], [0, 255, 255],
    [85, 0, 0], [85, 0, 80], [85, 0, 255], [77, 77, 0], [77, 77, 77], [77, 77, 255], [0, 255, 0], [0, 255, 5],
    [0, 255, 255], [255, 0, 0], [255, 0, 70], [255, 0, 255], [255, 53, 0], [255, 53, 67], [255, 53, 255], [255, 255, 0],
    [255, 255, 0], [255, 255, 255], [114, 185, 0], [255, 119, 0], [84, 56, 197], [255, 118, 197], [0, 129, 0],
    [63, 211, 137], [17, 202, 59], [21, 72, 236], [63, 67, 0], [0, 109, 111], [84, 85, 153], [170, 97, 103],
    [91, 100, 203], [166, 0, 191], [229, 72, 67], [147, 17, 175], [169, 0, 179], [0, 161, 184], [124, 249, 152],
    [0, 250, 242], [98, 23, 136], [1, 1, 1], [5, 5, 5], [10, 10, 10], [20, 20, 20], [40, 40, 40], [128, 128, 128],
    [200, 200, 200], [254, 254, 254],
];

#[rustfmt::skip]
const OF_ADOBE_RGB: [[u8; 3]; 56] = [
    [0, 0, 0], [0, 0, 77], [0, 0, 255], [0, 76, 0], [0, 76, 76], [0, 76, 255], [0, 255, 0], [0, 255, 50], [0, 255, 255],
    [89, 0, 0], [89, 0, 77], [89, 0, 255], [76, 76, 0], [76, 76, 76], [76, 76, 255], [0, 255, 0], [0, 255, 50],
    [0, 255, 255], [255, 0, 0], [255, 0, 77], [255, 0, 255], [255, 76, 0], [255, 76, 76], [255, 76, 255], [255, 255, 0],
    [255, 255, 50], [255, 255, 255], [99, 184, 0], [255, 128, 0], [87, 54, 195], [255, 127, 198], [0, 128, 0],
    [0, 209, 141], [0, 200, 69], [0, 69, 232], [60, 65, 0], [0, 107, 111], [83, 84, 151], [179, 101, 104], [90, 100, 200],
    [178, 3, 189], [243, 83, 72], [158, 27, 174], [181, 0, 178], [0, 159, 183], [92, 246, 158], [0, 246, 241],
    [104, 23, 135], [0, 0, 0], [1, 1, 1], [3, 3, 3], [12, 12, 12], [35, 35, 35], [129, 129, 129], [201, 201, 201],
    [254, 254, 254],
];

#[rustfmt::skip]
const OF_WIDE_GAMUT: [[u8; 3]; 56] = [
    [0, 0, 0], [0, 0, 103], [0, 0, 255], [0, 106, 0], [0, 105, 96], [0, 105, 255], [0, 255, 0], [0, 255, 0], [0, 255, 255],
    [133, 0, 0], [124, 0, 102], [0, 0, 255], [109, 96, 0], [96, 96, 96], [0, 95, 255], [0, 255, 0], [0, 255, 0],
    [0, 255, 255], [255, 0, 0], [255, 0, 100], [255, 0, 255], [255, 0, 0], [255, 0, 93], [255, 0, 255], [255, 255, 0],
    [255, 255, 0], [255, 255, 255], [124, 205, 0], [255, 108, 0], [42, 65, 214], [255, 104, 212], [0, 157, 0],
    [0, 231, 149], [0, 225, 62], [0, 95, 247], [90, 86, 0], [0, 139, 130], [69, 104, 172], [215, 102, 123], [16, 121, 217],
    [208, 0, 210], [255, 9, 88], [185, 0, 195], [213, 0, 200], [0, 190, 198], [43, 255, 162], [0, 255, 244], [125, 0, 159],
    [1, 1, 1], [4, 4, 4], [11, 11, 11], [26, 26, 26], [53, 53, 53], [146, 146, 146], [210, 210, 210], [254, 254, 254],
];

/// A curve of exponent 1.8 in 33 values.
fn in_33_values() -> Vec<u8> {
    let value = |i: u16| (65535.0 * (f64::from(i) / 32.0).powf(1.8)).round() as u16;
    table(&(0..33).map(value).collect::<Vec<_>>())
}

fn image() -> RgbImage {
    RgbImage::from_fn(8, 7, |x, y| Rgb(COLOURS[(y * 8 + x) as usize]))
}

fn file(bytes: Vec<u8>, colour: ColourRule) -> ImageFile {
    let rule = DecodeRule { colour, ..DecodeRule::default() };
    ImageFile::new(bytes, "a file".to_owned(), rule)
}

fn converted(bytes: Vec<u8>) -> Vec<u8> {
    let file = file(bytes, ColourRule::Convert);
    assert_eq!(file.check().unwrap(), (8, 7));
    file.decode().unwrap().samples().to_vec()
}

fn fault(bytes: Vec<u8>) -> String {
    let file = file(bytes, ColourRule::Convert);
    let error = file.decode().unwrap_err().to_string();
    assert_eq!(file.check().unwrap_err().to_string(), error);
    assert!(error.contains("--decode colour=ignore"), "{error}");
    error
}

/// The expected codes are those of littleCMS 2.19 (Pillow 13.0), relative colorimetric to its own sRGB, not optimised.
#[test]
fn profiles_are_converted_as_littlecms_does() {
    let image = image();
    for (profile, expected) in [
        (rgb_profile("Display P3", DISPLAY_P3, &srgb_curve()), OF_DISPLAY_P3),
        (rgb_profile("Adobe RGB (1998)", ADOBE_RGB, &table(&[563])), OF_ADOBE_RGB),
        (rgb_profile("Wide gamut", WIDE_GAMUT, &in_33_values()), OF_WIDE_GAMUT),
    ] {
        let found = converted(png_with_profile(&image, &profile));
        let pairs = found.iter().zip(expected.as_flattened());
        let off = pairs.map(|(found, expected)| found.abs_diff(*expected));
        assert!(off.clone().max() <= Some(1), "{off:?}");
        // The control: codes that are not converted are far away.
        let pairs = image.iter().zip(expected.as_flattened());
        assert!(pairs.map(|(a, b)| a.abs_diff(*b)).max() > Some(60));
        // The other formats hold the profile elsewhere, and the same pixels come of it.
        let page = Page::rgb(&image).with_profile(&profile);
        for bytes in [webp_with_profile(&image, &profile), tiff(Order::Big, &[page])] {
            assert_eq!(converted(bytes), found);
        }
        let coded = file(jpeg(&image), ColourRule::Convert).decode().unwrap();
        let coded = RgbImage::from_raw(8, 7, coded.samples().to_vec()).unwrap();
        let as_png = converted(png_with_profile(&coded, &profile));
        let as_jpeg = jpeg_with_profile(&jpeg(&image), &profile);
        assert_eq!(converted(as_jpeg), as_png);
    }
}

/// The same for every eighth shade of grey.
#[test]
fn grey_profiles_match_littlecms() {
    let expected = [
        0, 6, 20, 32, 43, 53, 63, 72, 81, 90, 99, 107, 115, 123, 131, 139, 146, 154, 161, 168, 176, 183, 190, 197, 203,
        210, 217, 223, 230, 237, 243, 249,
    ];
    let shades = image::GrayImage::from_fn(32, 1, |x, _| image::Luma([8 * x as u8]));
    let mut png = std::io::Cursor::new(Vec::new());
    shades.write_to(&mut png, image::ImageFormat::Png).unwrap();
    let profile = grey_profile("Grey gamma 1.8", &table(&[461]));
    let bytes = with_chunks(&png.into_inner(), &[profile_chunk(&profile)]);
    let pixels = file(bytes, ColourRule::Convert).decode().unwrap();
    for (pixel, expected) in pixels.samples().chunks(3).zip(expected) {
        assert!(pixel.iter().all(|sample| sample.abs_diff(expected) <= 1));
    }
    let error = fault(png_with_profile(&image(), &profile));
    assert!(error.contains("\"Grey gamma 1.8\" is for grey"), "{error}");
}

#[test]
fn equivalent_srgb_is_untouched() {
    let image = image();
    let profile = rgb_profile("sRGB of a test", SRGB, &srgb_curve());
    let code_points = |points: [u8; 4]| with_chunks(&png(&image), &[chunk(*b"cICP", &points)]);
    let mark = chunk(*b"sRGB", &[0]);
    let gamma = |value: u32| chunk(*b"gAMA", &value.to_be_bytes());
    for bytes in [
        png_with_profile(&image, &profile),
        webp_with_profile(&image, &profile),
        tiff(Order::Little, &[Page::rgb(&image).with_profile(&profile)]),
        code_points([1, 13, 0, 1]),
        with_chunks(&png(&image), std::slice::from_ref(&mark)),
        with_chunks(&png(&image), &[gamma(45_455)]),
        // The mark counts before gamma.
        with_chunks(&png(&image), &[gamma(100_000), mark]),
    ] {
        let digest = blake3::hash(&bytes).to_hex().to_string();
        let file = file(bytes.clone(), ColourRule::Convert);
        assert_eq!(file.digest().to_string(), digest);
        assert_eq!(file.note().colour, None);
        assert_eq!(converted(bytes), image.as_raw().as_slice());
    }
}

#[test]
fn the_first_information_counts() {
    let image = image();
    let p3 = profile_chunk(&rgb_profile("P3", DISPLAY_P3, &srgb_curve()));
    let mark = chunk(*b"sRGB", &[0]);
    let dark = chunk(*b"gAMA", &22_222_u32.to_be_bytes());
    let points = |points: [u8; 4]| chunk(*b"cICP", &points);
    let with = |chunks: &[Vec<u8>]| with_chunks(&png(&image), chunks);
    // Code points count before the profile, and the profile before mark and gamma.
    let srgb = converted(with(&[p3.clone(), points([1, 13, 0, 1])]));
    assert_eq!(srgb, image.as_raw().as_slice());
    let of_profile = converted(with(&[dark, mark, p3.clone()]));
    assert_eq!(of_profile, converted(with(&[p3])));
    assert_ne!(of_profile, srgb);
    let of_points = converted(with(&[points([12, 13, 0, 1])]));
    let close = |(a, b): (&u8, &u8)| a.abs_diff(*b) <= 1;
    assert!(of_points.iter().zip(&of_profile).all(close));
}

#[test]
fn unconvertible_profile_is_refused_or_ignored() {
    let image = image();
    let with = |kind, data: &[u8]| with_chunks(&png(&image), &[chunk(kind, data)]);
    let mut cut = rgb_profile("P3", DISPLAY_P3, &srgb_curve());
    cut.truncate(300);
    for (bytes, says) in [
        (with(*b"cICP", &[9, 16, 0, 1]), "PQ"),
        (with(*b"cICP", &[9, 18, 0, 1]), "HLG"),
        (with(*b"cICP", &[1, 13, 0, 0]), "narrow range"),
        (with(*b"gAMA", &55_556_u32.to_be_bytes()), "0.55556"),
        (with(*b"gAMA", &100_000_u32.to_be_bytes()), "linear light in 8 bits"),
        (png_with_profile(&image, &cut), "ICC profile"),
        (jpeg_with_profile(&jpeg(&image), b"no profile"), "ICC profile"),
    ] {
        let error = fault(bytes.clone());
        assert!(error.starts_with("a file: ") && error.contains(says), "{error}");
        let digest = blake3::hash(&bytes).to_hex().to_string();
        let ignoring = file(bytes, ColourRule::Ignore);
        assert!(ignoring.decode().is_ok());
        assert_eq!(ignoring.digest().to_string(), digest);
        let note = ignoring.note().colour.unwrap();
        assert_eq!(serde_json::to_value(note).unwrap()["handling"], "ignored");
    }
}

/// A few thousand bytes that stand for 64 MB.
#[test]
fn unbounded_profile_is_refused() {
    let bytes = png_with_profile(&image(), &vec![0; 64 << 20]);
    assert!(bytes.len() < 1 << 20);
    let error = fault(bytes.clone());
    insta::assert_snapshot!(redacted(&error), @"
    a file: the ICC profile has more than 4 MB; convert it to sRGB first, or take its codes as sRGB with --decode
        colour=ignore
    ");
    assert!(file(bytes, ColourRule::Ignore).decode().is_ok());
}

#[test]
fn a_run_says_what_was_converted() {
    let bench = Bench::new();
    let profile = rgb_profile("Display P3", DISPLAY_P3, &srgb_curve());
    bench.file("set/a.png", png_with_profile(&image(), &profile));
    bench.file("set/b.png", png(&image()));
    let question = |name: &str| {
        json!({"id": name, "frame": name, "question": "Is it?", "choices": ["yes", "no"], "answer": "no"}).to_string()
    };
    let questions = [question("a.png"), question("b.png")].join("\n");
    bench.file("set/questions.jsonl", questions);
    let line = "--data set --model random --levels L0,L2 --variant ev --out run";
    let called = bench.call(&words(line));
    assert_eq!(called.code, Some(0), "{called:?}");
    let said = "1 image is converted to sRGB (Display P3: 1; for example a.png)";
    assert_eq!(called.stderr.matches(said).count(), 1, "{called:?}");
    let manifest = fs::read(bench.path("run/manifest.json")).unwrap();
    let manifest: Value = serde_json::from_slice(&manifest).unwrap();
    assert_eq!(manifest["inputs"]["converted"], json!({"images": {"Display P3": 1}, "example": "a.png"}));
    let page = fs::read_to_string(bench.path("run/report.html")).unwrap();
    assert!(page.contains(said));
    // The same images by another rule are other images.
    let refused = bench.call(&words(&format!("{line} --colour ignore")));
    insta::assert_snapshot!(refused.messages(), @r#"
    exit code: 2
     WARN 1 image is taken as sRGB, because of --decode colour=ignore, although the file states other colours
        (Display P3: 1; for example a.png)
    error: run: the image "a.png" of question "a.png" has changed since the run began; restore the file, and flags
        that decide how it is read (--decode), or use another --out
    "#);
    // What was asked is made again by the rule of the run.
    let shown = bench.call(&words("show run a.png"));
    assert_eq!(shown.code, Some(0), "{shown:?}");
    for (rule, said, handling) in [("convert", said, "converted"), ("ignore", "1 image is taken as sRGB", "ignored")] {
        let line = format!("synthesize set --out {rule} --levels L0 --colour {rule}");
        let made = bench.call(&words(&line));
        assert!(made.stderr.contains(said), "{made:?}");
        let sidecar = fs::read(bench.path(&format!("{rule}/a_L0.json"))).unwrap();
        let sidecar: Value = serde_json::from_slice(&sidecar).unwrap();
        let digest = blake3::hash(&profile).to_hex().to_string();
        assert_eq!(sidecar["colour"], json!({"from": "Display P3", "profile": digest, "handling": handling}));
        let pixels = image::open(bench.path(&format!("{rule}/a_L0.png"))).unwrap();
        assert_eq!(pixels.into_rgb8() == image(), rule == "ignore");
    }
}
