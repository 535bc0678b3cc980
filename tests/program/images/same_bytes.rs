//! Images of every noise profile and every variant are the same bytes, however and by whichever command they are made.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::support::run::{Bench, assert_same_products, files, records, words};

/// All noise profiles and variants, with settings that are drawn for each frame.
const LIGHT: &str =
    "--profile all --variant all --levels L0,L2,9,T33.33 --seed 3 --motion speed=90,angle=random --auto gain=3";
/// Conditions of `LIGHT`: L0, and by level exposure drop alone, four readings of noise, automatic exposure; and a
/// motion blur.
const CONDITIONS: usize = 1 + 2 * 6 + 1;

/// Random answers about room frames with a known camera.
fn evaluate(bench: &Bench, more: &str) {
    bench.complete(&words(&format!("--model random --data rooms:frames=3,size=96x64 {more}")));
}

/// Digests of the images that a run has sent, by condition.
fn sent(run: &Path) -> BTreeMap<String, BTreeSet<String>> {
    let mut digests = BTreeMap::<String, BTreeSet<String>>::new();
    for record in records(run) {
        let text = |value: &Value| value.as_str().unwrap().to_owned();
        let of_condition = digests.entry(text(&record["condition"])).or_default();
        of_condition.insert(text(&record["image"]["digest"]));
    }
    digests
}

#[test]
fn threads_and_shards_keep_bytes() {
    let bench = Bench::new();
    evaluate(&bench, &format!("{LIGHT} --threads 1 --out whole"));
    let whole = bench.path("whole");
    let images = sent(&whole);
    assert_eq!(images.len(), CONDITIONS);
    let different: BTreeSet<_> = images.values().flatten().collect();
    assert_eq!(different.len(), 3 * CONDITIONS, "no two images are alike");

    evaluate(&bench, &format!("{LIGHT} --threads 3 --concurrency 16 --out many"));
    assert!(assert_same_products(&whole, &bench.path("many")) > 8);

    for part in ["2/3", "1/3", "3/3"] {
        evaluate(&bench, &format!("{LIGHT} --out parts --shard {part}"));
    }
    bench.complete(&words("merge parts --out merged"));
    assert!(assert_same_products(&whole, &bench.path("merged")) > 8);

    // A run that begins with one question, one reading and one variant, and is told of the others later.
    let less = "--levels L0,9 --variant noise --profile eld --seed 3";
    evaluate(&bench, &format!("{less} --limit 1 --out grown"));
    evaluate(&bench, &format!("{LIGHT} --resume grown"));
    assert_eq!(images, sent(&bench.path("grown")));

    // Negative control: another seed.
    let other = LIGHT.replace("--seed 3", "--seed 4");
    evaluate(&bench, &format!("{other} --out other"));
    let unlike = sent(&bench.path("other"));
    for (condition, digests) in &images {
        let is_drawn = !(condition.ends_with("-ev") || condition == "L0");
        assert_eq!(*digests != unlike[condition], is_drawn, "{condition}");
    }
}

#[test]
fn image_files_match_sent_images() {
    let bench = Bench::new();
    evaluate(&bench, &format!("{LIGHT} --out run"));
    bench.complete(&words("rooms --out rooms --frames 3 --size 96x64"));
    let made = bench.call(&words(&format!("synthesize rooms --out made {LIGHT}")));
    assert_eq!(made.code, Some(0), "{made:?}");

    let mut digests = BTreeMap::<String, BTreeSet<String>>::new();
    let sidecars = files(&bench.path("made"));
    let sidecars = sidecars.iter().filter(|path| path.extension().is_some_and(|e| e == "json"));
    for (index, sidecar) in sidecars.enumerate() {
        let facts: Value = serde_json::from_slice(&fs::read(sidecar).unwrap()).unwrap();
        let image = fs::read(sidecar.with_extension("png")).unwrap();
        let digest = blake3::hash(&image).to_hex().to_string();
        assert_eq!(facts["schema"], "darkqa.image/2");
        let text = |field: &str| facts[field].as_str().unwrap();
        let (frame, condition) = (text("frame"), text("condition"));
        let (scene, name) = frame.split_once('/').unwrap();
        let of_condition = digests.entry(condition.to_owned()).or_default();
        of_condition.insert(digest);

        let (from, out) = (sidecar.to_str().unwrap(), format!("again{index}"));
        let source = format!("rooms/scenes/{scene}/rgb/{name}.png");
        let again = bench.call(&["synthesize", &source, "--out", &out, "--from", from]);
        assert_eq!(again.code, Some(0), "{again:?}");
        let alone = bench.path(&format!("{out}/{frame}_{condition}.png"));
        assert_eq!(image, fs::read(alone).unwrap(), "{frame} {condition}");
    }
    assert_eq!(digests, sent(&bench.path("run")));
}
