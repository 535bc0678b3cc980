//! What servers really do, and what comes of it: each behaviour over a raw connection, with its outcome, the number of
//! requests and the time waited.
mod failures;
mod fields;
mod gateways;
mod replies;
mod retries;
mod vendors;
mod wires;

use std::io::Write as _;
use std::sync::Arc;
use std::time::{Duration, Instant};

use crate::support::endpoint::{Answer, MockEndpoint, Request};
use darkqa_base::types::{Reply, Rgb};
use darkqa_eval::internals::ask::{Access, AskError, Endpoint, Message, Parameters, Remote, Secret, Sending};
use darkqa_pictures::Payload;
use darkqa_pictures::PayloadFormat;
use serde_json::Value;

fn sending() -> Sending {
    Sending { first_delay: Duration::from_millis(1), timeout: Duration::from_secs(20), ..Sending::default() }
}

fn image() -> Payload {
    let samples = (0..6 * 4 * 3).map(|i| i * 3).collect();
    Payload::encode(&Rgb::new(4, 6, samples).unwrap(), PayloadFormat::Png).unwrap()
}

/// The outcome of one question.
struct Outcome {
    result: Result<Reply, AskError>,
    /// The time until the result, pauses included.
    time: Duration,
    requests: Vec<Value>,
}

/// Asks once, with an image, of a server that plays these answers.
fn ask_with(answers: Vec<Answer>, sending: Sending, parameters: Parameters) -> Outcome {
    let mock = MockEndpoint::start(answers);
    let access = Access {
        key: Some(Secret::new("sk-0123456789abcdef", "KEY").unwrap()),
        ..Access::new(mock.base_url().parse().unwrap())
    };
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    runtime.block_on(async {
        let endpoint = Arc::new(Endpoint::open(access, sending).unwrap());
        let model = Remote::open(endpoint, parameters).unwrap();
        let started = Instant::now();
        let images = [Arc::new(image())];
        let message = Message { images: &images, ..Message::text_only("Red?") };
        let result = model.ask(message, 2).await;
        Outcome { result, time: started.elapsed(), requests: mock.requests().iter().map(Request::json).collect() }
    })
}

/// The same with the usual settings.
fn ask(answers: Vec<Answer>) -> Outcome {
    ask_with(answers, sending(), Parameters::new("m".into()))
}

fn gzip(text: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
    encoder.write_all(text).unwrap();
    encoder.finish().unwrap()
}

fn gzipped(text: &[u8]) -> Answer {
    Answer::new(200, gzip(text)).header("content-encoding", "gzip")
}

fn completion(message: &str) -> String {
    format!(r#"{{"choices":[{{"index":0,"message":{message},"finish_reason":"stop"}}]}}"#)
}

const PIECE: &str = r#"{"choices":[{"index":0,"delta":{"content":"B"}}]}"#;
