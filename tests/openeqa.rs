//! `openeqa` end to end: prompts byte for byte, marks, upstream's files, what is missing, resume, batch, people.

#![allow(clippy::unwrap_used)]

mod support;

use std::collections::BTreeSet;
use std::fs;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use image::{Rgb, RgbImage};
use serde_json::{Value, json};

use support::endpoint::{Answer, MockEndpoint, Request};
use support::house::{House, flags};
use support::run::{called, records};

/// Upstream's prompt for an answer with images, up to them.
const VISION: &str = "You are an intelligent question answering agent. I will ask you questions about an indoor space and you must provide an answer.\n\
You will be shown a set of images that have been collected from a single location.\n\
Given a user query, you must output `text` to answer to the question asked by the user.\n";

/// What an endpoint was sent.
fn sent(mock: &MockEndpoint) -> Vec<Value> {
    mock.requests().iter().map(Request::json).collect()
}

/// The words of a request, with a mark for each image.
fn words(request: &Value) -> String {
    let content = &request["messages"][0]["content"];
    if let Some(text) = content.as_str() {
        return text.to_owned();
    }
    let parts = content.as_array().unwrap().iter();
    parts
        .map(|part| part["text"].as_str().unwrap_or("[image]"))
        .collect()
}

/// The images of a request.
fn images(request: &Value) -> Vec<RgbImage> {
    let parts = request["messages"][0]["content"].as_array().unwrap();
    let urls = parts
        .iter()
        .filter_map(|part| part["image_url"]["url"].as_str());
    urls.map(|url| {
        let file = STANDARD.decode(url.strip_prefix("data:image/png;base64,").unwrap());
        image::load_from_memory(&file.unwrap()).unwrap().into_rgb8()
    })
    .collect()
}

fn check_asked(asked: &[Value]) {
    let queries = ["What colour is it?", "Where's the {sofa}?", "Is it “safe”?"];
    for (request, query) in asked.iter().zip(queries) {
        assert_eq!(
            words(request),
            format!("{VISION}[image][image][image]User Query: {query}")
        );
        let fields: Vec<&str> = request
            .as_object()
            .unwrap()
            .keys()
            .map(|key| &**key)
            .collect();
        assert_eq!(
            fields.into_iter().collect::<BTreeSet<_>>(),
            ["model", "temperature", "seed", "max_tokens", "messages"].into()
        );
        assert_eq!(
            json!([
                request["model"],
                request["temperature"],
                request["seed"],
                request["max_tokens"]
            ]),
            json!(["m", 0.2, 1234, 128])
        );
    }
    // Frames 0, 2 and 4 of five; of two: 0, round-half-even(0.5) = 0, and 1.
    let greys = |request: &Value| -> Vec<u8> {
        let images = images(request);
        assert!(images.iter().all(|image| image.dimensions() == (48, 32)));
        images
            .iter()
            .map(|image| image.get_pixel(9, 9)[0])
            .collect()
    };
    assert_eq!(greys(&asked[0]), [100, 140, 180]);
    assert_eq!(greys(&asked[2]), [100, 100, 120]);
}

fn check_judged(judged: &[Value]) {
    let ends = [
        "Your Turn:\nQuestion: What colour is it?\nAnswer: brown\nResponse: It's brown.",
        "Your Turn:\nQuestion: Where's the {sofa}?\nAnswer: Near the café's door\nExtra Answers: ['By the stairs', \"it's here\", \
         '\"both\" it\\'s', '日本']\nResponse: Near it",
        "Your Turn:\nQuestion: Is it “safe”?\nAnswer: No\nResponse: No",
    ];
    for (request, end) in judged.iter().zip(ends) {
        let prompt = words(request);
        assert!(prompt.ends_with(end), "{prompt}");
        assert!(
            prompt.starts_with("You are an AI assistant who will help me to evaluate the response")
        );
        assert_eq!(
            json!([
                request["model"],
                request["temperature"],
                request["seed"],
                request["max_tokens"]
            ]),
            json!(["j", 0.2, 1234, 32])
        );
    }
}

#[test]
fn every_prompt_is_upstreams_byte_for_byte() {
    let house = House::new();
    let model = MockEndpoint::start([
        Answer::text("It's brown. It may"),
        Answer::text("Near it"),
        Answer::text("No"),
    ]);
    let judge = MockEndpoint::start([
        Answer::text("5"),
        Answer::text("Your mark: 3"),
        Answer::text("1"),
    ]);
    let called = house.call(&[
        "--model",
        "m",
        "--base-url",
        &model.base_url(),
        "--judge",
        "j",
        "--judge-base-url",
        &judge.base_url(),
        "--levels",
        "L0",
        "--concurrency",
        "1",
        "--out",
        "run",
    ]);
    assert_eq!(called.code, Some(0), "{called:?}");
    let (asked, judged) = (sent(&model), sent(&judge));
    assert_eq!((asked.len(), judged.len()), (3, 3));
    check_asked(&asked);
    check_judged(&judged);
    assert_eq!(
        house.read("run/upstream/m-L0.json"),
        json!([
            {"question_id": "q1", "answer": "It's brown. It may"},
            {"question_id": "q2", "answer": "Near it"},
            {"question_id": "q3", "answer": "No"},
        ])
    );
    assert_eq!(
        house.read("run/upstream/m-L0-j-metrics.json"),
        json!({"q1": 5, "q2": 3, "q3": 1})
    );
    assert!(
        called.stdout.contains("3 of 3 answers scored\n1 cut after"),
        "{}",
        called.stdout
    );
}

#[test]
fn blind_models_are_asked_and_read_as_upstream_does() {
    let house = House::new();
    let model = MockEndpoint::start([
        Answer::text("A: a bed\nExplanation: x"),
        Answer::text("I cannot see."),
        Answer::text("A: yes"),
    ]);
    let base = model.base_url();
    let asked = [
        "--blind-model",
        "m",
        "--base-url",
        &base,
        "--concurrency",
        "1",
    ];
    let called = house.call(&[&asked[..], &["--judge", "script:j.jsonl", "--out", "run"]].concat());
    assert_eq!(called.code, Some(2), "{called:?}");
    house.0.file("j.jsonl", "{\"default\": \"5\"}");
    let called = house.call(&[&asked[..], &["--judge", "script:j.jsonl", "--out", "run"]].concat());
    assert_eq!(called.code, Some(0), "{called:?}");
    let request = model.requests()[0].json();
    let prompt = request["messages"][0]["content"].as_str().unwrap();
    assert!(prompt.ends_with("\n\nQ: What colour is it?"), "{prompt}");
    // Two marks of 5 and an answer that is none.
    assert!(
        called.stdout.contains("m without images: 66.7 ±"),
        "{}",
        called.stdout
    );
    assert!(
        called.stdout.contains("1 without an answer"),
        "{}",
        called.stdout
    );
    assert_eq!(
        house.read("run/upstream/m-blind.json")[1]["answer"],
        Value::Null
    );
    assert_eq!(
        house.read("run/upstream/m-blind-script_j.jsonl-metrics.json")["q2"],
        0
    );
}

#[test]
fn marks_come_to_upstreams_score() {
    let house = House::new();
    // [5, 5, 3, 1, null] of upstream's own arithmetic, by people's answers at L0 and L2.
    let people = json!([
        {"question_id": "q1", "answer": "brown", "annotator": 1},
        {"question_id": "q2", "answer": "at the door", "annotator": 1},
        {"question_id": "q3", "answer": "perhaps", "annotator": 1},
        {"question_id": "q1", "answer": "red", "annotator": "two"},
        {"question_id": "q2", "answer": null, "annotator": "two"},
        {"question_id": "q1", "answer": "brown", "level": "L2", "annotator": 1},
        {"question_id": "strange", "answer": "x"},
    ]);
    house.0.file("people.json", people.to_string());
    // Question by question, and of each question in the order of the file.
    let marks = ["5", "1", "5", "3"].map(Answer::text);
    let judge = MockEndpoint::start(marks);
    let called = house.call(&[
        "--answers",
        "human=people.json",
        "--judge",
        "j",
        "--judge-base-url",
        &judge.base_url(),
        "--concurrency",
        "1",
        "--out",
        "run",
    ]);
    assert_eq!(called.code, Some(0), "{called:?}");
    let dark = records(&house.0.path("run")).into_iter();
    let dark: Vec<Value> = dark.filter(|record| record["level"] == "L2").collect();
    assert_eq!(
        (&dark[0]["ev"], &dark[0]["reading"]),
        (&json!(4.0), &json!("paper"))
    );
    // What was answered alike at L2 is not judged again.
    assert_eq!(judge.requests().len(), 4);
    let summary = house.read("run/summary.json");
    let row = |level: &str| {
        let rows = summary["rows"].as_array().unwrap().iter();
        let mut rows = rows.filter(|row| row["by"] == "all" && row["level"] == level);
        rows.next().unwrap().clone()
    };
    let lit = row("L0");
    assert_eq!(
        (&lit["value"], &lit["n"], &lit["null"]),
        (&json!(0.5), &json!(5), &json!(1))
    );
    let dark = row("L2");
    // The first question alone is there in both: 1 against (1 + 0) / 2.
    assert_eq!((&dark["drop"], &dark["drop_n"]), (&json!(0.5), &json!(1)));
    assert!(
        called
            .stderr
            .contains("1 of 7 answers are to questions that are not asked: strange")
    );
    // Several people's answers are no file of upstream's, which has one a question.
    assert!(!house.0.path("run/upstream/human-L0.json").exists());
    assert!(house.0.path("run/upstream/human-L2-noise.json").exists());
}

#[test]
fn what_is_missing_is_named_and_counted_and_nothing_is_lost() {
    let house = House::new();
    fs::remove_dir_all(house.0.path("walks/scannet-v0")).unwrap();
    house.0.file("a.jsonl", "{\"default\": \"an answer\"}");
    house.0.file(
        "j.jsonl",
        "{\"question\": \"q1\", \"reply\": \"**4**\"}\n{\"default\": \"Quite good.\"}",
    );
    house.0.file("ids.json", "[\"q1\", \"q2\", \"q3\", \"q9\"]");
    let flags = [
        "--model",
        "script:a.jsonl",
        "--judge",
        "script:j.jsonl",
        "--levels",
        "L0,L2",
        "--subset",
        "ids.json",
        "--out",
        "run",
    ];
    let called = house.call(&flags);
    assert_eq!(called.code, Some(1), "{called:?}");
    for said in [
        "1 of 4 ids are not in the file of questions: q9",
        "1 of 2 walks cannot be shown (scannet-v0/001-b); unanswered questions: 1",
    ] {
        assert!(called.stderr.contains(said), "{said}: {}", called.stderr);
    }
    for said in [
        "0 of 6 answers scored",
        "2 not answered",
        "4 without a mark in the judge's reply",
    ] {
        assert!(called.stdout.contains(said), "{said}: {}", called.stdout);
    }
    // The judge's prose is read by the tolerant protocol, where there is a mark in it; nobody is asked again for it.
    let before = records(&house.0.path("run")).len();
    let called = house.call(&[&flags[..], &["--protocol", "tolerant"]].concat());
    assert!(
        called.stdout.contains("2 of 6 answers scored"),
        "{}",
        called.stdout
    );
    let after = records(&house.0.path("run"));
    // The two that failed are tried again, nothing else.
    assert_eq!(after.len(), before + 2);
    // The walk is found again: its question is asked, the others are not.
    let path = house.0.path("walks/scannet-v0/001-b/00000-rgb.png");
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    RgbImage::from_pixel(96, 64, Rgb([9; 3]))
        .save(&path)
        .unwrap();
    let called = house.call(&flags);
    assert!(
        called.stdout.contains("without a mark"),
        "{}",
        called.stdout
    );
    assert!(!called.stdout.contains("not answered"), "{}", called.stdout);
    let more = records(&house.0.path("run"));
    let new: Vec<&Value> = more[after.len()..].iter().collect();
    assert!(
        new.iter().all(|record| record["question"] == "q3"),
        "{new:?}"
    );
    assert_eq!(new.len(), 3);

    fs::remove_dir_all(house.0.path("walks")).unwrap();
    let called = house.call(&flags);
    assert_eq!(called.code, Some(2));
    assert!(
        called.stderr.contains("--frames: no walk can be shown"),
        "{}",
        called.stderr
    );
}

#[test]
fn a_broken_frame_takes_its_walk_out_alone() {
    let house = House::new();
    house
        .0
        .file("walks/hm3d-v0/000-a/00002-rgb.png", "no image");
    house.0.file("a.jsonl", "{\"default\": \"an answer\"}");
    let called = house.call(&[
        "--model",
        "script:a.jsonl",
        "--levels",
        "L0",
        "--out",
        "run",
    ]);
    assert_eq!(called.code, Some(1), "{called:?}");
    assert!(called.stderr.contains("00002-rgb.png"), "{}", called.stderr);
    let failed = records(&house.0.path("run"));
    let failed: Vec<&Value> = failed
        .iter()
        .filter(|record| !record["failure"].is_null())
        .collect();
    assert_eq!(failed.len(), 2);
    assert!(
        failed
            .iter()
            .all(|record| record["failure"]["kind"] == "image"),
        "{failed:?}"
    );
}

#[test]
fn one_camera_takes_a_walk_and_the_frames_are_the_same_at_every_level() {
    let house = House::new();
    let model = MockEndpoint::start([Answer::text("x")]);
    let base = model.base_url();
    let made = |out: &str, flags: &[&str]| -> Vec<Value> {
        let before = model.requests().len();
        let own = [
            "--model",
            "m",
            "--base-url",
            &base,
            "--limit",
            "1",
            "--concurrency",
            "1",
            "--out",
            out,
        ];
        let called = house.call(&[&own[..], flags].concat());
        assert_eq!(called.code, Some(0), "{called:?}");
        sent(&model).split_off(before)
    };
    let all = made("a", &["--levels", "L0,L2,L4"]);
    assert_eq!(all.len(), 3);
    let means: Vec<Vec<f64>> = all
        .iter()
        .map(|request| {
            let mean = |image: &RgbImage| {
                let sum: f64 = image.as_raw().iter().map(|code| f64::from(*code)).sum();
                sum / image.as_raw().len() as f64
            };
            images(request).iter().map(mean).collect()
        })
        .collect();
    assert_eq!(means[0], [100.0, 140.0, 180.0]);
    // Darker at each level, and lighter frames stay lighter: they are the same ones.
    for at in 0..3 {
        assert!(
            means[0][at] > means[1][at] && means[1][at] > means[2][at],
            "{means:?}"
        );
    }
    // The same in any order and by another run; other noise by another state of the camera or after the scaling.
    assert_eq!(made("b", &["--levels", "L2"])[0], all[1]);
    assert_ne!(
        made("c", &["--levels", "L2", "--sensor", "frame"])[0],
        all[1]
    );
    assert_ne!(
        made("d", &["--levels", "L2", "--degrade", "resized"])[0],
        all[1]
    );
    // A level more in the same run asks for that level alone.
    assert_eq!(made("b", &["--levels", "L2,L4"]), [all[2].clone()]);
}

#[test]
fn nothing_is_asked_twice_and_what_was_out_in_a_batch_is_taken_over() {
    let house = House::new();
    let silent = MockEndpoint::start([Answer::error(400, "bad", "must not be asked")]);
    let base = silent.base_url();
    let flags = [
        "--model",
        "m",
        "--base-url",
        &base,
        "--judge",
        "j",
        "--levels",
        "L0,L4",
        "--out",
        "run",
    ];
    let batch = [&flags[..], &["--batch"]].concat();
    let told = house.call(&batch);
    assert!(told.stdout.contains("6 requests in 1 file;"), "{told:?}");
    let answer = |file: &str, text: &dyn Fn(usize) -> String| {
        let input = fs::read_to_string(house.0.path(file)).unwrap();
        let lines = input.lines().enumerate().map(|(i, line)| {
            let line: Value = serde_json::from_str(line).unwrap();
            let body = json!({"choices": [{"message": {"content": text(i)}, "finish_reason": "stop"}], "usage": {"prompt_tokens": 9}});
            let line = json!({"custom_id": line["custom_id"], "response": {"status_code": 200, "body": body}, "error": null});
            format!("{line}\n")
        });
        house.0.file("out.jsonl", lines.collect::<String>());
        let words = ["batch", "import", "run", "out.jsonl"];
        let called = called(&mut house.0.command(&words));
        assert_eq!(called.code, Some(0), "{called:?}");
        assert!(called.stdout.contains("imported, 0 failed"), "{called:?}");
    };
    let line: Value = serde_json::from_str(
        fs::read_to_string(house.0.path("run/batch/1-m-001.jsonl"))
            .unwrap()
            .lines()
            .next()
            .unwrap(),
    )
    .unwrap();
    assert_eq!(images(&line["body"]).len(), 3);
    answer("run/batch/1-m-001.jsonl", &|i| format!("answer {i}"));
    // Now the marks, one for each different answer.
    let told = house.call(&batch);
    assert!(told.stdout.contains("6 requests in 1 file;"), "{told:?}");
    answer("run/batch/1-j-001.jsonl", &|_| "Your mark: 4".to_owned());
    let called = house.call(&flags);
    assert_eq!(called.code, Some(0), "{called:?}");
    assert!(called.stdout.contains("75.0 ±"), "{}", called.stdout);
    assert!(silent.requests().is_empty());
    // As a whole it is there already.
    assert_eq!(house.call(&flags).stdout, called.stdout);
    // Another judge marks the same answers.
    house.0.file("j.jsonl", "{\"default\": \"1\"}");
    let other = [
        &flags[..4],
        &[
            "--judge",
            "script:j.jsonl",
            "--levels",
            "L0,L4",
            "--out",
            "run",
        ],
    ]
    .concat();
    let called = house.call(&other);
    assert!(
        called.stdout.contains("0.0 ±") && silent.requests().is_empty(),
        "{called:?}"
    );
}

#[test]
fn a_run_goes_on_where_it_was_stopped() {
    let house = House::new();
    let refused = Answer::error(401, "invalid_api_key", "no");
    let model = MockEndpoint::start([Answer::text("one"), refused]);
    let base = model.base_url();
    let flags = [
        "--model",
        "m",
        "--base-url",
        &base,
        "--levels",
        "L0",
        "--concurrency",
        "1",
        "--out",
        "run",
    ];
    let called = house.call(&flags);
    assert_eq!(called.code, Some(2), "{called:?}");
    assert_eq!(records(&house.0.path("run")).len(), 1);
    let well = MockEndpoint::start([Answer::text("more")]);
    let base = well.base_url();
    let again = [
        "--model",
        "m",
        "--base-url",
        &base,
        "--levels",
        "L0",
        "--concurrency",
        "1",
        "--resume",
        "run",
    ];
    let called = house.call(&again);
    assert_eq!(called.code, Some(0), "{called:?}");
    assert_eq!(well.requests().len(), 2);
    // An evaluation is not mixed up with it.
    let other = [
        "--data",
        "rooms:frames=1",
        "--model",
        "random",
        "--out",
        "run",
    ];
    let called = house.0.call(&other);
    assert_eq!(called.code, Some(2), "{called:?}");
    assert!(
        called.stderr.contains("darkqa.openeqa/2"),
        "{}",
        called.stderr
    );
}

#[test]
fn a_model_that_is_gone_keeps_nobody_elses_answers_from_their_marks() {
    let house = House::new();
    let mock = MockEndpoint::answering(|request| {
        if request["model"] == "gone" {
            Answer::error(404, "model_not_found", "no such model")
        } else {
            Answer::text("5")
        }
    });
    let base = mock.base_url();
    let called = house.call(&[
        "--model",
        "gone",
        "--model",
        "m",
        "--judge",
        "j",
        "--base-url",
        &base,
        "--levels",
        "L0",
        "--out",
        "run",
    ]);
    assert_eq!(called.code, Some(2), "{called:?}");
    assert!(called.stderr.contains("no such model"), "{}", called.stderr);
    let summary = house.read("run/summary.json");
    let mut rows = summary["rows"].as_array().unwrap().iter();
    let row = rows
        .find(|row| row["model"] == "m" && row["by"] == "all")
        .unwrap();
    assert_eq!((&row["value"], &row["n"]), (&json!(1.0), &json!(3)));
}

#[test]
fn the_only_frame_of_a_walk_is_shown_as_often_as_frames_are_asked_for() {
    let house = House::new();
    fs::remove_file(house.0.path("walks/scannet-v0/001-b/00001-rgb.png")).unwrap();
    let mock = MockEndpoint::start([Answer::text("an answer")]);
    let called = house.call(&[
        "--model",
        "m",
        "--base-url",
        &mock.base_url(),
        "--levels",
        "L0,L2",
        "--splits",
        "scannet-v0",
        "--out",
        "run",
    ]);
    assert_eq!(called.code, Some(0), "{called:?}");
    for request in sent(&mock) {
        let parts = request["messages"][0]["content"].as_array().unwrap();
        let images = parts.iter().filter(|part| part["type"] == "image_url");
        assert_eq!(
            images.count(),
            3,
            "as upstream samples one frame three times"
        );
    }
}

#[test]
fn a_task_of_an_array_asks_about_walks_of_its_own() {
    let house = House::new();
    house.0.file("a.jsonl", "{\"default\": \"an answer\"}");
    let words = flags(&[
        "--model",
        "script:a.jsonl",
        "--levels",
        "L0",
        "--out",
        "run",
    ]);
    let mut command = house.0.command(&words);
    command.envs([
        ("SLURM_ARRAY_TASK_ID", "1"),
        ("SLURM_ARRAY_TASK_MIN", "0"),
        ("SLURM_ARRAY_TASK_COUNT", "2"),
    ]);
    let called = called(&mut command);
    assert_eq!(called.code, Some(0), "{called:?}");
    assert!(
        called.stderr.contains("this process does shard 2/2"),
        "{}",
        called.stderr
    );
    let asked = records(&house.0.path("run/shard-2-of-2"));
    let asked: Vec<&Value> = asked.iter().map(|record| &record["question"]).collect();
    assert_eq!(asked, ["q3"]);
}

#[test]
fn a_dry_run_says_what_it_would_take_and_sends_nothing() {
    let house = House::new();
    let silent = MockEndpoint::start([Answer::error(400, "bad", "must not be asked")]);
    let base = silent.base_url();
    let called = house.call(&[
        "--model",
        "gpt-4o",
        "--base-url",
        &base,
        "--judge",
        "gpt-4o-mini",
        "--out",
        "run",
        "--dry-run",
        "--json",
    ]);
    assert_eq!(called.code, Some(0), "{called:?}");
    let told: Value = serde_json::from_str(&called.stdout).unwrap();
    // Three questions at three levels, and as many marks.
    assert_eq!(
        (&told["lines"][0]["requests"], &told["lines"][1]["requests"]),
        (&json!(9), &json!(9))
    );
    assert_eq!(told["lines"][1]["model"], "gpt-4o-mini (judge)");
    assert_eq!((&told["trials"], &told["images"]), (&json!(18), &json!(18)));
    assert!(told["lines"][0]["dollars"].as_f64().unwrap() > 0.0);
    assert!(told["bytes"].as_f64().unwrap() > 9.0 * 3.0 * 100.0);
    assert!(silent.requests().is_empty() && !house.0.path("run").exists());
}

#[test]
fn a_budget_holds_for_answers_and_marks_together() {
    let house = House::new();
    let usage = json!({"prompt_tokens": 100_000, "completion_tokens": 10});
    let body = json!({"choices": [{"message": {"content": "5"}, "finish_reason": "stop"}], "usage": usage});
    let mock = MockEndpoint::start([Answer::json(200, &body)]);
    let base = mock.base_url();
    // 0.25 dollars a reply of gpt-4o.
    let flags = [
        "--model",
        "gpt-4o",
        "--judge",
        "gpt-4o",
        "--base-url",
        &base,
        "--levels",
        "L0",
        "--out",
        "run",
    ];
    let called = house.call(&[&flags[..], &["--max-cost", "1.1"]].concat());
    assert_eq!(called.code, Some(130), "{called:?}");
    assert_eq!(mock.requests().len(), 4);
    let called = house.call(&[&flags[..], &["--max-cost", "9"]].concat());
    assert_eq!(called.code, Some(0), "{called:?}");
    // Three answers and, as they are alike but about three questions, three marks.
    assert_eq!(mock.requests().len(), 6);
}

#[test]
fn people_get_a_page_without_the_answers_and_their_file_is_marked() {
    let house = House::new();
    let called = house.call(&["--study", "study", "--levels", "L0,L4"]);
    assert_eq!(called.code, Some(0), "{called:?}");
    assert!(
        called
            .stdout
            .contains("3 questions about 2 walks, 10 images, 2 conditions"),
        "{}",
        called.stdout
    );
    let page = fs::read_to_string(house.0.path("study/study.html")).unwrap();
    assert!(!page.contains("café") && page.contains("What colour is it?"));
    let images = fs::read_dir(house.0.path("study/images")).unwrap();
    assert!(
        images
            .map(|entry| entry.unwrap().file_name())
            .all(|name| !name.to_string_lossy().contains('L'))
    );
}
