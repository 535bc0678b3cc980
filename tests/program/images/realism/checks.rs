//! What is no pair of normal and low light is refused or left out by name, before anything is compared.

use super::*;
use crate::support::snapshot::lines_with;

const PICTURES: [(&str, u32); 3] = [("a", 1), ("b", 2), ("c", 3)];

/// Exchanges the images of two sides or names.
fn exchange(bench: &Bench, one: &str, other: &str) {
    let [one, other, between] = [one, other, "between"].map(|path| bench.path(path));
    fs::rename(&one, &between).unwrap();
    fs::rename(&other, &one).unwrap();
    fs::rename(&between, &other).unwrap();
}

fn exchange_sides(bench: &Bench, name: &str) {
    let side = |side: &str| format!("pairs/{side}/{name}.png");
    exchange(bench, &side("normal"), &side("low"));
}

#[test]
fn swapped_folders_are_refused_early() {
    let bench = Bench::new();
    made_pairs(&bench, "pairs", &PICTURES, &["--variant", "noise"]);
    let call = |words: &[&str]| {
        let words = [&["realism", "pairs", "--out", "out"], words].concat();
        bench.call(&words)
    };
    exchange(&bench, "pairs/normal", "pairs/low");
    let swapped = call(&[]);
    assert_eq!(swapped.code, Some(2), "{swapped:?}");
    insta::assert_snapshot!(swapped.messages(), @"
    exit code: 2
    error: pairs: low is brighter than normal in 3 of 3 pairs: are the folders swapped? (--ev states a drop that
        is meant)
    ");
    assert!(!bench.path("out").exists() && swapped.stdout.is_empty());
    // A stated drop does not hide it; one that is meant to brighten is followed.
    let stated = call(&["--ev", "4"]);
    insta::assert_snapshot!(stated.messages(), @"
    exit code: 2
    error: pairs: low is brighter than normal in 3 of 3 pairs: are the folders swapped? (--ev states a drop that
        is meant)
    ");
    let meant = call(&["--ev", "-4"]);
    assert_eq!(meant.code, Some(0), "{meant:?}");
    // Two of three are still more than half.
    exchange_sides(&bench, "b");
    let most = call(&[]);
    insta::assert_snapshot!(most.messages(), @"
    exit code: 2
    error: pairs: low is brighter than normal in 2 of 3 pairs: are the folders swapped? (--ev states a drop that
        is meant)
    ");
}

#[test]
fn swapped_pair_is_left_out() {
    let bench = Bench::new();
    made_pairs(&bench, "pairs", &PICTURES, &["--variant", "noise"]);
    let whole = json(&bench, &[]);
    assert_eq!(whole["pairs"], 3);
    exchange_sides(&bench, "b");
    let called = bench.call(&["realism", "pairs", "--json"]);
    assert_eq!(called.code, Some(1), "{called:?}");
    insta::assert_snapshot!(called.messages(), @"
    exit code: 1
    ERROR b: low is brighter than normal by 4.15 EV, so it is left out: are the two images swapped?
    ");
    let summary: Value = serde_json::from_str(&called.stdout).unwrap();
    assert_eq!(summary["pairs"], 2);
    assert_eq!(summary["swapped"], serde_json::json!(["b"]));
    let table = bench.call(&["realism", "pairs"]).stdout;
    insta::assert_snapshot!(lines_with(&table, "swapped"), @"1 pair left out as swapped");
}

#[test]
fn pair_of_two_scenes_left_out() {
    let bench = Bench::new();
    made_pairs(&bench, "pairs", &PICTURES, &["--variant", "noise"]);
    exchange(&bench, "pairs/low/a.png", "pairs/low/c.png");
    let called = bench.call(&["realism", "pairs", "--json"]);
    assert_eq!(called.code, Some(1), "{called:?}");
    for name in ["a", "c"] {
        let message = format!("{name}: its images show two scenes");
        assert!(called.stderr.contains(&message), "{}", called.stderr);
    }
    let summary: Value = serde_json::from_str(&called.stdout).unwrap();
    assert_eq!(summary["pairs"], 1);
    assert_eq!(summary["two_scenes"], serde_json::json!(["a", "c"]));
    fs::remove_file(bench.path("pairs/low/b.png")).unwrap();
    let none = bench.call(&["realism", "pairs"]);
    insta::assert_snapshot!(none.messages(), @"
    exit code: 2
     WARN pairs/normal/b.png: no partner in the other light
    ERROR a: its images show two scenes, so it is left out: their structure correlates by -0.01, that of one scene
        by 0.25 or more
    ERROR c: its images show two scenes, so it is left out: their structure correlates by 0.00, that of one scene
        by 0.25 or more
    error: pairs: no pair could be compared
    ");
}

#[test]
fn pair_of_similar_light_warns() {
    let bench = Bench::new();
    pair(&bench, "a", 1);
    let normal = bench.path("pairs/normal/a.png");
    let image = image::open(&normal).unwrap().to_rgb8();
    let samples: Vec<u8> = image
        .enumerate_pixels()
        .flat_map(|(_, _, pixel)| {
            let Rgb(codes) = pixel;
            codes.map(|code| code - code / 20)
        })
        .collect();
    RgbImage::from_raw(96, 64, samples).unwrap().save(bench.path("pairs/low/a.png")).unwrap();
    let called = bench.call(&["realism", "pairs"]);
    assert_eq!(called.code, Some(0), "{called:?}");
    insta::assert_snapshot!(called.messages(), @"
    exit code: 0
     WARN a: its exposure drop is 0.15 EV: below 0.5 EV both images have nearly the same light
    ");
    pair(&bench, "a", 1);
    let dark = bench.call(&["realism", "pairs"]);
    assert!(!dark.stderr.contains("exposure drop"), "{}", dark.stderr);
}
