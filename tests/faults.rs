//! What servers really do, and what comes of it: each behaviour over a raw connection, with its outcome, the number of
//! requests and the time waited.
#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod support;

use std::io::Write as _;
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime};

use darkqa_eval::internals::ask::{
    Access, AskError, Endpoint, Message, Parameters, Payload, PayloadFormat, Reach, Remote, Secret,
    Sending, Temperature, Wire,
};
use darkqa_eval::types::{FailureKind, Finish, Reply, Rgb};
use serde_json::{Value, json};
use support::endpoint::{Answer, MockEndpoint, Request};

fn sending() -> Sending {
    Sending {
        first_delay: Duration::from_millis(1),
        timeout: Duration::from_secs(20),
        ..Sending::default()
    }
}

fn image() -> Payload {
    let samples = (0..6 * 4 * 3).map(|i| i * 3).collect();
    Payload::encode(&Rgb::new(4, 6, samples).unwrap(), PayloadFormat::Png, None).unwrap()
}

struct Asked {
    result: Result<Reply, AskError>,
    waited: Duration,
    requests: Vec<Value>,
}

/// Asks once, with an image, of a server that plays these answers.
async fn asked_with(answers: Vec<Answer>, sending: Sending, parameters: Parameters) -> Asked {
    let mock = MockEndpoint::start(answers);
    let access = Access {
        key: Some(Secret::new("sk-0123456789abcdef", "KEY").unwrap()),
        ..Access::new(mock.base_url().parse().unwrap())
    };
    let endpoint = Arc::new(Endpoint::open(access, sending).unwrap());
    let model = Remote::open(endpoint, Wire::Chat, parameters).unwrap();
    let started = Instant::now();
    let images = [Arc::new(image())];
    let message = Message {
        images: &images,
        ..Message::words("Red?")
    };
    let result = model.ask(message, 2).await;
    Asked {
        result,
        waited: started.elapsed(),
        requests: mock.requests().iter().map(Request::json).collect(),
    }
}

async fn asked(answers: Vec<Answer>) -> Asked {
    asked_with(answers, sending(), Parameters::new("m".into())).await
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

fn stream(events: &[&str]) -> Answer {
    let events: Vec<String> = events
        .iter()
        .map(|event| format!("data: {event}"))
        .collect();
    let events = events.join("\n\n") + "\n\n";
    Answer::new(200, events).header("content-type", "text/event-stream")
}

const PIECE: &str = r#"{"choices":[{"index":0,"delta":{"content":"B"}}]}"#;

/// Replies that are answers at the first request, with the text that is read and why the model stopped.
#[tokio::test]
#[expect(clippy::too_many_lines, reason = "a table")]
async fn a_message_is_found_in_every_shape() {
    let b = r#"{"role":"assistant","content":"B"}"#;
    let plain = completion(b);
    let http = |head: &str, body: &str| Answer::raw(format!("{head}\r\n\r\n{body}"));
    let cases: Vec<(&str, Answer, &str, Finish)> = vec![
        ("plain", Answer::text("B"), "B", Finish::Stop),
        (
            "a bare minimum",
            Answer::new(200, r#"{"choices":[{"message":{"content":"B"}}]}"#),
            "B",
            Finish::Unknown,
        ),
        (
            "text parts",
            Answer::new(
                200,
                completion(
                    r#"{"content":[{"type":"text","text":"B"},{"type":"text","text":"."}]}"#,
                ),
            ),
            "B.",
            Finish::Stop,
        ),
        (
            "thinking parts",
            Answer::new(
                200,
                completion(
                    r#"{"content":[{"type":"thinking","thinking":[{"type":"text","text":"A"}]},{"type":"text","text":"B"}]}"#,
                ),
            ),
            "B",
            Finish::Stop,
        ),
        (
            "reasoning apart",
            Answer::new(
                200,
                completion(r#"{"content":"B","reasoning_content":"A","reasoning":"A"}"#),
            ),
            "B",
            Finish::Stop,
        ),
        (
            "no content",
            Answer::message(
                &json!({"content": null, "reasoning_content": "A? B?"}),
                "length",
            ),
            "",
            Finish::Length,
        ),
        (
            "a missing content",
            Answer::message(&json!({"role": "assistant"}), "stop"),
            "",
            Finish::Stop,
        ),
        (
            "filtered",
            Answer::message(&json!({"content": null}), "content_filter"),
            "",
            Finish::Filter,
        ),
        (
            "a tool call",
            Answer::message(&json!({"content": null, "tool_calls": []}), "tool_calls"),
            "",
            Finish::Other("tool_calls".into()),
        ),
        (
            "choices out of order",
            Answer::new(
                200,
                r#"{"choices":[{"index":1,"message":{"content":"A"}},{"index":0,"message":{"content":"B"}}]}"#,
            ),
            "B",
            Finish::Unknown,
        ),
        (
            "odd extras",
            Answer::new(
                200,
                r#"{"error":null,"usage":null,"model":7,"timings":{},"choices":[{"index":0,"message":{"content":"B"},"finish_reason":"STOP","x":[]}]}"#,
            ),
            "B",
            Finish::Stop,
        ),
        (
            "blank lines first",
            Answer::new(200, format!("\n\n \r\n{plain}")),
            "B",
            Finish::Stop,
        ),
        (
            "a byte order mark",
            Answer::new(200, format!("\u{FEFF}{plain}")),
            "B",
            Finish::Stop,
        ),
        (
            "bytes that are no text",
            Answer::new(
                200,
                [b"{\"choices\":[{\"message\":{\"content\":\"B\xff\"}}]}".as_slice()].concat(),
            ),
            "B\u{FFFD}",
            Finish::Unknown,
        ),
        (
            "half a surrogate pair",
            Answer::new(200, completion(r#"{"content":"B \ud83d"}"#)),
            "B \u{FFFD}",
            Finish::Stop,
        ),
        (
            "another content type",
            Answer::new(200, plain.clone()).header("content-type", "text/plain"),
            "B",
            Finish::Stop,
        ),
        ("compressed", gzipped(plain.as_bytes()), "B", Finish::Stop),
        (
            "an event stream",
            stream(&[
                PIECE,
                r#"{"choices":[{"index":0,"delta":{},"finish_reason":"stop"}]}"#,
                "[DONE]",
            ]),
            "B",
            Finish::Stop,
        ),
        (
            "an event stream without an end mark",
            stream(&[
                r#"{"choices":[{"index":0,"delta":{"content":"B"},"finish_reason":"length"}]}"#,
            ]),
            "B",
            Finish::Length,
        ),
        (
            "HTTP/1.0 without a length",
            http("HTTP/1.0 200 OK", &plain),
            "B",
            Finish::Stop,
        ),
        (
            "chunks",
            Answer::raw(format!(
                "HTTP/1.1 200 OK\r\ntransfer-encoding: chunked\r\n\r\n{:x};x=1\r\n{plain}\r\n0\r\nx-trailer: 1\r\n\r\n",
                plain.len()
            )),
            "B",
            Finish::Stop,
        ),
        (
            "an interim reply",
            Answer::raw(format!(
                "HTTP/1.1 103 Early Hints\r\nlink: </x>\r\n\r\nHTTP/1.1 200 OK\r\ncontent-length: {}\r\n\r\n{plain}",
                plain.len()
            )),
            "B",
            Finish::Stop,
        ),
        ("a slow body", Answer::text("B").drip(1), "B", Finish::Stop),
    ];
    for (name, answer, text, finish) in cases {
        let asked = asked(vec![answer]).await;
        let reply = asked
            .result
            .unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!(
            (reply.text.as_str(), &reply.finish),
            (text, &finish),
            "{name}"
        );
        assert_eq!((reply.attempts, asked.requests.len()), (1, 1), "{name}");
    }
    let refused = json!({"content": null, "refusal": "The answer is A, but I cannot say so."});
    let reply = asked(vec![Answer::message(&refused, "stop")])
        .await
        .result
        .unwrap();
    assert_eq!(reply.text, "");
    assert!(reply.refusal.unwrap().starts_with("The answer"));
}

/// Failures that pass: the same request is sent again, and answered then.
#[tokio::test]
#[expect(clippy::too_many_lines, reason = "a table")]
async fn what_may_pass_is_tried_again() {
    let html = Answer::new(200, "<html><title>Sign in</title>").header("content-type", "text/html");
    let mut cut_gzip = gzip(completion(r#"{"content":"B"}"#).as_bytes());
    cut_gzip.truncate(cut_gzip.len() / 2);
    let cases = [
        ("500", Answer::error(500, "x", "oops")),
        ("502 as a page", Answer::new(502, "<html>Bad gateway")),
        ("503", Answer::new(503, "")),
        ("504", Answer::new(504, "upstream timed out")),
        ("520 of Cloudflare", Answer::new(520, "<html>error 520")),
        (
            "529 of Anthropic",
            Answer::json(
                529,
                &json!({"type": "error", "error": {"type": "overloaded_error", "message": "Overloaded"}}),
            ),
        ),
        ("498 of Groq", Answer::new(498, "")),
        ("499 of nginx", Answer::new(499, "")),
        ("408", Answer::new(408, "")),
        ("409", Answer::new(409, "")),
        ("425", Answer::new(425, "")),
        (
            "429",
            Answer::error(429, "rate_limit_exceeded", "slow down"),
        ),
        (
            "429 of a minute's quota",
            Answer::json(
                429,
                &json!({"error": {"status": "RESOURCE_EXHAUSTED", "message": "You exceeded your current quota"}}),
            ),
        ),
        ("no byte", Answer::dropped()),
        ("half a head", Answer::raw("HTTP/1.1 200 OK\r\nconten")),
        ("no HTTP", Answer::raw("SSH-2.0-OpenSSH_9.6\r\n")),
        ("half a body", Answer::text("B").cut(20)),
        (
            "half a chunk",
            Answer::raw("HTTP/1.1 200 OK\r\ntransfer-encoding: chunked\r\n\r\nff\r\n{\"choi"),
        ),
        ("half a JSON text", Answer::new(200, "{\"choices\":[")),
        ("nothing", Answer::new(200, "")),
        ("204", Answer::raw("HTTP/1.1 204 No Content\r\n\r\n")),
        ("no choice", Answer::json(200, &json!({"choices": []}))),
        ("null choices", Answer::json(200, &json!({"choices": null}))),
        (
            "a choice without a message",
            Answer::json(200, &json!({"choices": [{"index": 0}]})),
        ),
        (
            "another object",
            Answer::json(200, &json!({"status": "ok"})),
        ),
        (
            "a reply that broke off",
            Answer::message(&json!({"content": "B"}), "error"),
        ),
        ("a page", html),
        ("a stream that broke off", stream(&[PIECE])),
        (
            "a stream with an error",
            stream(&[PIECE, r#"{"error":{"message":"overloaded","code":503}}"#]),
        ),
        ("a stream of nothing", stream(&["[DONE]"])),
        (
            "an error with status 200",
            Answer::json(200, &json!({"error": {"message": "no", "code": 502}})),
        ),
        (
            "an error as text with status 200",
            Answer::json(200, &json!({"error": "overloaded"})),
        ),
        (
            "an error in the choice",
            Answer::json(
                200,
                &json!({"choices": [{"error": {"message": "no", "code": 502}}]}),
            ),
        ),
        (
            "half a compressed body",
            Answer::new(200, cut_gzip).header("content-encoding", "gzip"),
        ),
        (
            "no compressed body",
            Answer::text("B").header("content-encoding", "gzip"),
        ),
        (
            "what the server says to try again",
            Answer::error(400, "x", "odd").header("x-should-retry", "true"),
        ),
        ("nesting without end", Answer::new(200, "[".repeat(5000))),
    ];
    for (name, answer) in cases {
        let asked = asked(vec![answer, Answer::text("B")]).await;
        let reply = asked
            .result
            .unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!((reply.text.as_str(), reply.attempts), ("B", 2), "{name}");
        assert_eq!(asked.requests.len(), 2, "{name}");
        assert_eq!(asked.requests[0], asked.requests[1], "{name}");
    }
}

/// Failures of this one request: it is not sent again, and others go on.
#[tokio::test]
async fn what_is_wrong_with_one_request_fails_it_at_once() {
    use FailureKind::{Filtered, Request, Response, Server};
    let bomb = vec![b' '; 300 << 20];
    let cases = [
        (
            "400",
            Answer::error(400, "x", "bad image"),
            Request,
            "bad image",
        ),
        (
            "a context that is too long",
            Answer::error(400, "context_length_exceeded", "too long"),
            Request,
            "too long",
        ),
        (
            "413 as a page",
            Answer::new(413, "<html><title>Too Large</title>"),
            Request,
            "--max-side",
        ),
        ("415", Answer::new(415, "image/webp"), Request, "image/webp"),
        (
            "422 of FastAPI",
            Answer::json(422, &json!({"detail": [{"msg": "field required"}]})),
            Request,
            "field required",
        ),
        (
            "a flat error",
            Answer::json(
                400,
                &json!({"object": "error", "message": "no", "code": 400}),
            ),
            Request,
            "no",
        ),
        (
            "a filter of Azure",
            Answer::json(
                400,
                &json!({"error": {"code": "content_filter", "message": "filtered", "innererror": {"code": "ResponsibleAIPolicyViolation"}}}),
            ),
            Filtered,
            "filtered",
        ),
        (
            "a moderator",
            Answer::json(
                403,
                &json!({"error": {"message": "no", "metadata": {"reasons": ["x"]}}}),
            ),
            Filtered,
            "no",
        ),
        (
            "what the server says not to try again",
            Answer::error(500, "x", "oops").header("x-should-retry", "false"),
            Server,
            "oops",
        ),
        (
            "400 with status 200",
            Answer::json(200, &json!({"error": {"message": "odd", "code": 400}})),
            Request,
            "odd",
        ),
        (
            "a body without end",
            Answer::new(200, vec![b' '; (16 << 20) + 1]),
            Response,
            "16 MiB",
        ),
        (
            "a small body that unpacks without end",
            gzipped(&bomb),
            Response,
            "16 MiB",
        ),
    ];
    for (name, answer, kind, said) in cases {
        let asked = asked(vec![answer]).await;
        let error = asked.result.unwrap_err();
        assert_eq!(
            (error.failure.kind, error.reach),
            (kind, Reach::Trial),
            "{name}: {error}"
        );
        assert_eq!((error.attempts, asked.requests.len()), (1, 1), "{name}");
        assert!(error.failure.message.contains(said), "{name}: {error}");
    }
}

/// Failures that every other request would meet: the run is to stop, and is told how to mend it.
#[tokio::test]
async fn what_reaches_every_request_is_told_apart() {
    let moved = |status| Answer::new(status, "").header("location", "https://elsewhere.example/v1");
    let cases = [
        ("401", Answer::error(401, "x", "no"), "--api-key-env"),
        ("402", Answer::error(402, "x", "pay"), "credit"),
        ("403", Answer::error(403, "x", "no"), "key"),
        ("404", Answer::new(404, ""), "--base-url"),
        (
            "404 of a model",
            Answer::error(404, "model_not_found", "no such model"),
            "--model",
        ),
        (
            "404 of OpenRouter",
            Answer::error(404, "x", "No endpoints found that support image input"),
            "--blind",
        ),
        ("405", Answer::new(405, ""), "--base-url"),
        ("407", Answer::new(407, ""), "key"),
        ("410", Answer::new(410, ""), "--model"),
        ("301", moved(301), "elsewhere"),
        ("302", moved(302), "--base-url"),
        ("307", moved(307), "elsewhere"),
        ("308", moved(308), "elsewhere"),
        (
            "no quota",
            Answer::error(429, "insufficient_quota", "no quota"),
            "credit",
        ),
        (
            "no billing",
            Answer::error(429, "billing_hard_limit_reached", "no"),
            "credit",
        ),
        (
            "no credit",
            Answer::error(400, "x", "Your credit balance is too low"),
            "credit",
        ),
        (
            "400 of a model",
            Answer::error(400, "model_not_found", "no such model"),
            "--model",
        ),
        (
            "a gateway without keys",
            Answer::error(400, "400", "No connected db."),
            "key",
        ),
        (
            "a key with status 200",
            Answer::json(200, &json!({"error": {"message": "who?", "code": 401}})),
            "who?",
        ),
        (
            "no eyes: llama.cpp",
            Answer::error(
                500,
                "500",
                "image input is not supported - hint: if this is unexpected, you may need to provide the mmproj",
            ),
            "--blind",
        ),
        (
            "no eyes: vLLM",
            Answer::json(
                400,
                &json!({"object": "error", "message": "m is not a multimodal model None"}),
            ),
            "--blind",
        ),
        (
            "no eyes: Ollama",
            Answer::error(400, "x", "this model does not support image input"),
            "--blind",
        ),
        (
            "no eyes: OpenAI",
            Answer::error(
                400,
                "x",
                "Invalid content type. image_url is only supported by certain models.",
            ),
            "--blind",
        ),
    ];
    for (name, answer, said) in cases {
        let asked = asked(vec![answer]).await;
        let error = asked.result.unwrap_err();
        assert_eq!(
            (error.reach, error.attempts),
            (Reach::Endpoint, 1),
            "{name}: {error}"
        );
        assert_eq!(asked.requests.len(), 1, "{name}");
        assert!(error.failure.message.contains(said), "{name}: {error}");
    }
}

/// Retries come to an end, with the last failure.
#[tokio::test]
async fn retries_come_to_an_end() {
    use FailureKind::{Connection, RateLimit, Response, Server, Timeout};
    let cases = [
        ("500", Answer::error(500, "x", "oops"), Server, Some(500)),
        ("429", Answer::error(429, "x", "slow"), RateLimit, Some(429)),
        (
            "nonsense",
            Answer::new(200, "nonsense"),
            Response,
            Some(200),
        ),
        ("no byte", Answer::dropped(), Connection, None),
        ("half a body", Answer::text("B").cut(9), Connection, None),
        (
            "an error with status 200",
            Answer::json(200, &json!({"error": "x"})),
            Server,
            Some(200),
        ),
        ("silence", Answer::silent(), Timeout, None),
        ("half a body and silence", Answer::stuck(), Timeout, None),
        ("a drip", Answer::text("B").drip(20), Timeout, None),
    ];
    for (name, answer, kind, status) in cases {
        let sending = Sending {
            retries: 2,
            timeout: Duration::from_millis(150),
            ..sending()
        };
        let asked = asked_with(vec![answer], sending, Parameters::new("m".into())).await;
        let error = asked.result.unwrap_err();
        assert_eq!(
            (error.failure.kind, error.failure.status),
            (kind, status),
            "{name}"
        );
        assert_eq!((error.attempts, error.reach), (3, Reach::Trial), "{name}");
        assert_eq!(asked.requests.len(), 3, "{name}");
        if kind == Timeout {
            assert!(asked.waited >= Duration::from_millis(450), "{name}");
            assert!(error.failure.message.contains("--timeout"), "{error}");
        }
    }
}

/// Waits that a server asks for are kept, in every form, and those beyond `--max-wait` are not begun.
#[tokio::test]
async fn waits_are_kept_and_capped() {
    let limited = |name: &str, value: &str| Answer::error(429, "x", "slow").header(name, value);
    let date = |seconds| httpdate::fmt_http_date(SystemTime::now() + Duration::from_secs(seconds));
    let skewed = limited("retry-after", "Sun, 06 Nov 1994 08:49:38 GMT")
        .header("date", "Sun, 06 Nov 1994 08:49:37 GMT");
    let cases = [
        // The first, for time goes on.
        ("a date", limited("retry-after", &date(2)), 900),
        ("milliseconds", limited("retry-after-ms", "200"), 200),
        ("seconds", limited("retry-after", "1"), 1000),
        ("a fraction", limited("retry-after", "0.2"), 200),
        (
            "milliseconds before seconds",
            limited("retry-after", "60").header("retry-after-ms", "200"),
            200,
        ),
        ("a date of a clock that is wrong", skewed, 1000),
        (
            "503",
            Answer::new(503, "").header("retry-after", "0.2"),
            200,
        ),
        (
            "a failure that is no pause",
            Answer::new(500, "").header("retry-after", "0.2"),
            200,
        ),
        ("no number", limited("retry-after", "soon"), 0),
        ("none", limited("retry-after", "0"), 0),
        ("less than none", limited("retry-after", "-5"), 0),
    ];
    for (name, answer, least) in cases {
        let asked = asked(vec![answer, Answer::text("B")]).await;
        assert_eq!(asked.result.unwrap().attempts, 2, "{name}");
        let waited = asked.waited.as_millis();
        assert!(
            (least..least + 1900).contains(&waited),
            "{name}: {waited} ms"
        );
    }
    for wait in ["600", "1e300", &date(86_400)] {
        let asked = asked(vec![limited("retry-after", wait)]).await;
        let error = asked.result.unwrap_err();
        assert!(error.failure.message.contains("--max-wait"), "{error}");
        assert_eq!((error.attempts, error.reach), (1, Reach::Endpoint));
        assert!(asked.waited < Duration::from_secs(2));
    }
}

/// Fields that a server does not take are sent otherwise from then on, where that was left to the program.
#[tokio::test]
async fn fields_are_adapted_once_for_all() {
    let refused = |param: &str, code: &str| {
        let message = format!("Unsupported: '{param}' is not supported with this model.");
        Answer::json(
            400,
            &json!({"error": {"param": param, "code": code, "message": message}}),
        )
    };
    let limit = || refused("max_tokens", "unsupported_parameter");
    let heat = || refused("temperature", "unsupported_value");
    let asked = asked(vec![limit(), heat(), Answer::text("B")]).await;
    assert_eq!(asked.result.unwrap().attempts, 3);
    let [first, second, third] = &asked.requests[..] else {
        panic!("{:?}", asked.requests);
    };
    assert_eq!(
        (&first["max_tokens"], &first["temperature"]),
        (&json!(1024), &json!(0.0))
    );
    assert_eq!(second["max_tokens"], Value::Null);
    assert_eq!(second["max_completion_tokens"], 1024);
    assert_eq!(
        (&third["max_completion_tokens"], &third["temperature"]),
        (&json!(1024), &Value::Null)
    );

    // What the user has said is never changed.
    let stated = Parameters {
        temperature: Temperature::Of(0.5),
        ..Parameters::new("m".into())
    };
    let asked = asked_with(vec![heat()], sending(), stated).await;
    let error = asked.result.unwrap_err();
    assert_eq!((error.reach, error.attempts), (Reach::Endpoint, 1));
    assert!(
        error.failure.message.contains("--temperature default"),
        "{error}"
    );
    // A server that takes neither name is left after both.
    let asked = asked_with(
        vec![
            limit(),
            refused("max_completion_tokens", "unsupported_parameter"),
        ],
        sending(),
        Parameters::new("m".into()),
    )
    .await;
    let error = asked.result.unwrap_err();
    assert_eq!(
        (error.reach, error.attempts),
        (Reach::Endpoint, 2),
        "{error}"
    );
}
