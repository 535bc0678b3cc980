//! Failures that do not pass: of one request, or of every request to the endpoint.

use darkqa_base::types::FailureKind;
use darkqa_eval::internals::ask::Reach;
use serde_json::json;

use super::{ask, gzipped};
use crate::support::endpoint::Answer;
use crate::support::table::check_rows;

/// Failures of this one request: it is not sent again, and others go on.
#[test]
fn single_request_faults_fail_at_once() {
    use FailureKind::{Filtered, Request, Response, Server};
    let bomb = vec![b' '; 300 << 20];
    let cases = [
        ("400", Answer::error(400, "x", "bad image"), Request, "bad image"),
        ("a context that is too long", Answer::error(400, "context_length_exceeded", "too long"), Request, "too long"),
        ("413 as a page", Answer::new(413, "<html><title>Too Large</title>"), Request, "--image max-side"),
        ("415", Answer::new(415, "image/webp"), Request, "image/webp"),
        (
            "422 of FastAPI",
            Answer::json(422, &json!({"detail": [{"msg": "field required"}]})),
            Request,
            "field required",
        ),
        ("a flat error", Answer::json(400, &json!({"object": "error", "message": "no", "code": 400})), Request, "no"),
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
            Answer::json(403, &json!({"error": {"message": "no", "metadata": {"reasons": ["x"]}}})),
            Filtered,
            "no",
        ),
        (
            "what the server says not to try again",
            Answer::error(500, "x", "oops").header("x-should-retry", "false"),
            Server,
            "oops",
        ),
        ("400 with status 200", Answer::json(200, &json!({"error": {"message": "odd", "code": 400}})), Request, "odd"),
        ("a body without end", Answer::new(200, vec![b' '; (16 << 20) + 1]), Response, "16 MiB"),
        ("a small body that unpacks without end", gzipped(&bomb), Response, "16 MiB"),
    ];
    check_rows(cases, |(name, answer, kind, message)| {
        let outcome = ask(vec![answer]);
        let error = outcome.result.unwrap_err();
        assert_eq!((error.failure.kind, error.reach), (kind, Reach::Trial), "{name}: {error}");
        assert_eq!((error.attempts, outcome.requests.len()), (1, 1), "{name}");
        assert!(error.failure.message.contains(message), "{name}: {error}");
    });
}

/// Failures that every other request would meet: the run is to stop, and is told how to mend it.
#[test]
fn general_faults_are_told_apart() {
    let moved = |status| Answer::new(status, "").header("location", "https://elsewhere.example/v1");
    let cases = [
        ("401", Answer::error(401, "x", "no"), "--api-key-env"),
        ("402", Answer::error(402, "x", "pay"), "credit"),
        ("403", Answer::error(403, "x", "forbidden"), "key"),
        ("404", Answer::new(404, ""), "--base-url"),
        ("404 of a model", Answer::error(404, "model_not_found", "no such model"), "--model"),
        ("404 of OpenRouter", Answer::error(404, "x", "No endpoints found that support image input"), "--blind"),
        ("405", Answer::new(405, ""), "--base-url"),
        ("407", Answer::new(407, ""), "NO_PROXY"),
        ("no HTTP", Answer::raw("SSH-2.0-x\r\n"), "https://"),
        ("410", Answer::new(410, ""), "--model"),
        ("301", moved(301), "elsewhere"),
        ("302", moved(302), "--base-url"),
        ("307", moved(307), "elsewhere"),
        ("308", moved(308), "elsewhere"),
        ("no quota", Answer::error(429, "insufficient_quota", "no quota"), "credit"),
        ("no billing", Answer::error(429, "billing_hard_limit_reached", "no"), "credit"),
        ("no credit", Answer::error(400, "x", "Your credit balance is too low"), "credit"),
        ("400 of a model", Answer::error(400, "model_not_found", "no such model"), "--model"),
        ("a gateway without keys", Answer::error(400, "400", "No connected db."), "key"),
        ("a key with status 200", Answer::json(200, &json!({"error": {"message": "who?", "code": 401}})), "who?"),
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
            Answer::json(400, &json!({"object": "error", "message": "m is not a multimodal model None"})),
            "--blind",
        ),
        ("no eyes: Ollama", Answer::error(400, "x", "this model does not support image input"), "--blind"),
        (
            "no eyes: OpenAI",
            Answer::error(400, "x", "Invalid content type. image_url is only supported by certain models."),
            "--blind",
        ),
    ];
    check_rows(cases, |(name, answer, message)| {
        let outcome = ask(vec![answer]);
        let error = outcome.result.unwrap_err();
        // Without a word about the cause, this request alone may be refused: two more questions show it.
        let reach = match name {
            "403" | "404" | "410" => Reach::ByStatus,
            _ => Reach::Endpoint,
        };
        assert_eq!((error.reach, error.attempts), (reach, 1), "{name}: {error}");
        assert_eq!(outcome.requests.len(), 1, "{name}");
        assert!(error.failure.message.contains(message), "{name}: {error}");
    });
}
