//! Questions that show several images in one request.

use std::collections::BTreeSet;
use std::fs;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use image::RgbImage;
use serde_json::{Value, json};

use crate::support::endpoint::{Answer, MockEndpoint, Request};
use crate::support::run::{Bench, model_args, records, words};
use crate::support::snapshot::lines_with;

/// A folder with three pictures and `set.json`: a question with two marks, one without marks, and one about a single
/// picture.
fn bench() -> Bench {
    let bench = Bench::new();
    for (name, shade, size) in [("a", 200, 64), ("b", 120, 48), ("c", 220, 40)] {
        let picture = RgbImage::from_fn(size, 40, |x, y| image::Rgb([shade, (x * 3) as u8, (y * 5) as u8]));
        picture.save(bench.path(&format!("{name}.png"))).unwrap();
    }
    let rows = json!([
        {"id": "two", "image": ["a.png", "b.png"], "question": "Is <image 2> like <image 1>?", "options": ["yes", "no"], "answer": "no"},
        {"id": "three", "image": ["a.png", "b.png", "c.png"], "question": "Which is wide?", "options": ["first", "second", "third"], "answer": "first"},
        {"id": "one", "image": ["c.png"], "question": "<image>What?", "options": ["x", "y"], "answer": "x"},
    ]);
    bench.file("set.json", rows.to_string());
    bench
}

/// The parts of the message of a request: words, and pictures.
fn parts(body: &Value) -> Vec<Result<String, RgbImage>> {
    let content = &body["messages"][0]["content"];
    let Some(parts) = content.as_array() else {
        return vec![Ok(content.as_str().unwrap().to_owned())];
    };
    parts
        .iter()
        .map(|part| {
            if let Some(text) = part["text"].as_str() {
                Ok(text.to_owned())
            } else {
                let url = part["image_url"]["url"].as_str().unwrap();
                let file = STANDARD.decode(url.split_once(',').unwrap().1).unwrap();
                Err(image::load_from_memory(&file).unwrap().into_rgb8())
            }
        })
        .collect()
}

/// Words, and the width of each picture.
fn outline(body: &Value) -> Vec<String> {
    parts(body).into_iter().map(|part| part.unwrap_or_else(|picture| picture.width().to_string())).collect()
}

fn mean(picture: &RgbImage) -> f64 {
    let sum: u64 = picture.as_raw().iter().map(|code| u64::from(*code)).sum();
    sum as f64 / picture.as_raw().len() as f64
}

#[test]
fn row_images_share_one_request() {
    let bench = bench();
    let endpoint = MockEndpoint::start([Answer::text("A")]);
    let url = endpoint.base_url();
    let line = "--data set.json --levels L0,L3 --blind-model m --out run";
    let refused = bench.call(&model_args(&url, line));
    insta::assert_snapshot!(refused.messages(), @"
    exit code: 2
    error: set.json: 2 of 3 rows show 2 images; --multi-image skip leaves them out, --multi-image send shows all
        of them in one request
    ");
    let line = format!("{line} --multi-image send");
    let called = bench.call(&model_args(&url, &line));
    insta::assert_snapshot!(called.messages(), @"
    exit code: 0
    set: 3 questions on 3 images in 1 family (no column of families)
    question = question, image = image (files 3), options = options, answer = answer (text), id = id
    2 questions show 2 to 3 images, all in one request: each at its mark (<image 2>) in the text, else in order
        beside it
    ");
    let bodies: Vec<Value> = endpoint.requests().iter().map(Request::json).collect();
    // Three questions: without an image, at L0, and at L3 in two variants.
    assert_eq!(bodies.len(), 12);
    let outlines: Vec<Vec<String>> = bodies.iter().map(outline).collect();
    let rest = "A. yes\nB. no\nAnswer with the option's letter from the given choices directly.";
    let two = ["Is ", "48", " like ", "64", &format!("?\n{rest}")].map(str::to_owned);
    assert_eq!(outlines.iter().filter(|found| **found == two).count(), 3);
    let three = |found: &&Vec<String>| {
        found.len() == 4 && found[0].contains("Which is wide?") && found[1..] == ["64", "48", "40"]
    };
    assert_eq!(outlines.iter().filter(three).count(), 3);
    let one = |found: &&Vec<String>| found.len() == 2 && found[0].starts_with("What?") && found[1] == "40";
    assert_eq!(outlines.iter().filter(one).count(), 3);
    // Without images the words keep the marks.
    let blind = |found: &&Vec<String>| found.len() == 1 && found[0].contains("Is <image 2> like <image 1>?");
    assert_eq!(outlines.iter().filter(blind).count(), 1);
    // All images of a request are darkened alike: both are dark, or none is.
    let mut lights = BTreeSet::new();
    for body in bodies.iter().filter(|body| outline(body) == two) {
        let pictures: Vec<RgbImage> = parts(body).into_iter().filter_map(Result::err).collect();
        let dark = pictures.iter().map(|picture| mean(picture) < 40.0).collect::<BTreeSet<bool>>();
        assert_eq!(dark.len(), 1);
        lights.extend(dark);
    }
    assert_eq!(lights.len(), 2);
    // A record has all of them, and nothing is asked again.
    let stored = records(&bench.path("run"));
    let seen = stored.iter().filter(|record| record["question"] == "three" && record["view"] == "image");
    for record in seen {
        let more = record["more_images"].as_array().unwrap();
        assert_eq!([&record["image"], &more[0], &more[1]].map(|image| image["width"].as_u64()), [64, 48, 40].map(Some));
    }
    assert!(
        stored.iter().filter(|record| record["question"] == "one").all(|record| record.get("more_images").is_none())
    );
    bench.complete(&model_args(&url, &line));
    assert_eq!(endpoint.requests().len(), 12);
    images_are_made_again(&bench);
}

/// `show` makes the very files again, all of them, and a picture of all; the page has them.
fn images_are_made_again(bench: &Bench) {
    let shown = bench.complete(&words("show run three"));
    insta::assert_snapshot!(lines_with(&shown, "images: "), @"three, about 3 images: a.png, b.png, c.png");
    assert_eq!(shown.matches("the same bytes as were sent").count(), 3, "{shown}");
    let files = fs::read_dir(bench.path("run/shown")).unwrap().count();
    assert_eq!(files, 9);
    bench.complete(&words("show run two --sheet sheet.png"));
    let sheet = image::open(bench.path("sheet.png")).unwrap();
    assert!(sheet.width() > 400);
    let questions = fs::read_to_string(bench.path("run/questions.jsonl")).unwrap();
    let images: Vec<Value> = questions
        .lines()
        .map(|line| serde_json::from_str::<Value>(line).unwrap())
        .map(|question| question["images"].clone())
        .collect();
    assert_eq!(images, [json!(["a.png", "b.png"]), json!(["a.png", "b.png", "c.png"]), Value::Null]);
    let small = fs::read_to_string(bench.path("run/thumbnails.jsonl")).unwrap();
    assert_eq!(small.lines().count(), 9);
    // Another picture in its place is noticed.
    RgbImage::from_pixel(48, 40, image::Rgb([1, 2, 3])).save(bench.path("b.png")).unwrap();
    let called = bench.call(&words("show run two"));
    insta::assert_snapshot!(called.lines_with("bytes"), @"
    exit code: 1
    L0: NOT the bytes that were sent: [DIGEST] now
    L3-ev: NOT the bytes that were sent: [DIGEST] now
    L3-noise: NOT the bytes that were sent: [DIGEST] now
    ");
}

#[test]
fn noise_is_independent_of_position() {
    let bench = bench();
    let endpoint = MockEndpoint::start([Answer::text("A")]);
    let url = endpoint.base_url();
    bench.complete(&model_args(&url, "--data set.json --levels L3 --variant noise --multi-image send --out run"));
    let requests = endpoint.requests();
    let pictures: Vec<RgbImage> =
        requests.iter().flat_map(|request| parts(&request.json())).filter_map(Result::err).collect();
    // Six images of three frames: those of one frame are alike, whichever question shows them, and in whichever place.
    let by_width = |width: u32| pictures.iter().filter(move |picture| picture.width() == width);
    for width in [64, 48, 40] {
        let first = by_width(width).next().unwrap();
        assert_eq!(by_width(width).count(), 2);
        assert!(by_width(width).all(|picture| picture == first));
    }
}

#[test]
fn what_shows_one_image_refuses_several() {
    let bench = bench();
    let called = bench.call(&words("export llava set.json --out sets --levels L0 --multi-image send"));
    insta::assert_snapshot!(called.messages(), @r#"
    exit code: 2
    set: 3 questions on 3 images in 1 family (no column of families)
    question = question, image = image (files 3), options = options, answer = answer (text), id = id
    2 questions show 2 to 3 images, all in one request: each at its mark (<image 2>) in the text, else in order
        beside it
    error: --multi-image: the question "two" shows 2 images, and an exported set has one image per question;
        --multi-image skip leaves such rows out
    "#);
    let called = bench.call(&words("--data set.json --model observer --levels L0 --multi-image send"));
    assert_eq!(called.code, Some(2));
    bench.complete(&words("check --data set.json --multi-image send --save-questions read.jsonl"));
    let read = fs::read_to_string(bench.path("read.jsonl")).unwrap();
    let counts = read.lines().map(|line| {
        let line: Value = serde_json::from_str(line).unwrap();
        line["image_sha256"].as_array().map_or(1, Vec::len)
    });
    assert_eq!(counts.collect::<Vec<usize>>(), [2, 3, 1]);
}
