//! Servers that shrink images, found by the tokens that they count.

use serde_json::{Value, json};

use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::run::{Bench, words};
use crate::support::snapshot::on_one_line;

/// A folder with ten questions about images of these sizes.
fn bench(sizes: &[(u32, u32)]) -> Bench {
    let bench = Bench::new();
    let mut lines = String::new();
    for number in 0..10 {
        let (width, height) = sizes[number % sizes.len()];
        let name = format!("{width}.png");
        let picture = image::RgbImage::from_pixel(width, height, image::Rgb([90, 60, 30]));
        picture.save(bench.path(&name)).unwrap();
        let question = json!({
            "id": format!("q{number}"), "image": name, "family": "color",
            "question": format!("What color is it, {number}?"),
            "choices": ["red", "blue", "brown"], "answer": "brown",
        });
        lines += &question.to_string();
        lines.push('\n');
    }
    bench.file("set.jsonl", lines);
    bench
}

/// Width and height of the PNG image in a request.
fn size(request: &Value) -> (u64, u64) {
    use base64::Engine as _;
    let text = request.to_string();
    let data = text.split("base64,").nth(1).unwrap();
    let bytes = base64::engine::general_purpose::STANDARD.decode(&data[..64]).unwrap();
    let side = |at: usize| u64::from(u32::from_be_bytes(bytes[at..at + 4].try_into().unwrap()));
    (side(16), side(20))
}

/// Sentences about shrunk images: of the run, and of its report.
fn told(sizes: &[(u32, u32)], tokens: fn(u64, u64) -> u64) -> [String; 2] {
    let bench = bench(sizes);
    let mock = MockEndpoint::answering(move |request| {
        let (width, height) = size(request);
        Answer::message_charged("C", 60 + tokens(width, height))
    });
    let base = mock.base_url();
    let line = format!("--model qwen2.5-vl-7b --base-url {base} --data set.jsonl --levels L0 --out run");
    let run = bench.call(&words(&line)).ended(0);
    let report = bench.call(&words("report run")).ended(0);
    [run.stderr, report.stdout].map(|text| {
        let text = on_one_line(&text);
        let start = text.find("qwen2.5-vl-7b: the server counts about");
        start.map_or_else(String::new, |start| {
            let text = &text[start..];
            text[..text.find("max-side=N").unwrap()].to_owned()
        })
    })
}

fn patches(width: u64, height: u64) -> u64 {
    let along = |side: u64| (side as f64 / 28.0).round() as u64;
    along(width) * along(height)
}

#[test]
fn shrunk_images_are_said_in_run_and_report() {
    let fixed = |_, _| 280;
    let [run, report] = told(&[(1280, 960), (640, 480)], fixed);
    // In the run after five replies, about the larger image.
    assert!(run.contains("rule of the model's family gives 1564"), "{run}");
    assert!(report.contains("at all sizes, where the rule"), "{report}");
    let longer_side = |width, height| patches(500, 500 * height / width);
    let [run, report] = told(&[(1280, 960)], longer_side);
    assert!(run.contains("tokens an image, where") && run.contains("gives 1564"), "{run}");
    assert!(report.contains("gives 1564"), "{report}");
}

#[test]
fn images_sent_as_they_are_raise_nothing() {
    for tokens in [patches as fn(u64, u64) -> u64, |_, _| 0] {
        for sizes in [&[(1280, 960), (640, 480)][..], &[(1280, 960)]] {
            assert_eq!(told(sizes, tokens), [String::new(), String::new()]);
        }
    }
}
