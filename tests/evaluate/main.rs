//! The main job from the outside: the program is called as a user calls it.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

#[path = "../support/mod.rs"]
mod support;

mod conditions;
mod failures;
mod interruption;
mod outputs;
mod requests;
mod resume;

use std::io::Cursor;

use serde_json::{Value, json};
use support::run::Bench;

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
