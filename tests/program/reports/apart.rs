//! What several runs share: the same trials with the same replies count once, all else stands apart, and the report
//! says why.

use std::fs;
use std::path::Path;

use crate::reports::compared::Scene;
use crate::support::run::{Bench, records, words};
use crate::support::snapshot::{on_one_line, redacted};
use crate::support::table::check_rows;
use serde_json::Value;

/// A copy of a run, with its records changed.
fn copied(bench: &Bench, from: &str, to: &str, change: impl Fn(&mut Value)) {
    let (from, to) = (bench.path(from), bench.path(to));
    fs::create_dir(&to).unwrap();
    for name in ["manifest.json", "questions.jsonl", "fidelity.jsonl"] {
        let _ = fs::copy(from.join(name), to.join(name));
    }
    write_records(&from, &to, change);
}

/// The records of a run, changed, as those of another.
fn write_records(from: &Path, to: &Path, change: impl Fn(&mut Value)) {
    let lines: String = records(from)
        .into_iter()
        .map(|mut record| {
            change(&mut record);
            format!("{record}\n")
        })
        .collect();
    fs::write(to.join("records.jsonl"), lines).unwrap();
}

/// Makes the reply that of a choice.
fn answer(record: &mut Value, chosen: u8) {
    record["reply"] = char::from(b'A' + chosen).to_string().into();
    for reading in ["strict", "lenient"] {
        record[reading]["chosen"] = chosen.into();
        record[reading]["why"] = Value::Null;
    }
    let is_right = record["truth"] == chosen;
    record["outcome"] = if is_right { "right" } else { "wrong" }.into();
}

/// The texts of the alerts that hold a word.
fn holding<'a>(alerts: &'a [String], word: &str) -> Vec<&'a str> {
    alerts.iter().map(String::as_str).filter(|text| text.contains(word)).collect()
}

#[test]
fn equal_trials_need_equal_replies() {
    let scene = Scene::new();
    scene.run("", "g1");
    copied(&scene.bench, "g1", "g2", |record| {
        answer(record, 2);
        record["served_model"] = "mock-2".into();
    });
    copied(&scene.bench, "g1", "g3", |record| {
        if record["question"] == "q0" {
            answer(record, 1);
        }
    });
    copied(&scene.bench, "g1", "same", |_| ());
    for line in ["report g1 g2", "report g2 g1"] {
        let text = scene.bench.complete(&words(&format!("{line} --full")));
        check_rows(["m (g1)", "m (g2)"], |name| {
            assert!(text.contains(name), "{name}: {text}");
        });
        let alerts = scene.alerts(line);
        let apart = "m stands apart as m (g1) and m (g2): 160 of 160 replies to the same trials differ.";
        assert_eq!(holding(&alerts, "apart"), [apart], "{alerts:#?}");
        let served = holding(&alerts, "m was served as ");
        assert!(served[0].contains("mock-1 in g1") && served[0].contains("mock-2 in g2"), "{alerts:#?}");
    }
    // Of three runs, those that agree are one.
    let alerts = scene.alerts("report g1 g3 same");
    let apart = "m stands apart as m (g1) and m (g3): 4 of 160 replies to the same trials differ.";
    assert_eq!(holding(&alerts, "apart"), [apart], "{alerts:#?}");
    let all = "All 160 replies of same are in the other runs, too, and count once.";
    assert_eq!(holding(&alerts, "count once"), [all], "{alerts:#?}");
    // An old run has other replies by its nature, but another model behind the name is news.
    let alerts = scene.alerts("report g2 --baseline g1");
    assert_eq!(alerts, ["m was served as mock-2 in g2 and mock-1 in g1."]);
    let named_twice = scene.alerts("report same ./same g1");
    assert!(named_twice.contains(&"same is named twice and counted once.".to_owned()), "{named_twice:#?}");
}

#[test]
fn run_in_other_light_is_compared() {
    let scene = Scene::new();
    scene.run("", "a");
    scene.run("--seed 1", "first");
    copied(&scene.bench, "first", "b", |record| {
        if record["condition"] == "L0" && record["question"] == "q0" {
            answer(record, 2);
        }
    });
    let alerts = scene.alerts("report a b --out ab");
    let apart = "m stands apart as m (a) and m (b): 1 of 80 replies to the same trials differ.";
    assert_eq!(holding(&alerts, "m stands"), [apart], "{alerts:#?}");
    let rows = scene.csv("ab/comparisons.csv");
    let lights: Vec<[&str; 4]> = rows
        .iter()
        .filter(|row| row[0] == "light" && row[5] == "all" && row.last().unwrap() == "strict")
        .map(|row| [&*row[1], &*row[2], &*row[3], &*row[4]])
        .collect();
    let expected =
        [["m (a)", "L3-noise @a", "m (b)", "L3-noise @b"], ["m (a)", "L3-noise+one @a", "m (b)", "L3-noise+one @b"]];
    assert_eq!(lights, expected);
}

#[test]
fn wording_is_compared_with_first_run() {
    let scene = Scene::new();
    scene.run("--levels L0 --llie-on l0", "a");
    copied(&scene.bench, "a", "b", |record| answer(record, 2));
    let path = scene.bench.path("b/questions.jsonl");
    let text = fs::read_to_string(&path).unwrap();
    fs::write(&path, text.replace("What color", "Which color")).unwrap();
    scene.run("--levels L0 --llie-on l0 --limit 1 --model n", "one");
    let expected = "The words of 40 shared questions differ.";
    check_rows(["report a b", "report a b one", "report one a b"], |line| {
        let alerts = scene.alerts(line);
        assert!(alerts.contains(&expected.to_owned()), "{line}: {alerts:#?}");
    });
}

#[test]
fn row_pooling_fewer_models_is_marked() {
    let scene = Scene::new();
    scene.run("--model m --model n --blind-model m", "run");
    let text = scene.bench.complete(&words("report run --full --out out"));
    let heading = "Pooled over all models, paired by question, in percentage points";
    assert!(text.contains(heading), "{text}");
    let rows = scene.csv("out/pooled.csv");
    let place = |name: &str| rows[0].iter().position(|head| head == name).unwrap();
    let models = |kind: &str| {
        let mut numbers: Vec<&str> = rows
            .iter()
            .filter(|row| row[0] == kind && row[place("mode")] == "strict")
            .map(|row| &*row[place("models")])
            .collect();
        numbers.dedup();
        numbers
    };
    assert_eq!((models("noise"), models("blind")), (vec!["2"], vec!["1"]));
    let page = fs::read_to_string(scene.bench.path("out/report.html")).unwrap();
    assert!(page.contains("Pooled over all models"));
    scene.run("--model m --model n", "even");
    let even = scene.bench.complete(&words("report even --full"));
    assert!(even.contains("Pooled over 2 models, paired"), "{even}");
}

/// A run of the observer on a few small rooms.
const ROOMS: &str = "--model observer --levels L0,L3 --data frames";

#[test]
fn shards_of_observer_are_one_light() {
    let bench = Bench::new();
    bench.rooms("frames", 4, "160x120");
    for shard in ["1/2", "2/2"] {
        bench.complete(&words(&format!("{ROOMS} --shard {shard} --out s")));
    }
    let text = bench.complete(&words("report s/shard-1-of-2 s/shard-2-of-2"));
    assert!(!text.contains("apart"), "{text}");
}

#[test]
fn runs_under_other_rules_keep_controls() {
    let bench = Bench::new();
    let rules = include_str!("../../../src/questions/rules.toml");
    let own = rules.replace("detail_ppm = 500 ", "detail_ppm = 501 ");
    assert_ne!(own, rules);
    bench.file("own.toml", own);
    bench.rooms("frames", 4, "160x120");
    bench.complete(&words(&format!("{ROOMS} --out a")));
    bench.complete(&words(&format!("{ROOMS} --rules own.toml --out b")));
    let full = bench.complete(&words("report a b --full"));
    check_rows(
        [
            "! The rules of the questions differ: --rules is unset in a and ",
            "! observer and observer:other-room stand apart, as in observer (a) and observer (b): --rules is unset in a and ",
        ],
        |alert| assert!(full.contains(alert), "{alert}: {full}"),
    );
    let short = bench.complete(&words("report a b"));
    let joined = on_one_line(&short);
    check_rows(
        ["observer: known-signal observer", "shown images of other rooms, scores ", " (a) and ", " (b); chance is "],
        |part| assert!(joined.contains(part), "{part}: {joined}"),
    );
}

#[test]
fn only_models_decide_worse() {
    let scene = Scene::new();
    scene.run("--model random", "random");
    copied(&scene.bench, "random", "wrong", |record| answer(record, 1));
    let judged = |line: &str| {
        let called = scene.bench.call(&words(line));
        (called.code, called.stdout, called.stderr)
    };
    let (code, stdout, stderr) = judged("report wrong --baseline random --fail-if-worse");
    assert_eq!(code, Some(2), "{stdout}{stderr}");
    insta::assert_snapshot!(redacted(&stderr), @"
    error: --fail-if-worse: no model can be compared with random: none answered the same question about the same
        image in both (random and the observer do not count); leave the flag out to see the report
    ");
    // A model without a possible verdict says nothing.
    scene.run("--limit 4", "few");
    copied(&scene.bench, "few", "fewer", |record| answer(record, 1));
    let (code, stdout, _) = judged("report fewer --baseline few");
    assert_eq!(code, Some(0));
    let joined = on_one_line(&stdout);
    assert!(
        joined.contains("No verdict against few is possible") && !joined.contains("It is not shown that any"),
        "{stdout}"
    );
    let (code, _, stderr) = judged("report fewer --baseline few --fail-if-worse");
    assert_eq!(code, Some(2), "{stderr}");
    insta::assert_snapshot!(redacted(&stderr), @"
    error: --fail-if-worse: no verdict against few is possible on m L0, m L3-ev, m L3-noise and 1 more: no
        condition shares more than 4 questions, and 30 are needed; leave the flag out to see the report
    ");
    // Reference models that are worse beside a model that is not.
    scene.run("", "m");
    let join = |one: &str, other: &str, out: &str| {
        copied(&scene.bench, one, out, |_| ());
        let more = fs::read(scene.bench.path(other).join("records.jsonl")).unwrap();
        let path = scene.bench.path(out).join("records.jsonl");
        let all = [fs::read(&path).unwrap(), more].concat();
        fs::write(path, all).unwrap();
    };
    copied(&scene.bench, "random", "right", |record| {
        let truth = record["truth"].as_u64().unwrap() as u8;
        answer(record, truth);
    });
    join("m", "right", "old");
    join("m", "wrong", "new");
    let (code, stdout, _) = judged("report new --baseline old --fail-if-worse");
    assert_eq!(code, Some(0), "{stdout}");
    assert!(stdout.contains("It is not shown that any model is worse"), "{stdout}");
}
