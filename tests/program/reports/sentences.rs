//! The findings in words, from a run to its report: what scripted models answer in the dark is said, and what they do
//! not is not.

use std::fmt::Write;
use std::fs;

use serde_json::{Value, json};

use crate::support::run::{Bench, words};

/// Number of frames, each with a question about a thing that is there and one about a thing that is not.
const FRAMES: usize = 12;

/// A folder of frames with their questions.
fn bench() -> Bench {
    let bench = Bench::new();
    let mut lines = String::new();
    for frame in 0..FRAMES {
        let shade = 60 + 10 * frame as u8;
        let picture = image::RgbImage::from_fn(48, 32, |x, y| image::Rgb([shade + x as u8, 90 + y as u8, 40]));
        fs::create_dir_all(bench.path("frames")).unwrap();
        picture.save(bench.path(&format!("frames/{frame}.png"))).unwrap();
        for answer in ["yes", "no"] {
            let question = json!({
                "id": format!("{answer}{frame}"), "frame": format!("{frame}.png"), "family": "presence",
                "question": format!("Is there a thing, {answer}{frame}?"), "choices": ["yes", "no"], "answer": answer,
            });
            let _ = writeln!(lines, "{question}");
        }
    }
    bench.file("frames/questions.jsonl", lines);
    bench
}

/// The findings of a run of a scripted model, and the rows of `pooled.csv` about false answers. `reply` gives the reply
/// to a question by its true answer and the condition.
fn findings(bench: &Bench, out: &str, reply: fn(&str, &str) -> String) -> (Vec<Value>, Vec<String>) {
    let mut lines = String::new();
    for condition in ["L0", "L3-ev", "L3-noise", "L5-ev", "L5-noise"] {
        for answer in ["yes", "no"] {
            for frame in 0..FRAMES {
                let reply = reply(answer, condition);
                let line = json!({"question": format!("{answer}{frame}"), "condition": condition, "reply": reply});
                let _ = writeln!(lines, "{line}");
            }
        }
    }
    bench.file(&format!("{out}.jsonl"), lines);
    bench.complete(&words(&format!("--model script:{out}.jsonl --data frames --levels L0,L3,L5 --out {out}")));
    let summary = fs::read(bench.path(out).join("summary.json")).unwrap();
    let summary: Value = serde_json::from_slice(&summary).unwrap();
    let table = fs::read_to_string(bench.path(out).join("pooled.csv")).unwrap();
    let rows = table.lines().filter(|row| row.starts_with("answers ") && row.contains(",strict,"));
    (summary["findings"].as_array().unwrap().clone(), rows.map(str::to_owned).collect())
}

/// The sentences of a kind.
fn texts<'f>(findings: &'f [Value], kind: &str) -> Vec<&'f str> {
    findings.iter().filter(|finding| finding["kind"] == kind).map(|finding| finding["text"].as_str().unwrap()).collect()
}

#[test]
fn growing_no_is_a_finding() {
    let bench = bench();
    let (said, rows) = findings(&bench, "dark", |answer, condition| {
        let is_dark = condition == "L5-noise";
        if is_dark { "no" } else { answer }.to_owned()
    });
    assert_eq!(
        texts(&said, "hallucination"),
        ["At L5 “no” is answered to 100.0 % of the objects that are there (0.0 % at L0)."]
    );
    let finding = said.iter().find(|finding| finding["kind"] == "hallucination");
    let finding = finding.unwrap();
    assert_eq!(finding["verdict"], "worse");
    assert_eq!((&finding["values"]["n"], &finding["values"]["difference"]), (&json!(12.0), &json!(100.0)), "{finding}");
    // One finding, not two: it is also one answer to everything.
    assert!(texts(&said, "collapse").is_empty(), "{said:?}");
    // Two words, two variants and two levels; one row alone is shown.
    assert_eq!(rows.len(), 8, "{rows:?}");
    let worse: Vec<&String> = rows.iter().filter(|row| row.contains(",worse,")).collect();
    assert_eq!(worse.len(), 1, "{rows:?}");
    assert!(worse[0].starts_with("answers no to what is there,L5,noise,,presence,1,12,0,12,1,0,1,"), "{worse:?}");
}

#[test]
fn hallucination_ignores_unread_replies() {
    let bench = bench();
    // “no” at every level, also at L0: no growth, and no collapse in the dark.
    let (said, rows) = findings(&bench, "always", |_, _| "no".to_owned());
    assert!(texts(&said, "hallucination").is_empty(), "{said:?}");
    assert!(!rows.iter().any(|row| row.contains(",worse,")), "{rows:?}");
    assert!(texts(&said, "collapse").is_empty(), "{said:?}");
    // A refusal in the dark is no “no”.
    let (said, rows) = findings(&bench, "refused", |answer, condition| {
        let is_dark = condition.starts_with("L5");
        if is_dark { "I cannot tell." } else { answer }.to_owned()
    });
    assert_eq!(texts(&said, "darkness").len(), 1, "{said:?}");
    for kind in ["hallucination", "collapse"] {
        assert!(texts(&said, kind).is_empty(), "{said:?}");
    }
    assert!(!rows.iter().any(|row| row.contains(",worse,")), "{rows:?}");
}
