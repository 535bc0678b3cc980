//! Variants of a camera that does what cameras do: automatic exposure, which is measured in EV, and motion blur, which
//! has an axis of its own; through evaluations, their reports, and everything that makes images again.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use serde_json::{Value, json};

use crate::support::frames::png;
use crate::support::house::House;
use crate::support::run::{Bench, assert_same_products, records, words};
use crate::support::snapshot::{on_one_line, redacted};
use crate::support::table::check_rows;

/// Number of frames, each with one question: enough replies and clusters for a threshold.
const FRAMES: usize = 32;

/// Frames with questions, and a scripted model that answers rightly but at these conditions.
fn bench(wrong: &[&str]) -> Bench {
    let bench = Bench::new();
    let (mut questions, mut replies) = (String::new(), String::new());
    for frame in 0..FRAMES {
        bench.file(&format!("frames/{frame}.png"), png(40 + frame as u8));
        let question = json!({
            "id": format!("q{frame}"), "frame": format!("{frame}.png"), "family": "presence",
            "question": format!("Is there thing {frame}?"), "choices": ["yes", "no"], "answer": "yes",
        });
        let _ = writeln!(questions, "{question}");
        for condition in wrong {
            let reply = json!({"question": format!("q{frame}"), "condition": condition, "reply": "no"});
            let _ = writeln!(replies, "{reply}");
        }
    }
    let _ = writeln!(replies, "{}", json!({"default": "yes"}));
    bench.file("frames/questions.jsonl", questions);
    bench.file("m.jsonl", replies);
    bench
}

fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap()
}

/// The values of some columns of a table, row by row.
fn columns(run: &Path, file: &str, names: &[&str]) -> Vec<Vec<String>> {
    let table = read(&run.join(file));
    let mut lines = table.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let head = lines.next().unwrap();
    let places: Vec<usize> = names.iter().map(|name| head.iter().position(|column| column == name).unwrap()).collect();
    lines.map(|row| places.iter().map(|at| row[*at].to_owned()).collect()).collect()
}

/// Every table and figure of a run with all four variants keeps exposure times and exposure drops apart.
#[test]
fn exposure_times_have_own_axis() {
    let bench = bench(&["T66.67-motion", "T133.33-motion", "L5-noise", "L5-auto"]);
    let stdout = bench.complete(&words("--model script:m.jsonl --data frames --variant all --out run"));
    let run = bench.path("run");
    let findings = bench.complete(&words("report run --findings"));
    for sentence in [
        "With noise, darkness costs 100.0 points at L5, from 100.0 % at L0.",
        "automatic exposure: Darkness costs 100.0 points at L5, from 100.0 % at L0.",
        "Motion blur costs 100.0 points at T133.33, from 100.0 % at L0.",
    ] {
        let said = on_one_line(&findings);
        assert!(said.contains(sentence), "{sentence}: {findings}");
        let page = read(&run.join("report.html"));
        assert!(page.contains(sentence), "{sentence}");
    }
    let lines: Vec<Vec<&str>> = stdout.lines().map(|line| line.split_whitespace().collect()).collect();
    let after = |name: &str| {
        lines
            .iter()
            .filter(|line| line.first() == Some(&"script:m.jsonl"))
            .any(|line| line[1..].join(" ") == format!("{name} 95 %"))
    };
    assert!(after("L0 L1 L2 L3 L4 L5"), "{stdout}");
    assert!(after("L0 T8.33 T16.67 T33.33 T66.67 T133.33"), "{stdout}");
    // The accuracy falls from 1 at 33.33 ms to 0 at 66.67 ms; halfway between 1 and chance is 3/4.
    let blur = columns(&run, "blur_thresholds.csv", &["variant", "family", "threshold_ms", "longest_ms"]);
    // Each curve in both parsings.
    assert_eq!(blur.len(), 4);
    for row in &blur {
        let threshold: f64 = row[2].parse().unwrap();
        assert!((threshold - (33.33 + 33.34 / 4.0)).abs() < 1e-6, "{row:?}");
        assert_eq!((&*row[0], &*row[3]), ("motion", "133.33"));
    }
    let light = columns(&run, "thresholds.csv", &["variant", "darkest_ev"]);
    let of_light = |row: &Vec<String>| ["ev", "noise", "auto"].contains(&&*row[0]) && row[1] == "9";
    assert!(light.len() == 12 && light.iter().all(of_light), "{light:?}");
    let pooled = columns(&run, "pooled.csv", &["kind", "variant", "family", "level", "mode"]);
    let levels = |kind: &str, variant: &str| -> String {
        pooled
            .iter()
            .filter(|row| row[..3] == [kind, variant, "all"] && row[4] == "strict")
            .map(|row| &*row[3])
            .collect::<Vec<_>>()
            .join(" ")
    };
    assert_eq!(levels("motion blur", "motion"), "T8.33 T16.67 T33.33 T66.67 T133.33 T66.67–T133.33");
    assert_eq!(levels("darkness", "auto"), "L1 L2 L3 L4 L5 L4–L5");
    assert_eq!(levels("darkness", "motion"), "");
    assert_eq!(levels("noise", "noise"), "L1 L2 L3 L4 L5 L4–L5 L1–L3");
    assert_eq!(levels("noise", "auto"), "", "only noise extends the exposure drop");
    let mut rows = columns(&run, "summary.csv", &["level", "family", "mode"]);
    rows.retain(|row| row[1] == "all" && row[2] == "strict");
    let mut in_order: Vec<String> = rows.iter().map(|row| row[0].clone()).collect();
    in_order.dedup();
    let joined = in_order.join(" ");
    insta::assert_snapshot!(redacted(&joined), @"L0 L1 L2 L3 L4 L5 T8.33 T16.67 T33.33 T66.67 T133.33");
    let figure = |name: &str| read(&run.join(format!("figures/{name}.svg")));
    let axis = |figure: &str, title: &str| figure.matches(title).count();
    let accuracy = figure("accuracy");
    assert_eq!(axis(&accuracy, "level; exposure drop in EV"), 3);
    assert_eq!(axis(&accuracy, "level; exposure time in ms"), 1);
    assert!(!figure("variants").contains("motion blur"));
    assert!(!figure("thresholds").contains("motion blur"));
    assert!(figure("blur_thresholds").contains("threshold of motion blur in ms"));
    for record in records(&run) {
        let is_motion = record["variant"] == "motion";
        assert_eq!(record["ev"].is_null(), is_motion);
        assert_eq!(record["severity"].is_number(), is_motion);
        let has_camera = is_motion || record["variant"] == "auto";
        assert_eq!(record["image"]["exposure"].is_object(), has_camera, "{record}");
    }
}

/// What can still be read from the pixels: the observer loses little at L3 with automatic exposure, and much in a long
/// exposure.
#[test]
fn the_observer_loses_what_moves() {
    let bench = Bench::new();
    bench.complete(&words(
        "--model observer --data rooms:frames=4,size=240x180 --variant auto,motion --levels L0,L3,T8.33,T133.33 --out run",
    ));
    let run = bench.path("run");
    let seen = |condition: &str| -> u64 {
        let records = records(&run);
        records
            .iter()
            .filter(|record| record["condition"] == condition && record["model"] == "observer")
            .map(|record| record["observed"]["seen"].as_u64().unwrap())
            .sum()
    };
    let [clean, auto, short, long] = ["L0", "L3-auto", "T8.33-motion", "T133.33-motion"].map(seen);
    assert!(short * 10 > clean * 9, "{short} of {clean}");
    assert!(auto * 2 > clean && auto < clean, "{auto} of {clean}");
    assert!(long * 3 < clean * 2, "{long} of {clean}");
    let page = read(&run.join("report.html"));
    assert!(page.contains("exposure time in ms") && page.contains("automatic exposure"));
}

/// Images of the camera's variants are made again, and are the same in every part of the program that makes them.
#[test]
fn what_camera_made_is_made_again() {
    let bench = Bench::new();
    let rooms = "--data rooms:frames=4,size=96x64";
    let light = "--variant all --levels L0,L5,T33.33 --seed 3 --motion speed=90,angle=random --auto gain=3";
    let all = |more: &str| format!("--model random {rooms} {light} {more}");
    bench.complete(&words(&all("--out whole")));
    let whole = bench.path("whole");
    let sent = records(&whole);
    let id = sent[0]["question"].as_str().unwrap();
    let shown = bench.call(&["show", "whole", id, "--out", "shown"]);
    assert_eq!(shown.code, Some(0), "{shown:?}");
    assert_eq!(shown.stdout.matches("the same bytes as were sent").count(), 5, "{shown:?}");
    let sheet = bench.call(&["show", "whole", id, "--sheet", "item.png"]);
    assert_eq!(sheet.code, Some(0), "{sheet:?}");
    let left_out = "not drawn: L5-auto, L5-ev, T33.33-motion\n";
    assert!(sheet.stdout.contains(left_out), "{sheet:?}");
    // In parts, and on one thread.
    for part in ["1/2", "2/2"] {
        bench.complete(&words(&all(&format!("--out parts --threads 1 --shard {part}"))));
    }
    bench.complete(&words("merge parts --out merged"));
    assert!(assert_same_products(&whole, &bench.path("merged")) > 8);
    // As files of other tools, and of a Batch API.
    bench.complete(&words("rooms --out rooms --frames 4 --size 96x64"));
    bench.complete(&words("questions rooms --out questions.jsonl"));
    let export = format!("export llava rooms --questions questions.jsonl --out set {light}");
    let exported = bench.call(&words(&export));
    insta::assert_snapshot!(exported, @"
    exit code: 0
    stdout:
    12 questions about 4 images in 5 conditions:
    set/L0/questions.jsonl
    set/L5-ev/questions.jsonl
    set/L5-noise/questions.jsonl
    set/L5-auto/questions.jsonl
    set/T33.33-motion/questions.jsonl
    ");
    let digests = |condition: &str| -> Vec<String> {
        let mut digests: Vec<String> = sent
            .iter()
            .filter(|record| record["condition"] == condition)
            .map(|record| record["image"]["digest"].as_str().unwrap().to_owned())
            .collect();
        digests.sort();
        digests.dedup();
        digests
    };
    let made = |condition: &str| -> Vec<String> {
        let images = crate::support::run::files(&bench.path("set"));
        let mut digests: Vec<String> = images
            .iter()
            .filter(|path| {
                let is_of_it = path.to_str().unwrap().contains(condition);
                is_of_it && path.extension() == Some("png".as_ref())
            })
            .map(|path| blake3::hash(&fs::read(path).unwrap()).to_hex())
            .map(|digest| digest.to_string())
            .collect();
        digests.sort();
        digests.dedup();
        digests
    };
    for condition in ["L5-auto", "T33.33-motion"] {
        let (sent, made) = (digests(condition), made(condition));
        assert!(!made.is_empty() && made.iter().all(|digest| sent.contains(digest)), "{condition}");
    }
    let batch = format!("batch export --model m --base-url http://127.0.0.1:9/v1 {rooms} {light} --out batch");
    bench.complete(&words(&batch));
    let trials = read(&bench.path("batch/batch/trials.jsonl"));
    assert!(trials.contains("T33.33-motion") && trials.contains("blur_px"), "{trials}");
}

/// Walks through houses: each frame of a walk has a direction of its own, if it is drawn, and one blur otherwise.
#[test]
fn walks_are_blurred_frame_by_frame() {
    let house = House::new();
    house.0.file("a.jsonl", "{\"default\": \"an answer\"}\n");
    house.0.file("j.jsonl", "{\"default\": \"4\"}\n");
    let run = |motion: &str, out: &str| -> Vec<Value> {
        let line = format!(
            "--model script:a.jsonl --judge script:j.jsonl --variant auto,motion --levels L0,L5,T66.67 --motion {motion} --out {out}"
        );
        let called = house.call(&words(&line));
        assert_eq!(called.code, Some(0), "{called:?}");
        let all = records(&house.0.path(out));
        all.into_iter().filter(|record| record["step"] == "answer").collect()
    };
    let exposure = |records: &[Value], condition: &str| {
        let found = records.iter().find(|record| record["condition"] == condition).unwrap();
        found["images"]["exposure"].clone()
    };
    let (fixed, drawn) = (run("angle=45", "a"), run("angle=random", "b"));
    // f = 96 / (2 tan 39.5°), before the frames are scaled to 48 pixels.
    let focal = 48.0 / 39.5_f64.to_radians().tan();
    let expected = focal * 30_f64.to_radians() * 0.06667;
    for records in [&fixed, &drawn] {
        let found = exposure(records, "T66.67-motion")["blur_px"].as_f64().unwrap();
        assert!((found - expected).abs() < 1e-9, "{found}");
        assert_eq!(exposure(records, "L5-auto")["system_gain"], 6.0);
        assert!(exposure(records, "L0").is_null());
    }
    assert_eq!(exposure(&fixed, "T66.67-motion")["blur_angle"], 45.0);
    assert!(exposure(&drawn, "T66.67-motion")["blur_angle"].is_null());
    let table = read(&house.0.path("a/summary.csv"));
    assert!(table.contains("T66.67,motion") && table.contains("L5,auto"), "{table}");
    let scores = read(&house.0.path("a/figures/scores.svg"));
    for axis in ["level; exposure drop in EV", "level; exposure time in ms"] {
        assert_eq!(scores.matches(axis).count(), 1, "{axis}");
    }
    // Degraded after scaling, the picture moves by as much less.
    let line = "--model script:a.jsonl --variant motion --levels T66.67 --degrade resized --out c";
    let called = house.call(&words(line));
    assert_eq!(called.code, Some(0), "{called:?}");
    let resized = exposure(&records(&house.0.path("c")), "T66.67-motion");
    let found = resized["blur_px"].as_f64().unwrap();
    assert!((found - expected / 2.0).abs() < 1e-9, "{found}");
}

/// A dry run counts the trials of each variant, and says what is idle.
#[test]
fn a_dry_run_counts_every_variant() {
    let bench = bench(&[]);
    let count = |more: &str| -> (Value, String) {
        let line = format!("--model script:m.jsonl --data frames --dry-run --json {more}");
        let called = bench.call(&words(&line));
        assert_eq!(called.code, Some(0), "{called:?}");
        (serde_json::from_str(&called.stdout).unwrap(), called.stderr)
    };
    let trials = |forecast: &Value| forecast.to_string();
    check_rows(
        [
            ("", 11),
            ("--variant auto", 6),
            ("--variant motion", 6),
            ("--variant all", 21),
            ("--variant both,motion --levels L0-L5,T5,T10..T30:10", 15),
        ],
        |(more, conditions)| {
            let (forecast, _) = count(more);
            let text = trials(&forecast);
            let expected = format!("{}", conditions * FRAMES);
            assert!(text.contains(&expected), "{more}: {text}");
        },
    );
    let (_, stderr) = count("--variant both --motion speed=3");
    insta::assert_snapshot!(redacted(&stderr), @" WARN --motion: no effect: no variant has motion blur");
}
