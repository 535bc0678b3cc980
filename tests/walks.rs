//! Runs of open questions and what every run can do: parts and their merging, reports from the folder alone, images made again, and
//! a kill in the midst of it.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod support;

use std::collections::BTreeSet;
use std::fs;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use support::endpoint::{Answer, MockEndpoint};
use support::house::{House, flags};
use support::run::{Called, called, files, records};

/// A script that answers each question in its own words, and one that marks the answers.
fn scripts(house: &House) {
    house.0.file(
        "a.jsonl",
        "{\"question\": \"q1\", \"condition\": \"L0\", \"reply\": \"brown\"}\n{\"question\": \"q1\", \"reply\": \"grey\"}\n\
         {\"default\": \"an answer\"}",
    );
    house.0.file(
        "j.jsonl",
        "{\"question\": \"q1\", \"reply\": \"4\"}\n{\"default\": \"2\"}",
    );
}

fn run(house: &House, more: &[&str]) -> Called {
    let own = ["--model", "script:a.jsonl", "--judge", "script:j.jsonl"];
    house.call(&[&own[..], &["--levels", "L0,L3"], more].concat())
}

fn complete(house: &House, more: &[&str]) -> String {
    let called = run(house, more);
    assert_eq!(called.code, Some(0), "{more:?}: {called:?}");
    called.stdout
}

#[test]
fn parts_are_together_what_one_run_is() {
    let house = House::new();
    scripts(&house);
    complete(&house, &["--out", "whole"]);
    for part in ["1/2", "2/2"] {
        complete(&house, &["--out", "parts", "--shard", part]);
    }
    let told = house.0.complete(&["merge", "parts", "--out", "merged"]);
    let (whole, merged) = (house.0.path("whole"), house.0.path("merged"));
    let keys = |run: &std::path::Path| -> BTreeSet<String> {
        let records = records(run).into_iter();
        records.map(|record| record["key"].to_string()).collect()
    };
    assert_eq!(keys(&whole), keys(&merged));
    // Every product but those that hold times or the run's name, byte for byte.
    let timed = [
        "manifest.json",
        "records.jsonl",
        "summary.json",
        "report.html",
        "thumbnails.jsonl",
    ];
    let mut compared = 0;
    for path in files(&whole) {
        let name = path.strip_prefix(&whole).unwrap();
        if !timed.iter().any(|timed| name.ends_with(timed)) {
            let there = fs::read(merged.join(name)).unwrap();
            assert_eq!(fs::read(&path).unwrap(), there, "{}", name.display());
            compared += 1;
        }
    }
    assert!(compared > 5, "{compared}");
    // It is the run that the whole command goes on with: nothing is left to ask, of answers or of marks.
    let before = fs::read(merged.join("records.jsonl")).unwrap();
    assert_eq!(complete(&house, &["--out", "merged"]), told);
    assert_eq!(fs::read(merged.join("records.jsonl")).unwrap(), before);
    // Runs of the other kind are no part of it.
    let other = ["--data", "rooms:frames=2,size=64x48", "--model", "random"];
    let shard = ["--levels", "L0", "--shard", "1/2", "--out", "parts"];
    fs::remove_dir_all(house.0.path("parts/shard-1-of-2")).unwrap();
    house.0.complete(&[&other[..], &shard].concat());
    let refused = house.0.call(&["merge", "parts", "--out", "mixed"]);
    assert_eq!(refused.code, Some(2), "{refused:?}");
    assert!(
        refused.stderr.contains("cannot be one run"),
        "{}",
        refused.stderr
    );
}

#[test]
fn a_report_is_made_from_the_folder_alone() {
    let house = House::new();
    scripts(&house);
    let told = complete(&house, &["--out", "run"]);
    let page = fs::read(house.0.path("run/report.html")).unwrap();
    for gone in ["report.html", "summary.csv", "summary.json", "tables.tex"] {
        fs::remove_file(house.0.path(&format!("run/{gone}"))).unwrap();
    }
    fs::remove_dir_all(house.0.path("walks")).unwrap();
    assert_eq!(house.0.complete(&["report", "run"]), told);
    assert_eq!(fs::read(house.0.path("run/report.html")).unwrap(), page);
}

#[test]
fn several_runs_are_compared_if_one_judge_marked_them() {
    let house = House::new();
    scripts(&house);
    complete(&house, &["--out", "one"]);
    house.0.file("b.jsonl", "{\"default\": \"grey\"}");
    let other = ["--model", "script:b.jsonl", "--levels", "L0,L3"];
    let judged = |judge: &str, out: &str| {
        let called = house.call(&[&other[..], &["--judge", judge, "--out", out]].concat());
        assert_eq!(called.code, Some(0), "{called:?}");
    };
    judged("script:j.jsonl", "two");
    let told = house
        .0
        .complete(&["report", "one", "two", "--out", "compared"]);
    for model in ["script:a.jsonl", "script:b.jsonl"] {
        assert!(told.contains(model), "{told}");
    }
    let summary = fs::read_to_string(house.0.path("compared/summary.csv")).unwrap();
    let of_all = summary.lines().filter(|line| line.contains(",all,all,"));
    assert_eq!(of_all.count(), 4, "{summary}");
    // The same model with other replies stands once for each run.
    house.0.file("a.jsonl", "{\"default\": \"nothing\"}");
    complete(&house, &["--out", "three"]);
    let told = house.0.complete(&["report", "one", "three"]);
    assert!(told.contains("script:a.jsonl (three)"), "{told}");
    fs::copy(house.0.path("j.jsonl"), house.0.path("k.jsonl")).unwrap();
    judged("script:k.jsonl", "four");
    let refused = house.0.call(&["report", "one", "four"]);
    assert_eq!(refused.code, Some(2), "{refused:?}");
    assert!(
        refused.stderr.contains("another judge"),
        "{}",
        refused.stderr
    );
}

#[test]
fn the_images_of_a_walk_are_made_again_and_proved() {
    let house = House::new();
    scripts(&house);
    complete(&house, &["--out", "run"]);
    let told = house.0.complete(&["show", "run", "q1"]);
    assert_eq!(told.matches("the very bytes that were sent").count(), 2);
    assert!(told.contains("brown") && told.contains("grey"), "{told}");
    let shown = files(&house.0.path("run/shown"));
    assert_eq!(shown.len(), 6, "three frames in two conditions: {shown:?}");
    // Another frame in the place of one that was shown is noticed.
    let [one, other] = ["00002", "00003"].map(|frame| {
        house
            .0
            .path(&format!("walks/hm3d-v0/000-a/{frame}-rgb.png"))
    });
    fs::copy(other, one).unwrap();
    let called = house.0.call(&["show", "run", "q1"]);
    assert_eq!(called.code, Some(1), "{called:?}");
    assert!(called.stdout.contains("NOT the bytes that were sent"));
    // And the run goes on with it no more.
    let refused = run(&house, &["--out", "run"]);
    assert_eq!(refused.code, Some(2), "{refused:?}");
    assert!(
        refused.stderr.contains("is not the one stored in this run"),
        "{}",
        refused.stderr
    );
}

#[test]
fn time_is_said_of_walks_too() {
    let house = House::new();
    scripts(&house);
    let called = run(&house, &["--out", "run", "--timings"]);
    assert!(
        called.stderr.contains("timings:") && called.stderr.contains("degrade"),
        "{}",
        called.stderr
    );
}

#[test]
fn a_killed_run_goes_on_and_asks_nothing_twice() {
    let house = House::new();
    let mock = MockEndpoint::answering(|request| {
        std::thread::sleep(Duration::from_millis(60));
        let judge = request["model"] == "j";
        Answer::text(if judge { "5" } else { "an answer" })
    });
    let base = mock.base_url();
    let words = flags(&[
        "--model",
        "m",
        "--judge",
        "j",
        "--base-url",
        &base,
        "--levels",
        "L0-L5",
        "--variant",
        "both",
        "--concurrency",
        "2",
        "--out",
        "run",
    ]);
    let mut child = Command::new(assert_cmd::cargo::cargo_bin("darkqa-eval"))
        .args(&words)
        .current_dir(house.0.path(""))
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let started = Instant::now();
    let path = house.0.path("run/records.jsonl");
    let there = || {
        fs::read_to_string(&path)
            .unwrap_or_default()
            .lines()
            .count()
    };
    while there() < 8 {
        assert!(started.elapsed() < Duration::from_mins(1), "nothing came");
        std::thread::sleep(Duration::from_millis(5));
    }
    let killed = Command::new("kill")
        .args(["-9", &child.id().to_string()])
        .status();
    assert!(killed.unwrap().success());
    child.wait().unwrap();
    let kept: Vec<Value> = records(&house.0.path("run"));
    let called = called(&mut house.0.command(&words));
    assert_eq!(called.code, Some(0), "{called:?}");
    let all = records(&house.0.path("run"));
    assert_eq!(all[..kept.len()], kept[..]);
    let keys: BTreeSet<String> = all.iter().map(|record| record["key"].to_string()).collect();
    assert_eq!(keys.len(), all.len(), "no trial twice");
    // 3 questions in 11 conditions, and a mark for each question, for all answers are alike.
    let steps = |step: &str| all.iter().filter(|record| record["step"] == step).count();
    assert_eq!((steps("answer"), steps("mark")), (33, 3));
    assert!(
        mock.requests().len() <= all.len() + 2,
        "only what was in flight is asked again: {}",
        mock.requests().len()
    );
    let summary: Value = house.read("run/summary.json");
    assert_eq!(summary["run"]["status"], json!("complete"));
}
