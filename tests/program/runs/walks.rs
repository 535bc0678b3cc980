//! Runs of open questions and what every run can do: parts and their merging, reports from the folder alone, images
//! made again, and a kill in the midst of it.

use std::collections::BTreeSet;
use std::fs;
use std::process::Stdio;
use std::time::Duration;

use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::house::{House, flags};
use crate::support::process::{signal, wait_until};
use crate::support::run::{Called, assert_same_products, files, records, words};
use crate::support::snapshot::lines_with;
use serde_json::{Value, json};

/// A script that answers each question in its own words, and one that marks the answers.
fn scripts(house: &House) {
    house.0.file(
        "a.jsonl",
        "{\"question\": \"q1\", \"condition\": \"L0\", \"reply\": \"brown\"}\n{\"question\": \"q1\", \"reply\": \"grey\"}\n\
         {\"default\": \"an answer\"}",
    );
    house.0.file("j.jsonl", "{\"question\": \"q1\", \"reply\": \"4\"}\n{\"default\": \"2\"}");
}

/// A run with the scripts, and more arguments.
fn run(house: &House, more: &str) -> Called {
    let line = format!("--model script:a.jsonl --judge script:j.jsonl --levels L0,L3 {more}");
    house.call(&words(&line))
}

/// The output of a run with the scripts that must be complete.
fn complete(house: &House, more: &str) -> String {
    let called = run(house, more);
    assert_eq!(called.code, Some(0), "{more}: {called:?}");
    called.stdout
}

#[test]
fn walk_shards_equal_one_run() {
    let house = House::new();
    scripts(&house);
    complete(&house, "--out whole");
    for part in ["1/2", "2/2"] {
        complete(&house, &format!("--out parts --shard {part}"));
    }
    let table = house.0.complete(&["merge", "parts", "--out", "merged"]);
    let (whole, merged) = (house.0.path("whole"), house.0.path("merged"));
    let keys = |run: &std::path::Path| -> BTreeSet<String> {
        records(run).into_iter().map(|record| record["key"].to_string()).collect()
    };
    assert_eq!(keys(&whole), keys(&merged));
    let compared = assert_same_products(&whole, &merged);
    assert!(compared > 5, "{compared}");
    // It is the run that the whole command goes on with: nothing is left to ask, of answers or of marks.
    let before = fs::read(merged.join("records.jsonl")).unwrap();
    assert_eq!(complete(&house, "--out merged"), table);
    assert_eq!(fs::read(merged.join("records.jsonl")).unwrap(), before);
    // Runs of the other kind are no part of it.
    fs::remove_dir_all(house.0.path("parts/shard-1-of-2")).unwrap();
    house.0.complete(&words("--data rooms:frames=2,size=64x48 --model random --levels L0 --shard 1/2 --out parts"));
    let refused = house.0.call(&["merge", "parts", "--out", "mixed"]);
    insta::assert_snapshot!(refused.messages(), @"
    exit code: 2
    error: parts/shard-2-of-2: runs of questions with choices and of open questions cannot be merged:
        parts/shard-1-of-2 is of the other kind
    ");
}

#[test]
fn report_is_made_from_folder_alone() {
    let house = House::new();
    scripts(&house);
    let table = complete(&house, "--out run");
    let page = fs::read(house.0.path("run/report.html")).unwrap();
    for gone in ["report.html", "summary.csv", "summary.json", "tables.tex"] {
        fs::remove_file(house.0.path(&format!("run/{gone}"))).unwrap();
    }
    fs::remove_dir_all(house.0.path("walks")).unwrap();
    assert_eq!(house.0.complete(&["report", "run"]), table);
    assert_eq!(fs::read(house.0.path("run/report.html")).unwrap(), page);
}

#[test]
fn comparison_needs_one_judge() {
    let house = House::new();
    scripts(&house);
    complete(&house, "--out one");
    // An answer in the dark stays one when its file is given to another run.
    let given = house.call(&words(
        "--answers again=one/upstream/script_a.jsonl-L3-noise.json --judge script:j.jsonl --levels L0,L3 --out given",
    ));
    assert_eq!(given.code, Some(0), "{given:?}");
    let summary = fs::read_to_string(house.0.path("given/summary.csv")).unwrap();
    assert!(summary.contains("again,image,L3,noise,") && !summary.contains("again,image,L0,"), "{summary}");
    house.0.file("b.jsonl", "{\"default\": \"grey\"}");
    let run_other = |judge: &str, out: &str| {
        let line = format!("--model script:b.jsonl --levels L0,L3 --judge {judge} --out {out}");
        let called = house.call(&words(&line));
        assert_eq!(called.code, Some(0), "{called:?}");
    };
    run_other("script:j.jsonl", "two");
    let table = house.0.complete(&["report", "one", "two", "--out", "compared"]);
    insta::assert_snapshot!(lines_with(&table, "script:"), @"
    OpenEQA by LLM-Match, marked by script:j.jsonl, protocol upstream
    Score in % (LLM-Match, marked by script:j.jsonl, protocol upstream): mean (difference from L0), and how far
        the widest 95 % interval over 2 episodes reaches down and up
     script:a.jsonl   with noise   41.7   41.7 (0.0)   6 of 6   −40.9 +56.8
     script:b.jsonl   with noise   41.7   41.7 (0.0)   6 of 6   −40.9 +56.8
     script:a.jsonl   with noise   hm3d-v0                 50.0   50.0 (0.0)   −41.8 +41.8
     script:b.jsonl   with noise   hm3d-v0                 50.0   50.0 (0.0)   −41.8 +41.8
    ");
    let summary = fs::read_to_string(house.0.path("compared/summary.csv")).unwrap();
    let of_all = summary.lines().filter(|line| line.contains(",all,all,"));
    assert_eq!(of_all.count(), 4, "{summary}");
    // The same model with other replies stands once for each run.
    house.0.file("a.jsonl", "{\"default\": \"nothing\"}");
    complete(&house, "--out three");
    let table = house.0.complete(&["report", "one", "three"]);
    let apart = "! script:a.jsonl stands apart as script:a.jsonl (one) and script:a.jsonl (three): its file is d2db69ca… in one and 020b644a… in three; 6 of 6 replies to the same trials differ.";
    assert!(table.replace("\n  ", " ").contains(apart), "{table}");
    insta::assert_snapshot!(lines_with(&table, "(three)   "), @"
     script:a.jsonl (three)   with noise   41.7   41.7 (0.0)   6 of 6   −40.9 +56.8
     script:a.jsonl (three)   with noise   hm3d-v0                 50.0   50.0 (0.0)   −41.8 +41.8
    ");
    fs::copy(house.0.path("j.jsonl"), house.0.path("k.jsonl")).unwrap();
    run_other("script:k.jsonl", "four");
    let refused = house.0.call(&["report", "one", "four"]);
    insta::assert_snapshot!(refused.messages(), @"
    exit code: 2
    error: four: its answers were marked by script:k.jsonl (upstream) and those of one by script:j.jsonl
        (upstream): marks of two judges or protocols cannot be compared; report each run alone, or run openeqa on
        its folder again with the other's --judge and --protocol: only marks are asked
    ");
}

/// An endpoint whose model answers `brown`, and marks with 2 at temperature 0.2 and with 4 else.
fn answering_and_marking() -> MockEndpoint {
    MockEndpoint::answering(|request| {
        let is_mark = request.to_string().contains("Your mark");
        Answer::text(match (is_mark, &request["temperature"]) {
            (false, _) => "brown",
            (true, low) if *low == json!(0.2) => "2",
            (true, _) => "4",
        })
    })
}

#[test]
fn self_marking_model_keeps_its_marks() {
    let house = House::new();
    let mock = answering_and_marking();
    let base = mock.base_url();
    for (out, temperature) in [("one", "0.5"), ("two", "1")] {
        let called = house.call(&words(&format!(
            "--model m --judge m --base-url {base} --temperature {temperature} --levels L0 --out {out}"
        )));
        assert_eq!(called.code, Some(0), "{called:?}");
    }
    house.0.complete(&["report", "one", "two", "--out", "both"]);
    let summary = fs::read_to_string(house.0.path("both/summary.csv")).unwrap();
    let of_all: Vec<&str> = summary.lines().filter(|line| line.contains(",all,all,")).collect();
    // Three of three answers are marked with 2, at the temperature of the judge.
    for (line, temperature) in of_all.iter().zip(["0.5", "1"]) {
        let begin = format!("m (--temperature {temperature}),image,L0,none,,all,all,3,3,0,0,0,0,0,0.25,");
        assert!(line.starts_with(&begin), "{line}");
    }
    assert_eq!(of_all.len(), 2, "{summary}");
    // The temperature of the answers is known beside that of the marks.
    let again =
        house.call(&words(&format!("--model m --judge m --base-url {base} --temperature 1 --levels L0 --out one")));
    assert_eq!(again.code, Some(2), "{again:?}");
}

#[test]
fn judges_of_one_name_differ() {
    let house = House::new();
    let mock = answering_and_marking();
    let base = mock.base_url();
    for (out, temperature) in [("one", "0.2"), ("two", "1")] {
        let called = house.call(&words(&format!(
            "--model m --judge j --base-url {base} --judge-temperature {temperature} --levels L0 --out {out}"
        )));
        assert_eq!(called.code, Some(0), "{called:?}");
    }
    let refused = house.0.call(&["report", "one", "two"]);
    insta::assert_snapshot!(refused.messages(), @"
    exit code: 2
    error: one: the judges of the runs have one name and differ: --judge-temperature is 0.2 in one and 1 in two;
        marks of two judges cannot be compared: report each run alone
    ");
    // And in one run.
    let again = house
        .call(&words(&format!("--model m --judge j --base-url {base} --judge-temperature 1 --levels L0 --out one")));
    insta::assert_snapshot!(again.messages(), @r#"
    exit code: 2
     WARN 1 of 2 walks has fewer frames than --num-frames 3: they are shown several times in a request, as
        upstream does (the 2 frames of scannet-v0/001-b, for example)
    error: one: the judge j has another --judge-temperature in this run: it was "0.2", now it is "1"; use another
        --out, or the same --judge-temperature
    "#);

    scripts(&house);
    complete(&house, "--out three");
    house.0.file("j.jsonl", "{\"default\": \"1\"}");
    complete(&house, "--out four");
    let refused = house.0.call(&["report", "three", "four"]);
    assert_eq!(refused.code, Some(2), "{refused:?}");
}

#[test]
fn walk_images_are_rebuilt_and_verified() {
    let house = House::new();
    scripts(&house);
    complete(&house, "--out run");
    let report = house.0.complete(&["show", "run", "q1"]);
    assert_eq!(report.matches("the same bytes as were sent").count(), 2);
    assert!(report.contains("brown") && report.contains("grey"), "{report}");
    let images = files(&house.0.path("run/shown"));
    assert_eq!(images.len(), 6, "three frames in two conditions: {images:?}");
    // Another frame in the place of one that was shown is noticed.
    let [one, other] = ["00002", "00003"].map(|frame| house.0.path(&format!("walks/hm3d-v0/000-a/{frame}-rgb.png")));
    fs::copy(other, one).unwrap();
    let called = house.0.call(&["show", "run", "q1"]);
    insta::assert_snapshot!(called.lines_with("bytes"), @"
    exit code: 1
    L0: NOT the bytes that were sent: [DIGEST] now
    L3-noise: NOT the bytes that were sent: [DIGEST] now
    ");
    // And the run goes on with it no more.
    let refused = run(&house, "--out run");
    insta::assert_snapshot!(refused.messages(), @r#"
    exit code: 2
     WARN 1 of 2 walks has fewer frames than --num-frames 3: they are shown several times in a request, as
        upstream does (the 2 frames of scannet-v0/001-b, for example)
    error: run: the image "hm3d-v0/000-a" of question "q1" has changed since the run began; so has 1 more
        question; restore the file or its --data, or use another --out
    "#);
}

#[test]
fn walks_report_their_timings() {
    let house = House::new();
    scripts(&house);
    let called = run(&house, "--out run --timings");
    assert!(called.stderr.contains("timings:") && called.stderr.contains("degrade"), "{}", called.stderr);
}

#[test]
fn killed_run_repeats_nothing() {
    let house = House::new();
    let mock = MockEndpoint::answering(|request| {
        std::thread::sleep(Duration::from_millis(60));
        let judge = request["model"] == "j";
        Answer::text(if judge { "5" } else { "an answer" })
    });
    let line = format!(
        "--model m --judge j --base-url {} --levels L0-L5 --variant both --concurrency 2 --out run",
        mock.base_url()
    );
    let args = flags(&words(&line));
    let mut child = house.0.spawn(&args, Stdio::null());
    let path = house.0.path("run/records.jsonl");
    let stored = || fs::read_to_string(&path).unwrap_or_default();
    wait_until(|| stored().lines().count() >= 8);
    signal(&child, "-9");
    child.wait().unwrap();
    let before: Vec<Value> = records(&house.0.path("run"));
    let called = house.0.call(&args);
    assert_eq!(called.code, Some(0), "{called:?}");
    let all = records(&house.0.path("run"));
    assert_eq!(all[..before.len()], before[..]);
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
