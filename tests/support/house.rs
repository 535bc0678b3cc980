//! Walks through two houses, and open questions about them.

use std::fs;

use image::{Rgb, RgbImage};
use serde_json::{Value, json};

use super::run::{Bench, Called, called};

/// A file of questions and two walks of three frames, the second shorter than what is shown of it.
pub struct House(pub Bench);

impl House {
    pub fn new() -> Self {
        let bench = Bench::new();
        for (walk, frames) in [("hm3d-v0/000-a", 5_u32), ("scannet-v0/001-b", 2)] {
            for frame in 0..frames {
                // Flat grey of its own, so that a frame is known again by its pixels.
                let grey = 100 + 20 * frame as u8;
                let picture = RgbImage::from_pixel(96, 64, Rgb([grey; 3]));
                let path = bench.path(&format!("walks/{walk}/{frame:05}-rgb.png"));
                fs::create_dir_all(path.parent().unwrap()).unwrap();
                picture.save(path).unwrap();
            }
        }
        let question = |id: &str, text: &str, answer: &str, walk: &str, category: &str| json!({"question_id": id, "question": text, "answer": answer, "category": category, "episode_history": walk});
        let mut extra =
            question("q2", "Where's the {sofa}?", "Near the café's door", "hm3d-v0/000-a", "object localization");
        extra["extra_answers"] = json!(["By the stairs", "it's here", "\"both\" it's", "日本"]);
        let all = json!([
            question("q1", "What colour is it?", "brown", "hm3d-v0/000-a", "attribute recognition"),
            extra,
            question("q3", "Is it “safe”?", "No", "scannet-v0/001-b", "world knowledge"),
        ]);
        bench.file("questions.json", all.to_string());
        Self(bench)
    }

    pub fn call(&self, words: &[&str]) -> Called {
        called(&mut self.0.command(&flags(words)))
    }

    pub fn read(&self, path: &str) -> Value {
        serde_json::from_slice(&fs::read(self.0.path(path)).unwrap()).unwrap()
    }
}

/// The flags of all calls, and some more.
pub fn flags<'a>(more: &[&'a str]) -> Vec<&'a str> {
    let own = ["openeqa", "--questions", "questions.json", "--frames", "walks"];
    let few = ["--num-frames", "3", "--image-size", "48"];
    [&own[..], &few, more].concat()
}
