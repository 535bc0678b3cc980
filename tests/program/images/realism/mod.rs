//! `realism` from the outside, on pairs that the test makes: the dark one by an independent, simple noise ([`pair`]),
//! or by the program ([`made_pairs`]).

mod checks;
mod fit;
mod rows;

use std::fs;

use crate::support::run::{Bench, words};
use crate::support::snapshot::each;
use crate::support::table::check_rows;
use image::{Rgb, RgbImage};
use serde_json::Value;

/// A normal image, and the same 2.2 EV darker (so that codes are halved) under noise of a few codes.
fn pair(bench: &Bench, name: &str, salt: u32) {
    let normal =
        RgbImage::from_fn(96, 64, |x, y| Rgb([(60 + x) as u8, (50 + 2 * y) as u8, (40 + (x + y) % 120) as u8]));
    let mut state = salt;
    let low = RgbImage::from_fn(96, 64, |x, y| {
        Rgb(normal.get_pixel(x, y).0.map(|code| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            // The sum of two uniform numbers, from −12 to 12.
            let noise = (state >> 8) % 13 + (state >> 20) % 13;
            (u32::from(code) / 2 + noise).saturating_sub(12) as u8
        }))
    });
    for (folder, image) in [("normal", &normal), ("low", &low)] {
        fs::create_dir_all(bench.path(&format!("pairs/{folder}"))).unwrap();
        image.save(bench.path(&format!("pairs/{folder}/{name}.png"))).unwrap();
    }
}

/// A picture of shaded rectangles, another one for each number.
fn picture(number: u32) -> RgbImage {
    let mut state = number.wrapping_mul(2_654_435_761).wrapping_add(99);
    let mut draw = |most: u32| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) % most
    };
    let mut image = RgbImage::from_fn(320, 240, |x, y| {
        let code = (90 + x / 8 + y / 6) as u8;
        Rgb([code, code, code - 10])
    });
    for _ in 0..25 {
        let [left, top, code] = [draw(320), draw(240), 25 + draw(190)];
        let [right, bottom] = [(left + 70).min(320), (top + 60).min(240)];
        for y in top..bottom {
            for x in left..right {
                let shade = code + (x - left) / 7 + (y - top) / 12;
                let codes = [shade, shade.saturating_sub(8), shade / 2 + 20];
                image.put_pixel(x, y, Rgb(codes.map(|code| code as u8)));
            }
        }
    }
    image
}

/// Pairs of pictures of these names and numbers in a folder; the low-light images are 4 EV darker, as `synthesize`
/// makes them by these words.
fn made_pairs(bench: &Bench, folder: &str, pictures: &[(&str, u32)], words: &[&str]) {
    for (name, number) in pictures {
        for side in ["normal", "low"] {
            fs::create_dir_all(bench.path(&format!("{folder}/{side}"))).unwrap();
        }
        let normal = bench.path(&format!("{folder}/normal/{name}.png"));
        picture(*number).save(&normal).unwrap();
        let made = bench.path("made");
        let synthesize = ["synthesize", normal.to_str().unwrap(), "--levels", "L2"];
        bench.complete(&[&synthesize[..], &["--out", "made", "--force"], words].concat());
        let images: Vec<_> = fs::read_dir(&made)
            .unwrap()
            .map(|file| file.unwrap().path())
            .filter(|path| path.extension().is_some_and(|end| end == "png"))
            .collect();
        assert_eq!(images.len(), 1, "{images:?}");
        fs::rename(&images[0], bench.path(&format!("{folder}/low/{name}.png"))).unwrap();
        fs::remove_dir_all(&made).unwrap();
    }
}

fn json(bench: &Bench, words: &[&str]) -> Value {
    let words = [&["realism", "pairs", "--json"], words].concat();
    let called = bench.call(&words);
    assert_eq!(called.code, Some(0), "{called:?}");
    serde_json::from_str(&called.stdout).unwrap()
}

#[test]
fn noise_resembles_noise() {
    let bench = Bench::new();
    for (salt, name) in ["a", "b", "c"].into_iter().enumerate() {
        pair(&bench, name, salt as u32);
    }
    let kl = |row: &Value| row["kl"]["value"].as_f64().unwrap();
    for rules in [&[][..], &["--kl-bins", "kousha"]] {
        let summary = json(&bench, rules);
        assert!(kl(&summary["noise"][0]) < 0.5 * kl(&summary["exposure"]), "{summary:#}");
        let drop = summary["drop"]["value"].as_f64().unwrap();
        assert!((drop - 2.2).abs() < 0.1, "{drop}");
        assert_eq!(summary["pairs"], 3);
    }
    let dropped = json(&bench, &["--kl-empty", "drop"]);
    assert!(kl(&dropped["exposure"]) <= 0.0);
    assert_eq!(json(&bench, &[]), json(&bench, &["--threads", "1"]));
    assert_ne!(json(&bench, &[]), json(&bench, &["--seed", "1"]));
}

#[test]
fn files_hold_every_pair() {
    let bench = Bench::new();
    for (salt, name) in ["a", "b", "c"].into_iter().enumerate() {
        pair(&bench, name, salt as u32);
    }
    fs::copy(bench.path("pairs/low/b.png"), bench.path("pairs/low/stray.png")).unwrap();
    let table = bench.call(&["realism", "pairs", "--out", "out"]);
    insta::assert_snapshot!(table.messages(), @"
    exit code: 0
     WARN pairs/low/stray.png: no partner in the other light
    ");
    let rows = ["exposure drop alone", "with sensor noise", "±", "Fu et al. 2023", "other rule: "];
    check_rows(rows, |word| {
        assert!(table.stdout.contains(word), "{word:?}: {}", table.stdout);
    });
    let pairs = fs::read_to_string(bench.path("out/pairs.csv")).unwrap();
    assert_eq!(pairs.lines().count(), 7);
    assert!(fs::read_to_string(bench.path("out/residuals.svg")).unwrap().starts_with("<svg"));
    assert!(image::open(bench.path("out/crops.png")).unwrap().width() > 700);
    let summary = fs::read_to_string(bench.path("out/summary.json")).unwrap();
    assert_eq!(serde_json::from_str::<Value>(&summary).unwrap()["unmatched"], 1);
}

#[test]
fn equal_images_are_told_as_such() {
    let bench = Bench::new();
    pair(&bench, "a", 1);
    fs::copy(bench.path("pairs/low/a.png"), bench.path("pairs/normal/a.png")).unwrap();
    let table = bench.call(&["realism", "pairs", "--ev", "0"]);
    insta::assert_snapshot!(table.lines_with("∞"), @"
    exit code: 0
     exposure drop alone        ∞         1.0000   0.000   0.0          0.000
     paper                         −∞        −0.5639   +5.268       1
    ");
    insta::assert_snapshot!(table.messages(), @"
    exit code: 0
     WARN --ev 0: below 0.5 EV both images have nearly the same light
    ");
    let summary = json(&bench, &["--ev", "0"]);
    assert_eq!(summary["exposure"]["psnr"]["value"], Value::Null);
    assert!(summary["exposure"]["kl"]["value"].as_f64().unwrap().abs() < 1e-9);
}

#[test]
fn broken_pair_does_not_stop_others() {
    let bench = Bench::new();
    pair(&bench, "a", 1);
    pair(&bench, "b", 2);
    RgbImage::new(20, 20).save(bench.path("pairs/low/b.png")).unwrap();
    let called = bench.call(&["realism", "pairs"]);
    insta::assert_snapshot!(called.messages(), @"
    exit code: 1
    ERROR b: pair: 96 × 64 pixels against 20 × 20; both images of a pair must have the same size
    ");
    insta::assert_snapshot!(called.lines_with("pair failed"), @"
    exit code: 1
    1 pair failed
    ");
    let calls =
        ["realism nowhere", "realism pairs/low", "realism pairs --ev 99", "realism pairs --kl-bins two", "realism"];
    let errors = each(calls, |call| {
        let refused = bench.call(&words(call));
        assert_eq!(refused.stderr.trim_end().lines().count(), 1, "{refused:?}");
        refused.messages()
    });
    insta::assert_snapshot!(errors, @"
    realism nowhere
      exit code: 2
      error: nowhere: cannot read: [OS ERROR]
    realism pairs/low
      exit code: 2
      error: pairs/low: no pairs in it; expected are folders normal and low (or high and low, val_rgb_h and
          val_rgb_l), or files like normal1.png and low1.png; --normal DIR and --low DIR name any two folders,
          instead of PAIRS
    realism pairs --ev 99
      exit code: 2
      error: invalid value '99' for '--ev <EV>': a number from -20 to 20 expected
    realism pairs --kl-bins two
      exit code: 2
      error: invalid value 'two' for '--kl-bins <KL_BINS>' [possible values: fu, kousha]
    realism
      exit code: 2
      error: the following required arguments were not provided: <PAIRS>
    ");
}
