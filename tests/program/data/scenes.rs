//! The scenes of a user's frames: read from the questions, used as clusters, and missed where names suggest them.

use std::fs;

use serde_json::json;

use crate::support::run::{Bench, words};

/// A folder of 24 frames of 12 scenes with two questions each; the questions have a `scene` if `named`.
fn questions(bench: &Bench, named: bool) {
    let lines = (0..48).map(|number| {
        let frame = number / 2;
        let mut question = json!({
            "id": format!("q{number}"), "frame": format!("scene{:04}_{frame}.png", frame / 2), "family": "color",
            "question": format!("What color is it, {number}?"), "choices": ["red", "blue", "brown"], "answer": "brown",
        });
        if named {
            question["scene"] = json!(format!("home {}", frame / 2));
        }
        format!("{question}\n")
    });
    bench.file("set/questions.jsonl", lines.collect::<String>());
}

fn bench() -> Bench {
    let bench = Bench::new();
    fs::create_dir(bench.path("set")).unwrap();
    for frame in 0..24 {
        let picture = image::RgbImage::from_pixel(32, 24, image::Rgb([90, 60, frame]));
        let name = format!("set/scene{:04}_{frame}.png", frame / 2);
        picture.save(bench.path(&name)).unwrap();
    }
    bench
}

const RUN: &str = "--model random --data set --levels L0,L3 --variant ev --out run";

#[test]
fn scenes_are_clusters_and_can_be_named_later() {
    let bench = bench();
    questions(&bench, false);
    let suggested = "File names suggest 12 scenes (scene0000, scene0001, …), but the data name none, so the 24 frames count as independent";
    let called = bench.call(&words(RUN));
    assert_eq!(called.code, Some(0), "{called:?}");
    assert!(called.stderr.contains(suggested), "{}", called.stderr);
    let joined = |text: &str| text.replace("\n  ", " ");
    assert!(
        joined(&called.stdout).contains(suggested),
        "{}",
        called.stdout
    );
    assert!(
        called.stdout.contains("With 24 frames the intervals"),
        "{}",
        called.stdout
    );
    let check = bench.call(&words("check set"));
    assert!(joined(&check.stdout).contains(suggested), "{check:?}");
    // Named later: nothing is asked again, and the intervals are by scene.
    let records = || fs::read(bench.path("run/records.jsonl")).unwrap();
    let before = records();
    questions(&bench, true);
    let called = bench.call(&words(RUN));
    assert_eq!(called.code, Some(0), "{called:?}");
    assert!(records() == before);
    assert!(!called.stderr.contains("suggest") && !called.stdout.contains("suggest"));
    assert!(
        called.stdout.contains("With 12 scenes the intervals"),
        "{}",
        called.stdout
    );
    // What can be detected follows from the scenes, too.
    let check = bench.call(&words("check set"));
    let power = "power: 48 questions in 12 scenes detects ";
    assert!(joined(&check.stdout).contains(power), "{check:?}");
    let dry = bench.call(&words(&format!("{RUN} --dry-run")));
    assert!(
        dry.stdout.contains(power) && dry.stdout.contains("; 5 points need about "),
        "{dry:?}"
    );
    // A file without them takes none away.
    questions(&bench, false);
    let called = bench.call(&words(RUN));
    assert!(
        called.stdout.contains("With 12 scenes the intervals"),
        "{}",
        called.stdout
    );
    assert!(records() == before);
}
