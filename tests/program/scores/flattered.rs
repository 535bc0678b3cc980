//! Reports that would flatter a model: replies missing where it is wrong, and questions with one answer.

use serde_json::{Value, json};

use crate::support::run::{Bench, words};

const FRAMES: usize = 24;
const ROOMS: [&str; 4] = ["bedroom", "kitchen", "bathroom", "hall"];

/// A set of frames with four questions each; `truth` gives the true choice of a question.
fn bench(truth: impl Fn(usize) -> usize) -> Bench {
    let bench = Bench::new();
    let mut lines = String::new();
    for item in 0..4 * FRAMES {
        let frame = item / 4;
        let name = format!("f{frame}.png");
        let grey = image::Rgb([90 + 5 * frame as u8, 120, 120]);
        image::RgbImage::from_pixel(16, 12, grey).save(bench.path(&name)).unwrap();
        let line = json!({
            "id": format!("q{item}"), "image": name, "family": "room",
            "question": format!("Which room is {item}?"), "choices": ROOMS,
            "answer": ROOMS[truth(item)],
        });
        lines.push_str(&line.to_string());
        lines.push('\n');
    }
    bench.file("set.jsonl", lines);
    bench
}

/// Writes the answers of a scripted model; `answer` gives the choice by condition and question, `None` for no reply.
fn script(bench: &Bench, conditions: &[&str], answer: impl Fn(&str, usize) -> Option<usize>) {
    let mut lines = String::new();
    for condition in conditions {
        for item in 0..4 * FRAMES {
            if let Some(choice) = answer(condition, item) {
                let reply = ["A", "B", "C", "D"][choice];
                let line = json!({ "question": format!("q{item}"), "condition": condition, "reply": reply });
                lines.push_str(&line.to_string());
                lines.push('\n');
            }
        }
    }
    bench.file("m.jsonl", lines);
}

const RUN: [&str; 10] =
    ["--model", "script:m.jsonl", "--data", "set.jsonl", "--levels", "L0,L5", "--variant", "ev", "--out", "o"];

fn read(bench: &Bench, name: &str) -> String {
    std::fs::read_to_string(bench.path(name)).unwrap()
}

fn summary(bench: &Bench) -> Value {
    serde_json::from_str(&read(bench, "o/summary.json")).unwrap()
}

fn texts<'s>(summary: &'s Value, list: &str, kind: &str) -> Vec<&'s str> {
    let all = summary[list].as_array().unwrap().iter();
    all.filter(|one| one["kind"] == kind).map(|one| one["text"].as_str().unwrap()).collect()
}

#[test]
fn refused_questions_are_no_sight() {
    let truth = |item: usize| item % 4;
    let bench = bench(truth);
    // In the dark half of the answers would be wrong; those questions get no reply.
    script(&bench, &["L0", "L5-ev"], |condition, item| match condition {
        "L0" => Some(if item.is_multiple_of(10) { (truth(item) + 1) % 4 } else { truth(item) }),
        _ => (item / 4).is_multiple_of(2).then(|| truth(item)),
    });
    let called = bench.call(&[&RUN[..], &["--full"]].concat());
    let summary = summary(&bench);
    assert_eq!(
        summary["alerts"][0]["text"],
        "Replies of script:m.jsonl are missing for 48 of 96 questions at L5-ev (50.0 %), and of 0.0 % at L0. If that depends on the condition, the \
         others flatter the model: intervals and verdicts hold for all values of the missing ones."
    );
    assert_eq!(
        texts(&summary, "findings", "darkness"),
        ["No verdict on darkness is possible at L5: 50.0 % of the questions lack a reply at L5."]
    );
    let table = read(&bench, "o/summary.csv");
    let dark = table.lines().find(|line| line.contains("L5-ev") || line.contains(",L5,"));
    assert!(dark.unwrap().contains("0.5,1"), "{table}");
    assert!(words(&called.stdout).join(" ").contains("missing wrong–right 50.0–100.0"), "{}", called.stdout);
    let thresholds = read(&bench, "o/thresholds.csv");
    assert!(thresholds.contains("by the missing replies"), "{thresholds}");
}

#[test]
fn one_true_answer_is_named_and_weighted() {
    // Four of five rooms are bedrooms, and the model says so whatever it sees.
    let truth = |item: usize| {
        if item.is_multiple_of(5) { 1 + item / 5 % 3 } else { 0 }
    };
    let bench = bench(truth);
    script(&bench, &["L0", "L5-ev"], |condition, item| {
        let sees = condition == "L0" && item.is_multiple_of(10);
        Some(if sees { truth(item) } else { 0 })
    });
    // Without images too.
    let answers = read(&bench, "m.jsonl");
    bench.file("m.jsonl", format!("{answers}{{\"default\":\"A\"}}\n"));
    let alert = |bench: &Bench| texts(&summary(bench), "alerts", "answers").concat();
    bench.call(&RUN).ended(0);
    let without_blind = alert(&bench);
    assert!(
        without_blind
            .starts_with("One answer to everything scores well: “bedroom” is true of 76 of 96 questions about room.")
            && without_blind.contains("Ask without images too (--blind)"),
        "{without_blind}"
    );
    let table = read(&bench, "o/thresholds.csv");
    assert!(table.contains("common answer"), "{table}");
    // The remedy: the same command with the flag.
    bench.call(&[&RUN[..], &["--blind"]].concat()).ended(0);
    assert!(!alert(&bench).contains("--blind"), "{}", alert(&bench));
    let table = read(&bench, "o/thresholds.csv");
    assert!(table.contains("no image"), "{table}");
    let mut rows = csv::Reader::from_path(bench.path("o/summary.csv")).unwrap();
    let names = rows.headers().unwrap().clone();
    let column = |name: &str| names.iter().position(|one| one == name).unwrap();
    let dark = rows
        .records()
        .map(Result::unwrap)
        .find(|row| &row[column("level")] == "L5" && &row[column("mode")] == "strict")
        .unwrap();
    assert_eq!(&dark[column("balanced")], "0.25");
    assert!(dark[column("value")].starts_with("0.79"));
}

#[test]
fn balanced_questions_have_no_remark() {
    let bench = bench(|item| item % 4);
    script(&bench, &["L0", "L5-ev"], |_, item| Some(item % 4));
    bench.call(&RUN).ended(0);
    assert_eq!(texts(&summary(&bench), "alerts", "answers"), [""; 0]);
    assert!(!read(&bench, "o/summary.csv").contains("balanced"));
}
