//! What no other test would miss: the sets of Holm's correction, a long torn line, the patience with an outage, which
//! frames a report shows, the warning of replies that were cut, and open questions about enhanced walks.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::Duration;

use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::house::House;
use crate::support::onnx;
use crate::support::run::{Bench, called, records, words};
use crate::support::snapshot::redacted;
use crate::support::table::check_rows;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use darkqa_base::types::Digest;
use serde_json::{Value, json};

/// The lines of a file of JSON objects.
fn lines(path: &std::path::Path) -> Vec<Value> {
    let text = fs::read_to_string(path).unwrap();
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

// ---- Holm's correction ----

const FAMILIES: [&str; 2] = ["color", "presence"];
const OF_EACH: usize = 12;
const CONDITIONS: [&str; 5] = ["L0", "L1-ev", "L1-noise", "L4-ev", "L4-noise"];

/// Number of right replies per family and condition; the first questions are right.
const SKILLS: [(&str, [[usize; 2]; 5]); 3] = [
    ("a", [[12, 12], [12, 7], [10, 9], [4, 3], [1, 2]]),
    ("b", [[6, 9], [10, 4], [9, 4], [3, 3], [8, 0]]),
    ("c", [[4, 3], [4, 6], [2, 11], [11, 2], [5, 3]]),
];

/// The exact two-sided p-value of the sign test, Σ over k ≤ min(gained, lost) of 2·C(n, k)/2ⁿ and 1 at most, n = gained
/// + lost: with one pair a cluster, swapping clusters comes to it.
fn sign_test(gained: usize, lost: usize) -> f64 {
    let n = gained + lost;
    let (mut mass, mut tail) = (0.5_f64.powi(n as i32), 0.0);
    for k in 0..=gained.min(lost) {
        tail += mass;
        mass *= (n - k) as f64 / (k + 1) as f64;
    }
    (2.0 * tail).min(1.0)
}

/// Holm's adjustment of one of a set of m p-values (Holm 1979): with the values in rising order p₍₁₎ ≤ … ≤ p₍ₘ₎, the
/// i-th becomes the largest of min(1, (m − j + 1)·p₍ⱼ₎) over j ≤ i.
fn holm(set: &[f64], p: f64) -> f64 {
    let mut sorted = set.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted
        .iter()
        .enumerate()
        .filter(|(_, other)| **other <= p)
        .map(|(j, other)| (set.len() - j) as f64 * other)
        .fold(0.0, f64::max)
        .min(1.0)
}

/// The questions of each family that a model gets right in a condition.
fn right(model: &str, condition: &str) -> [usize; 2] {
    let name = model.strip_prefix("script:").unwrap();
    let name = name.strip_suffix(".jsonl").unwrap();
    let (_, skill) = SKILLS.iter().find(|(model, _)| *model == name).unwrap();
    let place = CONDITIONS.iter().position(|at| *at == condition);
    skill[place.unwrap()]
}

/// A set of questions, and models that know what is written above.
fn exam() -> Bench {
    let bench = Bench::with_questions(1);
    let ids: Vec<[String; 2]> = (0..OF_EACH).map(|i| FAMILIES.map(|family| format!("{family}{i}"))).collect();
    let question = |family: usize, id: &String| json!({"id": id, "image": "a.png", "family": FAMILIES[family], "question": format!("Which, {id}?"), "choices": ["one", "two", "three"], "answer": "three"});
    let all: Vec<String> = ids
        .iter()
        .flat_map(|pair| [question(0, &pair[0]), question(1, &pair[1])])
        .map(|question| question.to_string())
        .collect();
    bench.file("set.jsonl", all.join("\n"));
    check_rows(SKILLS, |(model, skill)| {
        let mut script = vec![json!({"default": "A"}).to_string()];
        for (condition, right) in CONDITIONS.into_iter().zip(skill) {
            for (family, right) in right.into_iter().enumerate() {
                let known = ids.iter().take(right).map(|pair| &pair[family]);
                script
                    .extend(known.map(|id| json!({"question": id, "condition": condition, "reply": "C"}).to_string()));
            }
        }
        bench.file(&format!("{model}.jsonl"), script.join("\n"));
    });
    bench
}

#[test]
fn holm_corrects_within_models_and_kind() {
    let bench = exam();
    let line = "--data set.jsonl --model script:a.jsonl --model script:b.jsonl --model script:c.jsonl --levels L0,L1,L4 \
                --out run";
    bench.complete(&words(line));
    let text = fs::read_to_string(bench.path("run/comparisons.csv")).unwrap();
    let mut rows = text.lines().map(|line| line.split(',').collect::<Vec<&str>>());
    let header = rows.next().unwrap();
    // The lenient rows have the same numbers here.
    let rows = rows.filter(|row| row.last() == Some(&"strict"));
    let place = |name: &str| header.iter().position(|head| *head == name).unwrap();
    let (p_holm, p_alone) = (place("p_holm"), place("p"));
    let mut sets = BTreeMap::<_, Vec<(f64, f64)>>::new();
    for row in rows {
        let [kind, model, condition, against, other, family] = row[..6] else {
            panic!("{row:?}");
        };
        // The first so many are right: of two, the one that knows more knows all that the other does.
        let (one, two) = (right(model, condition), right(against, other));
        let of = |family: usize| (one[family].saturating_sub(two[family]), two[family].saturating_sub(one[family]));
        let (gained, lost) = match FAMILIES.iter().position(|name| *name == family) {
            Some(family) => of(family),
            None => (of(0).0 + of(1).0, of(0).1 + of(1).1),
        };
        let number = |at: usize| row[at].parse::<f64>().unwrap();
        let due = sign_test(gained, lost);
        // The larger one of the exact p and that of the interval.
        let alone = number(p_alone);
        assert!(alone > due - 1e-12 && alone < (3.0 * due).max(0.02), "{due}: {row:?}");
        let set = (kind.to_owned(), family == "all", model.to_owned(), against.to_owned());
        let values = (alone, number(p_holm));
        sets.entry(set).or_default().push(values);
    }
    let whole: Vec<f64> = sets.values().flatten().map(|(p, _)| *p).collect();
    let mut apart = 0;
    for (set, values) in &sets {
        let alone: Vec<f64> = values.iter().map(|(p, _)| *p).collect();
        for &(p, stated) in values {
            let due = holm(&alone, p);
            assert!((stated - due).abs() < 1e-12, "{set:?}: {p} to {due}, not {stated}");
            apart += usize::from((holm(&whole, p) - due).abs() > 1e-6);
        }
    }
    let counts = |kind: &str, all: bool| -> Vec<usize> {
        sets.iter().filter(|((k, a, ..), _)| k == kind && *a == all).map(|(_, values)| values.len()).collect()
    };
    // Each pair of models in five conditions; each model dark with L0, and noisy with its exposure alone.
    for (kind, each) in [("model", 5), ("level", 4), ("variant", 2)] {
        assert_eq!(counts(kind, true), [each; 3], "{kind}");
        assert_eq!(counts(kind, false), [2 * each; 3], "{kind}");
    }
    assert!(apart > 20, "the sets make a difference: {apart}");
}

// ---- A torn last line ----

#[test]
fn long_torn_line_is_removed() {
    const STEP: usize = 64 * 1024;
    let bench = Bench::with_questions(3);
    let endpoint = MockEndpoint::start([Answer::text("C")]);
    let base = endpoint.base_url();
    let line = format!("--data set.jsonl --model m --base-url {base} --levels L0 --concurrency 1 --out run");
    bench.complete(&words(&line));
    let path = bench.path("run/records.jsonl");
    let whole = fs::read_to_string(&path).unwrap();
    let last = whole.lines().next_back().unwrap();
    let intact = &whole[..whole.len() - last.len() - 1];
    assert_eq!((whole.lines().count(), intact.lines().count()), (3, 2));
    let sizes = [STEP - 1, STEP, STEP + 1, 2 * STEP, 5 * STEP + 7];
    for (before, size) in sizes.into_iter().enumerate() {
        // The reply went on and on, and the process was killed in the midst of it.
        let begun = last.split_once("\"reply\":\"").unwrap().0;
        let torn = format!("{begun}\"reply\":\"{}", "on and on ".repeat(size / 10 + 1));
        fs::write(&path, format!("{intact}{}", &torn[..size])).unwrap();
        bench.complete(&words(&line));
        let mended = fs::read_to_string(&path).unwrap();
        assert!(mended.starts_with(intact), "{size}: {} bytes", mended.len());
        assert_eq!(records(&bench.path("run")).len(), 3, "{size}");
        assert_eq!(endpoint.requests().len(), 3 + before + 1, "{size}");
    }
}

// ---- The patience with an outage ----

/// A run of 200 questions, 20 at a time, with a server that answers the first 20, fails so often, and answers again:
/// the code and the messages, and how many trials failed.
fn outage(length: usize) -> (Option<i32>, String, usize) {
    const TOGETHER: usize = 20;
    let bench = Bench::with_questions(200);
    let count = AtomicUsize::new(0);
    let endpoint = MockEndpoint::answering(move |_| {
        let place = count.fetch_add(1, Ordering::SeqCst);
        let milliseconds = if place < TOGETHER { 0 } else { 60 };
        // Later outcomes come later, so that none of the good replies falls among the failures.
        thread::sleep(Duration::from_millis(milliseconds));
        if (TOGETHER..TOGETHER + length).contains(&place) {
            Answer::error(500, "x", "out of order")
        } else {
            thread::sleep(Duration::from_millis(2 * milliseconds));
            Answer::text("C")
        }
    });
    let base = endpoint.base_url();
    let line = format!(
        "--data set.jsonl --model m --base-url {base} --levels L0 --retries 0 --concurrency {TOGETHER} --out run"
    );
    let called = bench.call(&words(&line));
    let failed = records(&bench.path("run"));
    let failed = failed.iter().filter(|record| record["outcome"] == "failed");
    (called.code, called.stderr, failed.count())
}

#[test]
fn outage_under_three_windows_survives() {
    let (code, output, failed) = outage(30);
    assert_eq!((code, failed), (Some(1), 30), "{output}");
    let (code, output, failed) = outage(59);
    assert_eq!((code, failed), (Some(1), 59), "{output}");
}

#[test]
fn outage_of_three_windows_stops_run() {
    let (code, output, failed) = outage(1000);
    assert_eq!(code, Some(2), "{output}");
    insta::assert_snapshot!(redacted(&output), @"
    error: http://127.0.0.1:[PORT]/v1: m: 60 trials in a row failed: http://127.0.0.1:[PORT]/v1 answered 500: out
        of order (replies so far are stored; the same command continues)
    ");
    // Those that were under way then, and no more.
    assert!((60..100).contains(&failed), "{failed}: {output}");
}

// ---- The frames that a report shows ----

#[test]
fn thumbnails_follow_lowest_digests() {
    const FRAMES: usize = 60;
    const MOST: usize = 48;
    let bench = Bench::new();
    let mut lines_of = Vec::new();
    for i in 0..FRAMES {
        let name = format!("frame-{i:02}.png");
        fs::create_dir_all(bench.path("frames")).unwrap();
        let picture = image::RgbImage::from_pixel(16, 12, image::Rgb([90, 60 + i as u8, 30]));
        picture.save(bench.path(&format!("frames/{name}"))).unwrap();
        let question = json!({"id": format!("q{i}"), "frame": name, "family": "color", "question": "Which?", "choices": ["red", "blue"], "answer": "red"});
        lines_of.push(question.to_string());
    }
    bench.file("frames/questions.jsonl", lines_of.join("\n"));
    let line = "--data frames --model random --levels L0,L5 --variant noise --out";
    bench.complete(&words(&format!("{line} whole")));
    for part in ["1/3", "2/3", "3/3"] {
        bench.complete(&words(&format!("{line} parts --shard {part}")));
    }
    bench.complete(&words("merge parts --out merged"));
    let mut ranked: Vec<String> = (0..FRAMES).map(|i| format!("frame-{i:02}.png")).collect();
    ranked.sort_by_key(|frame| *Digest::from_bytes(frame.as_bytes()).as_bytes());
    let due: BTreeSet<(String, String)> =
        ranked[..MOST].iter().flat_map(|frame| ["L0", "L5-noise"].map(|at| (frame.clone(), at.to_owned()))).collect();
    let stored = |run: &str| {
        let lines = lines(&bench.path(&format!("{run}/thumbnails.jsonl")));
        let text = |line: &Value, field: &str| line[field].as_str().unwrap().to_owned();
        let places: BTreeSet<(String, String)> =
            lines.iter().map(|line| (text(line, "frame"), text(line, "condition"))).collect();
        assert_eq!(places.len(), lines.len(), "{run}: none twice");
        let images = lines.iter().map(|line| (text(line, "image"), text(line, "crop")));
        (places, images.collect::<BTreeSet<(String, String)>>())
    };
    let (whole, merged) = (stored("whole"), stored("merged"));
    assert_eq!(whole.0, due);
    assert_eq!(whole, merged);
}

// ---- Replies that were cut ----

/// What is said where so many of ten replies were cut at the token limit, with these words.
fn cut_report(cut: usize, output: &Value) -> String {
    let bench = Bench::with_questions(10);
    let cut = std::iter::repeat_n(Answer::message(&json!({"content": output}), "length"), cut);
    let endpoint = MockEndpoint::start(cut.chain([Answer::text("C")]));
    let base = endpoint.base_url();
    let line = format!("--data set.jsonl --model m --base-url {base} --levels L0 --concurrency 1 --out run");
    let called = bench.call(&words(&line));
    assert_eq!(called.code, Some(0), "{called:?}");
    assert_eq!(endpoint.requests().len(), 10);
    called.stderr
}

#[test]
fn truncating_limit_warns() {
    let output = cut_report(6, &Value::Null);
    insta::assert_snapshot!(redacted(&output), @"
    WARN 6 of the first 10 replies were cut at the token limit with no answer: a reasoning model needs a larger
       --max-tokens, or a lower --reasoning-effort
    ");
    let rows = [(5, Value::Null), (10, json!("The answer is C"))];
    check_rows(rows, |(cut, words)| {
        let output = cut_report(cut, &words);
        assert!(!output.contains("replies were cut"), "{output}");
    });
}

// ---- Open questions about enhanced walks ----

const OPEN: &str = "--model m --judge j --levels L0,L3 --llie bright.onnx --llie-anyway --out run --base-url";

/// A house, and a model that makes everything brighter.
fn bright_house() -> House {
    let house = House::new();
    onnx::gain(3.0).write(&house.0.path(""), "bright.onnx");
    house
}

/// The mean code of the images of a request.
fn brightness(request: &Value) -> f64 {
    let parts = request["messages"][0]["content"].as_array().unwrap();
    let urls = parts.iter().filter_map(|part| part["image_url"]["url"].as_str());
    let mut samples = Vec::new();
    for url in urls {
        let file = STANDARD.decode(url.strip_prefix("data:image/png;base64,").unwrap());
        let image = image::load_from_memory(&file.unwrap()).unwrap().into_rgb8();
        samples.extend(image.into_raw());
    }
    let sum: f64 = samples.iter().map(|code| f64::from(*code)).sum();
    sum / samples.len() as f64
}

/// Answers all lines of a batch file, and takes the answers over.
fn answer_batch(house: &House, file: &str, reply: &str) -> Vec<Value> {
    let requests = lines(&house.0.path(file));
    let answers = requests.iter().map(|request| {
        let body = json!({"choices": [{"message": {"content": reply}, "finish_reason": "stop"}]});
        let response = json!({"status_code": 200, "body": body});
        format!("{}\n", json!({"custom_id": request["custom_id"], "response": response, "error": null}))
    });
    house.0.file("out.jsonl", answers.collect::<String>());
    let called = called(&mut house.0.command(&["batch", "import", "run", "out.jsonl"]));
    assert_eq!(called.code, Some(0), "{called:?}");
    requests
}

/// The conditions of what a run holds, answers and marks apart, each as often as it is there.
fn counts(house: &House) -> BTreeMap<String, usize> {
    let mut counts = BTreeMap::new();
    for record in lines(&house.0.path("run/records.jsonl")) {
        let name = record["condition"].as_str().unwrap_or("marks").to_owned();
        *counts.entry(name).or_default() += usize::from(record["failure"].is_null());
    }
    counts
}

#[test]
fn enhanced_walks_use_batch_and_page() {
    let house = bright_house();
    let silent = MockEndpoint::start([Answer::error(400, "bad", "must not be asked")]);
    let line = format!("{OPEN} {}", silent.base_url());
    let batch = format!("{line} --batch");
    let called = house.call(&words(&batch));
    insta::assert_snapshot!(called, @r#"
    exit code: 0
    stdout:
    9 requests in 1 file; 0 already answered, 0 waiting for an earlier batch
    run/batch/1-m-001.jsonl (9 requests)
    upload each file to the Batch API, then run: darkqa-eval batch import run OUTPUT.jsonl ERRORS.jsonl …
    then run the same command again, for the remaining requests and the marks
    stderr:
     WARN 1 of 2 walks has fewer frames than --num-frames 3: they are shown several times in a request, as
        upstream does (the 2 frames of scannet-v0/001-b, for example)
     WARN bright: value ranges of 0..1 in and 0..1 out assumed, because nothing sets them; its images of dark
        frames are plausible. To confirm, add to bright.onnx.toml next to it: `range_in = "0..1"` and `range_out =
        "0..1"`
    "#);
    let requests = answer_batch(&house, "run/batch/1-m-001.jsonl", "It is brown");
    let mut light = BTreeMap::<String, Vec<f64>>::new();
    for trial in lines(&house.0.path("run/batch/trials.jsonl")) {
        let of = requests
            .iter()
            .find(|request| trial["key"].as_str().unwrap().starts_with(request["custom_id"].as_str().unwrap()));
        let condition = trial["condition"].as_str().unwrap().to_owned();
        light.entry(condition).or_default().push(brightness(&of.unwrap()["body"]));
    }
    assert_eq!(light.len(), 3);
    // Three times as bright, but for what noise and rounding leave of it.
    for (raw, enhanced) in light["L3-noise"].iter().zip(&light["L3-noise+bright"]) {
        assert!((2.5 * raw..3.5 * raw).contains(enhanced), "{light:?}");
    }
    let called = house.call(&words(&batch));
    // One mark for each question: all conditions were answered alike.
    insta::assert_snapshot!(called, @"
    exit code: 0
    stdout:
    3 requests in 1 file; 0 already answered, 0 waiting for an earlier batch
    run/batch/1-j-001.jsonl (3 requests)
    upload each file to the Batch API, then run: darkqa-eval batch import run OUTPUT.jsonl ERRORS.jsonl …
    stderr:
     WARN 1 of 2 walks has fewer frames than --num-frames 3: they are shown several times in a request, as
        upstream does (the 2 frames of scannet-v0/001-b, for example)
    ");
    answer_batch(&house, "run/batch/1-j-001.jsonl", "Your mark: 4");
    let called = house.call(&words(&line));
    assert!(
        called.stdout.contains("! bright: 0..1 assumed. Neither sidecar nor preset states its value ranges, and\n")
    );
    assert!(called.stdout.contains("\nbright: 96 × 64: "), "{called:?}");
    insta::assert_snapshot!(called.lines_with("+ bright"), @"
    exit code: 0
     m       with noise + bright          75.0 (0.0)   3 of 3   −72.1 +24.7
     m       with noise + bright   hm3d-v0                        75.0 (0.0)   −57.6 +22.7
    ");
    assert!(silent.requests().is_empty());
    let each = ["L0", "L3-noise", "L3-noise+bright", "marks"];
    assert_eq!(counts(&house), each.map(|name| (name.to_owned(), 3)).into());
    let summary = house.read("run/summary.json");
    let row = summary["rows"].as_array().unwrap().iter().find(|row| row["by"] == "all" && row["enhancer"] == "bright");
    assert_eq!((&row.unwrap()["n"], &row.unwrap()["value"]), (&json!(3), &json!(0.75)));
    let page = fs::read_to_string(house.0.path("run/report.html")).unwrap();
    assert!(page.contains("bright"), "the page names the enhancer");
    assert!(house.0.path("run/upstream/m-L3-noise+bright.json").exists());
}

#[test]
fn stopped_enhanced_walks_resume() {
    let house = bright_house();
    let answered = std::iter::repeat_n(Answer::text("one"), 4);
    let refused = Answer::error(401, "invalid_api_key", "no");
    let first = MockEndpoint::start(answered.chain([refused]));
    let line = format!("{OPEN} {} --concurrency 1", first.base_url());
    let called = house.call(&words(&line));
    assert_eq!(called.code, Some(2), "{called:?}");
    let before = fs::read_to_string(house.0.path("run/records.jsonl")).unwrap();
    assert_eq!(before.lines().count(), 4);
    let well = MockEndpoint::answering(|request| {
        let mark = request["model"] == "j";
        Answer::text(if mark { "5" } else { "one" })
    });
    let line = format!("{OPEN} {} --concurrency 1", well.base_url());
    let called = house.call(&words(&line.replace("--out", "--resume")));
    assert_eq!(called.code, Some(0), "{called:?}");
    // Five answers, and one mark for each question.
    assert_eq!(well.requests().len(), 5 + 3);
    let after = fs::read_to_string(house.0.path("run/records.jsonl")).unwrap();
    assert!(after.starts_with(&before));
    let each = ["L0", "L3-noise", "L3-noise+bright", "marks"];
    assert_eq!(counts(&house), each.map(|name| (name.to_owned(), 3)).into());
    let thumbnails = lines(&house.0.path("run/thumbnails.jsonl"));
    let thumbnails = thumbnails.iter().map(|line| line["condition"].as_str().unwrap());
    assert_eq!(thumbnails.collect::<BTreeSet<&str>>(), each[..3].iter().copied().collect());
}

// ---- Replies without an answer ----

#[test]
fn null_or_refused_reply_is_unanswered() {
    let house = House::new();
    let model = MockEndpoint::start([
        Answer::message(&json!({"content": null}), "stop"),
        Answer::message(&json!({"content": null, "refusal": "I cannot say."}), "stop"),
        Answer::text("No"),
    ]);
    let judge = MockEndpoint::start([Answer::text("5")]);
    let line = format!(
        "--model m --base-url {} --judge j --judge-base-url {} --levels L0 --concurrency 1 --out run",
        model.base_url(),
        judge.base_url()
    );
    let called = house.call(&words(&line));
    assert_eq!(called.code, Some(0), "{called:?}");
    let requests = judge.requests();
    assert_eq!(requests.len(), 1, "the judge is sent what is an answer");
    let prompt = requests[0].json()["messages"][0]["content"].to_string();
    insta::assert_snapshot!(redacted(&prompt), @r#"
    "You are an AI assistant who will help me to evaluate the response given the question and the correct
        answer.\nTo mark a response, you should output a single integer between 1 and 5 (including 1, 5).\n5 means
        that the response perfectly matches the answer.\n1 means that the response is completely different from
        the answer.\n\nExample 1:\nQuestion: Is it overcast?\nAnswer: no\nResponse: yes\nYour mark: 1\n\nExample
        2:\nQuestion: Who is standing at the table?\nAnswer: woman\nResponse: Jessica\nYour mark: 3\n\nExample
        3:\nQuestion: Are there drapes to the right of the bed?\nAnswer: yes\nResponse: yes\nYour mark: 5\n\nYour
        Turn:\nQuestion: Is it “safe”?\nAnswer: No\nResponse: No"
    "#);
    assert_eq!(
        house.read("run/upstream/m-L0.json"),
        json!([
            {"question_id": "q1", "answer": null},
            {"question_id": "q2", "answer": null},
            {"question_id": "q3", "answer": "No"},
        ])
    );
    assert_eq!(house.read("run/upstream/m-L0-j-metrics.json"), json!({"q1": 0, "q2": 0, "q3": 5}));
    let summary = house.read("run/summary.json");
    let row = summary["rows"].as_array().unwrap().iter().find(|row| row["by"] == "all").unwrap();
    assert_eq!((&row["n"], &row["null"]), (&json!(3), &json!(2)));
    assert!((row["value"].as_f64().unwrap() - 1.0 / 3.0).abs() < 1e-12);
    insta::assert_snapshot!(called.lines_with("without an answer"), @r#"
    exit code: 0
    2 without an answer (none in a file, only thoughts, no "A:" of a blind model):
    "#);
    // Asked and answered: the same command asks neither again.
    let again = house.call(&words(&line));
    assert_eq!(again.code, Some(0), "{again:?}");
    assert_eq!((model.requests().len(), judge.requests().len()), (3, 1));
}
