//! Failures that do not pass, in the words of each vendor.

use std::time::Duration;

use darkqa_base::types::FailureKind;
use darkqa_eval::internals::ask::{Constrain, ExtraFields, Parameters, Reach};
use serde_json::{Value, json};

use super::{none_spent, of_field, plain, routed};
use crate::endpoints::faults::ask_with;
use crate::support::endpoint::Answer;
use crate::support::table::check_rows;

/// A name, what is asked for, the answer, what comes of it, and words of the message.
type Case = (&'static str, Parameters, Answer, (FailureKind, Reach), &'static [&'static str]);

/// Failures that neither waiting nor another request solves: one request, and the remedy.
#[test]
#[expect(clippy::too_many_lines, reason = "a table")]
fn vendor_failure_wordings_are_recognized() {
    use FailureKind::{Filtered, RateLimit, Request, Server};
    use Reach::{Endpoint, Trial};
    let effort = || Parameters { reasoning_effort: Some("minimal".into()), ..plain() };
    let constrained = || Parameters { constrain: Constrain::Json, ..plain() };
    let own = |body: Value| Parameters {
        extra: ExtraFields { body: body.as_object().unwrap().clone(), ..ExtraFields::default() },
        ..plain()
    };
    let cases: Vec<Case> = vec![
        (
            "OpenAI, a request beyond a minute's tokens",
            plain(),
            routed(
                429,
                "Request too large for m in organization o on tokens per min (TPM): Limit 30000, Requested 32000. Please try again in 2ms.",
            ),
            (Request, Trial),
            &["Requested 32000", "--image max-side"],
        ),
        (
            "OpenAI, a limit of the day on tokens",
            plain(),
            routed(
                429,
                "Rate limit reached for m on tokens per day (TPD): Limit 200000, Used 199990. Please try again in 20ms.",
            ),
            (RateLimit, Endpoint),
            &["(TPD)", "--resume"],
        ),
        (
            "OpenAI, a wait beyond --max-wait",
            plain(),
            routed(429, "Rate limit reached on requests per min (RPM). Please try again in 7m12s."),
            (RateLimit, Endpoint),
            &["432 s", "--retries max-wait"],
        ),
        (
            "Gemini, a limit of the day",
            plain(),
            Answer::json(
                429,
                &json!([{"error": {"code": 429, "status": "RESOURCE_EXHAUSTED", "message": "You exceeded your current quota.", "details": [
                    {"violations": [{"quotaId": "GenerateRequestsPerDayPerProjectPerModel-FreeTier"}]}, {"retryDelay": "0.02s"}]}}]),
            ),
            (RateLimit, Endpoint),
            &["--resume"],
        ),
        (
            "Gemini, an effort that it does not take",
            effort(),
            Answer::json(
                400,
                &json!([{"error": {"code": 400, "message": "Invalid value for reasoning_effort: minimal. Valid values are: none, low, medium, high.", "status": "INVALID_ARGUMENT"}}]),
            ),
            (Request, Endpoint),
            &["none, low, medium, high", "--reasoning-effort"],
        ),
        (
            "OpenAI, an effort that it does not take",
            effort(),
            of_field(
                400,
                &json!("reasoning_effort"),
                &json!("unsupported_value"),
                "Unsupported value: 'minimal' is not supported with the 'm' model. Supported values are: 'none', 'low'.",
            ),
            (Request, Endpoint),
            &["'none', 'low'", "--reasoning-effort"],
        ),
        (
            "OpenRouter, credits",
            plain(),
            Answer::json(402, &json!({"error": {"code": 402, "message": "Insufficient credits"}})),
            (Request, Endpoint),
            &["credit"],
        ),
        (
            "OpenRouter, a moderator",
            plain(),
            Answer::json(
                403,
                &json!({"error": {"code": 403, "message": "input flagged", "metadata": {"reasons": ["violence"], "flagged_input": "x"}}}),
            ),
            (Filtered, Trial),
            &["flagged"],
        ),
        (
            "OpenRouter, an error within a choice",
            plain(),
            Answer::json(
                200,
                &json!({"choices": [{"error": {"code": 502, "message": "upstream gone"}, "message": {"content": "A"}}]}),
            ),
            (Server, Trial),
            &["upstream gone"],
        ),
        (
            "OpenRouter, the provider's own words",
            plain(),
            Answer::json(
                400,
                &json!({"error": {"code": 400, "message": "Provider returned error", "metadata": {"raw": "image is truncated", "provider_name": "p"}}}),
            ),
            (Request, Trial),
            &["image is truncated"],
        ),
        (
            "Groq, a request beyond a minute's tokens",
            plain(),
            Answer::error(
                413,
                "rate_limit_exceeded",
                "Request too large for model `m` on tokens per minute (TPM): Limit 6000, Requested 9000, please reduce your message size and try again.",
            ),
            (Request, Trial),
            &["Requested 9000", "--image max-side"],
        ),
        (
            "Together, no money",
            plain(),
            Answer::json(
                429,
                &json!({"error": {"message": "Credit limit exceeded, please navigate to billing", "type": "credit_limit", "param": null, "code": null}}),
            ),
            (RateLimit, Endpoint),
            &["credit"],
        ),
        (
            "xAI, no money",
            plain(),
            Answer::json(
                429,
                &json!({"code": "Some resource has been exhausted", "error": "Your team t has either used all available credits or reached its monthly spending limit."}),
            ),
            (RateLimit, Endpoint),
            &["spending limit", "credit"],
        ),
        (
            "DashScope, no money",
            plain(),
            Answer::error(400, "Arrearage", "Access denied, please make sure your account is in good standing."),
            (Request, Endpoint),
            &["credit"],
        ),
        (
            "DashScope, a moderator",
            plain(),
            Answer::error(400, "data_inspection_failed", "Input data may contain inappropriate content."),
            (Filtered, Trial),
            &["inappropriate"],
        ),
        (
            "DashScope, a moderator with a dash",
            plain(),
            Answer::error(400, "DataInspectionFailed", "Input data may contain inappropriate content."),
            (Filtered, Trial),
            &["inappropriate"],
        ),
        (
            "DashScope, an image that is too small",
            plain(),
            routed(
                400,
                "The image length and width do not meet the model restrictions. [height:8 or width:8 must be larger than 10]",
            ),
            (Request, Trial),
            &["larger than 10"],
        ),
        (
            "xAI, a field of the user's own",
            own(json!({"presence_penalty": 1})),
            routed(400, "Model m does not support parameter presence_penalty."),
            (Request, Endpoint),
            &["presence_penalty", "--extra-body"],
        ),
        (
            "DeepSeek, no money",
            plain(),
            Answer::json(
                402,
                &json!({"error": {"message": "Insufficient Balance", "type": "unknown_error", "param": null, "code": "invalid_request_error"}}),
            ),
            (Request, Endpoint),
            &["credit"],
        ),
        (
            "DeepSeek, a constraint",
            constrained(),
            routed(400, "This response_format type is unavailable now"),
            (Request, Endpoint),
            &["response_format", "--request constrain"],
        ),
        (
            "TGI, a request that is not valid",
            plain(),
            Answer::json(
                422,
                &json!({"error": "Input validation error: `inputs` tokens + `max_new_tokens` must be <= 2048. Given: 1887 `inputs` tokens and 1024 `max_new_tokens`", "error_type": "validation"}),
            ),
            (Request, Trial),
            &["must be <= 2048"],
        ),
        (
            "TGI, a generation that failed",
            plain(),
            Answer::json(
                424,
                &json!({"error": "Request failed during generation: Server error: CUDA", "error_type": "generation"}),
            ),
            (Server, Trial),
            &["during generation"],
        ),
    ];
    check_rows(cases, |(name, parameters, answer, expected, words)| {
        let outcome = ask_with(vec![answer], none_spent(), parameters);
        let error = outcome.result.unwrap_err();
        assert_eq!((error.failure.kind, error.reach), expected, "{name}: {error}");
        assert_eq!((error.attempts, outcome.requests.len()), (1, 1), "{name}");
        assert!(outcome.time < Duration::from_secs(2), "{name}");
        for word in words {
            assert!(error.failure.message.contains(word), "{name}: {error}");
        }
    });
}
