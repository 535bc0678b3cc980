//! Marks and scores: upstream's arithmetic, what is missing, answers of people.

use std::fs;

use image::{Rgb, RgbImage};
use serde_json::{Value, json};

use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::house::House;
use crate::support::parquet_file::rows;
use crate::support::run::{records, words};
use crate::support::table::check_rows;

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
    let called = house.call(&words(&format!(
        "--answers human=people.json --judge j --judge-base-url {} --concurrency 1 --out run",
        judge.base_url()
    )));
    assert_eq!(called.code, Some(0), "{called:?}");
    let degraded: Vec<Value> =
        records(&house.0.path("run")).into_iter().filter(|record| record["level"] == "L2").collect();
    assert_eq!((&degraded[0]["ev"], &degraded[0]["reading"]), (&json!(4.0), &json!("paper")));
    // What was answered alike at L2 is not judged again.
    assert_eq!(judge.requests().len(), 4);
    let summary = house.read("run/summary.json");
    let row = |level: &str| {
        summary["rows"]
            .as_array()
            .unwrap()
            .iter()
            .find(|row| row["by"] == "all" && row["level"] == level)
            .unwrap()
            .clone()
    };
    let clean = row("L0");
    assert_eq!((&clean["value"], &clean["n"], &clean["null"]), (&json!(0.5), &json!(5), &json!(1)));
    let degraded = row("L2");
    // The first question alone is there in both: 1 against (1 + 0) / 2.
    assert_eq!((&degraded["change"], &degraded["change_n"]), (&json!(0.5), &json!(1)));
    insta::assert_snapshot!(called.messages(), @"
    exit code: 0
     WARN people.json: 1 of 7 answers are to questions that are not asked: strange
    ");
    // Several people's answers are no file of upstream's, which has one a question.
    assert!(!house.0.path("run/upstream/human-L0.json").exists());
    assert!(house.0.path("run/upstream/human-L2-noise.json").exists());
}

/// OpenEQA itself asks four questions more than once.
#[test]
fn equal_answers_are_marked_once() {
    let house = House::new();
    let mut questions = house.read("questions.json");
    let twin = |id: &str, category: &str, extra: Value| json!({"question_id": id, "question": "What colour is it?", "answer": "brown", "category": category, "episode_history": "scannet-v0/001-b", "extra_answers": extra});
    let questions = questions.as_array_mut().unwrap();
    questions.push(twin("q4", "world knowledge", Value::Null));
    // Another right answer makes another mark.
    questions.push(twin("q5", "world knowledge", json!(["red"])));
    let questions = json!(questions);
    house.0.file("questions.json", questions.to_string());
    house.0.file("a.jsonl", "{\"default\": \"red\"}");
    let judge = MockEndpoint::start(["2", "3", "4", "5"].map(Answer::text));
    let called = house.call(&words(&format!(
        "--model script:a.jsonl --levels L0 --judge j --judge-base-url {} --concurrency 1 --out run",
        judge.base_url()
    )));
    assert_eq!(called.code, Some(0), "{called:?}");
    assert_eq!(judge.requests().len(), 4);
    assert!(!called.stderr.contains("not judged"), "{called:?}");
    let items = records(&house.0.path("run"));
    let mark_of = |id: &str| {
        items
            .iter()
            .find(|record| record["question"] == id && record["step"] == "mark")
            .map(|mark| mark["upstream"].clone())
    };
    assert!(mark_of("q1").is_some() && mark_of("q4").is_none() && mark_of("q5").is_some());
    let summary = house.read("run/summary.json");
    let all = summary["rows"].as_array().unwrap().iter();
    let all = all.clone().find(|row| row["by"] == "all").unwrap();
    assert_eq!(all["n"], json!(5), "{all}");
    let table = rows(&house.0.path("run/records.parquet"));
    let of = |id: &str| table.iter().find(|row| row["question"] == id).unwrap()["mark"].clone();
    assert_eq!(of("q1"), of("q4"));
    assert_ne!(of("q4"), of("q5"));
}

#[test]
fn missing_answers_are_counted() {
    let house = House::new();
    fs::remove_dir_all(house.0.path("walks/scannet-v0")).unwrap();
    house.0.file("a.jsonl", "{\"default\": \"an answer\"}");
    house.0.file("j.jsonl", "{\"question\": \"q1\", \"reply\": \"**4**\"}\n{\"default\": \"Quite good.\"}");
    house.0.file("ids.json", "[\"q1\", \"q2\", \"q3\", \"q9\"]");
    let args = words("--model script:a.jsonl --judge script:j.jsonl --levels L0,L2 --subset ids.json --out run");
    let called = house.call(&args);
    assert_eq!(called.code, Some(1), "{called:?}");
    let notes = [
        "1 of 4 ids are not in the file of questions: q9",
        "1 of 2 walks cannot be shown (scannet-v0/001-b); unanswered questions: 1",
    ];
    check_rows(notes, |note| {
        assert!(called.stderr.contains(note), "{note}: {}", called.stderr);
    });
    let counts = ["0 of 6 answers scored", "2 not answered", "4 without a mark in the judge's reply"];
    check_rows(counts, |count| {
        assert!(called.stdout.contains(count), "{count}: {}", called.stdout);
    });
    // The judge's prose is read by the tolerant protocol, where there is a mark in it; nobody is asked again for it.
    let before = records(&house.0.path("run")).len();
    let called = house.call(&[&args[..], &["--protocol", "tolerant"]].concat());
    insta::assert_snapshot!(called.lines_with("scored"), @"
    exit code: 1
    2 of 6 answers scored
    2 not answered: not scored
    2 without a mark in the judge's reply: not scored (--protocol tolerant reads
    ! 2 answers are not scored, because the judge gave no mark.
      missing are not scored.
     model            light          L0           L2   scored   95 %
    ");
    let after = records(&house.0.path("run"));
    // The two that failed are tried again, nothing else.
    assert_eq!(after.len(), before + 2);
    // The walk is found again: its question is asked, the others are not.
    let path = house.0.path("walks/scannet-v0/001-b/00000-rgb.png");
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    RgbImage::from_pixel(96, 64, Rgb([9; 3])).save(&path).unwrap();
    let called = house.call(&args);
    insta::assert_snapshot!(called.lines_with("without a mark"), @"
    exit code: 1
    6 without a mark in the judge's reply: not scored (--protocol tolerant reads
    ");
    assert!(!called.stdout.contains("not answered"), "{}", called.stdout);
    let more = records(&house.0.path("run"));
    let new: Vec<&Value> = more[after.len()..].iter().collect();
    assert!(new.iter().all(|record| record["question"] == "q3"), "{new:?}");
    assert_eq!(new.len(), 3);

    fs::remove_dir_all(house.0.path("walks")).unwrap();
    let called = house.call(&args);
    insta::assert_snapshot!(called.messages(), @"
    exit code: 2
     WARN ids.json: 1 of 4 ids are not in the file of questions: q9
    error: --frames: no walk can be shown: walks: cannot read: [OS ERROR]; DIR/EPISODE_HISTORY/*-rgb.png expected
    ");
}

#[test]
fn lost_model_does_not_block_marks() {
    let house = House::new();
    let mock = MockEndpoint::answering(|request| {
        if request["model"] == "gone" {
            Answer::error(404, "model_not_found", "no such model")
        } else {
            Answer::text("5")
        }
    });
    let base = mock.base_url();
    let called =
        house.call(&words(&format!("--model gone --model m --judge j --base-url {base} --levels L0 --out run")));
    insta::assert_snapshot!(called.lines_with("no such model"), @"
    exit code: 1
    ! not asked any further: http://127.0.0.1:[PORT]/v1: gone: http://127.0.0.1:[PORT]/v1 answered 404: no such
        model (the server knows no model of this name: check --model and --base-url) (replies so far are stored;
        the same command continues)
    ");
    let summary = house.read("run/summary.json");
    let row = summary["rows"].as_array().unwrap().iter().find(|row| row["model"] == "m" && row["by"] == "all").unwrap();
    assert_eq!((&row["value"], &row["n"]), (&json!(1.0), &json!(3)));
}

#[test]
fn study_page_hides_answers() {
    let house = House::new();
    let called = house.call(&["--study", "study", "--levels", "L0,L4"]);
    insta::assert_snapshot!(called, @"
    exit code: 0
    stdout:
    study/study.html: 3 questions about 2 walks, 10 images, 2 conditions; a person sees each walk in one of them,
        and 2 people see it in all
    to mark what they save: openeqa --answers NAME=FILE
    stderr:
     WARN 1 of 2 walks has fewer frames than --num-frames 3: they are shown several times in a request, as
        upstream does (the 2 frames of scannet-v0/001-b, for example)
    ");
    let page = fs::read_to_string(house.0.path("study/study.html")).unwrap();
    assert!(!page.contains("café") && page.contains("What colour is it?"));
    let images = fs::read_dir(house.0.path("study/images")).unwrap();
    assert!(images.map(|entry| entry.unwrap().file_name()).all(|name| !name.to_string_lossy().contains('L')));
}

/// A judge that thinks before it marks.
fn thinking_judge() -> MockEndpoint {
    MockEndpoint::answering(|body| {
        if body["max_tokens"].as_u64().unwrap() < 100 {
            Answer::message(&json!({"content": "The answer says"}), "length")
        } else {
            Answer::text("5")
        }
    })
}

#[test]
fn larger_limit_repeats_truncated_marks() {
    let house = House::new();
    let people = json!([
        {"question_id": "q1", "answer": "brown"},
        {"question_id": "q2", "answer": "at the door"},
    ]);
    house.0.file("people.json", people.to_string());
    let judge = thinking_judge();
    let call = |more: &str| {
        house.call(&words(&format!(
            "--answers human=people.json --judge j --judge-base-url {} --levels L0 --out run {more}",
            judge.base_url()
        )))
    };
    let first = call("");
    assert_eq!((first.code, judge.requests().len()), (Some(1), 2));
    insta::assert_snapshot!(first.lines_with("scored"), @"
    exit code: 1
    0 of 2 answers scored
    2 without a mark in the judge's reply: not scored (--protocol tolerant reads
    ! 2 answers are not scored, because the judge gave no mark.
     model   light       L0   scored   95 %
    ");

    let grown = call("--judge-max-tokens 200");
    assert_eq!((grown.code, judge.requests().len()), (Some(0), 4), "{grown:?}");
    insta::assert_snapshot!(grown.messages(), @"
    exit code: 0
     WARN --levels: no effect: no model is shown an image
    2 truncated replies are asked again with the larger --judge-max-tokens
    ");
    insta::assert_snapshot!(grown.lines_with("scored"), @"
    exit code: 0
    2 of 2 answers scored
     model   light          L0   scored   95 %
    ");

    // Nothing is asked again with this limit, or the first.
    for limit in ["200", "32"] {
        let on = call(&format!("--judge-max-tokens {limit}"));
        assert_eq!((on.code, judge.requests().len()), (Some(0), 4), "{on:?}");
    }
}
