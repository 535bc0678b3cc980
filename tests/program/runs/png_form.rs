//! Forms of PNG files: a run of an earlier version keeps its form, and is compared with runs of the newest one.

use std::collections::BTreeMap;
use std::fs;

use serde_json::{Value, json};

use crate::support::run::{Bench, records, words};

fn manifest(bench: &Bench, run: &str) -> Value {
    serde_json::from_slice(&fs::read(bench.path(run).join("manifest.json")).unwrap()).unwrap()
}

/// Makes a run one of a version without forms: its manifest names none.
fn remove_form(bench: &Bench, run: &str) {
    let mut manifest = manifest(bench, run);
    assert_eq!(manifest.as_object_mut().unwrap().remove("png"), Some(json!("noise")));
    bench.file(&format!("{run}/manifest.json"), manifest.to_string());
}

/// The digest of each image by question and condition.
fn digests(bench: &Bench, run: &str) -> BTreeMap<[String; 2], String> {
    let image = |record: &Value| record["image"]["digest"].as_str().unwrap().to_owned();
    let place = |record: &Value| ["question", "condition"].map(|field| record[field].as_str().unwrap().to_owned());
    records(&bench.path(run)).iter().map(|record| (place(record), image(record))).collect()
}

#[test]
fn earlier_run_keeps_its_form() {
    let bench = Bench::new();
    bench.complete(&words("--model random --levels L0,L2 --limit 2 --out old"));
    bench.complete(&words("--model random --levels L0,L2,L4 --limit 2 --out new"));
    remove_form(&bench, "old");
    bench.complete(&words("--model random --levels L0,L2,L4 --limit 2 --out old"));
    let (old, new) = (digests(&bench, "old"), digests(&bench, "new"));
    assert_eq!(old.len(), new.len());
    for ([question, condition], digest) in &old {
        let is_same = new[&[question.clone(), condition.clone()]] == *digest;
        // Levels of the second call have the form of the run; L0 is sent unchanged.
        assert_eq!(is_same, !condition.starts_with("L4"), "{condition}");
    }
    let question = &old.keys().next().unwrap()[0];
    let shown = bench.complete(&["show", "old", question, "--condition", "L4-noise"]);
    assert!(shown.contains("the same bytes as were sent"), "{shown}");
    assert_eq!((manifest(&bench, "old").get("png"), &manifest(&bench, "new")["png"]), (None, &json!("noise")));
}

#[test]
fn baseline_in_an_earlier_form_is_compared() {
    let bench = Bench::new();
    let run = |out: &str, seed: &str| {
        bench.complete(&words(&format!("--model observer --levels L0,L4 --seed {seed} --out {out}")));
    };
    run("old", "0");
    remove_form(&bench, "old");
    run("new", "0");
    run("other", "1");
    let alert = "The PNG files of old have an earlier form";
    assert!(bench.complete(&words("report new --baseline old")).contains(alert));
    assert!(!bench.complete(&words("report other --baseline old")).contains(alert));
}
