//! Variants of a camera that does what cameras do: automatic exposure, which is measured in EV, and motion blur, which has an axis of
//! its own; through evaluations, their reports, and everything that makes images again.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use serde_json::{Value, json};

use crate::support::frames::png;
use crate::support::run::{Bench, records, words};
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
            let reply =
                json!({"question": format!("q{frame}"), "condition": condition, "reply": "no"});
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

/// What can still be read from the pixels: the observer loses little at L3 with automatic exposure, and much in a long exposure.
#[test]
fn the_observer_loses_what_moves() {
    let bench = Bench::new();
    bench.complete(&words(
        "--model observer --data rooms:frames=4,size=240x180 --variant auto,motion --levels L0,L3,T8.33,T133.33 --out run",
    ));
    let run = bench.path("run");
    let seen = |condition: &str| -> u64 {
        let records = records(&run);
        let of_condition = records
            .iter()
            .filter(|record| record["condition"] == condition && record["model"] == "observer");
        let seen = of_condition.map(|record| record["observed"]["seen"].as_u64().unwrap());
        seen.sum()
    };
    let [clean, auto, short, long] = ["L0", "L3-auto", "T8.33-motion", "T133.33-motion"].map(seen);
    assert!(short * 10 > clean * 9, "{short} of {clean}");
    assert!(auto * 2 > clean && auto < clean, "{auto} of {clean}");
    assert!(long * 2 < clean, "{long} of {clean}");
    let page = read(&run.join("report.html"));
    assert!(page.contains("exposure time in ms") && page.contains("automatic exposure"));
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
    assert!(
        stderr.contains("--motion: no effect: no variant has motion blur"),
        "{stderr}"
    );
}
