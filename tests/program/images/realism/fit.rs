//! `--fit`: the gain of a known camera comes back, what is not a sensor's noise is refused, and no pair is judged by
//! its own gain.

use super::rows::{column, csv};
use super::*;
use crate::support::snapshot::lines_with;

const FIXED: [&str; 3] = ["--variant", "noise", "--fixed"];

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or(f64::NAN)
}

/// The fits of a summary under a noise profile, pair by pair.
fn fits<'s>(summary: &'s Value, reading: &str) -> &'s [Value] {
    let fit = summary["fits"].as_array().unwrap().iter().find(|fit| fit["reading"] == reading).unwrap();
    fit["pairs"].as_array().unwrap()
}

#[test]
fn known_gain_fits_every_profile() {
    check_rows(["paper", "eld", "level", "physical"], |reading| {
        let bench = Bench::new();
        for (name, gain) in [("weak", "0.2"), ("middle", "0.7746"), ("strong", "3")] {
            let words = ["--profile", reading, "--gain", gain, "--seed", "5"];
            let words = [&FIXED[..], &words].concat();
            made_pairs(&bench, "pairs", &[(name, 4)], &words);
        }
        // The drop is stated: without a forward tone curve, mean light is not that of the exposure drop.
        let summary = json(&bench, &["--fit", "--ev", "4", "--profile", reading]);
        for (fit, gain) in fits(&summary, reading).iter().zip([0.7746, 3.0, 0.2]) {
            let found = number(&fit["gain"]);
            assert!((found / gain - 1.0).abs() < 0.1, "{gain}: {fit}");
            assert_eq!(fit["outcome"], "fitted", "{fit}");
            assert!(number(&fit["misfit"]) < 0.1, "{fit}");
        }
        let pooled = &summary["fits"][0]["pooled"];
        assert_eq!(pooled["n"], 3);
        let mean = number(&pooled["mean"]["value"]);
        // The geometric mean of 0.2, 0.7746 and 3.
        assert!((mean / 0.7746 - 1.0).abs() < 0.1, "{pooled}");
        assert!(number(&pooled["mean"]["interval"][0]) < mean);
    });
}

/// A picture that holds linear light is fitted as light, as it is compared: its noise is not that of a picture of its
/// codes.
#[test]
fn known_gain_fits_linear_light() {
    let bench = Bench::new();
    for side in ["normal", "low"] {
        fs::create_dir_all(bench.path(&format!("pairs/{side}"))).unwrap();
    }
    let normal = bench.path("pairs/normal/a.png");
    let light = image::ImageBuffer::<Rgb<u16>, Vec<u16>>::from_fn(320, 240, {
        let picture = picture(4);
        move |x, y| {
            let linear = |code: u8| (65_535.0 * (f64::from(code) / 255.0).powf(2.2)) as u16;
            Rgb(picture.get_pixel(x, y).0.map(linear))
        }
    });
    light.save(&normal).unwrap();
    let words = ["--transfer", "linear", "--profile", "physical", "--gain", "0.7746"];
    let words = [&FIXED[..], &words, &["--levels", "L2", "--out", "made"]].concat();
    bench.complete(&[&["synthesize", normal.to_str().unwrap()], &words[..]].concat());
    let low = bench.path("made/a_L2-noise@physical.png");
    fs::rename(low, bench.path("pairs/low/a.png")).unwrap();
    let fit = ["--fit", "--ev", "4", "--profile", "physical"];
    let gain = |words: &[&str]| {
        let summary = json(&bench, &[&fit[..], words].concat());
        number(&fits(&summary, "physical")[0]["gain"])
    };
    let found = gain(&["--transfer", "linear"]);
    assert!((found / 0.7746 - 1.0).abs() < 0.1, "{found}");
}

/// A picture without noise, and one whose noise was averaged away: the one has no gain, the other a smaller one.
#[test]
fn foreign_noise_is_not_fitted() {
    let bench = Bench::new();
    made_pairs(&bench, "pairs", &[("bare", 4)], &["--variant", "ev"]);
    let loud = [&FIXED[..], &["--gain", "3", "--profile", "physical"]].concat();
    made_pairs(&bench, "pairs", &[("averaged", 4)], &loud);
    let path = bench.path("pairs/low/averaged.png");
    let image = image::open(&path).unwrap().to_rgb8();
    let filtered = image::imageops::resize(
        &image::imageops::resize(&image, 160, 120, image::imageops::FilterType::Triangle),
        320,
        240,
        image::imageops::FilterType::Triangle,
    );
    filtered.save(&path).unwrap();
    let arguments = ["--fit", "--ev", "4", "--profile", "physical", "--out", "out"];
    let table = bench.complete(&[&["realism", "pairs"], &arguments[..]].concat());
    insta::assert_snapshot!(lines_with(&table, "smaller K"), @"
    System gain K by the spread of smooth blocks, as saved; a smaller K than the sensor's means that noise was
        averaged away
    ");
    let refused = "bare, physical: K 0.02, misfit";
    assert!(table.contains(refused), "{table}");
    let reason =
        "no fit, as the ladder of K ends here: the low image's noise is not a sensor's under this noise profile";
    assert!(table.contains(reason), "{table}");
    let rows = csv(&bench, "out/fits.csv");
    assert_eq!(column(&rows, "pair"), ["averaged", "bare"]);
    assert_eq!(column(&rows, "outcome")[1], "end-of-ladder");
    let gain: f64 = column(&rows, "gain")[0].parse().unwrap();
    assert!(gain < 1.5, "{gain}");
    // Only the pair that has a gain enters the camera file.
    fs::remove_file(bench.path("pairs/low/averaged.png")).unwrap();
    let words = ["realism", "pairs", "--fit", "--ev", "4", "--out", "none"];
    let none = bench.call(&words);
    assert_eq!(none.code, Some(0), "{none:?}");
    assert!(!bench.path("none/fitted.toml").exists());
    insta::assert_snapshot!(none.messages(), @"
    exit code: 0
     WARN pairs/normal/averaged.png: no partner in the other light
     WARN none/fitted.toml: not written, because no pair is fitted under paper
    ");
    assert!(!none.stdout.contains("gain fitted"), "{}", none.stdout);
}

/// Pairs of one camera and one pair of another.
fn unequal_pairs(bench: &Bench, folder: &str, names: &[(&str, u32)]) {
    for (name, number) in names {
        let gain = if *name == "loud" { "6" } else { "0.3" };
        let words = [&FIXED[..], &["--gain", gain, "--profile", "physical"]].concat();
        made_pairs(bench, folder, &[(name, *number)], &words);
    }
}

const FIT: [&str; 5] = ["--fit", "--ev", "4", "--profile", "physical"];

/// The numbers of a pair's image by one camera.
fn of_pair(bench: &Bench, file: &str, pair: &str, camera: &str) -> Vec<String> {
    let rows = csv(bench, file);
    let cells = ["pair", "camera", "psnr", "ssim", "kl"].map(|name| column(&rows, name));
    let mut places = (0..rows.len() - 1).filter(|row| cells[0][*row] == pair && cells[1][*row] == camera);
    let row = places.next().unwrap();
    cells[2..].iter().map(|cells| cells[row].clone()).collect()
}

/// With three fitted pairs, a pair is judged by the camera that the other two alone give; not by one that knows its own
/// gain.
#[test]
fn pairs_are_judged_by_others_gain() {
    let bench = Bench::new();
    let others = [("one", 4), ("two", 5)];
    unequal_pairs(&bench, "others", &others);
    unequal_pairs(&bench, "pairs", &[others[0], others[1], ("loud", 6)]);
    let fit = |folder: &str, out: &str| bench.complete(&[&["realism", folder, "--out", out], &FIT[..]].concat());
    let marked = fit("others", "two");
    insta::assert_snapshot!(lines_with(&marked, "gain fitted"), @"
     with sensor noise, physical, gain fitted to the same pairs   40.69     0.9347   0.001    0.0          0.001
     physical, gain fitted to the same pairs   +0.91     −0.0119   −11.513       2
    one: with noise, physical, gain fitted to the same pairs: PSNR 40.56 SSIM 0.9327 D_KL 0.002
    two: with noise, physical, gain fitted to the same pairs: PSNR 40.83 SSIM 0.9366 D_KL 0.000
    ");
    let table = fit("pairs", "three");
    insta::assert_snapshot!(lines_with(&table, "gain fitted"), @"
     with sensor noise, physical, gain fitted to the other pairs   33.18 ±6.58    0.7240 ±0.2830   0.703 ±1.271
        0.0 ±0.0     0.703 ±1.271
     physical, gain fitted to the other pairs   −3.46 ±7.89   −0.1076 ±0.2572   −11.588 ±2.113       3
    loud: with noise, physical, gain fitted to the other pairs: PSNR 30.44 SSIM 0.6029 D_KL 1.283
    one: with noise, physical, gain fitted to the other pairs: PSNR 35.73 SSIM 0.8290 D_KL 0.313
    two: with noise, physical, gain fitted to the other pairs: PSNR 33.37 SSIM 0.7401 D_KL 0.514
    ");
    let judged = of_pair(&bench, "three/pairs.csv", "loud", "other-pairs");
    for (camera, is_same) in [("two/fitted.toml", true), ("three/fitted.toml", false)] {
        let words = ["realism", "pairs", "--ev", "4", "--profile", "physical"];
        bench.complete(&[&words[..], &["--camera", camera, "--out", "given"]].concat());
        let given = of_pair(&bench, "given/pairs.csv", "loud", "given");
        assert_eq!(given == judged, is_same, "{camera}: {given:?} {judged:?}");
    }
}

#[test]
fn fitted_camera_reproduces_numbers() {
    let bench = Bench::new();
    unequal_pairs(&bench, "pairs", &[("one", 4), ("loud", 5)]);
    let fit = ["--fit", "--ev", "4", "--profile", "paper,physical", "--out", "out"];
    bench.complete(&[&["realism", "pairs"], &fit[..]].concat());
    for reading in ["paper", "physical"] {
        let camera = format!("out/fitted-{reading}.toml");
        let text = fs::read_to_string(bench.path(&camera)).unwrap();
        assert!(text.contains(&format!("the noise profile {reading}, as saved;")), "{text}");
        assert_eq!(text.contains("ratio = [200.0, 200.0]"), reading == "paper", "{text}");
        let words = ["realism", "pairs", "--ev", "4", "--profile", reading];
        let again = bench.complete(&[&words[..], &["--json", "--camera", &camera]].concat());
        let again: Value = serde_json::from_str(&again).unwrap();
        let fitted = fs::read_to_string(bench.path("out/summary.json")).unwrap();
        let fitted: Value = serde_json::from_str(&fitted).unwrap();
        let row = fitted["noise"]
            .as_array()
            .unwrap()
            .iter()
            .find(|row| row["reading"] == reading && row["camera"] == "same-pairs");
        for name in ["psnr", "ssim", "kl", "differences"] {
            assert_eq!(row.unwrap()[name], again["noise"][0][name], "{reading}, {name}");
        }
    }
}

#[test]
fn fits_depend_only_on_seed() {
    let bench = Bench::new();
    unequal_pairs(&bench, "pairs", &[("one", 4), ("loud", 5)]);
    let fit = |words: &[&str]| json(&bench, &[&["--fit", "--profile", "all"], words].concat());
    let once = fit(&[]);
    assert_eq!(once, fit(&["--threads", "1"]));
    assert_eq!(once, fit(&["--threads", "5"]));
    assert_ne!(once["fits"], fit(&["--seed", "1"])["fits"]);
    let paper = &once["fits"][0];
    assert_eq!(paper["reading"], "paper");
    assert_eq!(paper["ratio"], 200.0);
    assert_eq!(once["fits"][3]["ratio"], Value::Null);
    let pinned = json(&bench, &["--fit", "--ratio", "100"]);
    assert_eq!(pinned["fits"][0]["ratio"], 100.0);
}

#[test]
fn gain_is_pinned_or_fitted() {
    let bench = Bench::new();
    pair(&bench, "a", 1);
    let refused = bench.call(&["realism", "pairs", "--fit", "--gain", "1"]);
    insta::assert_snapshot!(refused.messages(), @"
    exit code: 2
    error: the argument '--fit' cannot be used with '--noise gain=<K>'
    ");
    // 96 blocks of 8 × 8 pixels are 12 in a bin.
    let few = bench.complete(&["realism", "pairs", "--fit"]);
    insta::assert_snapshot!(
        lines_with(&few, "no fit"),
        @"a, paper: no fit: too few blocks of 8 × 8 pixels are smooth, and neither black nor white"
    );
}
