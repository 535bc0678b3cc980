//! Orders of choices, repeats, constraints, and reading again.
use std::collections::{BTreeMap, BTreeSet};
use std::fs;

use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::run::{Bench, model_args, records, words};
use crate::support::snapshot::{lines_with, on_one_line, redacted};
use serde_json::{Value, json};

/// The arguments of every run, and more of them.
fn args(more: &str) -> Vec<&str> {
    [words("--data set.jsonl --levels L0"), words(more)].concat()
}

/// The output of a complete run in the folder `run`.
fn run(bench: &Bench, more: &str) -> String {
    bench.complete(&[args("--out run --full"), words(more)].concat())
}

#[test]
fn rotation_averages_position_bias() {
    let bench = Bench::with_questions(6);
    bench.file("script.jsonl", "{\"default\":\"A\"}");
    let table = run(&bench, "--model script:script.jsonl --circular");
    let records = records(&bench.path("run"));
    assert_eq!(records.len(), 18);
    let truths: Vec<u64> = records.iter().map(|r| r["truth"].as_u64().unwrap()).collect();
    for truth in 0..3 {
        assert_eq!(truths.iter().filter(|t| **t == truth).count(), 6);
    }
    for record in &records {
        let truth = record["truth"].as_u64().unwrap() as usize;
        assert_eq!(record["choices"][truth], "brown");
    }
    // Always A: right in one rotation of three, never in all.
    assert!(table.contains("33.3"), "{table}");
    assert!(table.contains("right every time") && table.contains("0.0"), "{table}");
    let csv = fs::read_to_string(bench.path("run/summary.csv")).unwrap();
    assert!(csv.lines().next().unwrap().ends_with("value,low,high,always,reading"), "{csv}");
    let text = "{\"default\":\"brown\"}";
    bench.file("script.jsonl", text);
    let by_text = args("--out by-text --model script:script.jsonl --circular");
    insta::assert_snapshot!(redacted(&bench.complete(&by_text)), @"
    script:script.jsonl · 6 questions · 1 frame · 18 replies, 0 failed · intervals
     by question
    ! Only 6 questions (8 are needed): wide intervals, few possible verdicts.

     accuracy in %
     script:script.jsonl    L0   95 %
     untouched           100.0   −33.9 0.0
     95 %: how far the widest interval of the row reaches down and up
     chance 33.3
    run: by-text
    report: by-text/report.html
    ");
}

#[test]
fn chance_follows_asked_questions() {
    let bench = Bench::with_questions(1);
    let question = |id: &str, choices: &[&str]| {
        let question = json!({
            "id": id, "image": "a.png", "family": "color", "question": "What color is it?", "choices": choices,
            "answer": "brown",
        });
        format!("{question}\n")
    };
    let two = question("two", &["red", "brown"]);
    let four = question("four", &["red", "brown", "blue", "green"]);
    bench.file("set.jsonl", two + &four);
    bench.file("script.jsonl", "{\"default\":\"A\"}");
    // Two replies with a half and four with a quarter each: two of six, as for the one who always says A.
    let table = run(&bench, "--model script:script.jsonl --circular");
    insta::assert_snapshot!(lines_with(&table, "33.3"), @"
     script:script.jsonl   untouched            33.3   6          0        0   −33.0 +65.2
    chance: 33.33 over 6 orders of choices
     script:script.jsonl   L0          A        100.0    33.3    +66.7   −100.0 to +100.0   1.000         –
    ");
    insta::assert_snapshot!(lines_with(&table, "chance"), @"
    chance: 33.33 over 6 orders of choices
    chance with each question once, as the paper counts: 37.50 over 2 questions
    ");
}

#[test]
fn shuffled_orders_are_stable() {
    let orders = |seed: &str| {
        let bench = Bench::with_questions(6);
        bench.complete(&words(&format!(
            "--data set.jsonl --levels L0,L2 --out run --model random --shuffle-options --seed {seed}"
        )));
        let orders: BTreeSet<(String, String)> = records(&bench.path("run"))
            .iter()
            .map(|record| (record["question"].to_string(), record["choices"].to_string()))
            .collect();
        assert_eq!(orders.len(), 6, "one order a question");
        orders
    };
    assert_eq!(orders("1"), orders("1"));
    assert_ne!(orders("1"), orders("2"));
    let kinds: BTreeSet<String> = orders("1").into_iter().map(|(_, order)| order).collect();
    assert!(kinds.len() > 1);
}

#[test]
fn repeats_are_trials_of_their_own() {
    let bench = Bench::with_questions(6);
    let mock = MockEndpoint::start([Answer::text("C")]);
    let base = mock.base_url();
    let repeated = format!("--model m --base-url {base} --repeats 3");
    run(&bench, &repeated);
    assert_eq!(mock.requests().len(), 18);
    let records = records(&bench.path("run"));
    let repeats: Vec<u64> = records.iter().map(|r| r["repeat"].as_u64().unwrap_or(0)).collect();
    for repeat in 0..3 {
        assert_eq!(repeats.iter().filter(|r| **r == repeat).count(), 6);
    }
    run(&bench, &repeated);
    assert_eq!(mock.requests().len(), 18, "none is asked again");
}

/// The wording, order and question of each record of a model, with its number of records.
fn askings(bench: &Bench, view: &str) -> BTreeMap<(String, u64, String), usize> {
    let mut askings = BTreeMap::new();
    for record in records(&bench.path("run")).iter().filter(|record| record["view"] == view) {
        let wording = record["wording"].as_str().unwrap_or("none").to_owned();
        let order = record["order"].as_u64().unwrap_or(0);
        *askings.entry((wording, order, record["question"].to_string())).or_default() += 1;
    }
    askings
}

#[test]
fn every_question_is_asked_in_each_wording_and_order_once() {
    let bench = Bench::with_questions(6);
    let mock = MockEndpoint::start([Answer::text("C")]);
    let own = bench.path("own");
    fs::create_dir(&own).unwrap();
    fs::write(
        own.join("choice.txt"),
        "Q: {{ question }}\n{% for c in choices %}{{ c.letter }}) {{ c.text }}\n{% endfor %}",
    )
    .unwrap();
    let models = format!("--model m --blind-model m --base-url {}", mock.base_url());
    let several =
        format!("{models} --prompts paper --prompts terse --prompts own={} --choice-order shuffle=2", own.display());
    run(&bench, &several);
    let images = askings(&bench, "image");
    assert_eq!(images.len(), 6 * 3 * 2);
    assert!(images.values().all(|count| *count == 1));
    // The words without an image of "own" are those of "paper", and a request is never paid twice.
    let blind = askings(&bench, "blind");
    assert!(blind.keys().all(|(wording, ..)| wording == "paper" || wording == "terse"));
    assert_eq!((blind.len(), mock.requests().len()), (6 * 2 * 2, 6 * 3 * 2 + 6 * 2 * 2));
    let requests = mock.requests();
    let own = requests.iter().filter(|request| request.json().to_string().contains("Q: ")).count();
    assert_eq!(own, 12, "the prompts of the folder are sent");
    run(&bench, &several);
    assert_eq!(mock.requests().len(), 60, "none is asked again");
    let csv = fs::read_to_string(bench.path("run/variation.csv")).unwrap();
    assert!(csv.lines().any(|line| line.starts_with("m,image,L0,")), "{csv}");
    let fewer = bench.call(&[args("--out run"), words(&models), words("--prompts paper")].concat());
    assert!(fewer.stderr.contains("--prompts"), "other wordings are another run: {}", fewer.stderr);
}

#[test]
fn a_report_says_whether_other_wordings_were_asked() {
    let bench = Bench::with_questions(12);
    let models = "--data set.jsonl --levels L0,L5 --variant ev --model random";
    let one = bench.complete(&[words(models), words("--out one --findings")].concat());
    assert!(on_one_line(&one).contains("how far others move the results is unknown"), "{one}");
    assert!(!bench.path("one/variation.csv").exists());
    let prompts = "--prompts paper --prompts letter --out two --findings";
    let two = bench.complete(&[words(models), words(prompts)].concat());
    assert!(on_one_line(&two).contains("combinations of 2 wordings, 1 order"), "{two}");
    assert!(on_one_line(&two).contains("has intervals for others, too"), "{two}");
    assert!(bench.path("two/variation_differences.csv").exists());
}

#[test]
fn constraint_is_sent_and_parsed() {
    let bench = Bench::with_questions(6);
    let mock = MockEndpoint::start([Answer::text("{\"answer\": \"C\"}")]);
    let base = mock.base_url();
    let model = format!("--model m --base-url {base}");
    run(&bench, &format!("{model} --constrain json"));
    let sent = &mock.requests()[0].json();
    let schema = &sent["response_format"]["json_schema"]["schema"];
    assert_eq!(schema["properties"]["answer"]["enum"], json!(["A", "B", "C"]));
    for record in records(&bench.path("run")) {
        assert_eq!((&record["reply"], &record["outcome"]), (&"C".into(), &"right".into()));
    }
    let of = |run: &str| bench.complete(&["report", run, "--full"]);
    assert!(!of("run").contains("Constraint not followed"));
    // It measures something else, so it is another run.
    let other = [args("--out run"), words(&model)].concat();
    insta::assert_snapshot!(bench.call(&other).messages(), @r#"
    exit code: 2
    error: run: the model m has another --request constrain in this run: it was "json", now it is "none"; use
        another --out, or the same --request constrain
    "#);

    let mock = MockEndpoint::start([Answer::text("I think C")]);
    let base = mock.base_url();
    let free = args("--out free --constrain choice");
    let called = bench.call(&[free, model_args(&base, "")].concat());
    assert_eq!(mock.requests()[0].json()["structured_outputs"]["choice"], json!(["A", "B", "C"]));
    insta::assert_snapshot!(called.messages(), @"
    exit code: 0
     WARN m: a reply does not have the form that --request constrain=choice requests; the server may not support
        it, or the reply was truncated (--max-tokens)
    ");
    assert_eq!(called.stderr.matches("--request constrain=choice").count(), 1);
    let report = of("free");
    let report = on_one_line(&report);
    let counted = records(&bench.path("free")).len();
    let expected = format!("Constraint not followed: {counted} of {counted} replies of m");
    assert!(report.contains(&expected), "{report}");
}

#[test]
fn stored_replies_are_reparsed_offline() {
    let bench = Bench::with_questions(6);
    bench.file("script.jsonl", "{\"default\":\"C\"}");
    let table = run(&bench, "--model script:script.jsonl");
    let report = bench.complete(&["report", "run", "--full"]);
    assert_eq!(report, table, "the same from the records alone");
    // As an earlier version might have read them.
    let path = bench.path("run/records.jsonl");
    let old: String = fs::read_to_string(&path)
        .unwrap()
        .lines()
        .map(|line| {
            let mut record: Value = serde_json::from_str(line).unwrap();
            record["strict"] = json!({"chosen": null, "why": "no_choice"});
            record["outcome"] = "unparsed".into();
            record.to_string() + "\n"
        })
        .collect();
    fs::write(&path, &old).unwrap();
    assert!(bench.complete(&["report", "run", "--full"]).contains("   0.0"));
    let rescored = bench.complete(&["report", "run", "--rescore", "--full"]);
    assert!(rescored.starts_with("6 of 6 records now read differently\n"), "{rescored}");
    assert!(rescored.ends_with(&table), "{rescored}");
    let again = bench.complete(&["report", "run", "--rescore", "--full"]);
    assert!(again.starts_with("0 of 6"), "{again}");
    let stored = fs::read_to_string(&path).unwrap();
    assert!(stored.starts_with(&old), "what was kept is never changed");
    let none = bench.call(&["report", "nowhere"]);
    assert_eq!(none.code, Some(2));
}

#[test]
fn earlier_parsing_is_reported() {
    let bench = Bench::with_questions(6);
    bench.file("script.jsonl", "{\"default\":\"I can rule out option C.\"}");
    run(&bench, "--model script:script.jsonl");
    let [records, manifest] = ["run/records.jsonl", "run/manifest.json"].map(|name| bench.path(name));
    let read_manifest = || -> Value { serde_json::from_slice(&fs::read(&manifest).unwrap()).unwrap() };
    assert_eq!(read_manifest()["reply_reading"], "lenient/5");
    assert!(!bench.complete(&["report", "run"]).contains("differently"));
    // As an earlier version read them.
    let old: String = fs::read_to_string(&records)
        .unwrap()
        .lines()
        .map(|line| {
            let mut record: Value = serde_json::from_str(line).unwrap();
            assert_eq!(record["lenient"]["chosen"], Value::Null);
            record["lenient"] = json!({"chosen": record["truth"], "why": null});
            record.to_string() + "\n"
        })
        .collect();
    // The first version has no name in a manifest.
    for (stored, named) in [(None, "lenient/1"), (Some("lenient/4"), "lenient/4")] {
        let change = format!(
            "lenient/5 reads 6 of 6 replies differently than {named}: the lenient accuracy is 0.0 %, and was 100.0 %"
        );
        fs::write(&records, &old).unwrap();
        let mut earlier = read_manifest();
        match stored {
            Some(version) => earlier["reply_reading"] = json!(version),
            None => {
                earlier.as_object_mut().unwrap().remove("reply_reading");
            }
        }
        fs::write(&manifest, earlier.to_string()).unwrap();
        let report = bench.complete(&["report", "run"]);
        let said = on_one_line(&report);
        assert!(said.contains(&change), "{report}");
        let rescored = bench.complete(&["report", "run", "--rescore"]);
        assert!(rescored.starts_with(&format!("6 of 6 records now read differently\n{change}\n")), "{rescored}");
        assert_eq!(read_manifest()["reply_reading"], "lenient/5");
        assert!(!bench.complete(&["report", "run"]).contains("differently"));
    }
}

#[test]
fn unanswered_replies_show_their_reason() {
    let bench = Bench::with_questions(6);
    let thinking = json!({"content": null, "reasoning_content": "hmm"});
    let mut answers = vec![Answer::message(&thinking, "length"); 10];
    answers.push(Answer::message(&json!({"content": null}), "content_filter"));
    answers.push(Answer::message(&json!({"content": null, "refusal": "no"}), "stop"));
    let mock = MockEndpoint::start(answers);
    let base = mock.base_url();
    let repeated = args("--out run --full --repeats 2 --concurrency 1");
    let called = bench.call(&[repeated, model_args(&base, "")].concat());
    insta::assert_snapshot!(called.lines_with("token limit"), @"
    exit code: 0
    of the unparsed replies 10 cut at the token limit (--max-tokens), 1 refused, 1 withheld by a filter
    WARN 10 of the first 10 replies were cut at the token limit with no answer: a reasoning model needs a larger
        --max-tokens, or a lower --reasoning-effort
    ");
    insta::assert_snapshot!(called.messages(), @"
    exit code: 0
     WARN 10 of the first 10 replies were cut at the token limit with no answer: a reasoning model needs a larger
        --max-tokens, or a lower --reasoning-effort
    ");
}
