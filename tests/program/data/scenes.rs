//! The scenes of a user's frames: read from the questions, used as clusters, and missed where names suggest them.

use std::fs;

use serde_json::{Value, json};

use crate::support::run::{Bench, words};
use crate::support::snapshot::redacted;

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
fn scenes_cluster_and_are_named_later() {
    let bench = bench();
    questions(&bench, false);
    let suggested = "File names suggest 12 scenes (scene0000, scene0001, …), but the data name none, so the 24 frames count as independent";
    let called = bench.call(&words(RUN));
    insta::assert_snapshot!(called.messages(), @r#"
    exit code: 0
     WARN File names suggest 12 scenes (scene0000, scene0001, …), but the data name none, so the 24 frames count
        as independent; a "scene" in each question (or --map scene=COLUMN) names them
    "#);
    let joined = |text: &str| text.replace("\n  ", " ");
    assert!(joined(&called.stdout).contains(suggested), "{}", called.stdout);
    insta::assert_snapshot!(called.lines_with("the intervals"), @"
    exit code: 0
    Sample         ·  With 24 frames the intervals of the findings reach about 16
    ");
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
    insta::assert_snapshot!(called.lines_with("the intervals"), @"
    exit code: 0
    Sample         ·  With 12 scenes the intervals of the findings reach about 18
    ");
    // What can be detected follows from the scenes, too.
    let check = bench.call(&words("check set"));
    insta::assert_snapshot!(redacted(&joined(&check.stdout)), @r#"
    ok       48 questions, 48 with 3 choices; chance 33.3 %
    ok       families: color 48
    warning  always the letter "C" scores 100 %; ask the model without images too (--blind-model NAME), or show
        the choices in other orders (--choice-order shuffle)
    warning  always the answer "brown" scores 100 %; ask the model without images too (--blind-model NAME), or
        show the choices in other orders (--choice-order shuffle)
    ok       power: 48 questions in 12 scenes detects 35.2 points between two conditions in 80 % of such runs; 5
        points need about 251 scenes (one model; level 2.50 % after correction; assumed: 20 % of answers change
        without an effect, correlation 0.05 in a scene)
    ok       24 images, 5 kB, 24 of 32×24
    ok       median brightness 63 of 255 (24 images)
    warning  no model is named: --model NAME adds it to the check, and what a run would take
    ok: 48 questions, 3 warnings
    "#);
    let dry = bench.call(&words(&format!("{RUN} --dry-run")));
    insta::assert_snapshot!(dry, @"
    exit code: 0
    stdout:
    Nothing was sent. 0 of 96 trials are left to ask.
    power: 48 questions in 12 scenes detects 32.8 points between two conditions in 80 % of such runs; 5 points
        need about 232 scenes (one model; level 3.33 % after correction; assumed: 20 % of answers change without
        an effect, correlation 0.05 in a scene)
    ");
    // A file without them takes none away.
    questions(&bench, false);
    let called = bench.call(&words(RUN));
    insta::assert_snapshot!(called.lines_with("the intervals"), @"
    exit code: 0
    Sample         ·  With 12 scenes the intervals of the findings reach about 18
    ");
    assert!(records() == before);
}

/// The texts of the alerts of kind "clusters" in a summary.
fn cluster_alerts(summary: &str) -> Vec<String> {
    let summary: Value = serde_json::from_str(summary).unwrap();
    let alerts = summary["alerts"].as_array().unwrap().iter();
    alerts.filter(|alert| alert["kind"] == "clusters").map(|alert| alert["text"].as_str().unwrap().to_owned()).collect()
}

/// A set of frames with one question each, from the number of its picture and its scene.
fn frames(bench: &Bench, frames: impl IntoIterator<Item = (u8, &'static str)>) {
    let _ = fs::create_dir(bench.path("set"));
    let mut lines = String::new();
    for (number, (picture, scene)) in frames.into_iter().enumerate() {
        let image = image::RgbImage::from_pixel(32, 24, image::Rgb([90, 60, picture]));
        image.save(bench.path(&format!("set/{number}.png"))).unwrap();
        let question = json!({
            "id": format!("q{number}"), "frame": format!("{number}.png"), "scene": scene, "family": "color",
            "question": format!("What color is it, {number}?"), "choices": ["red", "blue", "brown"], "answer": "brown",
        });
        lines.extend([question.to_string(), "\n".to_owned()]);
    }
    bench.file("set/questions.jsonl", lines);
}

fn summary(bench: &Bench, run: &str) -> String {
    fs::read_to_string(bench.path(run).join("summary.json")).unwrap()
}

#[test]
fn equal_files_count_as_one_frame() {
    let bench = Bench::new();
    frames(&bench, (0..40).map(|number| (number / 4, "")));
    bench.complete(&words(RUN));
    let expected = ["40 frames show 10 different pictures: equal pictures count as one frame."];
    let stored = summary(&bench, "run");
    assert_eq!(cluster_alerts(&stored), expected);
    assert!(stored.contains("\"clusters\": 10.0"), "{stored}");
    // A stored run, and two runs together.
    bench.complete(&words(&RUN.replace("L3", "L4").replace("--out run", "--out other")));
    for runs in ["run", "run other"] {
        let report = bench.call(&words(&format!("report {runs} --json")));
        assert_eq!(cluster_alerts(&report.stdout), expected);
        assert!(report.stdout.contains("\"clusters\": 10.0"), "{report:?}");
    }
    let dry = bench.call(&words(&format!("{RUN} --dry-run")));
    assert!(dry.stdout.contains("40 questions in 10 frames"), "{dry:?}");
}

#[test]
fn few_scenes_are_clusters_with_an_alert() {
    let bench = Bench::new();
    let names = ["a", "b", "c", "d", "e"];
    frames(&bench, (0..40).map(|number| (number, names[usize::from(number) % 5])));
    bench.complete(&words(RUN));
    let stored = summary(&bench, "run");
    assert_eq!(cluster_alerts(&stored), ["Only 5 scenes (8 are needed): wide intervals, few possible verdicts."]);
    let report = bench.call(&words("report run"));
    let text = report.stdout.replace("\n  ", " ");
    assert!(text.contains("With 5 scenes no verdict"), "{text}");
}

#[test]
fn a_scene_with_most_questions_has_an_alert() {
    let bench = Bench::new();
    let names = ["a", "b", "c", "d", "e", "f", "g", "h"];
    let scenes = names.into_iter().chain(["hall"; 8]);
    frames(&bench, (0..).zip(scenes));
    bench.complete(&words(RUN));
    assert_eq!(
        cluster_alerts(&summary(&bench, "run")),
        ["Scene hall has 50 % of the questions: the results are mostly about it, and intervals may be too narrow."]
    );
    // Without one of them, no scene is large.
    let bench = Bench::new();
    let scenes = names.into_iter().chain(["hall"; 7]);
    frames(&bench, (0..).zip(scenes));
    bench.complete(&words(RUN));
    assert!(cluster_alerts(&summary(&bench, "run")).is_empty());
}

#[test]
fn frames_of_one_scene_are_clusters_with_an_alert() {
    let bench = Bench::new();
    frames(&bench, (0..12).map(|number| (number, "hall")));
    bench.complete(&words(RUN));
    assert_eq!(
        cluster_alerts(&summary(&bench, "run")),
        [
            "All 12 frames are of one scene and count as independent: the results are about this scene alone. Take more scenes."
        ]
    );
}
