//! The main job from the outside: the program is called as a user calls it.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod support;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io::Cursor;
use std::path::Path;

use serde_json::{Value, json};
use support::endpoint::{Answer, MockEndpoint};
use support::onnx;
use support::run::{Bench, called, files, records};

/// A small PNG with something to see in it.
fn png(shade: u8) -> Vec<u8> {
    let image = image::RgbImage::from_fn(24, 16, |x, y| {
        image::Rgb([shade.wrapping_add((x * 9) as u8), (y * 15) as u8, shade])
    });
    let mut bytes = Cursor::new(Vec::new());
    image.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    bytes.into_inner()
}

/// Two frames with three questions.
fn frames(bench: &Bench) {
    bench.file("frames/a.png", png(20));
    bench.file("frames/b.png", png(120));
    let questions = [
        json!({"id": "a1", "frame": "a.png", "family": "presence", "question": "Is there a \"lamp\" {{here}}?", "choices": ["yes", "no"], "answer": "no"}),
        json!({"id": "a2", "frame": "a.png", "family": "color", "question": "What color?", "choices": ["red", "blue", "green"], "answer": "blue"}),
        json!({"id": "b1", "frame": "b.png", "family": "presence", "question": "Is there a bed?", "choices": ["yes", "no"], "answer": "yes"}),
    ];
    let lines: Vec<String> = questions.iter().map(ToString::to_string).collect();
    bench.file("frames/questions.jsonl", lines.join("\n"));
}

fn text<'a>(record: &'a Value, key: &str) -> &'a str {
    record[key].as_str().unwrap_or("")
}

#[test]
fn the_built_in_rooms_run_without_anything() {
    let bench = Bench::new();
    let words = [
        "--model",
        "observer",
        "--blind-model",
        "observer",
        "--out",
        "run",
    ];
    let table = bench.complete(&words);
    assert!(
        table.contains("untouched")
            && table.contains("with noise")
            && table.contains("observer without images")
            && table.contains("chance: "),
        "{table}"
    );
    let (records, blind): (Vec<Value>, Vec<Value>) = records(&bench.path("run"))
        .into_iter()
        .partition(|record| record["view"] == "image");
    assert_eq!(records.len(), blind.len() * 11);
    assert!(blind.len() >= 12, "{}", blind.len());
    let right = |condition: &str| {
        let of = records
            .iter()
            .filter(|record| record["condition"] == condition);
        of.filter(|record| record["outcome"] == "right").count()
    };
    assert!(right("L0") * 10 >= blind.len() * 9, "{table}");
    let conditions: BTreeSet<&str> = records
        .iter()
        .map(|record| text(record, "condition"))
        .collect();
    assert_eq!(conditions.len(), 11);
    let manifest: Value =
        serde_json::from_slice(&fs::read(bench.path("run/manifest.json")).unwrap()).unwrap();
    assert_eq!(
        (&manifest["status"], &manifest["counts"]["answered"]),
        (&json!("complete"), &json!(blind.len() * 12))
    );
}

#[test]
fn every_condition_runs_raw_and_enhanced() {
    let bench = Bench::new();
    frames(&bench);
    onnx::gain(3.0).write(&bench.path(""), "bright.onnx");
    onnx::gamma(0.5).write(&bench.path(""), "curve.onnx");
    let words = [
        "--data",
        "frames",
        "--model",
        "random",
        "--llie",
        "bright.onnx",
        "--llie",
        "curve.onnx",
        "--out",
        "run",
    ];
    let table = bench.complete(&words);
    assert!(
        table.contains("with noise + bright") && table.contains("with noise + curve"),
        "{table}"
    );
    let records = records(&bench.path("run"));
    // L0, five of each variant, five for each enhancer on noise.
    assert_eq!(records.len(), 3 * (1 + 5 + 5 + 5 + 5));
    let digest = |condition: &str, frame: &str| {
        let of = |record: &&Value| {
            text(record, "condition") == condition && text(record, "frame") == frame
        };
        let digests: BTreeSet<String> = records
            .iter()
            .filter(of)
            .map(|record| record["image"]["digest"].to_string())
            .collect();
        assert_eq!(
            digests.len(),
            1,
            "one image for all questions of {condition}"
        );
        digests.into_iter().next().unwrap()
    };
    let shown: BTreeSet<String> = [
        "L0",
        "L1-ev",
        "L1-noise",
        "L1-noise+bright",
        "L1-noise+curve",
    ]
    .iter()
    .map(|c| digest(c, "b.png"))
    .collect();
    assert_eq!(shown.len(), 5, "five different images");
}

#[test]
fn a_record_and_a_row_keep_the_contract() {
    let bench = Bench::new();
    frames(&bench);
    bench.file("script.jsonl", "{\"question\":\"a1\",\"reply\":\"No.\"}\n{\"question\":\"b1\",\"condition\":\"L1-ev\",\"reply\":\"too dark to see\"}\n{\"default\":\"**A**\"}\n");
    let table = bench.complete(&[
        "--data",
        "frames",
        "--model",
        "script:script.jsonl",
        "--levels",
        "L0,L1",
        "--variant",
        "ev",
        "--out",
        "run",
    ]);
    assert!(
        table.contains("(66.7)"),
        "the lenient reading differs: {table}"
    );
    let records = records(&bench.path("run"));
    let record = records
        .iter()
        .find(|r| text(r, "question") == "b1" && text(r, "condition") == "L1-ev")
        .unwrap();
    let keys: Vec<&str> = record
        .as_object()
        .unwrap()
        .keys()
        .map(String::as_str)
        .collect();
    for key in [
        "key",
        "question",
        "frame",
        "family",
        "model",
        "view",
        "condition",
        "level",
        "variant",
        "ev",
        "reading",
        "enhancer",
        "choices",
        "truth",
        "reply",
        "strict",
        "lenient",
        "outcome",
        "failure",
        "usage",
        "latency_ms",
        "attempts",
        "image",
    ] {
        assert!(keys.contains(&key), "{key} of {keys:?}");
    }
    assert_eq!(
        (
            text(record, "level"),
            text(record, "variant"),
            text(record, "outcome")
        ),
        ("L1", "ev", "unparsed")
    );
    assert_eq!(record["ev"], 2.0);
    assert_eq!(record["reading"], Value::Null);
    assert_eq!(record["strict"], json!({"chosen": null, "why": "refused"}));
    assert_eq!(record["image"]["format"], "png");

    let csv = fs::read_to_string(bench.path("run/summary.csv")).unwrap();
    let mut lines = csv.lines();
    assert_eq!(
        lines.next().unwrap(),
        "model,view,level,variant,enhancer,family,mode,n,right,unparsed,failed,value,low,high,reading"
    );
    let all: Vec<&str> = lines.filter(|line| line.contains(",all,")).collect();
    // a1 is right both times; a2 and b1 say **A**, which is not strict: b1's A is right in the lenient reading.
    assert!(
        all.iter()
            .any(|line| line.contains(",L0,none,,all,strict,3,1,2,0,0.333")),
        "{csv}"
    );
    assert!(
        all.iter()
            .any(|line| line.contains(",L0,none,,all,lenient,3,2,0,0,0.666")),
        "{csv}"
    );
    assert!(
        all.iter()
            .any(|line| line.contains(",L1,ev,,all,lenient,3,1,1,0,0.333")),
        "{csv}"
    );
    assert!(
        all.iter()
            .any(|line| line.starts_with("chance,,,none,,all,strict,3,,0,0,0.4444")),
        "{csv}"
    );
}

#[test]
fn words_are_the_same_bytes_in_every_condition() {
    let bench = Bench::new();
    frames(&bench);
    let endpoint = MockEndpoint::start([Answer::text("A")]);
    let url = endpoint.base_url();
    bench.complete(&[
        "--data",
        "frames",
        "--model",
        "m",
        "--base-url",
        &url,
        "--levels",
        "L0,L5",
        "--out",
        "run",
    ]);
    let mut by_words = BTreeMap::<String, Vec<String>>::new();
    for request in endpoint.requests() {
        let content = request.json()["messages"][0]["content"].clone();
        assert_eq!(
            (&content[0]["type"], &content[1]["type"]),
            (&json!("text"), &json!("image_url"))
        );
        let image = text(&content[1]["image_url"], "url").to_owned();
        by_words
            .entry(text(&content[0], "text").to_owned())
            .or_default()
            .push(image);
    }
    assert_eq!(by_words.len(), 3);
    assert!(
        by_words
            .keys()
            .any(|words| words.contains("Is there a \"lamp\" {{here}}?\nA. yes\nB. no\n")),
        "{:?}",
        by_words.keys()
    );
    for images in by_words.values() {
        let different: BTreeSet<&String> = images.iter().collect();
        assert_eq!(
            (images.len(), different.len()),
            (3, 3),
            "L0, L5-ev, L5-noise"
        );
    }
}

#[test]
fn the_untouched_file_itself_is_sent() {
    use base64::Engine as _;
    let bench = Bench::new();
    frames(&bench);
    let endpoint = MockEndpoint::start([Answer::text("A")]);
    let url = endpoint.base_url();
    bench.complete(&[
        "--data",
        "frames",
        "--model",
        "m",
        "--base-url",
        &url,
        "--levels",
        "L0",
        "--limit",
        "1",
        "--out",
        "run",
    ]);
    let request = endpoint.requests()[0].json();
    let url = text(&request["messages"][0]["content"][1]["image_url"], "url").to_owned();
    let sent = base64::engine::general_purpose::STANDARD
        .decode(url.strip_prefix("data:image/png;base64,").unwrap())
        .unwrap();
    assert_eq!(sent, fs::read(bench.path("frames/a.png")).unwrap());
}

#[test]
fn a_stopped_run_goes_on_where_it_stopped() {
    let bench = Bench::new();
    frames(&bench);
    let words = |url: &str| -> Vec<String> {
        let words = [
            "--data",
            "frames",
            "--model",
            "m",
            "--base-url",
            url,
            "--levels",
            "L0-L2",
            "--concurrency",
            "1",
        ];
        words.iter().map(|&word| word.to_owned()).collect()
    };
    let answers = std::iter::repeat_n(Answer::text("A"), 4)
        .chain([Answer::error(401, "invalid_api_key", "no such key")])
        .chain([Answer::text("B")]);
    let endpoint = MockEndpoint::start(answers);
    let url = endpoint.base_url();
    let words: Vec<String> = words(&url);
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    let stopped = bench.call(&words);
    assert_eq!(stopped.code, Some(2), "{stopped:?}");
    assert!(stopped.stderr.contains("no such key"), "{stopped:?}");
    let runs: Vec<_> = fs::read_dir(bench.path("results"))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    assert_eq!((runs.len(), records(&runs[0]).len()), (1, 4));

    bench.complete(&words);
    assert_eq!(
        endpoint.requests().len(),
        15 + 1,
        "3 questions in 5 conditions, and the one that was refused"
    );
    assert_eq!(records(&runs[0]).len(), 15);

    let table = bench.complete(&words);
    assert!(table.contains("exposure drop"), "{table}");
    assert_eq!(
        endpoint.requests().len(),
        15 + 1,
        "a complete run asks nothing"
    );
}

#[test]
fn a_torn_record_is_asked_again_and_nothing_else() {
    let bench = Bench::new();
    frames(&bench);
    let endpoint = MockEndpoint::start([Answer::text("A")]);
    let url = endpoint.base_url();
    let words = [
        "--data",
        "frames",
        "--model",
        "m",
        "--base-url",
        &url,
        "--levels",
        "L0",
        "--out",
        "run",
    ];
    bench.complete(&words);
    let path = bench.path("run/records.jsonl");
    let kept = fs::read(&path).unwrap();
    fs::write(&path, &kept[..kept.len() - 20]).unwrap();
    let manifest = fs::read_to_string(bench.path("run/manifest.json")).unwrap();
    bench.file(
        "run/manifest.json",
        manifest.replace("\"complete\"", "\"started\""),
    );
    bench.complete(&words);
    assert_eq!(
        (records(&bench.path("run")).len(), endpoint.requests().len()),
        (3, 4)
    );
}

#[test]
fn failed_trials_are_counted_apart_and_asked_again() {
    let bench = Bench::new();
    frames(&bench);
    let broken = Answer::error(400, "bad_image", "cannot look at this");
    let endpoint = MockEndpoint::start([Answer::text("B"), broken, Answer::text("A")]);
    let url = endpoint.base_url();
    let words = [
        "--data",
        "frames",
        "--model",
        "m",
        "--base-url",
        &url,
        "--levels",
        "L0",
        "--concurrency",
        "1",
        "--out",
        "run",
    ];
    let first = bench.call(&words);
    assert_eq!(first.code, Some(1), "{first:?}");
    let csv = fs::read_to_string(bench.path("run/summary.csv")).unwrap();
    assert!(
        csv.contains("m,image,L0,none,,all,strict,2,2,0,1,1"),
        "{csv}"
    );
    let failed = records(&bench.path("run"))
        .into_iter()
        .find(|record| record["outcome"] == "failed")
        .unwrap();
    assert_eq!(
        (&failed["failure"]["status"], &failed["strict"]),
        (&json!(400), &Value::Null)
    );
    bench.complete(&words);
    assert_eq!(
        endpoint.requests().len(),
        4,
        "only the failed one is asked again"
    );
}

#[test]
fn another_configuration_on_the_same_folder_is_refused() {
    let bench = Bench::new();
    bench.complete(&["--model", "random", "--levels", "L0", "--out", "run"]);
    for (more, field) in [
        (["--seed", "7"], "--seed"),
        (["--image", "jpeg:90"], "--image"),
    ] {
        let mut words = vec!["--model", "random", "--levels", "L0", "--out", "run"];
        words.extend(more);
        let refused = bench.call(&words);
        assert_eq!(refused.code, Some(2), "{refused:?}");
        assert!(
            refused.stderr.contains(&format!("another {field}")),
            "{refused:?}"
        );
    }
}

#[test]
fn threads_and_order_change_no_byte() {
    let bench = Bench::new();
    frames(&bench);
    let images = |run: &str, threads: &str, concurrency: &str| {
        bench.complete(&[
            "--data",
            "frames",
            "--model",
            "random",
            "--threads",
            threads,
            "--concurrency",
            concurrency,
            "--out",
            run,
        ]);
        let digests: BTreeMap<String, String> = records(&bench.path(run))
            .iter()
            .map(|r| (r["key"].to_string(), r["image"]["digest"].to_string()))
            .collect();
        (
            digests,
            fs::read(bench.path(run).join("summary.csv")).unwrap(),
        )
    };
    assert_eq!(images("one", "1", "1"), images("many", "5", "16"));
}

#[test]
fn the_reference_run_is_made_again() {
    let bench = Bench::new();
    bench.complete(&[
        "--model",
        "observer",
        "--data",
        "rooms:frames=12,size=320x240",
        "--levels",
        "L0,L3",
        "--out",
        "run",
    ]);
    let reference = Path::new(env!("CARGO_MANIFEST_DIR")).join("results/reference");
    let made = |run: &Path| -> BTreeMap<String, Value> {
        let kept = records(run).into_iter();
        kept.map(|record| (record["key"].to_string(), record))
            .collect()
    };
    // Trials, choices, replies and the very files that were sent, whatever machine made them.
    assert_eq!(made(&bench.path("run")), made(&reference));
    for name in [
        "summary.csv",
        "comparisons.csv",
        "thresholds.csv",
        "figures/accuracy.svg",
    ] {
        let file = |run: &Path| fs::read_to_string(run.join(name)).unwrap();
        assert_eq!(file(&bench.path("run")), file(&reference), "{name}");
    }
}

#[test]
fn a_blind_model_sees_words_alone() {
    let bench = Bench::new();
    frames(&bench);
    let endpoint = MockEndpoint::start([Answer::text("A")]);
    let url = endpoint.base_url();
    let words = [
        "--data",
        "frames",
        "--model",
        "random",
        "--blind-model",
        "gpt",
        "--base-url",
        &url,
        "--levels",
        "L0",
        "--out",
        "run",
    ];
    let table = bench.complete(&words);
    assert!(
        table.contains("gpt without images: 33.3 ±")
            && table.contains(", n 3, unparsed 0, failed 0"),
        "{table}"
    );
    let requests = endpoint.requests();
    assert_eq!(requests.len(), 3, "once a question, not once a condition");
    assert!(
        requests
            .iter()
            .all(|request| !String::from_utf8_lossy(&request.body).contains("image_url"))
    );
    let blind = records(&bench.path("run"))
        .into_iter()
        .find(|record| record["view"] == "blind")
        .unwrap();
    assert_eq!(
        (&blind["condition"], &blind["image"], &blind["level"]),
        (&Value::Null, &Value::Null, &Value::Null)
    );
}

#[test]
fn ready_made_sets_are_read() {
    use base64::Engine as _;
    let bench = Bench::new();
    bench.file("set/one.png", png(20));
    bench.file("set/paths.tsv", "index\tquestion\thint\tA\tB\tC\tanswer\tcategory\timage_path\n1\t\"What,\nnow?\"\tLook closely.\tred\t\tblue\tC\tcolor\tone.png\n2\tAnd?\t\tyes\tno\t\tA\tOCR\tone.png\n");
    let file = base64::engine::general_purpose::STANDARD.encode(png(50));
    bench.file("set/base64.tsv", format!("index\timage\tquestion\tA\tB\tanswer\n7\t{file}\tWhat?\tred\tblue\tB\n8\t7\tAnd?\tyes\tno\tA\n"));
    bench.file("set/lines.jsonl", "{\"id\":1,\"image\":\"one.png\",\"question\":\"What?\",\"choices\":[\"red\",\"blue\"],\"answer\":\"blue\",\"family\":\"color\"}\n");
    bench.file("script.jsonl", "{\"default\":\"B\"}\n");
    for (set, n, right) in [
        ("paths.tsv", 2, 1),
        ("base64.tsv", 2, 1),
        ("lines.jsonl", 1, 1),
    ] {
        let data = format!("set/{set}");
        bench.complete(&[
            "--data",
            &data,
            "--model",
            "script:script.jsonl",
            "--levels",
            "L0,L3",
            "--out",
            set,
        ]);
        let records = records(&bench.path(set));
        assert_eq!(records.len(), n * 3, "{set}");
        let seen = records
            .iter()
            .filter(|r| r["condition"] == "L3-noise" && r["outcome"] == "right")
            .count();
        assert_eq!(seen, right, "{set}");
        assert!(
            records.iter().all(|record| record["image"]["width"] == 24),
            "{set}"
        );
    }
    let of_paths = records(&bench.path("paths.tsv"));
    let first = of_paths
        .iter()
        .find(|record| record["question"] == "1")
        .unwrap();
    assert_eq!(
        first["choices"],
        json!(["red", "blue"]),
        "an empty cell is no choice"
    );
}

#[test]
fn a_broken_image_is_found_before_anything_is_asked() {
    let bench = Bench::new();
    frames(&bench);
    let whole = png(20);
    let endpoint = MockEndpoint::start([Answer::text("A")]);
    let url = endpoint.base_url();
    let mut corrupt = whole.clone();
    let middle = corrupt.len() / 2;
    corrupt[middle] ^= 0x40;
    for (broken, says) in [
        (&whole[..whole.len() - 40], "ends before"),
        (&corrupt, "checksum"),
    ] {
        bench.file("frames/a.png", broken);
        let run = bench.call(&[
            "--data",
            "frames",
            "--model",
            "m",
            "--base-url",
            &url,
            "--levels",
            "L0",
            "--out",
            "run",
        ]);
        assert_eq!(run.code, Some(2), "{run:?}");
        assert!(
            run.stderr.contains("a.png: not a whole image") && run.stderr.contains(says),
            "{run:?}"
        );
    }
    assert_eq!(endpoint.requests().len(), 0);
}

#[test]
fn the_key_is_nowhere() {
    const KEY: &str = "sk-very-secret-0123456789";
    let bench = Bench::new();
    frames(&bench);
    let echo = Answer::error(400, "bad", &format!("your key {KEY} may not do that"));
    let endpoint =
        MockEndpoint::start([Answer::text(&format!("A {KEY}")), echo, Answer::text("B")]);
    let url = endpoint.base_url();
    let mut command = bench.command(&[
        "--data",
        "frames",
        "--model",
        "m",
        "--base-url",
        &url,
        "--levels",
        "L0",
        "--concurrency",
        "1",
        "--out",
        "run",
    ]);
    let run = called(command.env("OPENAI_API_KEY", KEY).env("RUST_LOG", "trace"));
    assert_eq!(
        endpoint.requests()[0].header("authorization"),
        Some(format!("Bearer {KEY}").as_str())
    );
    assert!(
        !run.stderr.contains(KEY) && !run.stdout.contains(KEY),
        "{run:?}"
    );
    for file in files(&bench.path("run")) {
        let content = fs::read(&file).unwrap();
        assert!(
            !String::from_utf8_lossy(&content).contains(KEY),
            "{}",
            file.display()
        );
    }
}

#[test]
fn json_is_the_summary() {
    let bench = Bench::new();
    let output = bench.complete(&[
        "--model", "random", "--levels", "L0", "--json", "--out", "run",
    ]);
    let summary: Value = serde_json::from_str(&output).unwrap();
    assert_eq!(summary["run"]["status"], "complete");
    assert_eq!(summary["folder"], "run");
    let kept = fs::read(bench.path("run/summary.json")).unwrap();
    let kept: Value = serde_json::from_slice(&kept).unwrap();
    assert_eq!(summary["rows"], kept["rows"]);
}

#[cfg(unix)]
#[test]
fn an_interrupt_keeps_what_was_answered() {
    use std::process::{Command, Stdio};
    use std::time::Duration;

    let bench = Bench::new();
    frames(&bench);
    let endpoint = MockEndpoint::start([Answer::text("A"), Answer::silent()]);
    let url = endpoint.base_url();
    let mut program = Command::new(assert_cmd::cargo::cargo_bin("darkqa-eval"))
        .args([
            "--data",
            "frames",
            "--model",
            "m",
            "--base-url",
            &url,
            "--levels",
            "L0",
            "--concurrency",
            "1",
            "--out",
            "run",
        ])
        .current_dir(bench.path(""))
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    while endpoint.requests().len() < 2 {
        std::thread::sleep(Duration::from_millis(5));
    }
    // The first asks to stop; the request that is never answered is given up by the second alone.
    interrupt(&program);
    std::thread::sleep(Duration::from_millis(300));
    assert!(
        program.try_wait().unwrap().is_none(),
        "what is on the wire is waited for"
    );
    interrupt(&program);
    assert_eq!(program.wait().unwrap().code(), Some(130));
    assert_eq!(records(&bench.path("run")).len(), 1);
    let manifest = fs::read_to_string(bench.path("run/manifest.json")).unwrap();
    assert!(manifest.contains("\"cancelled\""), "{manifest}");
}

#[cfg(unix)]
fn interrupt(program: &std::process::Child) {
    let signal = ["-INT", &program.id().to_string()];
    std::process::Command::new("kill")
        .args(signal)
        .status()
        .unwrap();
}

#[cfg(unix)]
#[test]
fn an_interrupt_does_not_wait_for_retries() {
    use std::process::{Command, Stdio};
    use std::time::Duration;

    let bench = Bench::new();
    frames(&bench);
    let later = Answer::error(429, "slow_down", "later").header("retry-after", "100");
    let endpoint = MockEndpoint::start([Answer::text("A"), later]);
    let url = endpoint.base_url();
    let program = Command::new(assert_cmd::cargo::cargo_bin("darkqa-eval"))
        .args([
            "--data",
            "frames",
            "--model",
            "m",
            "--base-url",
            &url,
            "--levels",
            "L0",
            "--concurrency",
            "1",
            "--out",
            "run",
        ])
        .current_dir(bench.path(""))
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    while endpoint.requests().len() < 2 {
        std::thread::sleep(Duration::from_millis(5));
    }
    std::thread::sleep(Duration::from_millis(100));
    interrupt(&program);
    // Would take 100 s otherwise, and the run of the tests with it.
    let output = program.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130));
    let table = String::from_utf8(output.stdout).unwrap();
    assert!(
        table.starts_with("cancelled: 1 of 3 trials answered, 0 failed"),
        "{table}"
    );
    assert_eq!(
        records(&bench.path("run")).len(),
        1,
        "what was given up has not failed"
    );
}

#[test]
fn a_model_that_does_not_exist_stops_itself_alone() {
    let bench = Bench::new();
    frames(&bench);
    let endpoint = MockEndpoint::start([Answer::error(404, "model_not_found", "no such model")]);
    let url = endpoint.base_url();
    let run = bench.call(&[
        "--data",
        "frames",
        "--model",
        "random",
        "--model",
        "gone",
        "--base-url",
        &url,
        "--levels",
        "L0-L2",
        "--out",
        "run",
    ]);
    assert_eq!(run.code, Some(2), "{run:?}");
    assert!(
        run.stderr.contains("gone") && run.stderr.contains("no such model"),
        "{run:?}"
    );
    let csv = fs::read_to_string(bench.path("run/summary.csv")).unwrap();
    assert!(
        csv.contains("random,image,L2,noise,,all,strict,3,") && !csv.contains("gone"),
        "{csv}"
    );
}

#[test]
fn an_endpoint_that_is_not_there_is_noticed_by_its_first_failures() {
    let bench = Bench::new();
    frames(&bench);
    let free = std::net::TcpListener::bind("127.0.0.1:0")
        .unwrap()
        .local_addr()
        .unwrap();
    let url = format!("http://{free}/v1");
    let run = bench.call(&[
        "--data",
        "frames",
        "--model",
        "m",
        "--base-url",
        &url,
        "--retries",
        "0",
        "--concurrency",
        "1",
        "--out",
        "run",
    ]);
    assert_eq!(run.code, Some(2), "{run:?}");
    assert!(
        run.stderr.contains("m: 5 trials in a row failed"),
        "{run:?}"
    );
    assert_eq!(records(&bench.path("run")).len(), 5);
}

#[test]
fn an_image_that_changes_under_way_is_not_taken_for_the_old_one() {
    let bench = Bench::new();
    frames(&bench);
    let later = Answer::error(429, "slow_down", "later").header("retry-after", "1");
    let endpoint = MockEndpoint::start([later, Answer::text("A")]);
    let url = endpoint.base_url();
    let changed = bench.path("frames/b.png");
    let run = std::thread::scope(|scope| {
        scope.spawn(|| {
            while endpoint.requests().is_empty() {
                std::thread::sleep(std::time::Duration::from_millis(5));
            }
            fs::write(&changed, png(200)).unwrap();
        });
        bench.call(&[
            "--data",
            "frames",
            "--model",
            "m",
            "--base-url",
            &url,
            "--concurrency",
            "1",
            "--out",
            "run",
        ])
    });
    assert_eq!(run.code, Some(1), "{run:?}");
    let of_b: Vec<Value> = records(&bench.path("run"))
        .into_iter()
        .filter(|record| record["frame"] == "b.png")
        .collect();
    assert_eq!(of_b.len(), 11);
    assert!(
        of_b.iter()
            .all(|record| text(&record["failure"], "message").contains("changed while the run")),
        "{of_b:?}"
    );
}

#[test]
fn an_enhancer_that_fails_is_found_before_anything_is_asked() {
    let bench = Bench::new();
    frames(&bench);
    onnx::not_a_number().write(&bench.path(""), "nan.onnx");
    let endpoint = MockEndpoint::start([Answer::text("A")]);
    let url = endpoint.base_url();
    let run = bench.call(&[
        "--data",
        "frames",
        "--model",
        "m",
        "--base-url",
        &url,
        "--llie",
        "nan.onnx",
        "--out",
        "run",
    ]);
    assert_eq!(run.code, Some(2), "{run:?}");
    assert!(
        run.stderr.contains("nan.onnx") && run.stderr.contains("NaN"),
        "{run:?}"
    );
    assert_eq!(endpoint.requests().len(), 0);
}

#[test]
fn kept_replies_are_read_as_new_ones() {
    let bench = Bench::new();
    frames(&bench);
    bench.file("script.jsonl", "{\"default\":\"A\"}\n");
    let words = [
        "--data",
        "frames",
        "--model",
        "script:script.jsonl",
        "--levels",
        "L0",
        "--out",
        "run",
    ];
    let table = bench.complete(&words);
    let path = bench.path("run/records.jsonl");
    let records = fs::read_to_string(&path).unwrap();
    fs::write(&path, records.replace("\"chosen\":0", "\"chosen\":1")).unwrap();
    assert_eq!(bench.complete(&words), table);
}

#[test]
fn two_scripts_that_say_the_same_are_two_models() {
    let bench = Bench::new();
    frames(&bench);
    for script in ["one.jsonl", "two.jsonl"] {
        bench.file(script, "{\"default\":\"A\"}\n");
    }
    bench.complete(&[
        "--data",
        "frames",
        "--model",
        "script:one.jsonl",
        "--model",
        "script:two.jsonl",
        "--levels",
        "L0",
        "--out",
        "run",
    ]);
    assert_eq!(records(&bench.path("run")).len(), 6);
}

#[test]
fn showing_a_complete_run_changes_nothing() {
    let bench = Bench::new();
    let words = ["--model", "random", "--levels", "L0", "--out", "run"];
    let table = bench.complete(&words);
    let kept = |name: &str| fs::read(bench.path("run").join(name)).unwrap();
    let before = ["manifest.json", "summary.json", "records.jsonl"].map(kept);
    let mut again = words.to_vec();
    again.extend(["--concurrency", "3"]);
    assert_eq!(bench.complete(&again), table);
    assert_eq!(
        ["manifest.json", "summary.json", "records.jsonl"].map(kept),
        before
    );
}
