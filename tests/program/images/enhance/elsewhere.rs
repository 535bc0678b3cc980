//! Images that were enhanced elsewhere (`--enhanced`).

use std::fs;
use std::path::{Path, PathBuf};

use image::{DynamicImage, ImageBuffer, Rgb};
use serde_json::Value;

use crate::support::run::{Bench, Called, words};
use crate::support::snapshot::redacted;

const ASK: &str = "--model random --data rooms --levels L3,L5 --variant noise";

/// A bench with eight rooms, their dark images in `dark`, and brighter copies with their JSON files in `made`.
fn bench() -> Bench {
    let bench = Bench::new();
    bench.rooms("rooms", 8, "96x64");
    bench.complete(&words("synthesize rooms --out dark --levels L0,L3,L5 --variant noise"));
    for dark in images(&bench.path("dark"), "") {
        let made = bench.path("made").join(dark.strip_prefix(bench.path("dark")).unwrap());
        fs::create_dir_all(made.parent().unwrap()).unwrap();
        let mut image = image::open(&dark).unwrap().into_rgb8();
        for sample in image.iter_mut() {
            *sample = sample.saturating_mul(4);
        }
        image.save(&made).unwrap();
        fs::copy(json(&dark), json(&made)).unwrap();
    }
    bench
}

fn json(image: &Path) -> PathBuf {
    image.with_extension("json")
}

/// The PNG files in the folders of a folder whose names contain a word, in order.
fn images(folder: &Path, word: &str) -> Vec<PathBuf> {
    let files = |folder: &Path| {
        let entries = fs::read_dir(folder).unwrap();
        entries.map(|entry| entry.unwrap().path())
    };
    let mut all: Vec<PathBuf> = files(folder).flat_map(|room| files(&room)).collect();
    all.retain(|path| {
        let name = path.file_name().unwrap().to_str().unwrap();
        path.extension().is_some_and(|extension| extension == "png") && name.contains(word)
    });
    all.sort();
    all
}

fn ask(bench: &Bench, flags: &str) -> Called {
    bench.call(&words(&format!("{ASK} {flags}")))
}

fn refused(bench: &Bench, flags: &str, expected: &[&str]) {
    let called = ask(bench, &format!("{flags} --out refused"));
    assert_eq!(called.code, Some(2), "{called:?}");
    for expected in expected {
        assert!(called.stderr.contains(expected), "{expected}: {called:?}");
    }
    assert!(!bench.path("refused").exists());
}

#[test]
fn enhanced_folder_is_a_condition() {
    let bench = bench();
    let called = ask(&bench, "--enhanced mine=made --out run");
    insta::assert_snapshot!(called.messages(), @"
    exit code: 0
     WARN made: 8 of 24 images are not used, because no question is about their frames or conditions:
        bathroom-0000/eye_L0.png, bathroom-0000/robot_L0.png, bedroom-0000/eye_L0.png, bedroom-0000/robot_L0.png
        and 4 more
    ");
    let text = fs::read_to_string(bench.path("run/manifest.json")).unwrap();
    let manifest: Value = serde_json::from_str(&text).unwrap();
    let judged = &manifest["enhancers"]["mine"]["judged"]["images"];
    assert!(judged.as_u64().unwrap() > 8, "{judged}");
    let fidelity = fs::read_to_string(bench.path("run/fidelity.csv")).unwrap();
    assert!(fidelity.contains("\nL5-noise+mine,"), "{fidelity}");
    let page = fs::read_to_string(bench.path("run/report.html")).unwrap();
    assert!(page.contains("enhanced not by this program"));

    let questions = fs::read_to_string(bench.path("run/questions.jsonl")).unwrap();
    let first: Value = serde_json::from_str(questions.lines().next().unwrap()).unwrap();
    let id = first["id"].as_str().unwrap();
    let shown = bench.complete(&["show", "run", id, "--condition", "L3-noise+mine"]);
    insta::assert_snapshot!(redacted(&shown), @r#"
    room_type-8cc29bfffd957388, about bathroom-0000/eye
    What type of room is this?
      A. bedroom
      B. bathroom  (true)
      C. kitchen
      D. living room
      E. dining room
      F. office
    L3-noise+mine: run/shown/bathroom-0000/eye_L3-noise+mine.png
    L3-noise+mine: the same bytes as were sent ([DIGEST])
      random: ✗ wrong: "F"
    "#);
    let sent = images(&bench.path("run/shown"), "+mine")[0].clone();
    let made = images(&bench.path("made"), "L3-noise");
    let pixels = |path: &Path| image::open(path).unwrap().into_rgb8();
    assert!(made.iter().any(|made| pixels(made) == pixels(&sent)));

    // A complete run asks nothing again; the folder may have moved.
    fs::rename(bench.path("made"), bench.path("moved")).unwrap();
    let before = fs::read(bench.path("run/records.jsonl")).unwrap();
    bench.complete(&words(&format!("{ASK} --enhanced mine=moved --resume run")));
    assert_eq!(fs::read(bench.path("run/records.jsonl")).unwrap(), before);
    // Other images of the same name are another enhancer.
    let changed = images(&bench.path("moved"), "L3")[0].clone();
    pixels(&images(&bench.path("dark"), "L3")[0]).save(&changed).unwrap();
    let called = ask(&bench, "--enhanced mine=moved --resume run");
    insta::assert_snapshot!(called.messages(), @r#"
    exit code: 2
     WARN moved: 8 of 24 images are not used, because no question is about their frames or conditions:
        bathroom-0000/eye_L0.png, bathroom-0000/robot_L0.png, bedroom-0000/eye_L0.png, bedroom-0000/robot_L0.png
        and 4 more
    error: run: the enhancer mine has another --enhanced in this run: it was "[DIGEST]", now it is "[DIGEST]"; use
        another --out, or the same --enhanced
    "#);
}

#[test]
fn parts_of_run_share_folder() {
    let bench = bench();
    for part in ["1/2", "2/2"] {
        bench.complete(&words(&format!("{ASK} --enhanced mine=made --out run --shard {part}")));
    }
    bench.complete(&words("merge run --out whole"));
    bench.complete(&words(&format!("{ASK} --enhanced mine=made --out at-once")));
    let table = |run: &str| fs::read_to_string(bench.path(run).join("summary.csv")).unwrap();
    assert_eq!(table("whole"), table("at-once"));
}

#[test]
fn each_unusable_image_is_named() {
    let bench = bench();
    let made = images(&bench.path("made"), "noise");
    let name = |place: usize| {
        let path = made[place].strip_prefix(bench.path("made")).unwrap();
        path.to_str().unwrap().to_owned()
    };
    fs::remove_file(&made[0]).unwrap();
    fs::rename(&made[1], made[1].with_extension("jpg")).unwrap();
    DynamicImage::new_rgb8(48, 32).save(&made[2]).unwrap();
    let deep: ImageBuffer<Rgb<u16>, Vec<u16>> = ImageBuffer::new(96, 64);
    deep.save(&made[3]).unwrap();
    DynamicImage::new_rgb8(96, 64).save_with_format(&made[4], image::ImageFormat::Jpeg).unwrap();
    fs::remove_file(json(&made[5])).unwrap();
    fs::copy(json(&made[7]), json(&made[6])).unwrap();
    fs::write(&made[8], "no image").unwrap();
    let expected = [
        format!("missing: {}, {} (only ", name(0), name(1)),
        format!("{} (48×32, not 96×64)", name(2)),
        format!("{} (16 bits), {} (JPEG), {}", name(3), name(4), name(8)),
        format!("copy it next to the enhanced one: {}", name(5)),
        format!("{} (other condition, drop)", name(6)),
        "8 of the 16 images of mine cannot be used; nothing was asked".to_owned(),
    ];
    let expected: Vec<&str> = expected.iter().map(String::as_str).collect();
    refused(&bench, "--enhanced mine=made", &expected);
}

#[test]
fn images_of_other_sources_are_refused() {
    let bench = bench();
    let enhanced = "--enhanced mine=made";
    for (flags, expected) in [
        ("--seed 3", "(other sensor: seed)"),
        ("--profile physical", "missing: "),
        ("--gain 2", "(other sensor: model"),
    ] {
        refused(&bench, &format!("{enhanced} {flags}"), &[expected]);
    }
    refused(&bench, "--enhanced mine=dark", &["dark images themselves"]);
    refused(&bench, "--enhanced mine=made --enhanced mine=dark", &["two enhancers are named mine"]);
    refused(&bench, "--llie lift --enhanced lift=made", &["two enhancers are named lift"]);
    // Images in each other's place.
    let dark = images(&bench.path("made"), "noise");
    let bytes: Vec<Vec<u8>> = dark.iter().map(|path| fs::read(path).unwrap()).collect();
    for (place, path) in dark.iter().enumerate() {
        fs::write(path, &bytes[(place + 5) % bytes.len()]).unwrap();
    }
    let called = ask(&bench, "--enhanced mine=made --out run");
    insta::assert_snapshot!(called.messages(), @"
    exit code: 2
     WARN made: 8 of 24 images are not used, because no question is about their frames or conditions:
        bathroom-0000/eye_L0.png, bathroom-0000/robot_L0.png, bedroom-0000/eye_L0.png, bedroom-0000/robot_L0.png
        and 4 more
    error: made: 5 of its 6 images of dark frames are implausible; they have edges that are not those of the
        frames (-0.01 of the edges agree, 1 at best); check that each has the name of its own dark image; --allow
        bad-enhancer uses them anyway
    ");
    ask(&bench, "--enhanced mine=made --allow bad-enhancer --out run").ended(0);
}
