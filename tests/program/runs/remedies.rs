//! Remedies that a message prints: the same command with the printed flag, in the same folder, gets all replies and
//! asks none twice.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use serde_json::{Value, json};

use crate::support::endpoint::{Answer, MockEndpoint, Request};
use crate::support::house::House;
use crate::support::run::{Bench, Called, model_args, records, words};
use crate::support::snapshot::on_one_line;
use crate::support::table::check_rows_at_once;

/// Number of questions of each run.
const QUESTIONS: usize = 12;

/// A server that answers, or refuses by a rule over the number of its answers so far and the body.
struct Server {
    mock: MockEndpoint,
    answered: Arc<AtomicUsize>,
}

impl Server {
    fn new(refuse: impl Fn(usize, &Value) -> Option<Answer> + Send + Sync + 'static) -> Self {
        let answered = Arc::new(AtomicUsize::new(0));
        let count = Arc::clone(&answered);
        let mock = MockEndpoint::answering(move |body| {
            if let Some(refusal) = refuse(count.load(Ordering::SeqCst), body) {
                return refusal;
            }
            count.fetch_add(1, Ordering::SeqCst);
            let text = if body["model"] == "j" { "4" } else { "C" };
            if body.get("stream").is_none() {
                return Answer::text(text);
            }
            Answer::streamed_text(text)
        });
        Self { mock, answered }
    }

    fn answered(&self) -> usize {
        self.answered.load(Ordering::SeqCst)
    }
}

fn refusal(status: u16, message: &str) -> Answer {
    Answer::json(status, &json!({"error": {"message": message}}))
}

/// Refuses if the condition holds.
fn when(holds: bool, status: u16, message: &str) -> Option<Answer> {
    holds.then(|| refusal(status, message))
}

fn tokens(body: &Value) -> u64 {
    body["max_tokens"].as_u64().unwrap_or(u64::MAX)
}

/// The records of a run by trial, the last of each.
fn last_records(bench: &Bench) -> BTreeMap<String, Value> {
    records(&bench.path("run")).into_iter().map(|record| (record["key"].to_string(), record)).collect()
}

/// A remedy that is tried in the state in which it is printed.
struct Row {
    name: &'static str,
    /// Flags of the first command, and of the second, which follows the remedy.
    flags: [&'static str; 2],
    /// The remedy in the message of the first command.
    remedy: &'static str,
    server: Server,
    /// Words of the report after the second command, or an empty text.
    report: &'static str,
}

const CANNOT: &str = "No endpoints found that can handle the requested parameters.";

#[expect(clippy::too_many_lines, reason = "a table")]
fn rows() -> Vec<Row> {
    let row = |name, flags, remedy, server, report| Row { name, flags, remedy, server, report };
    vec![
        row(
            "credit for 500 tokens",
            ["", "--max-tokens 500"],
            "--max-tokens 500",
            Server::new(|_, body| {
                when(
                    tokens(body) > 500,
                    402,
                    "This request requires more credits, or fewer max_tokens. You requested up to 1024 tokens, but can only afford 500.",
                )
            }),
            "m was asked with another token limit than the run began with (--max-tokens): 12 replies with 500",
        ),
        row(
            "credit that becomes less",
            ["", "--max-tokens 400"],
            "--max-tokens 400",
            Server::new(|answered, body| when(answered >= 4 && tokens(body) > 400, 402, "You can only afford 400")),
            "m was asked with several token limits (--max-tokens): 4 replies with 1024, 8 replies with 400",
        ),
        row(
            "a temperature of the user, refused later",
            ["--temperature 0.5", "--temperature default"],
            "--temperature default",
            Server::new(|answered, body| {
                when(
                    answered >= 3 && body.get("temperature").is_some(),
                    400,
                    "invalid temperature: only 1 is allowed for this model",
                )
            }),
            "The --temperature of m has two values, because the server refused the first: 0.5 in 3 replies, then default.",
        ),
        row(
            "a temperature of the user, refused at once",
            ["--temperature 0.5", "--temperature 1"],
            "--temperature default",
            Server::new(|_, body| {
                when(body["temperature"] != 1.0, 400, "invalid temperature: only 1 is allowed for this model")
            }),
            "The --temperature of m is 1 in all replies; the run began with 0.5.",
        ),
        row(
            "a default that was adapted, then set",
            ["", "--temperature default"],
            "no temperature is sent",
            {
                // One trial fails, so that something is left to ask.
                let failed = AtomicUsize::new(0);
                Server::new(move |answered, body| {
                    when(body.get("temperature").is_some(), 400, "`temperature` is deprecated for this model.")
                        .or_else(|| when(answered == 5 && failed.fetch_add(1, Ordering::SeqCst) == 0, 413, "too large"))
                })
            },
            "The --temperature of m has two values, because the server refused the first: auto in 11 replies, then default.",
        ),
        row(
            "a name of the token limit",
            ["--request token-field=max_tokens", "--request token-field=max_completion_tokens"],
            "--request token-field=max_completion_tokens",
            Server::new(|_, body| {
                when(
                    body.get("max_tokens").is_some(),
                    400,
                    "Unsupported parameter: 'max_tokens'. Use 'max_completion_tokens' instead.",
                )
            }),
            "",
        ),
        row(
            "no token limit at all",
            ["--request token-field=max_tokens", "--request token-field=none"],
            "(or none)",
            Server::new(|answered, body| {
                when(
                    answered >= 2 && (body.get("max_tokens").is_some() || body.get("max_completion_tokens").is_some()),
                    400,
                    "Unsupported parameter: 'max_tokens'",
                )
            }),
            "The --max-tokens of m has two values, because the server refused the first: 1024 in 2 replies, then unset.",
        ),
        row(
            "a stream",
            ["--request wire=chat", "--request wire=chat-stream"],
            "--request wire=chat-stream",
            Server::new(|_, body| when(body.get("stream").is_none(), 400, "This model only support stream mode")),
            "",
        ),
        row(
            "probabilities",
            ["--request probabilities", ""],
            "--request probabilities",
            Server::new(|_, body| when(body.get("logprobs").is_some(), 404, CANNOT)),
            "The --request probabilities of m is unset in all replies; the run began with true.",
        ),
        row(
            "a temperature that no provider takes",
            ["", "--temperature default"],
            "--temperature default",
            Server::new(|answered, body| when(answered >= 6 && body.get("temperature").is_some(), 404, CANNOT)),
            "auto in 6 replies, then default.",
        ),
        row(
            "an effort",
            ["--reasoning-effort minimal", ""],
            "--reasoning-effort",
            Server::new(|_, body| {
                when(body.get("reasoning_effort").is_some(), 400, "Unknown parameter: 'reasoning_effort'")
            }),
            "The --reasoning-effort of m is unset in all replies; the run began with minimal.",
        ),
        row(
            "a constraint",
            ["--request constrain=json", ""],
            "--request constrain",
            Server::new(|_, body| {
                when(body.get("response_format").is_some(), 400, "This response_format type is unavailable now")
            }),
            "The --request constrain of m is none in all replies; the run began with json.",
        ),
        row(
            "a system message",
            ["--system Hello", ""],
            "--system",
            Server::new(|_, body| {
                when(
                    body["messages"].to_string().contains("Hello"),
                    400,
                    "prompting with images is incompatible with system messages",
                )
            }),
            "The --system of m is unset in all replies; the run began with Hello.",
        ),
        row(
            "a field of the user",
            ["--extra-body {\"presence_penalty\":1}", ""],
            "--extra-body",
            Server::new(|_, body| {
                when(
                    body.get("presence_penalty").is_some(),
                    400,
                    "Model m does not support parameter presence_penalty.",
                )
            }),
            "The --extra-body of m is unset in all replies",
        ),
        row(
            "nucleus sampling, refused later",
            ["--top-p 0.9", ""],
            "--top-p",
            Server::new(|answered, body| {
                when(answered >= 1 && body.get("top_p").is_some(), 400, "`top_p` is not supported by this model")
            }),
            "The --top-p of m has two values, because the server refused the first: 0.9 in 1 reply, then unset.",
        ),
        row(
            "a quota for an hour",
            ["", "--retries max-wait=2000"],
            "--retries max-wait",
            {
                let refused = AtomicUsize::new(0);
                Server::new(move |answered, _| {
                    let is_out = answered == 3 && refused.fetch_add(1, Ordering::SeqCst) < 2;
                    let wait = if refused.load(Ordering::SeqCst) < 2 { "754" } else { "1" };
                    is_out.then(|| refusal(403, "Out of call volume quota.").header("retry-after", wait))
                })
            },
            "",
        ),
    ]
}

#[test]
fn printed_remedies_help() {
    check_rows_at_once(rows(), |row| {
        let Row { name, flags, remedy, server, report } = row;
        let bench = Bench::with_questions(QUESTIONS);
        let base = server.mock.base_url();
        let args = model_args(&base, "--data set.jsonl --levels L0 --out run --concurrency 1 --retries 0");
        let [first, second] = flags.map(|more| bench.call(&[args.clone(), words(more)].concat()));
        assert_ne!(first.code, Some(0), "{name}: {first:?}");
        assert!(first.stderr.contains(remedy), "{name}: {}", first.stderr);
        assert_eq!(second.code, Some(0), "{name}: {second:?}");
        let last = last_records(&bench);
        assert_eq!(last.len(), QUESTIONS, "{name}");
        assert!(last.values().all(|record| record["failure"].is_null()), "{name}");
        assert_eq!(server.answered(), QUESTIONS, "{name}: a reply was asked twice");
        let shown = bench.complete(&["report", "run", "--full"]);
        let plain = on_one_line(&shown);
        assert!(plain.contains(report), "{name}: {shown}");
        // Without a change, the report names none.
        assert!(!report.is_empty() || !plain.contains("the run began with"), "{name}: {shown}");
    });
}

/// Settings that no server refused are another run's once there are replies, and sampling settings that it refused do
/// not open others.
#[test]
fn settings_that_nobody_refused_stay() {
    let bench = Bench::with_questions(QUESTIONS);
    let server = Server::new(|answered, body| {
        when(answered >= 3 && body["temperature"] == 0.5, 400, "invalid temperature: only 1 is allowed for this model")
    });
    let base = server.mock.base_url();
    let run = |flags: &str| {
        let line = format!("--data set.jsonl --levels L0 --out run --concurrency 1 {flags}");
        bench.call(&model_args(&base, &line))
    };
    assert_eq!(run("--temperature 0.5").code, Some(2));
    let other = run("--temperature default --system Hello");
    assert_eq!(other.code, Some(2));
    assert!(other.stderr.contains("another --"), "{other:?}");
    assert_eq!(run("--temperature 0.5 --top-p 0.5").code, Some(2));
    assert_eq!(server.answered(), 3);
    assert_eq!(run("--temperature default").code, Some(0));
    // The accepted value continues; a third is refused by nobody.
    assert_eq!(run("--temperature default").code, Some(0));
    assert_eq!(server.answered(), QUESTIONS);
}

#[test]
fn changed_limits_ask_truncated_replies_again() {
    let bench = Bench::with_questions(QUESTIONS);
    let is_rich = Arc::new(AtomicUsize::new(0));
    let state = Arc::clone(&is_rich);
    let mock = MockEndpoint::answering(move |body| {
        let is_rich = state.load(Ordering::SeqCst) > 0;
        if !is_rich && tokens(body) > 400 {
            return refusal(402, "You can only afford 400");
        }
        let finish = if tokens(body) > 400 { "stop" } else { "length" };
        Answer::message(&json!({"role": "assistant", "content": "C"}), finish)
    });
    let base = mock.base_url();
    let args = model_args(&base, "--data set.jsonl --levels L0 --out run");
    assert_eq!(bench.call(&args).code, Some(2));
    let fewer = [args.clone(), words("--max-tokens 400")].concat();
    bench.complete(&fewer);
    let cut = last_records(&bench);
    assert!(cut.values().all(|record| record["max_tokens"] == 400), "{cut:?}");
    // The same limit asks nothing again; that of the first command does, because replies were cut below it.
    let asked = mock.requests().len();
    bench.complete(&fewer);
    assert_eq!(mock.requests().len(), asked);
    is_rich.store(1, Ordering::SeqCst);
    bench.complete(&args);
    assert_eq!(mock.requests().len(), asked + QUESTIONS);
    let whole = last_records(&bench);
    assert!(whole.values().all(|record| record["finish"] == "stop"), "{whole:?}");
    // What the cut replies cost is not forgotten.
    bench.complete(&args);
    assert_eq!(mock.requests().len(), asked + QUESTIONS);
}

/// A server for open questions whose judge has rules of its own.
fn of_judge(house: &House, server: &Server, flags: &str) -> Called {
    let base = server.mock.base_url();
    house.call(&words(&format!(
        "--model m --judge j --base-url {base} --levels L0 --out run --concurrency 1 --retries 0 {flags}"
    )))
}

fn sent(server: &Server, model: &str) -> Vec<Value> {
    let requests = server.mock.requests();
    requests.iter().map(Request::json).filter(|body| body["model"] == model).collect()
}

/// Checks that the first command fails and prints the remedy, and that the second, in the same folder, succeeds and
/// asks no answer again.
fn check_judge_remedy(server: &Server, flags: [&str; 2], remedy: &str) {
    let house = House::new();
    let [first, second] = flags;
    let first = of_judge(&house, server, first);
    assert_ne!(first.code, Some(0), "{first:?}");
    let printed = format!("{}{}", first.stdout, first.stderr);
    assert!(printed.contains(remedy), "{printed}");
    let answers = sent(server, "m").len();
    let second = of_judge(&house, server, second);
    assert_eq!(second.code, Some(0), "{second:?}");
    assert_eq!(sent(server, "m").len(), answers, "answers were asked again");
}

#[test]
fn default_temperature_of_the_judge_is_adapted() {
    let house = House::new();
    let server = Server::new(|_, body| {
        let is_refused = body["model"] == "j" && body.get("temperature").is_some();
        when(is_refused, 400, "invalid temperature: only 1 is allowed for this model")
    });
    let called = of_judge(&house, &server, "");
    assert_eq!(called.code, Some(0), "{called:?}");
    assert!(called.stderr.contains("j: no temperature is sent"), "{called:?}");
    assert!(sent(&server, "m").iter().all(|body| body["temperature"] == 0.2));
    assert_eq!(sent(&server, "j").last().unwrap().get("temperature"), None);
    // A temperature of the user is the user's to change: by the judge's flag, in the same folder.
    let server = Server::new(|_, body| {
        let is_refused = body["model"] == "j" && body["temperature"] != 1.0;
        when(is_refused, 400, "invalid temperature: only 1 is allowed for this model")
    });
    let flags = ["--judge-temperature 0.5", "--judge-temperature 1"];
    check_judge_remedy(&server, flags, "--judge-temperature default");
}

#[test]
fn default_seed_is_adapted_and_a_seed_of_the_user_is_named() {
    let extra = || {
        let details = json!({"detail": [{"type": "extra_forbidden", "loc": ["body", "seed"], "msg": "Extra inputs are not permitted"}]});
        Answer::json(422, &details)
    };
    let house = House::new();
    let server = Server::new(move |_, body| body.get("seed").map(|_| extra()));
    let called = of_judge(&house, &server, "");
    assert_eq!(called.code, Some(0), "{called:?}");
    assert!(called.stderr.contains("m: no seed is sent"), "{called:?}");
    let house = House::new();
    let server = Server::new(move |_, body| body.get("seed").map(|_| extra()));
    let first = of_judge(&house, &server, "--sampling-seed 7");
    assert_eq!(first.code, Some(2), "{first:?}");
    for words in ["seed: Extra inputs", "--sampling-seed none"] {
        assert!(first.stderr.contains(words), "{}", first.stderr);
    }
    let second = of_judge(&house, &server, "--sampling-seed none");
    assert_eq!(second.code, Some(0), "{second:?}");
}

#[test]
fn credit_of_the_judge_is_told_by_its_own_flag() {
    let server = Server::new(|_, body| when(body["model"] == "j" && tokens(body) > 20, 402, "You can only afford 20"));
    let flags = ["", "--judge-max-tokens 20"];
    check_judge_remedy(&server, flags, "--judge-max-tokens 20");
}

/// The least temperature that a server takes is sent, and nothing if that is refused, too.
#[test]
fn least_temperature_is_sent() {
    for (least, expected) in [(0.01, Some(0.01)), (0.5, None)] {
        let bench = Bench::with_questions(QUESTIONS);
        let server = Server::new(move |_, body| {
            let is_refused = body["temperature"].as_f64().is_some_and(|sent| sent < least);
            when(is_refused, 422, "Input validation error: `temperature` must be strictly positive")
        });
        let base = server.mock.base_url();
        let printed = bench.complete(&model_args(&base, "--data set.jsonl --levels L0 --out run"));
        let last = server.mock.requests().last().unwrap().json();
        assert_eq!(last.get("temperature").and_then(Value::as_f64), expected);
        let words = match expected {
            Some(_) => "the temperature is sent as 0.01, the least that it takes",
            None => "no temperature is sent",
        };
        let plain = on_one_line(&printed);
        assert!(plain.contains(words), "{printed}");
    }
}
