//! Images with the colours of video: SDR codes are kept on every route, wide primaries are converted, HDR only on
//! demand.

use crate::support::icc_files::{SRGB, rgb_profile, segments, table};
use crate::support::image_files::{
    chunk, jpeg, jpeg_with_profile, png, png_with_profile, profile_chunk, webp_with_profile, with_chunks,
};
use crate::support::run::{Bench, words};
use darkqa_pictures::decode_rule::ColourRule;
use darkqa_pictures::{DecodeRule, ImageFile};
use image::{Rgb, RgbImage};

/// XYZ of the primaries of BT.2020 at D50 (ITU-R BT.2020-2, adapted by Bradford).
const BT2020: [[f64; 3]; 3] = [[0.67348, 0.27904, -0.00194], [0.16567, 0.67534, 0.02998], [0.12505, 0.04562, 0.79685]];

/// The values of `cHRM`: white, red, green and blue.
const SRGB_CHRM: [u32; 8] = [31_270, 32_900, 64_000, 33_000, 30_000, 60_000, 15_000, 6_000];
const SMPTE_CHRM: [u32; 8] = [31_270, 32_900, 63_000, 34_000, 31_000, 59_500, 15_500, 7_000];
const PAL_CHRM: [u32; 8] = [31_270, 32_900, 64_000, 33_000, 29_000, 60_000, 15_000, 6_000];
const BT2020_CHRM: [u32; 8] = [31_270, 32_900, 70_800, 29_200, 17_000, 79_700, 13_100, 4_600];
const P3_CHRM: [u32; 8] = [31_270, 32_900, 68_000, 32_000, 26_500, 69_000, 15_000, 6_000];

/// Grey, a colour, dark grey and white.
const PIXELS: [[u8; 3]; 4] = [[128; 3], [200, 100, 50], [60; 3], [255; 3]];

/// [`PIXELS`] in sRGB, as in `tests/program/data/videos.rs`.
const OF_HLG: [[u8; 3]; 4] = [[137; 3], [255, 69, 27], [57; 3], [255; 3]];
const OF_PQ: [[u8; 3]; 4] = [[181; 3], [255, 0, 0], [39; 3], [255; 3]];
const OF_BT2020: [[u8; 3]; 4] = [[128; 3], [241, 76, 29], [60; 3], [255; 3]];
const OF_P3: [[u8; 3]; 4] = [[128; 3], [215, 93, 31], [60; 3], [255; 3]];
const OF_GAMMA_28: [[u8; 3]; 4] = [[106; 3], [189, 76, 26], [36; 3], [255; 3]];

fn image() -> RgbImage {
    RgbImage::from_fn(4, 1, |x, _| Rgb(PIXELS[x as usize]))
}

/// [`PIXELS`] in 16 bits.
fn deep_png() -> Vec<u8> {
    let image = image::ImageBuffer::from_fn(4, 1, |x, _| Rgb(PIXELS[x as usize].map(|code| u16::from(code) * 257)));
    let mut file = std::io::Cursor::new(Vec::new());
    image.write_to(&mut file, image::ImageFormat::Png).unwrap();
    file.into_inner()
}

fn cicp(points: [u8; 4]) -> Vec<u8> {
    chunk(*b"cICP", &points)
}

fn gama(exponent: u32) -> Vec<u8> {
    chunk(*b"gAMA", &exponent.to_be_bytes())
}

fn chrm(numbers: [u32; 8]) -> Vec<u8> {
    chunk(*b"cHRM", numbers.map(u32::to_be_bytes).as_flattened())
}

fn file(bytes: Vec<u8>, colour: ColourRule) -> ImageFile {
    let rule = DecodeRule { colour, ..DecodeRule::default() };
    ImageFile::new(bytes, "a file".to_owned(), rule)
}

fn pixels(file: &ImageFile) -> Vec<u8> {
    file.check().unwrap();
    file.decode().unwrap().samples().to_vec()
}

#[test]
fn codes_of_sdr_video_are_kept_in_png() {
    let tags = [
        // ffmpeg 7 and 9; 5.1 writes the same without cICP.
        vec![cicp([1, 1, 0, 1]), chrm(SRGB_CHRM), gama(50_994)],
        vec![cicp([1, 1, 0, 1]), chrm(SRGB_CHRM), gama(45_455)],
        vec![chrm(SRGB_CHRM), gama(50_994)],
        vec![gama(50_994)],
        vec![cicp([6, 6, 0, 1]), chrm(SMPTE_CHRM), gama(50_994)],
        vec![chrm(SMPTE_CHRM), gama(50_994)],
        vec![cicp([5, 6, 0, 1])],
        vec![chrm(PAL_CHRM), gama(50_994)],
        vec![cicp([7, 7, 0, 1])],
        vec![cicp([1, 14, 0, 1])],
        vec![cicp([1, 15, 0, 1])],
        vec![cicp([1, 4, 0, 1]), gama(45_455)],
        vec![cicp([2, 2, 0, 1])],
        vec![cicp([1, 13, 0, 1])],
    ];
    for chunks in tags {
        for image in [png(&image()), deep_png()] {
            let file = file(with_chunks(&image, &chunks), ColourRule::Convert);
            assert_eq!(pixels(&file), PIXELS.as_flattened(), "{chunks:?}");
            assert_eq!(file.note().colour, None);
        }
    }
}

#[test]
fn codes_of_sdr_video_are_kept_with_a_profile() {
    // The curve of BT.709 in segments, and the gamma of 1.961 that approximates it.
    let camera = segments(3, &[1.0 / 0.45, 1.0 / 1.099, 0.099 / 1.099, 1.0 / 4.5, 0.081]);
    for curve in [camera, table(&[502])] {
        let profile = rgb_profile("Rec. ITU-R BT.709-5", SRGB, &curve);
        let png = png_with_profile(&image(), &profile);
        let webp = webp_with_profile(&image(), &profile);
        for bytes in [png, webp] {
            let file = file(bytes, ColourRule::Convert);
            assert_eq!(pixels(&file), PIXELS.as_flattened());
            assert_eq!(file.note().colour, None);
        }
        let plain = pixels(&file(jpeg(&image()), ColourRule::Convert));
        let profiled = jpeg_with_profile(&jpeg(&image()), &profile);
        assert_eq!(pixels(&file(profiled, ColourRule::Convert)), plain);
        let wide = rgb_profile("Rec. ITU-R BT.2020-1", BT2020, &curve);
        let wide = file(png_with_profile(&image(), &wide), ColourRule::Convert);
        assert_near(&wide, OF_BT2020);
    }
    // A control: the curve of 1.8 is converted.
    let other = rgb_profile("Gamma 1.8", SRGB, &table(&[461]));
    let other = file(png_with_profile(&image(), &other), ColourRule::Convert);
    assert_ne!(pixels(&other), PIXELS.as_flattened());
}

fn assert_near(file: &ImageFile, expected: [[u8; 3]; 4]) {
    let found = pixels(file);
    let pairs = found.iter().zip(expected.as_flattened());
    let off = pairs.map(|(a, b)| a.abs_diff(*b)).max();
    assert!(off <= Some(1), "{found:?}, not {expected:?}");
}

#[test]
fn wide_primaries_and_gamma_are_converted() {
    for (chunks, expected) in [
        (vec![cicp([9, 1, 0, 1]), chrm(BT2020_CHRM)], OF_BT2020),
        (vec![cicp([9, 14, 0, 1])], OF_BT2020),
        (vec![cicp([9, 15, 0, 1])], OF_BT2020),
        (vec![chrm(BT2020_CHRM), gama(50_994)], OF_BT2020),
        (vec![cicp([12, 1, 0, 1])], OF_P3),
        (vec![cicp([12, 13, 0, 1])], OF_P3),
        (vec![chrm(P3_CHRM), gama(50_994)], OF_P3),
        (vec![chrm(P3_CHRM), gama(45_455)], OF_P3),
        (vec![cicp([5, 5, 0, 1])], OF_GAMMA_28),
        (vec![chrm(PAL_CHRM), gama(35_714)], OF_GAMMA_28),
    ] {
        for image in [png(&image()), deep_png()] {
            let file = file(with_chunks(&image, &chunks), ColourRule::Convert);
            assert_near(&file, expected);
            assert!(file.note().colour.is_some());
        }
    }
}

#[test]
fn hdr_is_converted_on_demand_alone() {
    // A profile of HDR states code points beside its tables.
    let hdr_profile = |points: [u8; 4]| {
        let data = [&b"cicp\0\0\0\0"[..], &points].concat();
        let profile = crate::support::icc_files::profile(*b"RGB ", &[(*b"cicp", data), (*b"A2B0", vec![0; 64])]);
        profile_chunk(&profile)
    };
    for (chunks, expected, name) in [
        (vec![cicp([9, 18, 0, 1]), chrm(BT2020_CHRM)], OF_HLG, "HLG (HDR), BT.2020"),
        (vec![cicp([9, 16, 0, 1])], OF_PQ, "PQ (HDR), BT.2020"),
        (vec![cicp([2, 16, 0, 1])], OF_PQ, "PQ (HDR), BT.2020"),
        (vec![hdr_profile([9, 16, 0, 1])], OF_PQ, "PQ (HDR), BT.2020"),
    ] {
        for image in [png(&image()), deep_png()] {
            let bytes = with_chunks(&image, &chunks);
            let refused = file(bytes.clone(), ColourRule::Convert);
            let problem = refused.decode().unwrap_err().to_string();
            assert!(problem.contains(name) && problem.contains("--decode colour=clip"), "{problem}");
            assert_eq!(refused.check().unwrap_err().to_string(), problem);
            let clipped = file(bytes.clone(), ColourRule::Clip);
            assert_near(&clipped, expected);
            let note = serde_json::to_value(clipped.note()).unwrap();
            assert_eq!(note["colour"]["from"], name);
            assert_eq!(note["colour"]["handling"], "clipped");
            let ignored = file(bytes, ColourRule::Ignore);
            assert_eq!(pixels(&ignored), PIXELS.as_flattened());
            assert_ne!(clipped.digest(), ignored.digest());
        }
    }
    // Other images are the same by both rules.
    for bytes in [png(&image()), with_chunks(&png(&image()), &[cicp([12, 13, 0, 1])])] {
        let [convert, clip] = [ColourRule::Convert, ColourRule::Clip].map(|rule| file(bytes.clone(), rule));
        assert_eq!((pixels(&convert), convert.digest()), (pixels(&clip), clip.digest()));
    }
}

/// ffmpeg 5.1 writes the primaries of an HDR frame alone.
#[test]
fn wide_primaries_without_a_transfer_are_refused() {
    for chunks in [vec![chrm(BT2020_CHRM)], vec![cicp([9, 2, 0, 1])]] {
        let file = file(with_chunks(&deep_png(), &chunks), ColourRule::Clip);
        let problem = file.decode().unwrap_err().to_string();
        assert!(problem.contains("no transfer is stated: the codes may be HDR"), "{problem}");
    }
}

#[test]
fn the_flag_in_the_message_about_hdr_helps() {
    let bench = Bench::new();
    bench.file("set/a.png", with_chunks(&deep_png(), &[cicp([9, 18, 0, 1])]));
    let refused = bench.call(&words("synthesize set --levels L0 --out dark"));
    insta::assert_snapshot!(refused.messages(), @"
    exit code: 1
    ERROR set/a.png: the codes are HLG (HDR), BT.2020; --decode colour=clip converts them to sRGB, where light
        above 203 cd/m² becomes white; or convert it to sRGB first, or take its codes as sRGB with --decode
        colour=ignore
    ");
    let line = "synthesize set --levels L0 --out dark --decode colour=clip";
    let said = bench.call(&words(line)).ended(0).stderr;
    assert!(said.contains("converted to sRGB by --decode colour=clip"), "{said}");
    let made = image::open(bench.path("dark/a_L0.png")).unwrap().into_rgb8();
    assert_eq!(made[(0, 0)].0, [137; 3]);
}
