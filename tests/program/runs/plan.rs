//! A plan of a run: written once, taken by every part, which then opens no frame that it does not ask about.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::run::{Bench, assert_same_products, files, records, words};
use crate::support::snapshot::redacted;

/// The flags of every run here: a folder of twelve small frames with maps and without questions.
const FLAGS: &str = "--model random --blind-model random --levels L0,L2 --data frames";

/// A folder of frames of built-in rooms.
fn with_frames() -> Bench {
    let bench = Bench::new();
    bench.rooms("frames", 12, "160x120");
    bench
}

fn lines(path: &Path) -> Vec<Value> {
    let text = fs::read_to_string(path).unwrap();
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

fn json(path: &Path) -> Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

#[test]
fn planned_shards_equal_one_run() {
    let bench = with_frames();
    bench.complete(&words(&format!("{FLAGS} --out whole")));
    let said = bench.complete(&words(&format!("plan {FLAGS} --out run")));
    insta::assert_snapshot!(redacted(&said), @"run/plan: 41 questions about 12 frames, 164 trials");
    let plan = bench.path("run/plan");
    let file = json(&plan.join("plan.json"));
    assert_eq!(file["schema"], "darkqa.plan/1");
    assert_eq!(file["counts"]["frames"], 12);
    assert_eq!(file["counts"]["scenes"], 6);
    assert_eq!(file["identity"]["--data"], "rooms-7");
    let questions = lines(&plan.join("questions.jsonl"));
    assert_eq!(questions, lines(&bench.path("whole/questions.jsonl")));
    assert_eq!(file["counts"]["questions"], questions.len());
    let trials = records(&bench.path("whole")).len();
    assert_eq!(file["counts"]["trials"], trials);
    let frames = lines(&plan.join("frames.jsonl"));
    for (place, frame) in frames.iter().enumerate() {
        assert_eq!(frame["place"], place);
        assert_eq!((&frame["width"], &frame["height"]), (&160.into(), &120.into()));
        let path = bench.path(frame["path"].as_str().unwrap());
        assert_eq!(frame["size"], fs::metadata(path).unwrap().len());
        assert!(frame["digest"].is_string() && frame["mtime"].is_string());
        assert!(frame["cost"]["seconds"].as_f64().unwrap() > 0.0);
    }
    let requests = frames.iter().map(|frame| frame["cost"]["requests"].as_u64());
    assert_eq!(requests.sum::<Option<u64>>(), Some(trials as u64));
    for part in 1..=5 {
        bench.complete(&words(&format!("{FLAGS} --out run --shard {part}/5")));
    }
    bench.complete(&words("merge run --out merged"));
    assert_same_products(&bench.path("whole"), &bench.path("merged"));
    // The whole run takes the plan, too.
    bench.complete(&words(&format!("plan {FLAGS} --out alone")));
    bench.complete(&words(&format!("{FLAGS} --out alone")));
    assert_same_products(&bench.path("whole"), &bench.path("alone"));
}

/// Every file of a frame of other parts is none that could be read.
#[test]
fn shard_opens_only_its_frames() {
    let bench = with_frames();
    let part = |flags: &str| {
        let line = format!("{flags} --data frames --levels L0,L2 --out run --shard 2/4");
        bench.call(&words(&line))
    };
    let models = "--model random --blind-model random";
    bench.complete(&words(&format!("plan {FLAGS} --out run")));
    let found = part(models);
    assert_eq!(found.code, Some(0), "{found:?}");
    let own: BTreeSet<String> = {
        let records = records(&bench.path("run/shard-2-of-4"));
        records.iter().map(|record| record["frame"].as_str().unwrap()).map(str::to_owned).collect()
    };
    assert!((2..=4).contains(&own.len()), "{own:?}");
    fs::remove_dir_all(bench.path("run/shard-2-of-4")).unwrap();
    let mut spoiled = 0;
    for path in files(&bench.path("frames/scenes")) {
        let is_own = own.iter().any(|frame| {
            let (scene, view) = frame.split_once('/').unwrap();
            path.file_stem().unwrap() == view && path.components().any(|part| part.as_os_str() == scene)
        });
        if !is_own && path.extension().unwrap() == "png" {
            fs::write(&path, "no image").unwrap();
            spoiled += 1;
        }
    }
    // An image and three maps of each frame.
    assert_eq!(spoiled, 4 * (12 - own.len()));
    let again = part(models);
    assert_eq!(again.code, Some(0), "{again:?}");
    // Nor does the observer need the maps of other frames, but for its control that is asked about them.
    let observer = part(&format!("{models} --model observer"));
    assert_ne!(observer.code, Some(2), "{observer:?}");
    // Without a plan every frame is read.
    fs::remove_dir_all(bench.path("run")).unwrap();
    assert_eq!(part(models).code, Some(2));
}

#[test]
fn foreign_plan_names_the_setting() {
    let bench = Bench::new();
    let flags = "--model random --levels L0,L2 --data rooms:frames=4,size=120x90";
    bench.complete(&words(&format!("plan {flags} --out run")));
    let refused = |line: &str, says: &str| {
        let called = bench.call(&words(line));
        assert_eq!(called.code, Some(2), "{line}: {called:?}");
        assert!(called.stderr.contains(says), "{says}: {}", called.stderr);
        assert!(called.stderr.contains("plan is of another run"), "{}", called.stderr);
    };
    refused(&format!("{flags} --seed 3 --out run"), "its --seed is 0, now it is 3");
    refused(&format!("{flags} --limit 3 --out run"), "its --limit is unset");
    refused(&format!("{flags} --variant ev --out run"), "its --variant is");
    refused(&format!("{flags} --gain 3 --out run"), "of the reading paper is");
    let model = "--model random --out run";
    refused(&format!("{model} --levels L0 --data rooms:frames=4,size=120x90"), "its --levels is");
    refused(&format!("{model} --levels L0,L2 --data rooms:frames=6,size=120x90"), "its --data is");
    assert!(!bench.path("run/manifest.json").exists());
    // Whoever answers, and whatever enhances, takes the same plan.
    bench.complete(&words(&format!("{flags} --blind-model random --llie lift --out run")));
}

#[test]
fn frame_changed_since_plan_is_named() {
    let bench = with_frames();
    bench.complete(&words(&format!("plan {FLAGS} --out run")));
    let frames = lines(&bench.path("run/plan/frames.jsonl"));
    let path = bench.path(frames[11]["path"].as_str().unwrap());
    let other = bench.path(frames[0]["path"].as_str().unwrap());
    fs::copy(other, &path).unwrap();
    bench.complete(&words(&format!("{FLAGS} --out run --shard 1/4")));
    let called = bench.call(&words(&format!("{FLAGS} --out run --shard 4/4")));
    assert_eq!(called.code, Some(2), "{called:?}");
    insta::assert_snapshot!(called.messages(), @r#"
    exit code: 2
    error: frame "office-0000/robot": its image is not the one that was planned (run/plan); restore it, or write
        the plan again into another --out
    "#);
    assert!(!bench.path("run/shard-4-of-4").exists());
    // The plan can be written again only where no part has begun.
    let again = bench.call(&words(&format!("plan {FLAGS} --out run")));
    insta::assert_snapshot!(again.messages(), @"
    exit code: 2
    error: run/plan: the run has parts of another plan, with other questions or frames (run/shard-1-of-4); use
        another --out, or delete the parts
    ");
    bench.complete(&words(&format!("plan {FLAGS} --out new")));
    // A file of the plan that was changed is refused.
    let questions = bench.path("new/plan/questions.jsonl");
    let text = fs::read_to_string(&questions).unwrap();
    fs::write(&questions, text.replacen("Which", "What", 1)).unwrap();
    let changed = bench.call(&words(&format!("{FLAGS} --out new")));
    insta::assert_snapshot!(changed.messages(), @"
    exit code: 2
    error: new/plan/questions.jsonl: the file is not the one that plan.json was written with; write the plan again
        with `darkqa-eval plan`
    ");
}

#[test]
fn missing_planned_shards_name_command() {
    let bench = with_frames();
    bench.complete(&words(&format!("plan {FLAGS} --out run")));
    for part in ["1/6", "2/6", "3/6", "5/6", "6/6"] {
        bench.complete(&words(&format!("{FLAGS} --out run --shard {part}")));
    }
    let merged = |flags: &str| bench.call(&words(&format!("merge run --out merged {flags}")));
    let refused = merged("");
    assert_eq!(refused.code, Some(2), "{refused:?}");
    let command = format!("darkqa-eval {FLAGS} --out run --shard 4/6");
    insta::assert_snapshot!(refused.messages(), @"
    exit code: 2
    error: run/shard-1-of-6: 1 shard is missing: 4/6 (2 of 12 frames, 24 trials); --partial merges the others;
        darkqa-eval --model random --blind-model random --levels L0,L2 --data frames --out run --shard 4/6 asks
        what is left
    ");
    let partial = merged("--partial");
    insta::assert_snapshot!(partial.messages(), @"
    exit code: 1
     WARN 1 shard is missing: 4/6 (2 of 12 frames, 24 trials); the summary covers only the others; darkqa-eval
        --model random --blind-model random --levels L0,L2 --data frames --out run --shard 4/6 asks what is left
    ");
    // Of two divisions, the one that lacks fewer shards goes on.
    bench.complete(&words(&format!("{FLAGS} --out run --shard 1/2")));
    let mixed = bench.call(&words("merge run --out mixed"));
    insta::assert_snapshot!(mixed.messages(), @"
    exit code: 2
    error: run/shard-1-of-2: 1 shard is missing: 2/2 (2 of 12 frames, 24 trials); --partial merges the others;
        darkqa-eval --model random --blind-model random --levels L0,L2 --data frames --out run --shard 2/2 asks
        what is left
    ");
    fs::remove_dir_all(bench.path("run/shard-5-of-6")).unwrap();
    let two = bench.call(&words("merge run --out mixed"));
    insta::assert_snapshot!(two.messages(), @"
    exit code: 2
    error: run/shard-1-of-2: 1 shard is missing: 2/2 (5 of 12 frames, 56 trials); --partial merges the others;
        darkqa-eval --model random --blind-model random --levels L0,L2 --data frames --out run --shard 2/2 asks
        what is left
    ");
    // The command said does what it says.
    let words: Vec<&str> = command.split(' ').skip(1).collect();
    bench.complete(&words);
    bench.complete(&crate::support::run::words(&format!("{FLAGS} --out run --shard 5/6")));
    bench.complete(&crate::support::run::words("merge run --out complete"));
}

#[test]
fn parts_of_plan_cost_about_same() {
    let bench = Bench::new();
    // Four small frames, and four with sixteen times the pixels.
    let lines = (0..8).map(|i| {
        let side = if i < 4 { 100 } else { 400 };
        let name = format!("{i}.png");
        image::RgbImage::new(side, side).save(bench.path(&name)).unwrap();
        let question = serde_json::json!({
            "id": format!("q{i}"), "image": name, "question": format!("Where is it, {i}?"),
            "choices": ["here", "there"], "answer": "here",
        });
        format!("{question}\n")
    });
    bench.file("set.jsonl", lines.collect::<String>());
    let flags = "--model random --levels L0-L5 --data set.jsonl";
    bench.complete(&words(&format!("{flags} --out equal --shard 1/2")));
    bench.complete(&words(&format!("plan {flags} --out run")));
    bench.complete(&words(&format!("{flags} --out run --shard 1/2")));
    let count = |part: &str| json(&bench.path(part).join("manifest.json"))["part"]["count"].clone();
    assert_eq!(count("equal/shard-1-of-2"), 4);
    let planned = count("run/shard-1-of-2").as_u64().unwrap();
    assert!(planned == 6, "{planned}");
}

#[test]
fn shard_may_cost_its_share() {
    let bench = Bench::new();
    let mock = MockEndpoint::start([Answer::text("A")]);
    // One question about the first frame, and nine about the second.
    let lines = (0..10).map(|i| {
        let name = format!("{}.png", i.min(1));
        image::RgbImage::new(64, 64).save(bench.path(&name)).unwrap();
        let question = serde_json::json!({
            "id": format!("q{i}"), "image": name, "question": format!("Where is it, {i}?"),
            "choices": ["here", "there"], "answer": "here",
        });
        format!("{question}\n")
    });
    bench.file("set.jsonl", lines.collect::<String>());
    let base = mock.base_url();
    let flags = format!("--model gpt-4o --base-url {base} --levels L0 --data set.jsonl --max-tokens 16");
    bench.complete(&words(&format!("plan {flags} --out run")));
    let frames = self::lines(&bench.path("run/plan/frames.jsonl"));
    let dollars: Vec<f64> = frames.iter().map(|frame| frame["cost"]["dollars"].as_f64().unwrap()).collect();
    let whole = dollars[0] + dollars[1];
    assert!((dollars[0] / whole - 0.1).abs() < 0.02, "{dollars:?}");
    let estimate = &json(&bench.path("run/plan/plan.json"))["estimate"];
    assert!((estimate["dollars"].as_f64().unwrap() - whole).abs() < 1e-9);
    // Four times what all is estimated to cost: the upper bound of each request is up to twice its estimate. Of a limit
    // of a sixth of the estimate the first part has a sixtieth, which is less than its one request, and an equal share
    // would be enough for it.
    let part = |part: u32, limit: f64| {
        let line = format!("{flags} --out run --shard {part}/2 --max-cost {limit:.9}");
        bench.call(&words(&line)).code
    };
    assert_eq!(part(1, whole / 6.0), Some(3));
    assert_eq!(part(1, 4.0 * whole), Some(0));
    assert_eq!(part(2, 4.0 * whole), Some(0));
}
