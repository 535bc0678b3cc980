//! What is particular to a vendor or a server: refused fields, waits, and failures, in its own words.

use std::time::Duration;

use darkqa_eval::internals::ask::{
    Constrain, ExtraFields, Parameters, Reach, Sending, WireSetting,
};
use darkqa_eval::types::FailureKind;
use serde_json::{Value, json};

use super::{ask_with, sending};
use crate::support::endpoint::Answer;
use crate::support::table::{check_rows, check_rows_at_once};

fn plain() -> Parameters {
    Parameters::new("m".into())
}

fn by_stream() -> Parameters {
    Parameters {
        wire: WireSetting::ChatStream,
        ..plain()
    }
}

fn with_probabilities() -> Parameters {
    Parameters {
        probabilities: true,
        ..plain()
    }
}

/// An error of OpenAI with the name of the field.
fn of_field(status: u16, param: &Value, code: &Value, message: &str) -> Answer {
    let error =
        json!({"message": message, "type": "invalid_request_error", "param": param, "code": code});
    Answer::json(status, &json!({ "error": error }))
}

/// An error that a router passes on as text within its own.
fn routed(status: u16, message: &str) -> Answer {
    of_field(status, &Value::Null, &json!(status.to_string()), message)
}

/// A field that is left to the program: each server's words of refusal cost one request, and the field is sent otherwise then.
#[test]
#[expect(clippy::too_many_lines, reason = "a table")]
fn refusals_in_the_words_of_each_vendor_cost_one_request() {
    let none = || Value::Null;
    let cases: Vec<(&str, Parameters, Answer, (&str, Value))> = vec![
        (
            "OpenAI, a model that reasons",
            plain(),
            of_field(
                400,
                &json!("temperature"),
                &json!("unsupported_value"),
                "Unsupported value: 'temperature' does not support 0.0 with this model. Only the default (1) value is supported.",
            ),
            ("temperature", none()),
        ),
        (
            "OpenAI, the token limit",
            plain(),
            of_field(
                400,
                &json!("max_tokens"),
                &json!("unsupported_parameter"),
                "Unsupported parameter: 'max_tokens' is not supported with this model. Use 'max_completion_tokens' instead.",
            ),
            ("max_completion_tokens", json!(1024)),
        ),
        (
            "OpenAI, probabilities",
            with_probabilities(),
            of_field(
                403,
                &none(),
                &none(),
                "You are not allowed to request logprobs from this model.",
            ),
            ("logprobs", none()),
        ),
        (
            "Anthropic",
            plain(),
            Answer::json(
                400,
                &json!({"type": "error", "error": {"type": "invalid_request_error", "message": "`temperature` is deprecated for this model."}, "request_id": "req_1"}),
            ),
            ("temperature", none()),
        ),
        (
            "Anthropic, a model that thinks",
            plain(),
            Answer::json(
                400,
                &json!({"type": "error", "error": {"type": "invalid_request_error", "message": "`temperature` may only be set to 1 when thinking is enabled. Please consult our documentation."}}),
            ),
            ("temperature", none()),
        ),
        (
            "Anthropic behind LiteLLM",
            plain(),
            routed(
                400,
                r#"litellm.BadRequestError: AnthropicException - {"type":"error","error":{"type":"invalid_request_error","message":"`temperature` is deprecated for this model."}}. Received Model Group=claude"#,
            ),
            ("temperature", none()),
        ),
        (
            "Bedrock behind LiteLLM",
            plain(),
            routed(
                400,
                r#"litellm.BadRequestError: BedrockException - {"message":"The model returned the following errors: `temperature` is deprecated for this model."}"#,
            ),
            ("temperature", none()),
        ),
        (
            "Gemini, probabilities",
            with_probabilities(),
            Answer::json(
                400,
                &json!([{"error": {"code": 400, "message": "Logprobs is not enabled for models/gemini-2.5-flash", "status": "INVALID_ARGUMENT"}}]),
            ),
            ("logprobs", none()),
        ),
        (
            "Mistral, the count of a stream's tokens",
            by_stream(),
            Answer::json(
                422,
                &json!({"object": "error", "message": {"detail": [{"type": "extra_forbidden", "loc": ["body", "stream_options"], "msg": "Extra inputs are not permitted"}]}}),
            ),
            ("stream_options", none()),
        ),
        (
            "Groq, probabilities",
            with_probabilities(),
            routed(400, "`logprobs` is not supported with this model"),
            ("logprobs", none()),
        ),
        (
            "Together, more probabilities than it states",
            with_probabilities(),
            of_field(
                400,
                &json!("top_logprobs"),
                &none(),
                "20 is greater than the maximum of 5 - 'top_logprobs'",
            ),
            ("top_logprobs", json!(5)),
        ),
        (
            "TGI, more probabilities than it states",
            with_probabilities(),
            Answer::json(
                422,
                &json!({"error": "Input validation error: `top_n_tokens` must be >= 0 and <= 5. Given: 20", "error_type": "validation"}),
            ),
            ("top_logprobs", json!(5)),
        ),
        (
            "vLLM on Gaudi, probabilities",
            with_probabilities(),
            of_field(
                400,
                &none(),
                &json!(400),
                "Gaudi doesn't support logprobs. Please remove 'logprobs'/'top_logprobs' from your request to receive a response.",
            ),
            ("logprobs", none()),
        ),
        (
            "DashScope, QwQ",
            plain(),
            routed(
                400,
                "This model only support stream mode, please enable the stream parameter to access the model.",
            ),
            ("stream", json!(true)),
        ),
        (
            "DashScope, QVQ",
            plain(),
            routed(400, "current user api does not support http call."),
            ("stream", json!(true)),
        ),
        (
            "DashScope, a model that thinks",
            plain(),
            routed(
                400,
                "parameter.enable_thinking must be set to false for non-streaming calls",
            ),
            ("stream", json!(true)),
        ),
        (
            "ModelScope",
            plain(),
            Answer::json(
                400,
                &json!({"errors": {"message": "enable thinking can not be support when `stream=False`"}}),
            ),
            ("stream", json!(true)),
        ),
        (
            "OpenAI, a model of the Responses API alone",
            plain(),
            of_field(
                404,
                &json!("model"),
                &none(),
                "This model is only supported in v1/responses and not in v1/chat/completions.",
            ),
            ("store", json!(false)),
        ),
    ];
    check_rows(cases, |(name, parameters, refusal, (field, expected))| {
        let outcome = ask_with(vec![refusal, Answer::text("B")], none_spent(), parameters);
        let sent = &outcome.requests;
        assert!(sent.len() == 2, "{name}: {:?}", outcome.result);
        let now = sent[1].get(field).cloned().unwrap_or_default();
        assert_eq!(now, expected, "{name}: {field}");
        assert_ne!(
            sent[0].get(field).cloned().unwrap_or_default(),
            now,
            "{name}"
        );
    });
}

/// No retry at all: what is answered nevertheless spent none. Nothing is turned away for long.
fn none_spent() -> Sending {
    Sending {
        retries: 0,
        patience: Duration::from_secs(2),
        ..sending()
    }
}

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
        let reply = outcome
            .result
            .unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!((reply.attempts, outcome.requests.len()), (2, 2), "{name}");
        let waited = outcome.time.as_millis();
        assert!(
            (least..least + 900).contains(&waited),
            "{name}: {waited} ms"
        );
    });
}

/// What no wait and no other request helps: one request, and the remedy.
#[test]
#[expect(clippy::too_many_lines, reason = "a table")]
fn what_does_not_pass_is_told_in_the_words_of_each_vendor() {
    use FailureKind::{Filtered, RateLimit, Request, Server};
    use Reach::{Endpoint, Trial};
    let effort = || Parameters {
        reasoning_effort: Some("minimal".into()),
        ..plain()
    };
    let constrained = || Parameters {
        constrain: Constrain::Json,
        ..plain()
    };
    let own = |body: Value| Parameters {
        extra: ExtraFields {
            body: body.as_object().unwrap().clone(),
            ..ExtraFields::default()
        },
        ..plain()
    };
    let cases: Vec<(&str, Parameters, Answer, (FailureKind, Reach), &[&str])> = vec![
        (
            "OpenAI, a request beyond a minute's tokens",
            plain(),
            routed(
                429,
                "Request too large for m in organization o on tokens per min (TPM): Limit 30000, Requested 32000. Please try again in 2ms.",
            ),
            (Request, Trial),
            &["Requested 32000", "--max-side"],
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
            routed(
                429,
                "Rate limit reached on requests per min (RPM). Please try again in 7m12s.",
            ),
            (RateLimit, Endpoint),
            &["432 s", "--max-wait"],
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
            Answer::json(
                402,
                &json!({"error": {"code": 402, "message": "Insufficient credits"}}),
            ),
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
            &["Requested 9000", "--max-side"],
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
            Answer::error(
                400,
                "Arrearage",
                "Access denied, please make sure your account is in good standing.",
            ),
            (Request, Endpoint),
            &["credit"],
        ),
        (
            "DashScope, a moderator",
            plain(),
            Answer::error(
                400,
                "data_inspection_failed",
                "Input data may contain inappropriate content.",
            ),
            (Filtered, Trial),
            &["inappropriate"],
        ),
        (
            "DashScope, a moderator with a dash",
            plain(),
            Answer::error(
                400,
                "DataInspectionFailed",
                "Input data may contain inappropriate content.",
            ),
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
            &["response_format", "--constrain"],
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
        assert_eq!(
            (error.failure.kind, error.reach),
            expected,
            "{name}: {error}"
        );
        assert_eq!((error.attempts, outcome.requests.len()), (1, 1), "{name}");
        assert!(outcome.time < Duration::from_secs(2), "{name}");
        for word in words {
            assert!(error.failure.message.contains(word), "{name}: {error}");
        }
    });
}
