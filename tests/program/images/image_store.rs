//! The image store: what a run takes from it is what it would make, however damaged the store is.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::support::house::House;
use crate::support::onnx;
use crate::support::run::{Bench, Called, assert_same_products, called, files, records, words};

/// Three frames in four enhanced images each.
const IMAGES: usize = 3 * 4;

/// What is said of an enhancer of which the store has all images.
const NOT_OPENED: &str = "one: not opened, because the store has all its images";
/// What is said when one of them is damaged.
const OPENED: &str = "one: opened, because the store lacks an image";

/// A run about small rooms with an enhancer; `--timings` says what the store gave.
fn evaluate(bench: &Bench, model: &str, more: &str) -> Called {
    let line = format!(
        "--model {model} --data frames --levels L3,L5 --variant both --llie one.onnx --llie-on both --llie-anyway --timings {more}"
    );
    let mut command = bench.command(&words(&line));
    let called = called(command.env("RUST_LOG", "darkqa_eval=debug"));
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

/// Asserts that two runs say the same of the same images: records, measures of fidelity, thumbnails, and the notes about enhancers.
fn assert_same(bench: &Bench, [one, other]: [&str; 2]) {
    let [one, other] = [one, other].map(|run| bench.path(run));
    assert_eq!(untimed(&one), untimed(&other));
    assert!(assert_same_products(&one, &other) > 8);
    for name in ["fidelity.jsonl", "thumbnails.jsonl"] {
        let lines = |run: &PathBuf| {
            let text = fs::read_to_string(run.join(name)).unwrap();
            text.lines()
                .map(str::to_owned)
                .collect::<BTreeSet<String>>()
        };
        assert!(!lines(&one).is_empty());
        assert_eq!(lines(&one), lines(&other), "{name}");
    }
    let notes = |run: &PathBuf| -> Value {
        let text = fs::read_to_string(run.join("manifest.json")).unwrap();
        serde_json::from_str::<Value>(&text).unwrap()["enhancers"].clone()
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
        file.windows(wanted.len())
            .rev()
            .any(|part| part == wanted.as_bytes())
    });
    entries.sort_unstable();
    entries
}

#[test]
fn a_second_model_takes_the_images_of_the_first_and_all_is_as_without() {
    let bench = bench();
    evaluate(&bench, "random", "--out random-alone");
    evaluate(&bench, "observer", "--out observer-alone");
    let first = evaluate(&bench, "random", "--images-cache images --out random");
    let none = format!("image store images: 0 of {IMAGES} images read");
    assert!(first.stderr.contains(&none), "{}", first.stderr);
    assert_eq!(stored(&bench).len(), IMAGES);
    assert!(!first.stderr.contains(NOT_OPENED), "{}", first.stderr);
    let second = evaluate(&bench, "observer", "--images-cache images --out observer");
    assert!(second.stderr.contains(NOT_OPENED), "{}", second.stderr);
    assert!(!second.stderr.contains(OPENED), "{}", second.stderr);
    // Measures of the degraded images, small copies of all, and what the enhancer was found to be.
    let measures = format!("{} measures and small copies", 3 * IMAGES + 1);
    assert!(second.stderr.contains(&measures), "{}", second.stderr);
    let all = format!("image store images: {IMAGES} of {IMAGES} images read");
    assert!(second.stderr.contains(&all), "{}", second.stderr);
    assert_same(&bench, ["random-alone", "random"]);
    assert_same(&bench, ["observer-alone", "observer"]);

    // Another size, format or model of the same name is another image.
    for (number, more) in ["--max-side 50", "--image jpeg:80", "--seed 9"]
        .iter()
        .enumerate()
    {
        let more = format!("{more} --images-cache images --out other-{number}");
        let other = evaluate(&bench, "random", &more);
        // Only what is drawn depends on the seed.
        let hits = if number == 2 { IMAGES / 2 } else { 0 };
        let read = format!("image store images: {hits} of {IMAGES} images read");
        assert!(other.stderr.contains(&read), "{more}: {}", other.stderr);
    }
    onnx::gamma(0.6).write(&bench.path(""), "one.onnx");
    let other = evaluate(&bench, "random", "--images-cache images --out another-file");
    assert!(other.stderr.contains(&none), "{}", other.stderr);
}

#[test]
fn damaged_and_exchanged_images_are_made_again_and_counted() {
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
    let read = format!("{} of {IMAGES} images read", IMAGES - 4);
    for said in [
        &read,
        "4 damaged and made again",
        "4 written",
        "is damaged",
        NOT_OPENED,
        OPENED,
    ] {
        assert!(again.stderr.contains(said), "{said}: {}", again.stderr);
    }
    assert_same(&bench, ["first", "again"]);
    let third = evaluate(&bench, "random", "--images-cache images --out third");
    let read = format!("{IMAGES} of {IMAGES} images read");
    assert!(third.stderr.contains(&read), "{}", third.stderr);
}

#[test]
fn an_enhancer_is_opened_if_an_image_is_missing_and_tried_again_on_other_frames() {
    let bench = bench();
    evaluate(&bench, "random", "--images-cache images --out first");
    fs::remove_file(&stored(&bench)[0]).unwrap();
    let again = evaluate(&bench, "observer", "--images-cache images --out again");
    assert!(!again.stderr.contains(NOT_OPENED), "{}", again.stderr);
    evaluate(&bench, "observer", "--out again-alone");
    assert_same(&bench, ["again-alone", "again"]);
    // Less is asked, so the enhancer is tried on other frames, and its note says so.
    let other = evaluate(
        &bench,
        "random",
        "--images-cache images --limit 1 --out other",
    );
    assert!(!other.stderr.contains(NOT_OPENED), "{}", other.stderr);
    evaluate(&bench, "random", "--limit 1 --out other-alone");
    assert_same(&bench, ["other-alone", "other"]);
    // Measures that are lost are measured again.
    fs::remove_dir_all(bench.path("images")).unwrap();
    let lost = evaluate(&bench, "random", "--images-cache images --out lost");
    assert!(
        lost.stderr.contains("0 measures and small copies"),
        "{}",
        lost.stderr
    );
    assert_same(&bench, ["first", "lost"]);
}

#[test]
fn an_enhancer_that_is_refused_is_refused_with_its_images_in_the_store() {
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
    assert!(refused.stderr.contains(problem), "{}", refused.stderr);
}

#[test]
fn a_dry_run_says_how_many_images_find_room_and_makes_no_store() {
    let bench = bench();
    let line = "--model random --data frames --levels L3,L5 --llie one.onnx --llie-anyway --dry-run --out run";
    let without = bench.complete(&words(line));
    assert!(!without.contains("image store"), "{without}");
    let roomy = bench.complete(&words(&format!("{line} --images-cache images")));
    let all = "the next model finds about 100 % of them";
    assert!(roomy.contains(all), "{roomy}");
    let narrow = bench.complete(&words(&format!(
        "{line} --images-cache images --images-cache-size 0.00001"
    )));
    assert!(narrow.contains("image store: enhanced images"), "{narrow}");
    assert!(!narrow.contains(all), "{narrow}");
    assert!(!bench.path("images").exists());
}

#[test]
fn shards_try_an_enhancer_once() {
    let bench = bench();
    for shard in ["1/3", "2/3", "3/3"] {
        evaluate(
            &bench,
            "random",
            &format!("--images-cache images --out run --shard {shard}"),
        );
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
fn two_processes_share_a_store_that_a_command_lists_and_empties() {
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
    assert!(
        listed.contains("L3-noise, enhanced by one, png"),
        "{listed}"
    );
    assert!(listed.contains("in all, in images"), "{listed}");
    let foreign = bench.file("images/v1/notes.txt", "mine");
    let cleared = bench.complete(&words("cache images --clear"));
    assert!(cleared.contains("files removed"), "{cleared}");
    assert!(stored(&bench).is_empty() && foreign.exists());
    let called = bench.call(&words("cache elsewhere"));
    assert_eq!(called.code, Some(2));
    assert!(
        called.stderr.contains("no image store"),
        "{}",
        called.stderr
    );
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
    assert!(
        first.contains("image store images: 1 of 10 images read"),
        "{first}"
    );
    let second = ask("--images-cache images --out second");
    assert!(
        second.contains("image store images: 10 of 10 images read"),
        "{second}"
    );
    for run in ["first", "second"] {
        let [alone, run] = ["alone", run].map(|run| house.0.path(run));
        assert_eq!(untimed(&alone), untimed(&run));
        assert!(assert_same_products(&alone, &run) > 4);
    }
}
