//! Linear light: OpenEXR files and rooms, whose highlights are kept until the light is reduced.

use std::fs;

use crate::support::exr_files::{compressed, cropped, exr, with_channels, with_primaries, with_two_layers};
use crate::support::run::{Bench, records, words};
use crate::support::snapshot::redacted;
use darkqa_base::types::{FrameId, Light, Pixels, Severity};
use darkqa_light::exposure::expose;
use darkqa_light::raw::negative::Negative;
use darkqa_light::{CameraModel, NoiseKey, NoiseProfile, Synthesis};
use darkqa_pictures::DecodeRule;
use darkqa_pictures::ImageFile;
use darkqa_pictures::decode_rule::ColourRule;
use exr::prelude::{Compression, FlatSamples, f16};
use image::RgbImage;
use serde_json::Value;

/// Light from black over white to 64 times white.
fn lights() -> Vec<f32> {
    (0..48 * 32 * 3).map(|i| 64.0 * (i as f32 / 4607.0).powi(4)).collect()
}

fn file(bytes: Vec<u8>) -> ImageFile {
    ImageFile::new(bytes, "a file".to_owned(), DecodeRule::default())
}

fn light(file: &ImageFile) -> Vec<f32> {
    match file.pixels().unwrap() {
        Pixels::Light(light) => light.samples().to_vec(),
        other => panic!("{other:?}"),
    }
}

/// The code of light after a drop, clipped after it.
fn code(light: f32, drop_ev: f64) -> u8 {
    let light = (f64::from(light) * (-drop_ev).exp2()).min(1.0);
    (255.0 * light.powf(1.0 / 2.2) + 0.5).floor() as u8
}

#[test]
fn light_is_clipped_after_the_drop() {
    let lights = lights();
    let bytes = exr([48, 32], &lights);
    let file = file(bytes.clone());
    assert_eq!(file.check().unwrap(), (48, 32));
    assert_eq!(light(&file), lights);
    let digest = blake3::hash(&bytes).to_hex().to_string();
    assert_ne!(file.digest().to_string(), digest);
    let (pixels, shown) = (file.pixels().unwrap(), file.decode().unwrap());
    for (light, shown) in lights.iter().zip(shown.samples()) {
        assert_eq!(*shown, code(*light, 0.0), "{light}");
    }
    for drop in [100, 200, 400, 600, 750, 900, 1600].map(Severity::from_hundredths) {
        let dark = expose(&pixels, drop);
        for (light, dark) in lights.iter().zip(dark.samples()) {
            assert_eq!(*dark, code(*light, drop.value()), "{light} at {drop}");
        }
    }
    // A lamp of 16 times white is still white at L2, where codes of 8 bits end at 72.
    assert_eq!(code(16.0, 4.0), 255);
    assert_eq!(code(1.0, 4.0), 72);
}

fn flat(light: f32) -> Light {
    Light::new(64, 64, vec![light; 64 * 64 * 3]).unwrap()
}

/// The mean code of a flat image in a noise profile without noise.
fn without_noise(reading: NoiseProfile, light: f32, drop: Severity) -> f64 {
    let synthesis = Synthesis::new(reading, CameraModel::default());
    let key = NoiseKey::new(0, &FrameId("a".to_owned()));
    let state = synthesis.state(&key, drop);
    let headroom = synthesis.headroom_ev(drop.value());
    let Synthesis { amplify, tone, .. } = synthesis;
    let pixels = Pixels::Light(flat(light).into());
    let negative = Negative::with_state(&pixels, &key, &state, amplify, tone, &[], headroom);
    let image = negative.develop(drop);
    let sum: f64 = image.samples().iter().map(|code| f64::from(*code)).sum();
    sum / image.samples().len() as f64
}

/// Where the sensor saturates: at white before the drop by the letter of the paper, and after it where less light means
/// fewer photons.
#[test]
fn sensor_saturates_as_reading_says() {
    let drop = Severity::L2;
    for reading in NoiseProfile::ALL {
        // Greys are those of the exposure branch, since no tone curve is undone.
        for light in [0.0, 0.02, 0.18, 0.5, 0.9] {
            let (found, expected) = (without_noise(reading, light, drop), f64::from(code(light, drop.value())));
            assert!((found - expected).abs() <= 1.0, "{reading:?}, {light}: {found}");
        }
        let lamp = without_noise(reading, 16.0, drop);
        let bright = without_noise(reading, 4.0, drop);
        match reading {
            NoiseProfile::Paper | NoiseProfile::Eld => {
                assert!((lamp - 72.0).abs() < 1.0 && (bright - 72.0).abs() < 1.0, "{lamp}");
            }
            NoiseProfile::Level | NoiseProfile::Physical => {
                assert!((lamp - 255.0).abs() < 1.0, "{lamp}");
                let expected = f64::from(code(4.0, drop.value()));
                assert!((bright - expected).abs() < 1.0, "{bright} {expected}");
            }
        }
    }
}

#[test]
fn shallow_and_deep_floats_are_read() {
    let values = [0.0, 0.25, 1.0, 2.5, 100.0, 0.5];
    let half = || FlatSamples::F16(values.iter().map(|v| f16::from_f32(*v)).collect());
    let single = || FlatSamples::F32(values.to_vec());
    let ones = || FlatSamples::F32(vec![1.0; 6]);
    for bytes in [
        with_channels([3, 2], vec![("R", half()), ("G", single()), ("B", half())]),
        with_channels([3, 2], vec![("R", half()), ("G", single()), ("B", half()), ("A", ones()), ("Z", half())]),
    ] {
        let expected: Vec<f32> = values.iter().flat_map(|value| [*value; 3]).collect();
        assert_eq!(light(&file(bytes)), expected);
    }
    let two = file(with_two_layers([3, 2], [0.25, 0.5]));
    assert_eq!(light(&two), [0.25; 18]);
    let note = two.note();
    assert_eq!(note.first_of.as_deref(), Some("OpenEXR of several layers"));
}

#[test]
fn every_lossless_compression_is_read() {
    let lights = lights();
    for compression in
        [Compression::Uncompressed, Compression::RLE, Compression::ZIP1, Compression::ZIP16, Compression::PIZ]
    {
        let bytes = compressed([48, 32], &lights, compression);
        assert_eq!(light(&file(bytes)), lights, "{compression:?}");
    }
    // A file that says that it has the lossy compression DWAA (8).
    let mut bytes = compressed([48, 32], &lights, Compression::PIZ);
    let name = b"compression\0compression\0";
    let at = bytes.windows(name.len()).position(|part| part == name);
    bytes[at.unwrap() + name.len() + 4] = 8;
    let error = file(bytes).decode().unwrap_err().to_string();
    insta::assert_snapshot!(
        redacted(&error),
        @"a file: an OpenEXR image of the lossy compression DWAA or DWAB, which is not read; save it with ZIP or PIZ"
    );
}

#[test]
fn invalid_light_is_refused_by_name() {
    let with = |value: f32| {
        let mut light = vec![0.5; 18];
        light[10] = value;
        exr([3, 2], &light)
    };
    assert!(light(&file(with(-5e-4)))[10].abs() < f32::MIN_POSITIVE);
    let grey = |value| FlatSamples::F32(vec![value; 6]);
    let whole = FlatSamples::U32(vec![1; 6]);
    let colours = || vec![("R", grey(0.5)), ("G", grey(0.5)), ("B", grey(0.5))];
    for (bytes, says) in [
        (with(f32::NAN), "NaN at the pixel (0, 1), channel G, is not an amount of light"),
        (with(f32::INFINITY), "inf at the pixel (0, 1)"),
        (with(-2e-3), "-0.002 at the pixel (0, 1)"),
        (with_channels([3, 2], [colours(), vec![("A", grey(0.5))]].concat()), "transparent in places"),
        (with_channels([3, 2], vec![("R", whole.clone()), ("G", whole.clone()), ("B", whole)]), "whole numbers"),
        (with_channels([3, 2], vec![("Y", grey(0.5))]), "channels R, G and B"),
        (cropped([3, 2], [5, 4]), "does not cover its display window"),
    ] {
        let file = file(bytes);
        let error = file.decode().unwrap_err().to_string();
        assert!(error.starts_with("a file: ") && error.contains(says), "{error}");
        assert_eq!(file.check().unwrap_err().to_string(), error);
    }
    // Overscan is cut off.
    assert_eq!(file(cropped([5, 4], [3, 2])).check().unwrap(), (3, 2));
    let whole = exr([48, 32], &lights());
    for length in [3, 10, 200, whole.len() / 2, whole.len() - 1] {
        let error = file(whole[..length].to_vec()).decode().unwrap_err();
        assert!(error.to_string().contains("not a"), "{length}: {error}");
    }
    let rule = DecodeRule { max_pixels: 48 * 32 - 1, ..DecodeRule::default() };
    let error = ImageFile::new(whole, "a file".to_owned(), rule).decode();
    insta::assert_snapshot!(
        redacted(&error.unwrap_err().to_string()),
        @"a file: 48 × 32 pixels are more than the 1535 that are read; shrink it first, or raise --decode max-pixels"
    );
}

/// The matrix of ITU-R BT.2087, table 1, inverted: from the primaries of BT.2020 to those of BT.709.
#[test]
fn other_primaries_are_converted() {
    const TO_BT709: [[f32; 3]; 3] =
        [[1.6605, -0.5876, -0.0728], [-0.1246, 1.1329, -0.0083], [-0.0182, -0.1006, 1.1187]];
    const BT2020: [[f32; 2]; 4] = [[0.708, 0.292], [0.170, 0.797], [0.131, 0.046], [0.3127, 0.3290]];
    const BT709: [[f32; 2]; 4] = [[0.64, 0.33], [0.30, 0.60], [0.15, 0.06], [0.3127, 0.3290]];
    let stated = [0.5, 0.4, 0.3, 0.0, 2.0, 0.0, 3.0, 3.0, 3.0_f32];
    let wide = with_primaries([3, 1], &stated, Some(BT2020));
    let converted = file(wide.clone());
    let found = light(&converted);
    for (found, stated) in found.chunks(3).zip(stated.chunks(3)) {
        for (found, row) in found.iter().zip(TO_BT709) {
            let expected: f32 = row.iter().zip(stated).map(|(a, b)| a * b).sum();
            let expected = expected.max(0.0);
            assert!((found - expected).abs() < 3e-3, "{found} {expected}");
        }
    }
    let note = serde_json::to_value(converted.note()).unwrap();
    assert_eq!(note["colour"]["handling"], "converted");
    let named = "primaries 0.7080 0.2920, 0.1700 0.7970, 0.1310 0.0460, white 0.3127 0.3290";
    assert_eq!(note["colour"]["from"], named);
    let same = file(with_primaries([3, 1], &stated, Some(BT709)));
    assert_eq!(light(&same), stated);
    assert_eq!(same.note().colour, None);
    let rule = DecodeRule { colour: ColourRule::Ignore, ..DecodeRule::default() };
    let ignoring = ImageFile::new(wide, "a file".to_owned(), rule);
    assert_eq!(light(&ignoring), stated);
    assert_ne!(ignoring.digest(), converted.digest());
}

#[test]
fn exposure_scales_light_alone() {
    let bench = Bench::new();
    let doubled: Vec<f32> = lights().iter().map(|light| 2.0 * light).collect();
    bench.file("one/a.exr", exr([48, 32], &lights()));
    bench.file("two/a.exr", exr([48, 32], &doubled));
    RgbImage::new(48, 32).save(bench.path("one/b.png")).unwrap();
    let made = bench.call(&words("synthesize one --out scaled --exposure 1 --levels L0,L3 --profile paper,physical"));
    insta::assert_snapshot!(made.messages(), @"
    exit code: 0
     WARN 1 image is of more than 8 bits, which are rounded to 8 only after the light is reduced (linear light: 1;
        for example a.exr)
     WARN 1 image is scaled by --decode exposure (1 EV: 1; for example a.exr)
     WARN 1 image is not linear light, so that a flag does not apply (--decode exposure: 1; for example b.png)
    ");
    let made = bench.call(&words("synthesize two --out plain --levels L0,L3 --profile paper,physical"));
    assert_eq!(made.code, Some(0), "{made:?}");
    for condition in ["L0", "L3-ev", "L3-noise", "L3-noise@physical"] {
        let read = |folder: &str, end: &str| fs::read(bench.path(&format!("{folder}/a_{condition}.{end}"))).unwrap();
        assert_eq!(read("scaled", "png"), read("plain", "png"), "{condition}");
        let sidecar: Value = serde_json::from_slice(&read("scaled", "json")).unwrap();
        assert_eq!((&sidecar["depth"], &sidecar["exposure_ev"]), (&"light".into(), &1.0.into()));
    }
    let from = "synthesize one/a.exr --from scaled/a_L3-noise@physical.json --out again";
    assert_eq!(bench.call(&words(from)).code, Some(2), "another exposure");
    let from = format!("{from} --exposure 1");
    assert_eq!(bench.call(&words(&from)).code, Some(0));
    assert_eq!(
        fs::read(bench.path("again/a_L3-noise@physical.png")).unwrap(),
        fs::read(bench.path("scaled/a_L3-noise@physical.png")).unwrap()
    );
    for wrong in ["21", "x", "nan"] {
        let refused = bench.call(&words(&format!("synthesize one --out no --exposure {wrong}")));
        assert_eq!(refused.code, Some(2), "{refused:?}");
    }
}

/// Rooms as light: drawn, and written as files and read again, they are the same images; as codes they are as before.
#[test]
fn rooms_have_light() {
    let bench = Bench::new();
    let rooms = "frames=4,size=64x48";
    let written = bench.call(&words("rooms --out lit --frames 4 --size 64x48 --light linear"));
    assert_eq!(written.code, Some(0), "{written:?}");
    let run = |data: &str, out: &str| {
        let line = format!("--data {data} --model random --levels L0,L2 --profile paper,physical --out {out}");
        let called = bench.call(&words(&line));
        assert_eq!(called.code, Some(0), "{called:?}");
        let mut records: Vec<(String, String)> = records(&bench.path(out))
            .iter()
            .map(|record| {
                let image = format!("{} {}", record["frame"], record["condition"]);
                (image, record["image"]["digest"].to_string())
            })
            .collect();
        records.sort();
        records.dedup();
        (called, records)
    };
    let (called, drawn) = run(&format!("rooms:{rooms},light=linear"), "drawn");
    insta::assert_snapshot!(called.messages(), @"
    exit code: 0
     WARN 4 images are of more than 8 bits, which are rounded to 8 only after the light is reduced (linear light:
        4; for example bathroom-0000/eye)
    ");
    let (_, read) = run("lit", "read");
    assert_eq!(drawn, read);
    assert_eq!(drawn.len(), 16);
    let (called, display) = run(&format!("rooms:{rooms}"), "display");
    assert!(!called.stderr.contains("more than 8 bits"), "{called:?}");
    assert!(display.iter().zip(&drawn).all(|(one, other)| one != other));
    let lines = fs::read_to_string(bench.path("lit/frames.jsonl")).unwrap();
    let mut brightest = 0.0_f32;
    for line in lines.lines() {
        let line: Value = serde_json::from_str(line).unwrap();
        let path = line["rgb"].as_str().unwrap();
        assert!(path.strip_suffix(".exr").is_some(), "{path}");
        let beside = bench.path(&format!("lit/{}", path.replace(".exr", ".png")));
        assert!(beside.is_file());
        let bytes = fs::read(bench.path(&format!("lit/{path}"))).unwrap();
        let light = light(&file(bytes));
        brightest = light.into_iter().fold(brightest, f32::max);
    }
    // Lamps and windows are far above white.
    assert!(brightest > 2.0, "{brightest}");
    let refused = bench.call(&words("--data rooms:light=dim --model random"));
    insta::assert_snapshot!(refused.messages(), @"
    exit code: 2
    error: invalid value 'rooms:light=dim' for '--data <DIR|FILE|rooms:…>': light=dim: display or linear expected
    ");
}

#[test]
fn realism_keeps_bit_depth() {
    let bench = Bench::new();
    bench.file("pairs/normal/1.exr", exr([48, 32], &lights()));
    let made = bench.call(&words("synthesize pairs/normal/1.exr --out dark --levels L1 --variant ev"));
    assert_eq!(made.code, Some(0), "{made:?}");
    let dark = fs::read(bench.path("dark/1_L1-ev.png")).unwrap();
    bench.file("pairs/low/1.png", dark);
    let compared = bench.call(&words("realism pairs --ev 2 --json"));
    assert_eq!(compared.code, Some(0), "{compared:?}");
    let summary: Value = serde_json::from_str(&compared.stdout).unwrap();
    // The real image is the exposure drop itself; from 8 bits it would differ in all highlights.
    let exposure = &summary["exposure"];
    assert!(exposure["psnr"]["value"].is_null(), "{exposure}");
    assert_eq!(exposure["kl"]["value"], 0.0);
}
