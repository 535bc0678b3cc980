//! Servers that drop images, or answer by the text alone.

use std::sync::atomic::{AtomicUsize, Ordering};

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};

use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::run::{Bench, Called, model_args};
use crate::support::snapshot::redacted;

const FRAMES: usize = 30;
const CHOICES: [&[&str]; 4] = [
    &["red", "green", "blue", "grey"],
    &["kitchen", "bedroom", "bathroom", "garage"],
    &["yes", "no"],
    &["chair", "table", "lamp", "sofa"],
];

/// The reply to each wording without an image.
const BY_WORDS: [&str; 4] = ["B", "A", "B", "C"];

fn truth(frame: usize, question: usize) -> usize {
    (frame * 7 + frame / 4 + question * 3) % CHOICES[question].len()
}

/// A set of frames that differ in width, so that the endpoint knows them, with the same four questions about each.
fn bench() -> Bench {
    let bench = Bench::new();
    let mut lines = String::new();
    for frame in 0..FRAMES {
        let name = format!("f{frame}.png");
        let grey = image::Rgb([120, 120, 120]);
        let picture = image::RgbImage::from_pixel(40 + frame as u32, 32, grey);
        picture.save(bench.path(&name)).unwrap();
        for (question, choices) in CHOICES.iter().enumerate() {
            let line = json!({
                "id": format!("f{frame}q{question}"), "image": name, "family": format!("f{question}"),
                "question": format!("Question {question}?"), "choices": choices,
                "answer": choices[truth(frame, question)],
            });
            lines.push_str(&line.to_string());
            lines.push('\n');
        }
    }
    bench.file("set.jsonl", lines);
    bench
}

/// A question to an endpoint.
struct Asked {
    frame: usize,
    question: usize,
    is_dark: bool,
}

impl Asked {
    fn new(body: &Value) -> Self {
        let parts = body["messages"][0]["content"].as_array().unwrap();
        let text = parts.iter().find_map(|part| part["text"].as_str()).unwrap();
        let question = (0..4).find(|i| text.contains(&format!("Question {i}?")));
        let url = parts.iter().find_map(|part| part["image_url"]["url"].as_str());
        let (_, data) = url.unwrap().split_once(',').unwrap();
        let image = image::load_from_memory(&STANDARD.decode(data).unwrap()).unwrap();
        Self {
            frame: image.width() as usize - 40,
            question: question.unwrap(),
            is_dark: image.to_luma8().pixels().all(|pixel| pixel.0[0] < 60),
        }
    }

    fn by_words(&self) -> Answer {
        Answer::text(BY_WORDS[self.question])
    }

    fn by_image(&self) -> Answer {
        Answer::text(["A", "B", "C", "D"][truth(self.frame, self.question)])
    }
}

fn call(answer: impl Fn(&Asked) -> Answer + Send + Sync + 'static) -> (Called, Vec<Value>) {
    let (bench, mock) = (bench(), MockEndpoint::answering(move |body| answer(&Asked::new(body))));
    let base = mock.base_url();
    let line = "--data set.jsonl --levels L0,L5 --variant ev --out run";
    let called = bench.call(&model_args(&base, line));
    assert_eq!(called.code, Some(0), "{called:?}");
    let text = std::fs::read_to_string(bench.path("run/summary.json")).unwrap();
    let summary: Value = serde_json::from_str(&text).unwrap();
    (called, summary["alerts"].as_array().unwrap().clone())
}

#[test]
fn dropped_images_raise_first_alert() {
    let (called, alerts) = call(Asked::by_words);
    let words = "The replies of m do not depend on the image: ";
    assert_eq!(called.stderr.matches(words).count(), 1, "{called:?}");
    assert_eq!(alerts[0]["kind"], "image_ignored", "{alerts:?}");
    let text = alerts[0]["text"].as_str().unwrap();
    assert!(text.starts_with(words));
    insta::assert_snapshot!(redacted(text), @"
    The replies of m do not depend on the image: 84 of 84 replies to untouched images are the usual reply to the
        wording although another answer is true (120 replies, 4 wordings, exact binomial test: p < 0.0001). The
        server may drop images, or cache replies by the text.
    ");
}

#[test]
fn every_second_image_lost_is_found() {
    let count = AtomicUsize::new(0);
    let (called, alerts) = call(move |asked| match count.fetch_add(1, Ordering::Relaxed) % 2 {
        0 => asked.by_words(),
        _ => asked.by_image(),
    });
    let words = "A part of the replies of m does not depend on the image: ";
    assert_eq!(called.stderr.matches(words).count(), 1, "{called:?}");
    assert!(alerts[0]["text"].as_str().unwrap().starts_with(words));
}

#[test]
fn word_guessing_in_dark_is_allowed() {
    let (called, alerts) = call(|asked| if asked.is_dark { asked.by_words() } else { asked.by_image() });
    assert!(!called.stderr.contains("depend on the image"), "{called:?}");
    assert!(alerts.iter().all(|alert| alert["kind"] != "image_ignored"));
}

#[test]
fn one_letter_has_its_own_sentence() {
    let (called, alerts) = call(|_| Answer::text("B"));
    let words = "m answers B whatever the image and the question: ";
    assert_eq!(called.stderr.matches(words).count(), 1, "{called:?}");
    assert!(alerts[0]["text"].as_str().unwrap().starts_with(words));
}
