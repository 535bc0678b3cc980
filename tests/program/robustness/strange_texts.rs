//! Names in a stranger's run that move a terminal, turn a line, hide, or are formulas: no product holds them as they
//! are.

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::support::run::{Bench, files, words};

/// A model, a family, a question and a frame as no data set should name them.
const MODEL: &str = "=1+1\u{1b}[31m\u{1b}]0;title\u{7}\r\u{202e}m";
const FAMILY: &str = "@SUM(1)\u{8}\u{9b}2J<b>&\u{200b}";
const QUESTION: &str = "+q\u{7f}\u{2066}\u{feff}";
const FRAME: &str = "-f\u{1b}[2J\u{85}\u{2028}";

/// The same value with these words in place of others, in keys as well.
fn exchanged(value: &Value, words: &[(&str, &str)]) -> Value {
    let word = |text: &str| {
        let found = words.iter().find(|(from, _)| *from == text);
        found.map_or(text, |(_, to)| to).to_owned()
    };
    match value {
        Value::String(text) => Value::String(word(text)),
        Value::Array(all) => all.iter().map(|value| exchanged(value, words)).collect(),
        Value::Object(all) => all.iter().map(|(key, value)| (word(key), exchanged(value, words))).collect(),
        other => other.clone(),
    }
}

fn exchange_in(path: &Path, words: &[(&str, &str)]) {
    let text = fs::read_to_string(path).unwrap();
    let values = serde_json::Deserializer::from_str(&text).into_iter::<Value>();
    let lines = values.map(|value| format!("{}\n", exchanged(&value.unwrap(), words)));
    fs::write(path, lines.collect::<String>()).unwrap();
}

/// The characters of a text that are hidden, line feeds aside.
fn hidden(text: &str) -> Vec<char> {
    let is_hidden = |c: &char| {
        *c != '\n'
            && (c.is_control()
                || ('\u{200b}'..='\u{200f}').contains(c)
                || ('\u{2028}'..='\u{202e}').contains(c)
                || ('\u{2060}'..='\u{206f}').contains(c)
                || *c == '\u{feff}')
    };
    text.chars().filter(is_hidden).collect()
}

#[test]
fn hostile_run_names_are_inert() {
    let bench = Bench::with_questions(8);
    bench.file("m.jsonl", "{\"default\": \"A\"}\n");
    bench.complete(&words("--model script:m.jsonl --model random --data set.jsonl --levels L0,L3,L5 --out run"));
    let exchange = [("script:m.jsonl", MODEL), ("color", FAMILY), ("q3", QUESTION), ("a.png", FRAME)];
    let lists = ["records", "questions", "thumbnails", "fidelity"];
    let lists = lists.map(|name| format!("run/{name}.jsonl"));
    for name in lists.iter().map(String::as_str).chain(["run/manifest.json"]) {
        if bench.path(name).exists() {
            exchange_in(&bench.path(name), &exchange);
        }
    }
    for line in [
        "report run --color always",
        "report run --full",
        "report run --markdown",
        // Its font has no letter for them: it says so, and how to name the model otherwise.
        "figures run --out figures",
        "show run q0 --out images",
        "site run --out site",
        "show run nothing",
        "report run --baseline run --fail-if-worse",
    ] {
        let called = bench.call(&words(line));
        for (stream, text) in [("stdout", &called.stdout), ("stderr", &called.stderr)] {
            let styles = ["\u{1b}[0m", "\u{1b}[1m", "\u{1b}[31m", "\u{1b}[32m", "\u{1b}[33m"];
            let text = styles
                .iter()
                .filter(|_| line.ends_with("always"))
                .fold(text.clone(), |text, style| text.replace(style, ""));
            let found = hidden(&text);
            assert!(found.is_empty(), "{line}, {stream}: {text:?}");
        }
    }
    let mut kinds = std::collections::BTreeMap::<String, usize>::new();
    for path in [files(&bench.path("run")), files(&bench.path("site"))].concat() {
        let kind = path.extension().unwrap_or_default().to_string_lossy().into_owned();
        // What stands for itself in JSON has its own signs for such characters.
        if ["svg", "csv", "tex", "html", "md", "txt"].contains(&&*kind) {
            let text = fs::read_to_string(&path).unwrap();
            let found = hidden(&text);
            assert!(found.is_empty(), "{}: {found:?}", path.display());
            if kind == "csv" {
                let is_formula = |cell: &str| cell.trim_start_matches(['"', ' ']).starts_with(['=', '@', '+']);
                assert!(!text.split([',', '\n']).any(is_formula), "{}", path.display());
            }
        }
        *kinds.entry(kind).or_default() += 1;
    }
    for (kind, least) in [("svg", 3), ("csv", 8), ("tex", 1), ("html", 2)] {
        assert!(kinds.get(kind).is_some_and(|count| *count >= least), "{kind}: {kinds:?}");
    }
    let page = fs::read_to_string(bench.path("run/report.html")).unwrap();
    assert!(page.contains("⟨U+001B⟩"));
}
