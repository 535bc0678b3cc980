//! Waits, as each vendor states them.

use serde_json::json;

use super::{none_spent, plain, routed};
use crate::endpoints::faults::ask_with;
use crate::support::endpoint::Answer;
use crate::support::table::check_rows_at_once;

/// Being turned away: the wait in milliseconds that is stated, or 0; no retry is spent.
#[test]
#[expect(clippy::too_many_lines, reason = "a table")]
fn each_vendor_states_its_waits() {
    let words = |message: &str| routed(429, message);
    let reset = |name: &str, value: &str| words("slow down").header(name, value);
    let cases = [
        (
            "OpenAI",
            words(
                "Rate limit reached for m in organization o on tokens per minute (TPM): Limit 30000, Used 29000, Requested 2000. \
                 Please try again in 210ms. Visit https://example.com to learn more.",
            ),
            210,
        ),
        (
            "OpenAI, a limit of requests that is full again",
            reset("x-ratelimit-remaining-requests", "0")
                .header("x-ratelimit-limit-requests", "500")
                .header("x-ratelimit-reset-requests", "220ms"),
            220,
        ),
        (
            "OpenAI, a limit of which something is left",
            reset("x-ratelimit-remaining-requests", "400")
                .header("x-ratelimit-limit-requests", "500")
                .header("x-ratelimit-reset-requests", "5s"),
            0,
        ),
        (
            "Azure",
            words("Requests to the ChatCompletions_Create Operation have exceeded the rate limit. Please retry after 1 seconds.")
                .header("retry-after", "1")
                .header("retry-after-ms", "230"),
            1000,
        ),
        (
            "Anthropic",
            Answer::json(
                429,
                &json!({"type": "error", "error": {"type": "rate_limit_error", "message": "This request would exceed your account's rate limit."}}),
            )
            .header("retry-after", "0.24"),
            240,
        ),
        (
            "Anthropic, overloaded",
            Answer::json(
                529,
                &json!({"type": "error", "error": {"type": "overloaded_error", "message": "Overloaded"}}),
            )
            .header("retry-after", "0.25"),
            250,
        ),
        (
            "Gemini",
            Answer::json(
                429,
                &json!([{"error": {"code": 429, "status": "RESOURCE_EXHAUSTED",
                    "message": "You exceeded your current quota, please check your plan and billing details.\nPlease retry in 0.1s.",
                    "details": [
                        {"@type": "type.googleapis.com/google.rpc.QuotaFailure", "violations": [{"quotaId": "GenerateRequestsPerMinutePerProjectPerModel-FreeTier"}]},
                        {"@type": "type.googleapis.com/google.rpc.RetryInfo", "retryDelay": "0.260000001s"}]}}]),
            ),
            260,
        ),
        (
            "OpenRouter, in seconds",
            Answer::json(
                429,
                &json!({"error": {"code": 429, "message": "Provider returned error", "metadata": {"raw": "busy", "provider_name": "p", "retry_after_seconds": 0.27}}}),
            ),
            270,
        ),
        (
            "OpenRouter, in headers",
            Answer::json(
                429,
                &json!({"error": {"code": 429, "message": "Provider returned error", "metadata": {"headers": {"RETRY-after": "0.28"}}}}),
            ),
            280,
        ),
        (
            "OpenRouter, with status 200",
            Answer::json(
                200,
                &json!({"error": {"code": 429, "message": "Provider returned error", "metadata": {"retry_after_seconds": 0.29}}}),
            ),
            290,
        ),
        (
            "Mistral",
            Answer::json(429, &json!({"object": "error", "message": "Rate limit exceeded", "type": "rate_limited", "param": null, "code": "1300"})),
            0,
        ),
        (
            "Groq",
            words(
                "Rate limit reached for model `m` in organization `o` on tokens per minute (TPM): Limit 6000, Used 5900, Requested 800. \
                 Please try again in 0.301999999s. Need more tokens? Upgrade.",
            ),
            300,
        ),
        (
            "Together",
            Answer::json(429, &json!({"error": {"message": "You are being rate limited", "type": "rate_limit", "param": null, "code": null}}))
                .header("retry-after", "0.31"),
            310,
        ),
        (
            "DashScope",
            Answer::error(429, "limit_requests", "You exceeded your current requests list, please wait and try again later."),
            0,
        ),
        (
            "DashScope, its own words",
            Answer::error(429, "Throttling.RateQuota", "Requests rate limit exceeded, please try again later."),
            0,
        ),
        (
            "Hugging Face, a model that is loaded",
            Answer::json(503, &json!({"error": "Model m is currently loading", "estimated_time": 0.32})),
            320,
        ),
        (
            "TGI",
            Answer::json(429, &json!({"error": "Model is overloaded", "error_type": "overloaded"})),
            0,
        ),
        (
            "a router that passes on words",
            words(
                r#"litellm.RateLimitError: OpenAIException - {"error":{"message":"Please try again in 330ms."}}"#,
            ),
            330,
        ),
        ("a wait that is none", words("Please try again in -5s."), 0),
        (
            "no wait, although the words have a time",
            words("The limit of 20 in 5 s was used up."),
            0,
        ),
    ];
    check_rows_at_once(cases, |(name, answer, least)| {
        let outcome = ask_with(vec![answer, Answer::text("B")], none_spent(), plain());
        let reply = outcome.result.unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!((reply.attempts, outcome.requests.len()), (2, 2), "{name}");
        let waited = outcome.time.as_millis();
        assert!((least..least + 900).contains(&waited), "{name}: {waited} ms");
    });
}
