//! The image store: what a run takes from it is what it would make, however damaged the store is.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::support::house::House;
use crate::support::onnx;
use crate::support::run::{Bench, Called, assert_same_products, called, files, records, words};
use crate::support::snapshot::redacted;

/// Three frames in four enhanced images each.
const IMAGES: usize = 3 * 4;

/// Message for an enhancer whose images are all in the store.
const NOT_OPENED: &str = "one: not opened, because the store has all its images";
/// Message when a stored image is damaged.
const OPENED: &str = "one: opened, because the store lacks an image";

/// A run about small rooms with an enhancer; `--timings` says what the store gave.
fn evaluate(bench: &Bench, model: &str, more: &str) -> Called {
    let line = format!(
        "--model {model} --data frames --levels L3,L5 --variant both --llie one.onnx --llie-on both --llie-anyway --timings {more}"
    );
    let mut command = bench.command(&words(&line));
    let called = called(command.env("RUST_LOG", "darkqa_engine=debug,darkqa_eval=warn"));
    assert_eq!(called.code, Some(0), "{line}: {called:?}");
    called
}

fn bench() -> Bench {
    let bench = Bench::new();
    bench.rooms("frames", 3, "96x64");
    onnx::gamma(0.5).write(&bench.path(""), "one.onnx");
    bench
}

/// Records without times, in order of their keys.
fn untimed(run: &Path) -> Vec<String> {
    let mut lines: Vec<String> = records(run)
        .into_iter()
        .map(|mut record| {
            without_times(&mut record);
            record.to_string()
        })
        .collect();
    lines.sort_unstable();
    lines
}

fn without_times(value: &mut Value) {
    if let Value::Object(fields) = value {
        fields.retain(|name, _| !name.ends_with("_ms") && name != "time" && name != "latency");
        fields.values_mut().for_each(without_times);
    }
}

/// Asserts that two runs say the same of the same images: records, measures of fidelity, thumbnails, and the notes
/// about enhancers.
fn assert_same(bench: &Bench, [one, other]: [&str; 2]) {
    let [one, other] = [one, other].map(|run| bench.path(run));
    assert_eq!(untimed(&one), untimed(&other));
    assert!(assert_same_products(&one, &other) > 8);
    for name in ["fidelity.jsonl", "thumbnails.jsonl"] {
        let lines = |run: &PathBuf| {
            let text = fs::read_to_string(run.join(name)).unwrap();
            text.lines().map(str::to_owned).collect::<BTreeSet<String>>()
        };
        assert!(!lines(&one).is_empty());
        assert_eq!(lines(&one), lines(&other), "{name}");
    }
    let notes = |run: &PathBuf| -> Value {
        let text = fs::read_to_string(run.join("manifest.json")).unwrap();
        let mut notes = serde_json::from_str::<Value>(&text).unwrap()["enhancers"].clone();
        for note in notes.as_object_mut().unwrap().values_mut() {
            // A time, and only of a run that opened the enhancer.
            note.as_object_mut().unwrap().remove("latency");
        }
        notes
    };
    assert!(notes(&one).is_object());
    assert_eq!(notes(&one), notes(&other));
}

/// The files of the store that hold an image, not measures, small copies or tries.
fn stored(bench: &Bench) -> Vec<PathBuf> {
    stored_as(bench, "image")
}

/// The files of the store with this kind of content.
fn stored_as(bench: &Bench, content: &str) -> Vec<PathBuf> {
    let mut entries = files(&bench.path("images"));
    entries.retain(|path| path.extension().is_some_and(|extension| extension == "img"));
    let wanted = format!("\"content\":\"{content}\"");
    entries.retain(|path| {
        let file = fs::read(path).unwrap();
        // The facts stand at the end.
        file.windows(wanted.len()).rev().any(|part| part == wanted.as_bytes())
    });
    entries.sort_unstable();
    entries
}

#[test]
fn second_model_reuses_stored_images() {
    let bench = bench();
    evaluate(&bench, "random", "--out random-alone");
    evaluate(&bench, "observer", "--out observer-alone");
    let first = evaluate(&bench, "random", "--images-cache images --out random");
    insta::assert_snapshot!(first.messages(), @"
    exit code: 0
    image store images: 0 of 12 images read (0.0 MB), 0 measures and small copies; these took [TIME] to make; 12
        written (0.1 MB); it holds 0.00 of [MEMORY]
    ");
    assert_eq!(stored(&bench).len(), IMAGES);
    assert!(!first.stderr.contains(NOT_OPENED), "{}", first.stderr);
    let second = evaluate(&bench, "observer", "--images-cache images --out observer");
    insta::assert_snapshot!(second.messages(), @"
    exit code: 0
    DEBUG one: not opened, because the store has all its images
    image store images: 12 of 12 images read (0.1 MB), 37 measures and small copies; these took [TIME] to make; 0
        written (0.0 MB); it holds 0.00 of [MEMORY]
    ");
    assert!(!second.stderr.contains(OPENED), "{}", second.stderr);
    // Measures of the degraded images, small copies of all, and what the enhancer was found to be.
    assert_same(&bench, ["random-alone", "random"]);
    assert_same(&bench, ["observer-alone", "observer"]);

    // Another size, format or model of the same name is another image.
    for (number, more) in ["--max-side 50", "--image jpeg:80", "--seed 9"].iter().enumerate() {
        let more = format!("{more} --images-cache images --out other-{number}");
        let other = evaluate(&bench, "random", &more);
        // Only what is drawn depends on the seed.
        let hits = if number == 2 { IMAGES / 2 } else { 0 };
        let read = format!("image store images: {hits} of {IMAGES} images read");
        assert!(other.stderr.contains(&read), "{more}: {}", other.stderr);
    }
    onnx::gamma(0.6).write(&bench.path(""), "one.onnx");
    let other = evaluate(&bench, "random", "--images-cache images --out another-file");
    insta::assert_snapshot!(other.messages(), @"
    exit code: 0
    image store images: 0 of 12 images read (0.0 MB), 24 measures and small copies; these took [TIME] to make; 12
        written (0.1 MB); it holds 0.00 of [MEMORY]
    ");
}

#[test]
fn damaged_stored_images_are_rebuilt() {
    let bench = bench();
    evaluate(&bench, "random", "--images-cache images --out first");
    let entries = stored(&bench);
    let mut flipped = fs::read(&entries[0]).unwrap();
    flipped[20] ^= 1;
    fs::write(&entries[0], flipped).unwrap();
    let cut = fs::read(&entries[1]).unwrap();
    fs::write(&entries[1], &cut[..cut.len() / 2]).unwrap();
    let [two, three] = [2, 3].map(|place: usize| fs::read(&entries[place]).unwrap());
    fs::write(&entries[2], three).unwrap();
    fs::write(&entries[3], two).unwrap();
    let again = evaluate(&bench, "random", "--images-cache images --out again");
    insta::assert_snapshot!(again.messages(), @"
    exit code: 0
    DEBUG one: not opened, because the store has all its images
     WARN --images-cache: images/v1/[DIGEST].img is damaged, and made again; so is each further one
    DEBUG one: opened, because the store lacks an image
    image store images: 8 of 12 images read (0.1 MB), 37 measures and small copies; these took [TIME] to make; 4
        written (0.0 MB), 4 damaged and made again; it holds 0.00 of [MEMORY]
    ");
    assert_same(&bench, ["first", "again"]);
    let third = evaluate(&bench, "random", "--images-cache images --out third");
    insta::assert_snapshot!(third.messages(), @"
    exit code: 0
    DEBUG one: not opened, because the store has all its images
    image store images: 12 of 12 images read (0.1 MB), 37 measures and small copies; these took [TIME] to make; 0
        written (0.0 MB); it holds 0.00 of [MEMORY]
    ");
}

#[test]
fn missing_image_opens_the_enhancer() {
    let bench = bench();
    evaluate(&bench, "random", "--images-cache images --out first");
    fs::remove_file(&stored(&bench)[0]).unwrap();
    let again = evaluate(&bench, "observer", "--images-cache images --out again");
    assert!(!again.stderr.contains(NOT_OPENED), "{}", again.stderr);
    evaluate(&bench, "observer", "--out again-alone");
    assert_same(&bench, ["again-alone", "again"]);
    // Less is asked, so the enhancer is tried on other frames, and its note says so.
    let other = evaluate(&bench, "random", "--images-cache images --limit 1 --out other");
    assert!(!other.stderr.contains(NOT_OPENED), "{}", other.stderr);
    evaluate(&bench, "random", "--limit 1 --out other-alone");
    assert_same(&bench, ["other-alone", "other"]);
    // Measures that are lost are measured again.
    fs::remove_dir_all(bench.path("images")).unwrap();
    let lost = evaluate(&bench, "random", "--images-cache images --out lost");
    insta::assert_snapshot!(lost.messages(), @"
    exit code: 0
    image store images: 0 of 12 images read (0.0 MB), 0 measures and small copies; these took [TIME] to make; 12
        written (0.1 MB); it holds 0.00 of [MEMORY]
    ");
    assert_same(&bench, ["first", "lost"]);
}

#[test]
fn refused_enhancer_ignores_stored_images() {
    let bench = Bench::new();
    bench.rooms("frames", 3, "96x64");
    onnx::gamma(0.0).write(&bench.path(""), "one.onnx");
    let line = "--model random --data frames --levels L3 --llie one.onnx --images-cache images";
    let overruled = bench.call(&words(&format!("{line} --llie-anyway --out anyway")));
    assert_eq!(overruled.code, Some(0), "{overruled:?}");
    let warned = bench.call(&words(&format!("{line} --llie-anyway --out warned")));
    let problem = "dark frames its images";
    for called in [overruled, warned] {
        assert!(called.stderr.contains(problem), "{}", called.stderr);
    }
    let refused = bench.call(&words(&format!("{line} --out refused")));
    assert_ne!(refused.code, Some(0), "{refused:?}");
    insta::assert_snapshot!(refused.messages(), @"
    exit code: 2
    error: one.onnx: on 6 of 6 dark frames its images are flat (brightness varies by 0.0 of 255). No usual value
        range fits (0..1, 0..255, -1..1, -0.5..0.5, mean and std of ImageNet or CLIP); perhaps it needs another
        `mean` and `std` (or `mean_out` and `std_out`), another output is the image, or the export has lost its
        weights. `darkqa-eval enhance doctor one.onnx IMAGES… --out DIR` tries each value range and colour order;
        --allow bad-enhancer uses it anyway
    ");
}

#[test]
fn dry_run_estimates_image_store() {
    let bench = bench();
    let line = "--model random --data frames --levels L3,L5 --llie one.onnx --llie-anyway --dry-run --out run";
    let without = bench.complete(&words(line));
    assert!(!without.contains("image store"), "{without}");
    let roomy = bench.complete(&words(&format!("{line} --images-cache images")));
    let all = "the next model finds about 100 % of them";
    insta::assert_snapshot!(redacted(&roomy), @"
    Nothing was sent. 60 of 60 trials are left to ask.
    at no endpoint, built in: random 60
    image store: enhanced images 0.0 MB, room [MEMORY]: the next model finds about 100 % of them
    power: 10 questions in 2 scenes detects no difference between two conditions; 5 points need about 276 scenes
        (one model; level 0.83 % after correction; assumed: 20 % of answers change without an effect, correlation
        0.05 in a scene)
    only 3 frames (8 are needed): intervals and tests would be rough
    ");
    let narrow = bench.complete(&words(&format!("{line} --images-cache images --images-cache-size 0.00001")));
    // 10 kB hold a part of the images, whose files depend on the form of PNG.
    let share =
        narrow.split_once("room 0.0 MB: the next model finds about ").and_then(|(_, rest)| rest.split_once(" %"));
    let share: u32 = share.unwrap().0.parse().unwrap();
    assert!((10..60).contains(&share), "{narrow}");
    assert!(!narrow.contains(all), "{narrow}");
    assert!(!bench.path("images").exists());
}

#[test]
fn shards_try_an_enhancer_once() {
    let bench = bench();
    for shard in ["1/3", "2/3", "3/3"] {
        evaluate(&bench, "random", &format!("--images-cache images --out run --shard {shard}"));
        // The result of the probe, and that the model was opened.
        assert_eq!(stored_as(&bench, "probe").len(), 2, "{shard}");
    }
    let frames = |shard: u8| {
        let manifest = format!("run/shard-{shard}-of-3/manifest.json");
        let text = fs::read_to_string(bench.path(&manifest)).unwrap();
        let manifest: Value = serde_json::from_str(&text).unwrap();
        manifest["enhancers"]["one"]["probe"].clone()
    };
    assert_eq!(frames(1)["frames"], 6);
    assert_eq!(frames(1), frames(2));
    assert_eq!(frames(1), frames(3));
}

#[test]
fn processes_share_one_image_store() {
    let bench = bench();
    std::thread::scope(|scope| {
        for model in ["random", "observer"] {
            let bench = &bench;
            scope.spawn(move || {
                let more = format!("--images-cache images --images-cache-what all --out {model}");
                evaluate(bench, model, &more)
            });
        }
    });
    evaluate(&bench, "random", "--out random-alone");
    evaluate(&bench, "observer", "--out observer-alone");
    assert_same(&bench, ["random-alone", "random"]);
    assert_same(&bench, ["observer-alone", "observer"]);
    let listed = bench.complete(&words("cache images"));
    assert!(listed.contains("L3-noise, enhanced by one, png"), "{listed}");
    assert!(listed.contains("in all, in images"), "{listed}");
    let foreign = bench.file("images/v1/notes.txt", "mine");
    let cleared = bench.complete(&words("cache images --clear"));
    insta::assert_snapshot!(redacted(&cleared), @"images: 50 files removed (0.4 MB)");
    assert!(stored(&bench).is_empty() && foreign.exists());
    let called = bench.call(&words("cache elsewhere"));
    insta::assert_snapshot!(called.messages(), @"
    exit code: 2
    error: elsewhere: no image store: the folder that --images-cache named is expected
    ");
}

#[test]
fn walks_share_their_images_too() {
    let house = House::new();
    onnx::gamma(0.5).write(&house.0.path(""), "one.onnx");
    let script = "{\"default\": \"4\"}";
    house.0.file("a.jsonl", script);
    let ask = |more: &str| {
        let line = format!(
            "--model script:a.jsonl --judge script:a.jsonl --levels L3 --variant both --llie one.onnx --llie-on both --llie-anyway --timings {more}"
        );
        let called = house.call(&words(&line));
        assert_eq!(called.code, Some(0), "{called:?}");
        called.stderr
    };
    ask("--out alone");
    // The first frames of both walks are alike, so without noise they are one image.
    let first = ask("--images-cache images --out first");
    insta::assert_snapshot!(redacted(&first), @r#"
     WARN 1 of 2 walks has fewer frames than --num-frames 3: they are shown several times in a request, as
        upstream does (the 2 frames of scannet-v0/001-b, for example)
     WARN one: value ranges of 0..1 in and 0..1 out assumed, because nothing sets them; its images of dark frames
        are plausible. To confirm, add to one.onnx.toml next to it: `range_in = "0..1"` and `range_out = "0..1"`
    image store images: 1 of 10 images read (0.0 MB), 0 measures and small copies; these took [TIME] to make; 9
        written (0.0 MB); it holds 0.00 of [MEMORY]
    "#);
    let second = ask("--images-cache images --out second");
    insta::assert_snapshot!(redacted(&second), @"
     WARN 1 of 2 walks has fewer frames than --num-frames 3: they are shown several times in a request, as
        upstream does (the 2 frames of scannet-v0/001-b, for example)
    image store images: 10 of 10 images read (0.0 MB), 1 measures and small copies; these took [TIME] to make; 0
        written (0.0 MB); it holds 0.00 of [MEMORY]
    ");
    for run in ["first", "second"] {
        let [alone, run] = ["alone", run].map(|run| house.0.path(run));
        assert_eq!(untimed(&alone), untimed(&run));
        assert!(assert_same_products(&alone, &run) > 4);
    }
}
