//! Two frames with three questions about them.

use std::io::Cursor;

use serde_json::json;

use super::run::Bench;

/// A small PNG with something to see in it.
pub fn png(shade: u8) -> Vec<u8> {
    let image =
        image::RgbImage::from_fn(24, 16, |x, y| image::Rgb([shade.wrapping_add((x * 9) as u8), (y * 15) as u8, shade]));
    let mut bytes = Cursor::new(Vec::new());
    image.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    bytes.into_inner()
}

impl Bench {
    /// A folder with `frames`: two frames with three questions.
    pub fn with_frames() -> Self {
        let bench = Self::new();
        bench.file("frames/a.png", png(20));
        bench.file("frames/b.png", png(120));
        let questions = [
            json!({"id": "a1", "frame": "a.png", "family": "presence", "question": "Is there a \"lamp\" {{here}}?", "choices": ["yes", "no"], "answer": "no"}),
            json!({"id": "a2", "frame": "a.png", "family": "color", "question": "What color?", "choices": ["red", "blue", "green"], "answer": "blue"}),
            json!({"id": "b1", "frame": "b.png", "family": "presence", "question": "Is there a bed?", "choices": ["yes", "no"], "answer": "yes"}),
        ];
        let lines: Vec<String> = questions.iter().map(ToString::to_string).collect();
        bench.file("frames/questions.jsonl", lines.join("\n"));
        bench
    }
}
