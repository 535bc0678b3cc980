//! What a report opens with in the terminal, in Markdown and as JSON, and the training data of enhancers.

use std::fs;

use crate::support::house::House;
use crate::support::image_files::{exposed_jpeg, jpeg};
use crate::support::run::{Bench, words};
use serde_json::{Value, json};

/// A run with `lift`.
fn enhanced(bench: &Bench) {
    bench.rooms("frames", 12, "96x64");
    bench.complete(&words("--model observer --data frames --levels L0,L3 --llie lift --out run"));
}

/// The parts of a text from the first line that contains each mark on.
fn has_in_order(text: &str, marks: &[&str]) {
    let mut rest = text;
    for mark in marks {
        let at = rest.find(mark);
        rest = &rest[at.unwrap_or_else(|| panic!("{mark} in {text}"))..];
    }
}

#[test]
fn every_length_and_every_syntax_combine() {
    let bench = Bench::new();
    enhanced(&bench);
    let report = |flags: &str| bench.complete(&words(&format!("report run {flags}")));
    let groups = ["Darkness", "Noise", "Enhancers"];
    has_in_order(&report(""), &groups);
    assert!(report("").contains("accuracy in %"));
    has_in_order(&report("--findings"), &groups);
    assert!(!report("--findings").contains("accuracy in %"));
    has_in_order(&report("--full"), &groups);
    for (flags, folded, tables) in [("--markdown", 1, 1), ("--markdown --findings", 0, 0), ("--markdown --full", 0, 2)]
    {
        let text = report(flags);
        has_in_order(&text, &groups);
        assert_eq!(text.matches("<details>").count(), folded, "{text}");
        let found = text.matches("\n| --- |").count();
        assert!(found.min(2) == tables, "{flags}: {text}");
    }
    for (flags, has_rows, has_tables) in
        [("--json", true, false), ("--json --findings", false, false), ("--json --full", true, true)]
    {
        let value: Value = serde_json::from_str(&report(flags)).unwrap();
        assert!(value["findings"].is_array(), "{flags}");
        assert_eq!(value["rows"].is_array(), has_rows, "{flags}");
        assert_eq!(value["tables"]["pooled"].is_array(), has_tables, "{flags}");
    }
    for flags in ["--full --findings", "--json --markdown"] {
        let refused = bench.call(&words(&format!("report run {flags}")));
        assert_eq!(refused.code, Some(2), "{refused:?}");
    }
}

#[test]
fn enhancer_training_data_is_reported() {
    let bench = Bench::new();
    enhanced(&bench);
    let trained = "lift: trained on this program's synthesis";
    let in_sentence = "lift at L3: no effect detected. lift was trained on this program's synthesis.";
    let check = || {
        let text = bench.complete(&words("report run")).replace("\n ", "");
        assert!(text.contains(trained), "{text}");
        let findings = bench.complete(&words("report run --json --findings"));
        let findings: Value = serde_json::from_str(&findings).unwrap();
        let findings = findings["findings"].as_array().unwrap();
        assert!(findings.iter().any(|finding| { finding["text"] == in_sentence }), "{findings:?}");
        let markdown = bench.complete(&words("report run --markdown"));
        assert!(markdown.contains(trained), "{markdown}");
        for file in ["report.html", "tables.tex"] {
            let text = fs::read_to_string(bench.path(&format!("run/{file}"))).unwrap();
            let text = text.replace("&#x27;", "'");
            assert!(text.contains(trained), "{file}");
        }
    };
    check();
    // A run of an earlier version has the digest of the enhancer, and no statement about its training.
    let path = bench.path("run/manifest.json");
    let mut manifest: Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    let lines = &mut manifest["enhancers"]["lift"]["convention"];
    let lines = lines.as_array_mut().unwrap();
    let before = lines.len();
    lines.retain(|line| line["key"] != json!("trained_on"));
    assert_eq!(lines.len() + 1, before);
    fs::write(&path, manifest.to_string()).unwrap();
    check();
}

#[test]
fn page_opens_with_summary() {
    let bench = Bench::with_questions(6);
    let mut replies = "{\"default\": \"C\"}\n".to_owned();
    for i in 0..6 {
        let line = json!({"question": format!("q{i}"), "condition": "L5-noise", "reply": "A"});
        replies += &line.to_string();
        replies.push('\n');
    }
    bench.file("m.jsonl", &replies);
    let text =
        bench.complete(&words("--model script:m.jsonl --model random --data set.jsonl --levels L0,L5 --out run"));
    // `random` is no model under test.
    assert!(text.starts_with("script:m.jsonl, random · 6 questions"), "{text}");
    let page = fs::read_to_string(bench.path("run/report.html")).unwrap();
    let marks = ["<h1>", "class=\"summary\"", "class=\"alert\"", "class=\"lead\""];
    has_in_order(&page, &marks);
    // The tables list families and frames; the first screen names none, because no test compares them.
    assert!(!page.contains("First to fail"));
    assert!(page.contains("a list, not a finding"));
}

#[test]
fn open_page_opens_with_scores() {
    let house = House::new();
    house.0.file("m.jsonl", "{\"default\": \"a sofa\"}\n");
    house.0.file("j.jsonl", "{\"default\": \"4\"}\n");
    let line = "--model script:m.jsonl --judge script:j.jsonl --levels L0,L4 --out run";
    let called = house.call(&words(line));
    assert_eq!(called.code, Some(0), "{called:?}");
    let page = fs::read_to_string(house.0.path("run/report.html")).unwrap();
    let summary = "<p class=\"summary\">script:m.jsonl with noise scores 75.0\u{a0}% at L4 (0.0 [";
    has_in_order(&page, &[summary, "3 questions about 2 walks. "]);
    assert!(!page.contains("Broken lines"));
}

#[test]
fn light_at_l0_stays_with_the_run() {
    let bench = Bench::new();
    bench.complete(&words("--model observer --data rooms:frames=6,size=96x72 --levels L0,L3 --out run"));
    let heads = || fs::read_to_string(bench.path("run/thresholds.csv")).unwrap().lines().next().unwrap().to_owned();
    let stored = || -> Value {
        let text = fs::read(bench.path("run/manifest.json")).unwrap();
        serde_json::from_slice::<Value>(&text).unwrap()["settings"]["--lux-at-l0"].clone()
    };
    assert!(!heads().contains("lux") && stored().is_null(), "{}", heads());
    bench.complete(&words("report run --lux-at-L0 200"));
    assert!(heads().contains(",lux,lux_low,lux_high,"), "{}", heads());
    bench.complete(&words("report run"));
    assert!(heads().contains(",lux,lux_low,lux_high,"), "{}", heads());
    assert_eq!(stored(), 200.0);
    let refused = bench.call(&words("report run --lux-at-l0 0"));
    assert!(refused.code == Some(2) && refused.stderr.contains("a number above 0 expected"), "{refused:?}");
}

#[test]
fn enhancers_are_timed_and_held_to_a_budget() {
    let bench = Bench::new();
    let asked = |flags: &str| {
        bench.complete(&words(&format!("--model random --data rooms:frames=3,size=96x72 --levels L0,L3 {flags}")))
    };
    let text = asked("--llie lift --llie-options budget=0.0001ms --out run");
    assert!(text.contains("lift: 96 × 72: ") && text.contains(" ms per image (median of "), "{text}");
    let manifest: Value = serde_json::from_slice(&fs::read(bench.path("run/manifest.json")).unwrap()).unwrap();
    let latency = &manifest["enhancers"]["lift"]["latency"][0];
    let [median, most] = ["median_ms", "within_95_ms"].map(|field| latency[field].as_f64().unwrap());
    assert!(0.0 < median && median <= most && latency["threads"].as_u64() >= Some(1), "{latency}");
    // Timing adds no image to the counts of the run: three frames at one level with noise.
    assert_eq!(manifest["enhancers"]["lift"]["size_counts"]["images"], 3, "{manifest}");
    let page = fs::read_to_string(bench.path("run/report.html")).unwrap();
    assert!(page.contains("latency of lift"), "the run facts");
    let help = text.lines().find(|line| line.starts_with("lift, ")).unwrap();
    assert!(help.ends_with(" ms an image: no verdict possible at L3 with noise"), "{help}");
    assert!(page.contains("help for its time") && page.contains(help.strip_prefix("lift, ").unwrap()), "{help}");
    assert!(!fs::read_to_string(bench.path("run/enhancer_use.csv")).unwrap().contains(" ms an image"));
    let report = |flags: &str| bench.complete(&words(&format!("report {flags}"))).replace("\n  ", " ");
    let over = "lift takes longer than --llie-options budget=0.0001ms: 96 × 72: ";
    assert!(report("run").contains(over), "kept with the run");
    let text = report("run --llie-budget 100s");
    assert!(!text.contains("takes longer"), "{text}");
    asked("--out plain");
    assert!(report("plain --llie-budget 5").contains("--llie-options budget has no effect: no enhancer ran."));
    let unused = "--lux-at-l0 200 changes nothing here: no threshold is known; the table of thresholds says why.";
    assert!(report("plain --lux-at-l0 200").contains(unused));
    // The second run opens no enhancer, because the store has its images.
    for (model, out) in [("random", "first"), ("observer", "second")] {
        bench.complete(&words(&format!(
            "--model {model} --data rooms:frames=3,size=96x72 --levels L0,L3 --llie lift --images-cache store --out {out}"
        )));
    }
    let unknown = "lift: --llie-options budget cannot be checked, because its images came from the store";
    assert!(report("second --llie-budget 5").contains(unknown));
    assert!(!report("first --llie-budget 100s").contains("cannot be checked"));
    let refused = bench.call(&words("report run --llie-budget fast"));
    assert!(refused.code == Some(2) && refused.stderr.contains("a time such as 50ms or 0.05s expected"), "{refused:?}");
}

#[test]
fn light_at_l0_is_estimated_from_the_settings_of_cameras() {
    // By ISO 2720, 2.5 · 2^EV lux: f/2.8, 1/50 s, ISO 400 is 6.615 EV; f/2, 1/30 s, ISO 1600 is 2.907; f/8, 1/125 s is
    // 12.966.
    for (aperture, time, sensitivity, expected) in
        [([28, 10], [1, 50], 400, 6.615), ([2, 1], [1, 30], 1600, 2.907), ([8, 1], [1, 125], 100, 12.966)]
    {
        let bench = Bench::with_questions(4);
        let picture = image::open(bench.path("a.png")).unwrap().to_rgb8();
        // The name keeps its ending: the content decides.
        fs::write(bench.path("a.png"), exposed_jpeg(&jpeg(&picture), aperture, time, sensitivity)).unwrap();
        bench.complete(&words("--model random --data set.jsonl --levels L0,L3 --out run"));
        let manifest: Value = serde_json::from_slice(&fs::read(bench.path("run/manifest.json")).unwrap()).unwrap();
        let exposure = &manifest["settings"]["exposure value at ISO 100"];
        assert!((exposure["mean"].as_f64().unwrap() - expected).abs() < 0.1, "{exposure}");
        assert_eq!(exposure["frames"], 1);
        let heads = fs::read_to_string(bench.path("run/thresholds.csv")).unwrap();
        assert!(heads.lines().next().unwrap().contains(",lux,"), "{heads}");
    }
}
