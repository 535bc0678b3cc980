//! Images of 16 bits: they keep their depth until the light is reduced.

use std::fs;

use crate::support::icc_files::{DISPLAY_P3, rgb_profile, srgb_curve};
use crate::support::image_files::{chunk, profile_chunk, with_chunks};
use crate::support::run::{Bench, words};
use crate::support::tiff_files::{Order, Page, tiff};
use darkqa_base::types::{Pixels, Severity};
use darkqa_light::exposure::expose;
use darkqa_pictures::DecodeRule;
use darkqa_pictures::ImageFile;
use darkqa_pictures::decode_rule::Transfer;
use image::{ImageBuffer, Rgb, RgbImage};
use serde_json::Value;

type Image16 = ImageBuffer<Rgb<u16>, Vec<u16>>;

/// Every 16-bit code once, and two more.
fn all_codes() -> Image16 {
    let codes = (0..=u16::MAX).chain([7, 9]);
    Image16::from_raw(66, 65_538 / 3 / 66, codes.collect()).unwrap()
}

fn png(image: &Image16) -> Vec<u8> {
    let mut file = std::io::Cursor::new(Vec::new());
    image.write_to(&mut file, image::ImageFormat::Png).unwrap();
    file.into_inner()
}

fn tiff_of(order: Order, image: &Image16) -> Vec<u8> {
    let page = Page {
        size: [image.width(), image.height()],
        channels: 3,
        samples: image.as_raw().clone(),
        bits: 16,
        tags: Vec::new(),
    };
    tiff(order, &[page])
}

fn file(bytes: Vec<u8>) -> ImageFile {
    ImageFile::new(bytes, "a file".to_owned(), DecodeRule::default())
}

fn linear(bytes: Vec<u8>) -> ImageFile {
    let rule = DecodeRule { transfer: Transfer::Linear, ..DecodeRule::default() };
    ImageFile::new(bytes, "a file".to_owned(), rule)
}

#[test]
fn codes_darken_before_rounding() {
    let image = all_codes();
    for bytes in [png(&image), tiff_of(Order::Big, &image), tiff_of(Order::Little, &image)] {
        let file = file(bytes.clone());
        let pixels = file.pixels().unwrap();
        assert!(matches!(&pixels, Pixels::Rgb16Image(codes) if codes.samples() == image.as_raw()));
        let digest = blake3::hash(&bytes).to_hex().to_string();
        assert_ne!(file.digest().to_string(), digest);
        let mut differ = [0; 6];
        let drops = [200, 400, 600, 750, 900, 220].map(Severity::from_hundredths);
        for (drop, differ) in drops.into_iter().zip(&mut differ) {
            let factor = (-drop.value() / 2.2).exp2();
            let of = |value: f64| (255.0 * value * factor + 0.5 + 1e-9).floor() as u8;
            let dark = expose(&pixels, drop);
            let shown = file.decode().unwrap();
            let codes = image.as_raw().iter();
            for ((code, dark), shown) in codes.zip(dark.samples()).zip(shown.samples()) {
                assert_eq!(*dark, of(f64::from(*code) / 65_535.0), "{code}, {drop}");
                let expected = (f64::from(*code) / 257.0).round();
                assert!((f64::from(*shown) - expected).abs() < 0.5);
                *differ += usize::from(*dark != of(f64::from(*shown) / 255.0));
            }
        }
        // Rounding to 8 bits first moves 13 % of all codes at L1, 7, 4, 2.4 and 1.7 % at L2 to L5.
        let percent = differ.map(|codes| (1000.0 * codes as f64 / 65_538.0).round() / 10.0);
        assert_eq!(percent[..5], [13.3, 7.1, 3.9, 2.4, 1.7]);
    }
}

/// A picture of 8 bits that is stored in 16 is the same picture.
#[test]
fn eight_bits_in_sixteen_match() {
    let bench = Bench::new();
    let eight = RgbImage::from_fn(37, 21, |x, y| Rgb([(x * 6) as u8, (y * 12) as u8, 90]));
    let samples = eight.as_raw().iter().map(|code| 257 * u16::from(*code)).collect();
    let sixteen = Image16::from_raw(37, 21, samples).unwrap();
    fs::create_dir_all(bench.path("8")).unwrap();
    eight.save(bench.path("8/a.png")).unwrap();
    bench.file("16/a.png", png(&sixteen));
    let levels = "--levels L0,L1,2.2,L5 --profile all";
    for depth in ["8", "16"] {
        let made = bench.call(&words(&format!("synthesize {depth} --out out-{depth} {levels}")));
        assert_eq!(made.code, Some(0), "{made:?}");
        let said = "1 image is of more than 8 bits, which are rounded to 8 only after the light is reduced (16-bit codes: 1; for example a.png)";
        assert_eq!(made.stderr.contains(said), depth == "16", "{made:?}");
    }
    let mut compared = 0;
    for entry in fs::read_dir(bench.path("out-8")).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        let read = |depth: &str| fs::read(bench.path(&format!("out-{depth}/{name}"))).unwrap();
        let (one, other) = (read("8"), read("16"));
        if name.strip_suffix(".png").is_some() {
            assert!(one == other, "{name}");
            compared += 1;
        } else {
            let sidecar = |bytes: &[u8]| serde_json::from_slice::<Value>(bytes).unwrap();
            assert_eq!(sidecar(&other)["depth"], "16-bit");
            assert_eq!(sidecar(&one).get("depth"), None);
            assert_ne!(sidecar(&one)["source"], sidecar(&other)["source"]);
        }
    }
    assert_eq!(compared, 16);
    // What is finer than 8 bits does show.
    let mut finer = sixteen;
    finer.iter_mut().for_each(|code| *code = code.saturating_add(100));
    bench.file("finer/a.png", png(&finer));
    let made = bench.call(&words(&format!("synthesize finer --out finer-out {levels}")));
    assert_eq!(made.code, Some(0), "{made:?}");
    let read = |path: &str| fs::read(bench.path(path)).unwrap();
    assert_eq!(read("finer-out/a_L0.png"), read("out-8/a_L0.png"));
    for condition in ["L1-ev", "L1-noise", "L5-noise@physical"] {
        let name = format!("a_{condition}.png");
        assert_ne!(read(&format!("finer-out/{name}")), read(&format!("out-8/{name}")));
    }
    // The JSON file makes the same image again.
    let again = "synthesize finer/a.png --from finer-out/a_L5-noise@physical.json --out again";
    assert_eq!(bench.call(&words(again)).code, Some(0));
    assert_eq!(read("again/a_L5-noise@physical.png"), read("finer-out/a_L5-noise@physical.png"));
}

#[test]
fn sixteen_bit_profiles_keep_sixteen_bits() {
    let image = Image16::from_fn(16, 16, |x, y| Rgb([(x * 4112) as u16, (y * 4112) as u16, 31_097]));
    let profile = profile_chunk(&rgb_profile("P3", DISPLAY_P3, &srgb_curve()));
    let deep = file(with_chunks(&png(&image), std::slice::from_ref(&profile)));
    let Pixels::Rgb16Image(codes) = deep.pixels().unwrap() else { panic!("16 bits") };
    // The same colours in 8 bits, which are multiples of 257 in 16.
    let eight = RgbImage::from_fn(16, 16, |x, y| {
        Rgb(image.get_pixel(x, y).0.map(|code| ((u32::from(code) + 128) / 257) as u8))
    });
    let shallow = with_chunks(&crate::support::image_files::png(&eight), &[profile]);
    let shallow = file(shallow).decode().unwrap();
    for (deep, shallow) in codes.samples().iter().zip(shallow.samples()) {
        let off = f64::from(*deep) / 257.0 - f64::from(*shallow);
        assert!(off.abs() < 0.503, "{deep} {shallow}");
    }
    assert!(codes.samples().iter().any(|code| code % 257 != 0));
}

#[test]
fn linear_light_from_flag_or_file() {
    let image = Image16::from_fn(8, 8, |x, y| Rgb([(x * 8000) as u16, (y * 100) as u16, 65_535]));
    let gamma = |value: u32| chunk(*b"gAMA", &value.to_be_bytes());
    let by_file = with_chunks(&png(&image), &[gamma(100_000)]);
    let light = |file: &ImageFile| match file.pixels().unwrap() {
        Pixels::Light(light) => light,
        other => panic!("{other:?}"),
    };
    let expected: Vec<f32> = image.as_raw().iter().map(|code| f32::from(*code) / 65_535.0).collect();
    for file in
        [linear(png(&image)), linear(tiff_of(Order::Big, &image)), file(by_file.clone()), linear(by_file.clone())]
    {
        assert_eq!(light(&file).samples(), expected);
        let note = serde_json::to_value(file.note()).unwrap();
        assert_eq!(note, serde_json::json!({"depth": "light"}));
    }
    assert_ne!(linear(png(&image)).digest(), file(png(&image)).digest());
    // A file that says something else is not overruled in silence.
    for contradicting in [
        with_chunks(&png(&image), &[gamma(45_455)]),
        with_chunks(&png(&image), &[chunk(*b"sRGB", &[0])]),
        with_chunks(&png(&image), &[profile_chunk(&rgb_profile("P3", DISPLAY_P3, &srgb_curve()))]),
    ] {
        let file = linear(contradicting);
        let error = file.decode().unwrap_err().to_string();
        assert!(error.contains("--decode transfer=linear"), "{error}");
        assert_eq!(file.check().unwrap_err().to_string(), error);
    }
    // Eight bits are never linear light, and the note says that the flag does not apply.
    let eight = crate::support::image_files::png(&RgbImage::from_pixel(2, 2, Rgb([9; 3])));
    let file = linear(eight.clone());
    assert!(matches!(file.pixels().unwrap(), Pixels::Codes8(_)));
    assert_eq!(file.note().no_light, ["--decode transfer=linear"]);
    let digest = blake3::hash(&eight).to_hex().to_string();
    assert_eq!(file.digest().to_string(), digest);
}
