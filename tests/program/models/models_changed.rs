//! A run whose file of models changes: models that are taken out, that get other settings or another name; and what
//! reports say of each model.

use std::collections::BTreeMap;
use std::fs;

use serde_json::Value;

use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::run::{Bench, Called, records, words};
use crate::support::snapshot::{lines_with, redacted};

const RUN: &str = "--models models.toml --data set.jsonl --levels L0 --retries 0 --out run";

fn table(name: &str, id: &str, url: &str, more: &str) -> String {
    format!("[[model]]\nname = \"{name}\"\nid = \"{id}\"\nendpoints = [\"{url}\"]\n{more}\n")
}

/// Runs the program with a file of these tables; it must end with everything scored.
fn complete(bench: &Bench, tables: &[String], line: &str) -> Called {
    bench.file("models.toml", tables.concat());
    let called = bench.call(&words(&format!("{RUN} {line}")));
    assert_eq!(called.code, Some(0), "{called:?}");
    called
}

/// The accuracy of each model in the summary, by name.
fn accuracies(bench: &Bench) -> BTreeMap<String, String> {
    let text = fs::read_to_string(bench.path("run/summary.json")).unwrap();
    let summary: Value = serde_json::from_str(&text).unwrap();
    let rows = summary["rows"].as_array().unwrap();
    rows.iter()
        .filter(|row| (&row["mode"], &row["family"]) == (&"strict".into(), &"all".into()) && row["model"] != "chance")
        .map(|row| (row["model"].as_str().unwrap().to_owned(), row["value"].to_string()))
        .collect()
}

fn names(bench: &Bench) -> Vec<String> {
    accuracies(bench).into_keys().collect()
}

/// An endpoint whose replies are right (C) where at most 9 tokens are allowed.
fn endpoint() -> MockEndpoint {
    MockEndpoint::answering(|body| match body["max_tokens"].as_u64() {
        Some(..10) => Answer::text("C"),
        _ => Answer::text("A"),
    })
}

#[test]
fn removed_model_is_excluded_but_kept() {
    let mock = endpoint();
    let url = mock.base_url();
    let bench = Bench::with_questions(2);
    let [one, two] = ["one", "two"].map(|name| table(name, name, &url, ""));
    complete(&bench, &[one.clone(), two.clone()], "--model random");
    let all = ["one", "random", "two"];
    assert_eq!(names(&bench), all);
    // Asking some of them leaves the others in.
    let run = complete(&bench, &[one.clone(), two.clone()], "--model random --only one");
    assert!(!run.stdout.contains("left out"), "{}", run.stdout);
    assert_eq!(names(&bench), all);
    let asked = mock.requests().len();
    let run = complete(&bench, std::slice::from_ref(&two), "");
    insta::assert_snapshot!(run, @"
    exit code: 0
    stdout:
    two · 2 questions · 1 frame · 2 replies, 0 failed · intervals by question
    ! Only 2 questions (8 are needed): wide intervals, few possible verdicts.
    ! one and random are left out of run: the file of models has no such model any
      more, or has it with other settings; report --all shows all.

     accuracy in %
     two          L0   95 %
     untouched   0.0   0.0 +65.8
     95 %: how far the widest interval of the row reaches down and up
     chance 33.3
    run: run
    report: run/report.html
    ");
    assert_eq!(names(&bench), ["two"]);
    let kept = records(&bench.path("run"));
    assert!(kept.iter().any(|record| record["model"] == "one"));
    bench.complete(&["report", "run"]);
    assert_eq!(names(&bench), ["two"]);
    let shown = bench.complete(&["report", "run", "--all"]);
    assert!(!shown.contains("left out"), "{shown}");
    assert_eq!(names(&bench), all);
    // Back in the file it is shown, and nothing is asked.
    complete(&bench, &[two, one], "");
    assert_eq!(names(&bench), ["one", "two"]);
    assert_eq!(mock.requests().len(), asked);
}

/// The control of the observer is asked with it, and no file names it.
#[test]
fn control_of_observer_goes_with_it() {
    let bench = Bench::new();
    let [observer, random] = ["observer", "random"].map(|id| format!("[[model]]\nid = \"{id}\"\n"));
    let line = "--models models.toml --levels L0 --out run";
    let complete = |models: String, more: &str| {
        bench.file("models.toml", models);
        bench.complete(&words(&format!("{line} {more}")))
    };
    let has_control = || {
        let table = fs::read_to_string(bench.path("run/observer.csv")).unwrap_or_default();
        table.contains("observer:")
    };
    complete(observer.clone() + &random, "");
    assert!(has_control());
    let shown = complete(observer + &random, "--only random");
    assert!(has_control() && !shown.contains("left out"), "{shown}");
    let shown = complete(random, "");
    insta::assert_snapshot!(redacted(&shown), @"
    random · 19 questions · 6 frames · 19 replies, 0 failed · intervals by scene
    ! Only 3 scenes (8 are needed): wide intervals, few possible verdicts.
    ! observer and observer:other-room are left out of run: the file of models has
      no such model any more, or has it with other settings; report --all shows all.

     accuracy in %
     random       L0   95 %
     untouched  52.6   −36.5 +33.9
     95 %: how far the widest interval of the row reaches down and up
     chance 38.6
    run: run
    report: run/report.html
    ");
    let shown = bench.complete(&words("report run --json"));
    assert!(!shown.contains("\"model\": \"observer\""), "{shown}");
}

#[test]
fn changed_settings_make_another_model() {
    let mock = endpoint();
    let url = mock.base_url();
    let bench = Bench::with_questions(3);
    let with = |limit: u32| table("m", "m", &url, &format!("max-tokens = {limit}"));
    complete(&bench, &[with(20)], "");
    assert_eq!(accuracies(&bench)["m"], "0.0");
    let run = complete(&bench, &[with(9)], "");
    insta::assert_snapshot!(run, @"
    exit code: 0
    stdout:
    m · 3 questions · 1 frame · 3 replies, 0 failed · intervals by question
    ! Only 3 questions (8 are needed): wide intervals, few possible verdicts.
    ! m (before) is left out of run: the file of models has no such model any more,
      or has it with other settings; report --all shows all.

     accuracy in %
     m            L0   95 %
     untouched 100.0   −56.1 0.0
     95 %: how far the widest interval of the row reaches down and up
     chance 33.3
    run: run
    report: run/report.html
    ");
    assert_eq!(mock.requests().len(), 6);
    assert_eq!(accuracies(&bench), BTreeMap::from([("m".into(), "1.0".into())]));
    bench.complete(&["report", "run", "--all", "--rescore"]);
    let both = BTreeMap::from([("m".into(), "1.0".into()), ("m (before)".into(), "0.0".into())]);
    assert_eq!(accuracies(&bench), both);
    // Back and forth nothing is asked, and nothing is mixed.
    for (limit, now, before) in [(20, "0.0", "1.0"), (9, "1.0", "0.0"), (20, "0.0", "1.0")] {
        complete(&bench, &[with(limit)], "");
        assert_eq!(names(&bench), ["m"]);
        bench.complete(&["report", "run", "--all"]);
        let found = accuracies(&bench);
        assert_eq!((&*found["m"], &*found["m (before)"]), (now, before), "{limit}");
        assert_eq!(found.len(), 2);
    }
    assert_eq!(mock.requests().len(), 6);
    // A third one, and both that were before.
    complete(&bench, &[with(8)], "");
    assert_eq!(mock.requests().len(), 9);
    bench.complete(&["report", "run", "--all"]);
    let found = accuracies(&bench);
    assert_eq!(found["m"], "1.0");
    assert_eq!(names(&bench), ["m", "m (before 2)", "m (before)"]);
    assert_eq!(records(&bench.path("run")).len(), 9);
    // A model that a flag names is held to what it was, as ever.
    let flags = format!("--data set.jsonl --levels L0 --out run --model m --max-tokens 7 --base-url {url}");
    let refused = bench.call(&words(&flags));
    insta::assert_snapshot!(refused.messages(), @"
    exit code: 2
    error: run: the model m has another --max-tokens in this run: it was 8, now it is 7; use another --out, or the
        same --max-tokens
    ");
}

#[test]
fn two_models_may_exchange_their_names() {
    let mock = endpoint();
    let url = mock.base_url();
    let bench = Bench::with_questions(2);
    let tables =
        |good: &str, bad: &str| [table(good, "m", &url, "max-tokens = 9"), table(bad, "m", &url, "max-tokens = 20")];
    complete(&bench, &tables("x", "y"), "");
    let found = accuracies(&bench);
    assert_eq!((&*found["x"], &*found["y"]), ("1.0", "0.0"));
    let asked = mock.requests().len();
    let run = complete(&bench, &tables("y", "x"), "");
    let found = accuracies(&bench);
    assert_eq!((&*found["x"], &*found["y"]), ("0.0", "1.0"));
    assert!(!run.stdout.contains("left out"), "{}", run.stdout);
    assert_eq!((mock.requests().len(), found.len()), (asked, 2));
}

/// A model is asked with and without images under two names; they differ in nothing else.
#[test]
fn renamed_models_separate_blind_replies() {
    const BLIND: &str = "view = \"blind\"";
    // Right (C) where there is an image.
    let mock = MockEndpoint::answering(|body| {
        let has_image = body["messages"][0]["content"].is_array();
        Answer::text(if has_image { "C" } else { "A" })
    });
    let url = mock.base_url();
    let tables = |image: &str, blind: &str| [table(blind, "m", &url, BLIND), table(image, "m", &url, "")];
    let is = |bench: &Bench, image: &str, blind: &str| {
        let expected = [(image, "1.0"), (blind, "0.0")];
        let expected = expected.map(|(name, value)| (name.to_owned(), value.to_owned()));
        assert_eq!(accuracies(bench), BTreeMap::from(expected));
    };
    // Both get another name, in whatever order the names are; they exchange them; and nothing is asked again.
    let bench = Bench::with_questions(2);
    complete(&bench, &tables("GPT-4o", "GPT-4o (blind)"), "");
    is(&bench, "GPT-4o", "GPT-4o (blind)");
    assert_eq!(mock.requests().len(), 4);
    for (image, blind) in [("4o", "4o (blind)"), ("seeing", "a"), ("a", "seeing"), ("a", "b")] {
        complete(&bench, &tables(image, blind), "");
        is(&bench, image, blind);
        bench.complete(&["report", "run", "--all"]);
        is(&bench, image, blind);
    }
    assert_eq!(mock.requests().len(), 4);
    // One gets another name, and the other one is new.
    for blind in ["4o (blind)", "3o"] {
        let bench = Bench::with_questions(2);
        complete(&bench, &[table("GPT-4o", "m", &url, "")], "");
        let asked = mock.requests().len();
        complete(&bench, &tables("4o", blind), "");
        is(&bench, "4o", blind);
        assert_eq!(mock.requests().len(), asked + 2);
    }
    // One is taken out, and the other one has its name.
    let bench = Bench::with_questions(2);
    complete(&bench, &tables("x", "y"), "");
    let run = complete(&bench, &[table("x", "m", &url, BLIND)], "");
    insta::assert_snapshot!(run, @"
    exit code: 0
    stdout:
    x · 2 questions · 1 frame · 2 replies, 0 failed · intervals by question
    ! Only 2 questions (8 are needed): wide intervals, few possible verdicts.
    ! x (before) is left out of run: the file of models has no such model any more,
      or has it with other settings; report --all shows all.

     accuracy in %
     without images: x 0.0 [0.0, 65.8] · chance 33.3
    run: run
    report: run/report.html
    ");
    assert_eq!(accuracies(&bench), BTreeMap::from([("x".into(), "0.0".into())]));
}

#[test]
fn models_with_adapted_requests_are_marked() {
    let strict = MockEndpoint::answering(|body| match body.get("temperature") {
        Some(_) => Answer::error(
            400,
            "unsupported_value",
            "Unsupported value: 'temperature' does not support 0 with this model.",
        ),
        None => Answer::text("C"),
    });
    let mock = endpoint();
    let bench = Bench::with_questions(2);
    let tables =
        [table("thinker", "t", &strict.base_url(), ""), table("plain", "p", &mock.base_url(), "max-tokens = 9")];
    let run = complete(&bench, &tables, "");
    let foot = "† requests were changed because the server refused what was set (thinker: no";
    insta::assert_snapshot!(run.lines_with("†"), @"
    exit code: 0
     thinker † 100.0   −65.8 0.0
     † requests were changed because the server refused what was set (thinker: no
    ");
    assert!(run.stdout.contains(foot), "{}", run.stdout);
    assert!(!run.stdout.contains("plain †"), "{}", run.stdout);
    let full = bench.complete(&["report", "run", "--full"]);
    insta::assert_snapshot!(lines_with(&full, "†"), @"
     thinker †   untouched   100.0   2          0        0   −65.8 0.0
    † requests were changed because the server refused what was set (thinker: no temperature is sent: the server's
        own is used)
    ");
    let page = fs::read_to_string(bench.path("run/report.html")).unwrap();
    assert!(page.contains("<p class=\"foot\">† requests were changed"), "the foot is on the page");
    let tex = fs::read_to_string(bench.path("run/tables.tex")).unwrap();
    assert!(tex.contains("thinker $\\dagger$ &") && tex.contains("{\\footnotesize $\\dagger$ requests"), "{tex}");
    // The name in files is the name alone; under another name the mark stays.
    assert_eq!(names(&bench), ["plain", "thinker"]);
    let tables =
        [table("renamed", "t", &strict.base_url(), ""), table("plain", "p", &mock.base_url(), "max-tokens = 9")];
    let run = complete(&bench, &tables, "");
    insta::assert_snapshot!(run.lines_with("†"), @"
    exit code: 0
     renamed † 100.0   −65.8 0.0
     † requests were changed because the server refused what was set (renamed: no
    ");
    // Without a change there is no mark.
    let run = complete(&bench, &tables[1..], "");
    assert!(!run.stdout.contains('†'), "{}", run.stdout);
}

#[test]
fn model_columns_show_on_demand() {
    let mock = endpoint();
    let url = mock.base_url();
    let bench = Bench::with_questions(2);
    let tables = [table("First", "org/first", &url, "deployment = \"fp8\""), table("Second", "org/second", &url, "")];
    let run = complete(&bench, &tables, "");
    assert!(!run.stdout.contains("org/first"), "{}", run.stdout);
    let line = "report run --columns id,deployment,served";
    let short = bench.complete(&words(line));
    insta::assert_snapshot!(redacted(&short), @"
    2 models · 2 questions · 1 frame · 4 replies, 0 failed · intervals by question
    ! Only 2 questions (8 are needed): wide intervals, few possible verdicts.

     accuracy in %
     untouched    L0   95 %
     First       0.0   0.0 +65.8
     Second      0.0   0.0 +65.8
     95 %: how far the widest interval of the row reaches down and up
     chance 33.3
     First: id org/first · deployment fp8 · served as mock-1
     Second: id org/second · deployment – · served as mock-1
    run: run
    report: run/report.html
    ");
    let full = bench.complete(&words(&format!("{line} --full")));
    let row = full.lines().find(|line| line.starts_with(" First ")).unwrap();
    insta::assert_snapshot!(
        redacted(row.trim_start()),
        @"First    untouched   0.0   org/first    fp8          mock-1      2          0        0   0.0 +65.8"
    );
    let page = fs::read_to_string(bench.path("run/report.html")).unwrap();
    assert!(page.contains("<th scope=\"col\">served as</th>"), "the column is on the page");
    let summary = fs::read_to_string(bench.path("run/summary.csv")).unwrap();
    let mut lines = summary.lines();
    assert!(lines.next().unwrap().ends_with(",id,deployment,served_model"), "{summary}");
    assert!(lines.next().unwrap().ends_with(",org/first,fp8,mock-1"), "{summary}");
    bench.complete(&["report", "run"]);
    let summary = fs::read_to_string(bench.path("run/summary.csv")).unwrap();
    assert!(!summary.contains("org/first"), "{summary}");
    let refused = bench.call(&words("report run --columns colour"));
    assert_eq!(refused.code, Some(2), "{refused:?}");
}
