//! Fields that are left to the program, and refused in the words of each vendor.

use darkqa_eval::internals::ask::{Parameters, WireSetting};
use serde_json::{Value, json};

use super::{none_spent, of_field, plain, routed};
use crate::endpoints::faults::ask_with;
use crate::support::endpoint::Answer;
use crate::support::table::check_rows;

fn by_stream() -> Parameters {
    Parameters { wire: WireSetting::ChatStream, ..plain() }
}

fn with_probabilities() -> Parameters {
    Parameters { probabilities: true, ..plain() }
}

/// A field that is left to the program: each server's words of refusal cost one request, and the field is sent
/// otherwise then.
#[test]
#[expect(clippy::too_many_lines, reason = "a table")]
fn vendor_refusals_cost_one_request() {
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
            of_field(403, &none(), &none(), "You are not allowed to request logprobs from this model."),
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
            of_field(400, &json!("top_logprobs"), &none(), "20 is greater than the maximum of 5 - 'top_logprobs'"),
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
            routed(400, "This model only support stream mode, please enable the stream parameter to access the model."),
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
            routed(400, "parameter.enable_thinking must be set to false for non-streaming calls"),
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
        assert_ne!(sent[0].get(field).cloned().unwrap_or_default(), now, "{name}");
    });
}
