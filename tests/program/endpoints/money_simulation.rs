//! A simulation of `--max-cost`: runs in four shards at servers of random prices, reply lengths and failures, which
//! count what they charge. The charge never exceeds the limit.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Duration;

use serde_json::{Value, json};

use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::run::{Bench, words};

/// Number of processes that share a limit.
const SHARDS: usize = 4;

/// Number of frames; each is in one shard.
const FRAMES: usize = 8;

/// Number of questions about each frame.
const QUESTIONS: usize = 8;

/// Random numbers by the generator SplitMix64.
#[derive(Clone, Copy)]
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut mixed = self.0;
        mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ (mixed >> 31)
    }

    /// A number from 0 to 1.
    fn share(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// A number between two, uniform on the scale of its logarithm.
    fn between(&mut self, low: f64, high: f64) -> f64 {
        low * (high / low).powf(self.share())
    }
}

/// A server and the run that asks it.
#[derive(Clone, Copy)]
struct Setting {
    seed: u64,
    /// Dollars per million tokens.
    input: f64,
    cached: f64,
    output: f64,
    max_tokens: u64,
    /// Share of the replies that are as long as their limit.
    long: f64,
    /// Share of the requests that fail.
    failing: f64,
    concurrency: u64,
    /// The limit in dollars.
    limit: f64,
}

impl Setting {
    fn new(seed: u64) -> Self {
        let mut numbers = Numbers(seed);
        let input = numbers.between(0.05, 20.0);
        let output = numbers.between(0.05, 100.0);
        let max_tokens = numbers.between(16.0, 2048.0) as u64;
        // Of one request with a prompt of 150 tokens and the longest reply.
        let request = (150.0 * input + max_tokens as f64 * output) / 1e6;
        Self {
            seed,
            input,
            cached: input * numbers.share(),
            output,
            max_tokens,
            long: numbers.share(),
            failing: 0.4 * numbers.share(),
            concurrency: numbers.between(1.0, 256.9) as u64,
            limit: request * SHARDS as f64 * numbers.between(2.0, 14.0),
        }
    }

    /// The answer to a request, and its charge in dollars.
    fn answer(&self, request: &Value, number: u64) -> (Answer, f64) {
        let mut numbers = Numbers(self.seed ^ number.wrapping_mul(0x5851_f42d_4c95_7f2d));
        let text = request["messages"].to_string();
        let text = text.split("data:image").next().map_or(0, str::len);
        let prompt = 90 + text as u64 / 4;
        let cached = (numbers.share() * prompt as f64) as u64;
        let reply = if numbers.share() < self.long { self.max_tokens } else { 1 + numbers.next() % self.max_tokens };
        let tokens = (prompt - cached) as f64 * self.input + cached as f64 * self.cached;
        let dollars = (tokens + reply as f64 * self.output) / 1e6;
        let usage = json!({
            "prompt_tokens": prompt, "completion_tokens": reply, "prompt_tokens_details": {"cached_tokens": cached},
        });
        let choices = json!([{"message": {"content": "C"}, "finish_reason": "stop"}]);
        let whole = Answer::json(200, &json!({"choices": choices, "usage": usage}));
        if numbers.share() >= self.failing {
            return (whole, dollars);
        }
        match numbers.next() % 8 {
            0 => (Answer::error(429, "rate_limit_exceeded", "slow down").header("retry-after", "0"), 0.0),
            1 => (Answer::error(400, "invalid", "no such image"), 0.0),
            2 => (Answer::error(500, "x", "oops"), dollars),
            3 => (Answer::error(504, "x", "oops"), dollars),
            4 => (Answer::json(200, &json!({"choices": [], "usage": usage})), dollars),
            5 => (Answer::json(200, &json!({"choices": choices})), dollars),
            6 => (whole.cut(10), dollars),
            _ => (Answer::silent(), dollars),
        }
    }
}

/// The charge of a run in four shards, as a share of its limit; and whether the limit ended it.
fn simulate(setting: Setting) -> (f64, bool) {
    let bench = Bench::new();
    let picture = image::RgbImage::from_pixel(64, 48, image::Rgb([90, 60, 30]));
    let mut lines = String::new();
    for frame in 0..FRAMES {
        picture.save(bench.path(&format!("{frame}.png"))).unwrap();
        for number in 0..QUESTIONS {
            let words = "very ".repeat(number % 5);
            let question = json!({
                "id": format!("q{frame}-{number}"), "image": format!("{frame}.png"), "family": "color",
                "question": format!("What {words}color is number {number} of {frame}?"),
                "choices": ["red", "blue", "brown"], "answer": "brown",
            });
            lines += &question.to_string();
            lines.push('\n');
        }
    }
    bench.file("set.jsonl", lines);
    let Setting { input, cached, output, .. } = setting;
    bench.file(
        "prices.toml",
        format!(
            "as-of = \"2026-01-01\"\nbatch = 0.5\n[models]\n\
             m = {{ input = {input}, output = {output}, cached-input = {cached}, image-tokens = 80 }}\n"
        ),
    );
    let charged = Arc::new(Mutex::new(0.0));
    let number = AtomicU64::new(0);
    let mock = MockEndpoint::answering({
        let charged = Arc::clone(&charged);
        move |request| {
            let number = number.fetch_add(1, Ordering::SeqCst);
            let (answer, dollars) = setting.answer(request, number);
            *charged.lock().unwrap() += dollars;
            // Replies overtake each other.
            thread::sleep(Duration::from_millis(Numbers(number).next() % 20));
            answer
        }
    });
    let base = mock.base_url();
    let codes: Vec<Option<i32>> = thread::scope(|scope| {
        let shards: Vec<_> = (1..=SHARDS).map(|shard| {
            let line = format!(
                "--data set.jsonl --levels L0 --model m --base-url {base} --prices prices.toml --out run --shard {shard}/{SHARDS} \
                 --max-tokens {} --concurrency {} --max-cost {} --timeout 0.5 --retries 2 --threads 1",
                setting.max_tokens, setting.concurrency, setting.limit
            );
            let bench = &bench;
            scope.spawn(move || bench.call(&words(&line)).code)
        }).collect();
        shards.into_iter().map(|shard| shard.join().unwrap()).collect()
    });
    let share = *charged.lock().unwrap() / setting.limit;
    let is_over = codes.iter().all(|code| *code == Some(3));
    assert!(codes.iter().all(|code| matches!(code, Some(0..=3))), "seed {}: {codes:?}", setting.seed);
    assert!(share <= 1.0 + 1e-9, "seed {}: {share} of the limit", setting.seed);
    (share, is_over)
}

#[test]
fn a_limit_holds_for_random_servers() {
    for seed in 1..=4 {
        simulate(Setting::new(seed));
    }
}

/// The long form: some minutes.
#[test]
#[ignore = "slow"]
#[expect(clippy::print_stdout, reason = "the result of the simulation")]
fn limit_holds_for_200_random_servers() {
    let mut shares = Vec::new();
    for seed in 1..=200 {
        let (share, is_over) = simulate(Setting::new(seed));
        shares.extend(is_over.then_some(share));
    }
    shares.sort_by(f64::total_cmp);
    let at = |part: f64| shares[(part * (shares.len() - 1) as f64) as usize];
    println!(
        "{} runs ended by the limit in all shards; share of it that was charged: lowest {:.2}, 10 % {:.2}, median {:.2}, highest {:.2}",
        shares.len(),
        at(0.0),
        at(0.1),
        at(0.5),
        at(1.0)
    );
}
