use super::*;
use crate::ask::requests::{Parameters, RequestFields, TokenField};

fn parameters() -> Parameters {
    Parameters {
        reasoning_effort: Some("minimal".into()),
        ..Parameters::new("m".into())
    }
}

fn classify(status: u16, body: &str) -> AskError {
    let sent = SentFields {
        parameters: &parameters(),
        fields: RequestFields {
            wire: Wire::Chat,
            token_field: TokenField::MaxTokens,
            temperature: Some(0.0),
            stream_usage: true,
            top_logprobs: None,
            thinking: None,
        },
        has_image: true,
        has_key: true,
    };
    AskError::refused(status, &ApiError::from_body(body), Wire::Chat, sent)
}

#[test]
fn statuses_are_classified() {
    for status in [301, 302, 307, 401, 402, 403, 404, 405, 407, 410] {
        let class = classify(status, "");
        let reach = match status {
            300..400 | 407 => Reach::Endpoint,
            _ => Reach::ByStatus,
        };
        assert_eq!(
            (class.reach, class.retry),
            (reach, Retry::Never),
            "{status}"
        );
        assert!(!class.failure.message.is_empty(), "{status}");
    }
    for (status, kind) in [
        (408, FailureKind::Timeout),
        (425, FailureKind::Timeout),
        (499, FailureKind::Server),
        (409, FailureKind::Server),
        (429, FailureKind::RateLimit),
        (500, FailureKind::Server),
        (503, FailureKind::Server),
        (529, FailureKind::Server),
        (599, FailureKind::Server),
    ] {
        let class = classify(status, "");
        assert_eq!(
            (class.reach, class.retry),
            (Reach::Trial, Retry::AfterDelay),
            "{status}"
        );
        assert_eq!(class.failure.kind, kind);
    }
    for status in [400, 413, 415, 422] {
        let class = classify(status, "");
        assert_eq!(
            (class.reach, class.retry),
            (Reach::Trial, Retry::Never),
            "{status}"
        );
    }
}

#[test]
fn codes_and_messages_override_the_status() {
    for (status, body) in [
        (
            429,
            r#"{"error":{"type":"insufficient_quota","code":"insufficient_quota","message":"You exceeded your current quota"}}"#,
        ),
        (
            400,
            r#"{"error":{"type":"invalid_request_error","message":"Your credit balance is too low"}}"#,
        ),
        (400, r#"{"error":{"code":"model_not_found","message":"x"}}"#),
        (
            400,
            r#"{"error":{"message":"No connected db.","code":"400"}}"#,
        ),
        (
            500,
            r#"{"error":{"code":500,"message":"image input is not supported - hint: mmproj"}}"#,
        ),
        (
            400,
            r#"{"object":"error","message":"X is not a multimodal model None","code":400}"#,
        ),
    ] {
        let class = classify(status, body);
        assert_eq!(
            (class.reach, class.retry),
            (Reach::Endpoint, Retry::Never),
            "{body}"
        );
    }
    // Gemini's limit per minute also mentions a quota, but waiting helps.
    let minute = r#"{"error":{"code":429,"status":"RESOURCE_EXHAUSTED","message":"You exceeded your current quota, please check your plan"}}"#;
    assert_eq!(classify(429, minute).retry, Retry::AfterDelay);
    let moderated = r#"{"error":{"code":403,"message":"x","metadata":{"reasons":["violence"]}}}"#;
    let filtered = r#"{"error":{"code":"content_filter","message":"x","innererror":{"code":"ResponsibleAIPolicyViolation"}}}"#;
    for (status, body) in [(403, moderated), (400, filtered)] {
        let class = classify(status, body);
        assert_eq!(
            (class.reach, class.retry, class.failure.kind),
            (Reach::Trial, Retry::Never, FailureKind::Filtered)
        );
    }
}

#[test]
fn the_message_names_the_helpful_flag() {
    for (body, reach, flag) in [
        (
            r#"{"error":{"param":"temperature","message":"x"}}"#,
            Reach::Endpoint,
            "--temperature default",
        ),
        (
            r#"{"error":{"param":"max_tokens","message":"Use 'max_completion_tokens' instead."}}"#,
            Reach::Endpoint,
            "--request token-field=max_completion_tokens",
        ),
        (
            r#"{"error":{"message":"Unsupported: 'max_tokens'. Use 'max_completion_tokens' instead."}}"#,
            Reach::Endpoint,
            "--request token-field=max_completion_tokens",
        ),
        (
            r#"{"error":{"message":"`temperature` is deprecated for this model."}}"#,
            Reach::Endpoint,
            "--temperature default",
        ),
        (
            r#"{"detail":[{"type":"extra_forbidden","loc":["body","temperature"],"msg":"Extra inputs are not permitted"}]}"#,
            Reach::Endpoint,
            "--temperature default",
        ),
        // The message may concern this request alone.
        (
            r#"{"error":{"message":"max_tokens is too large for this prompt: 1024"}}"#,
            Reach::Trial,
            "--max-tokens",
        ),
        (
            r#"{"error":{"param":"reasoning_effort","message":"x"}}"#,
            Reach::Endpoint,
            "--reasoning-effort",
        ),
    ] {
        let class = classify(400, body);
        assert_eq!(class.reach, reach, "{body}");
        assert!(class.failure.message.contains(flag), "{body}");
    }
    // A field that was not sent cannot be the cause.
    for body in [
        r#"{"error":{"param":"max_completion_tokens","message":"x"}}"#,
        r#"{"error":{"param":"messages.[0].content.[1].image_url.detail","message":"x"}}"#,
    ] {
        assert_eq!(classify(400, body).failure.message, "", "{body}");
    }
}

#[test]
fn unsupported_fields_differ_from_wrong_values() {
    for (body, refused_field) in [
        (
            r#"{"error":{"param":"max_tokens","code":"unsupported_parameter","message":"x"}}"#,
            Some(AdaptableField::TokenField),
        ),
        (
            r#"{"error":{"message":"Unsupported: 'max_tokens'. Use 'max_completion_tokens' instead."}}"#,
            Some(AdaptableField::TokenField),
        ),
        (
            r#"{"error":{"param":"temperature","code":"unsupported_value","message":"only 1"}}"#,
            Some(AdaptableField::Temperature),
        ),
        (
            r#"{"error":{"param":"max_tokens","message":"max_tokens is too large: 1024"}}"#,
            None,
        ),
        (
            r#"{"error":{"param":"reasoning_effort","code":"unsupported_value","message":"x"}}"#,
            None,
        ),
    ] {
        assert_eq!(classify(400, body).refused_field, refused_field, "{body}");
    }
}
