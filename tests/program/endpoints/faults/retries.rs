//! Failures that pass: tried again, up to a number, after the time that the server asks for.

use std::time::{Duration, SystemTime};

use darkqa_base::types::FailureKind;
use darkqa_eval::internals::ask::{Parameters, Reach, Sending};
use serde_json::json;

use super::{PIECE, ask, ask_with, completion, gzip, sending};
use crate::support::endpoint::Answer;
use crate::support::snapshot::redacted;
use crate::support::table::{check_rows, check_rows_at_once};

/// Failures that pass: the same request is sent again, and answered then.
#[test]
fn what_may_pass_is_tried_again() {
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
        ("429", Answer::error(429, "rate_limit_exceeded", "slow down")),
        (
            "429 of a minute's quota",
            Answer::json(
                429,
                &json!({"error": {"status": "RESOURCE_EXHAUSTED", "message": "You exceeded your current quota"}}),
            ),
        ),
        ("no byte", Answer::dropped()),
        ("half a head", Answer::raw("HTTP/1.1 200 OK\r\nconten")),
        ("half a body", Answer::text("B").cut(20)),
        ("half a chunk", Answer::raw("HTTP/1.1 200 OK\r\ntransfer-encoding: chunked\r\n\r\nff\r\n{\"choi")),
        ("half a JSON text", Answer::new(200, "{\"choices\":[")),
        ("nothing", Answer::new(200, "")),
        ("204", Answer::raw("HTTP/1.1 204 No Content\r\n\r\n")),
        ("no choice", Answer::json(200, &json!({"choices": []}))),
        ("null choices", Answer::json(200, &json!({"choices": null}))),
        ("a choice without a message", Answer::json(200, &json!({"choices": [{"index": 0}]}))),
        ("another object", Answer::json(200, &json!({"status": "ok"}))),
        ("a reply that broke off", Answer::message(&json!({"content": "B"}), "error")),
        ("a page", html),
        ("a stream that broke off", Answer::stream(&[PIECE])),
        ("a stream with an error", Answer::stream(&[PIECE, r#"{"error":{"message":"overloaded","code":503}}"#])),
        ("a stream of nothing", Answer::stream(&["[DONE]"])),
        ("an error with status 200", Answer::json(200, &json!({"error": {"message": "no", "code": 502}}))),
        ("an error as text with status 200", Answer::json(200, &json!({"error": "overloaded"}))),
        ("an error in the choice", Answer::json(200, &json!({"choices": [{"error": {"message": "no", "code": 502}}]}))),
        ("half a compressed body", Answer::new(200, cut_gzip).header("content-encoding", "gzip")),
        ("no compressed body", Answer::text("B").header("content-encoding", "gzip")),
        ("what the server says to try again", Answer::error(400, "x", "odd").header("x-should-retry", "true")),
        ("nesting without end", Answer::new(200, "[".repeat(5000))),
    ];
    check_rows(cases, |(name, answer)| {
        let outcome = ask(vec![answer, Answer::text("B")]);
        let reply = outcome.result.unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!((reply.text.as_str(), reply.attempts), ("B", 2), "{name}");
        assert_eq!(outcome.requests.len(), 2, "{name}");
        assert_eq!(outcome.requests[0], outcome.requests[1], "{name}");
    });
}

/// Retries come to an end, with the last failure.
#[test]
fn retries_come_to_an_end() {
    use FailureKind::{Connection, Response, Server, Timeout};
    let cases = [
        ("500", Answer::error(500, "x", "oops"), Server, Some(500)),
        ("nonsense", Answer::new(200, "nonsense"), Response, Some(200)),
        ("no byte", Answer::dropped(), Connection, None),
        ("half a body", Answer::text("B").cut(9), Connection, None),
        ("an error with status 200", Answer::json(200, &json!({"error": "x"})), Server, Some(200)),
        ("silence", Answer::silent(), Timeout, None),
        ("half a body and silence", Answer::stuck(), Timeout, None),
        ("a drip", Answer::text("B").drip(20), Timeout, None),
    ];
    check_rows(cases, |(name, answer, kind, status)| {
        let sending = Sending {
            retries: 2,
            // On a busy machine the server must still have read the request.
            timeout: Duration::from_millis(400),
            ..sending()
        };
        let outcome = ask_with(vec![answer], sending, Parameters::new("m".into()));
        let error = outcome.result.unwrap_err();
        assert_eq!((error.failure.kind, error.failure.status), (kind, status), "{name}");
        assert_eq!((error.attempts, error.reach), (3, Reach::Trial), "{name}");
        assert_eq!(outcome.requests.len(), 3, "{name}");
        if kind == Timeout {
            assert!(outcome.time >= Duration::from_millis(1200), "{name}");
            assert!(error.failure.message.contains("--timeout"), "{error}");
        }
    });
}

/// Waits that a server asks for are kept, in every form, and those beyond `--retries max-wait` are not begun.
#[test]
fn waits_are_kept_and_capped() {
    let limited = |name: &str, value: &str| Answer::error(429, "x", "slow").header(name, value);
    let date = |seconds| httpdate::fmt_http_date(SystemTime::now() + Duration::from_secs(seconds));
    let skewed =
        limited("retry-after", "Sun, 06 Nov 1994 08:49:38 GMT").header("date", "Sun, 06 Nov 1994 08:49:37 GMT");
    let cases = [
        // The first, for time goes on.
        ("a date", limited("retry-after", &date(2)), 900),
        ("milliseconds", limited("retry-after-ms", "200"), 200),
        ("seconds", limited("retry-after", "1"), 1000),
        ("a fraction", limited("retry-after", "0.2"), 200),
        ("the longer of two", limited("retry-after", "0.1").header("retry-after-ms", "300"), 300),
        ("in words", Answer::error(429, "x", "Rate limit reached. Please try again in 400ms."), 400),
        (
            "in a list, as Google states it",
            Answer::json(429, &json!([{"error": {"message": "quota", "details": [{"retryDelay": "0.35s"}]}}])),
            350,
        ),
        ("a date of a clock that is wrong", skewed, 1000),
        ("503", Answer::new(503, "").header("retry-after", "0.2"), 200),
        ("a failure that is no pause", Answer::new(500, "").header("retry-after", "0.2"), 200),
        ("no number", limited("retry-after", "soon"), 0),
        ("none", limited("retry-after", "0"), 0),
        ("less than none", limited("retry-after", "-5"), 0),
    ];
    check_rows_at_once(cases, |(name, answer, least)| {
        let outcome = ask(vec![answer, Answer::text("B")]);
        assert_eq!(outcome.result.unwrap().attempts, 2, "{name}");
        let waited = outcome.time.as_millis();
        assert!((least..least + 1900).contains(&waited), "{name}: {waited} ms");
    });
    check_rows(["600", "1e300", &date(86_400)], |wait| {
        let outcome = ask(vec![limited("retry-after", wait)]);
        let error = outcome.result.unwrap_err();
        assert!(error.failure.message.contains("--retries max-wait"), "{error}");
        assert_eq!((error.attempts, error.reach), (1, Reach::Endpoint));
        assert!(outcome.time < Duration::from_secs(2));
    });
}

/// Being turned away is a wait: it spends no retry, and only `--retries patience` ends it. A limit for the day ends it
/// at once.
#[test]
fn rejected_request_waits_without_retry() {
    let away = || Answer::error(429, "x", "slow").header("retry-after", "0.02");
    let patient = Sending { retries: 1, ..sending() };
    let mut answers: Vec<Answer> = (0..8).map(|_| away()).collect();
    answers.push(Answer::text("B"));
    let outcome = ask_with(answers, patient, Parameters::new("m".into()));
    assert_eq!(outcome.result.unwrap().attempts, 9);
    let impatient = Sending { patience: Duration::from_millis(200), ..patient };
    let outcome = ask_with(vec![away()], impatient, Parameters::new("m".into()));
    let error = outcome.result.unwrap_err();
    assert_eq!((error.failure.kind, error.reach), (FailureKind::RateLimit, Reach::Endpoint));
    insta::assert_snapshot!(redacted(&error.failure.message), @"
    http://127.0.0.1:[PORT]/v1 answered 429: slow (no request was accepted for [TIME], longer than --retries
        patience; continue later with --resume)
    ");
    assert!(error.attempts > 2, "{}", error.attempts);
    let daily = "Rate limit reached on requests per day (RPD): Limit 200. Please try again in 20ms.";
    let too_large = "Request too large for m on tokens per minute: Limit 1, Requested 2. Please try again in 2ms.";
    for (message, reach, words) in [(daily, Reach::Endpoint, "--resume"), (too_large, Reach::Trial, "--image max-side")]
    {
        let outcome = ask_with(vec![Answer::error(429, "x", message)], patient, Parameters::new("m".into()));
        let error = outcome.result.unwrap_err();
        assert_eq!((error.attempts, error.reach), (1, reach), "{error}");
        assert!(error.failure.message.contains(words), "{error}");
    }
}
