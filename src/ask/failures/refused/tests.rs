use super::*;
use crate::failures::find_error;
use crate::requests::{Parameters, RequestFields, TokenField};
use serde_json::Value;
use serde_json::json;

fn parameters() -> Parameters {
    Parameters { reasoning_effort: Some("minimal".into()), ..Parameters::new("m".into()) }
}

fn classify(status: u16, body: &str) -> AskError {
    let sent = SentFields {
        parameters: &parameters(),
        fields: RequestFields {
            wire: Wire::Chat,
            token_field: TokenField::MaxTokens,
            temperature: Some(0.0),
            seed: None,
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
            403 | 404 | 410 => Reach::ByStatus,
            _ => Reach::Endpoint,
        };
        assert_eq!((class.reach, class.retry), (reach, Retry::Never), "{status}");
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
        assert_eq!((class.reach, class.retry), (Reach::Trial, Retry::AfterDelay), "{status}");
        assert_eq!(class.failure.kind, kind);
    }
    for status in [400, 413, 415, 422] {
        let class = classify(status, "");
        assert_eq!((class.reach, class.retry), (Reach::Trial, Retry::Never), "{status}");
    }
}

#[test]
fn codes_and_messages_override_the_status() {
    for (status, body) in [
        (
            429,
            r#"{"error":{"type":"insufficient_quota","code":"insufficient_quota","message":"You exceeded your current quota"}}"#,
        ),
        (400, r#"{"error":{"type":"invalid_request_error","message":"Your credit balance is too low"}}"#),
        (400, r#"{"error":{"code":"model_not_found","message":"x"}}"#),
        (400, r#"{"error":{"message":"No connected db.","code":"400"}}"#),
        (500, r#"{"error":{"code":500,"message":"image input is not supported - hint: mmproj"}}"#),
        (400, r#"{"object":"error","message":"X is not a multimodal model None","code":400}"#),
    ] {
        let class = classify(status, body);
        assert_eq!((class.reach, class.retry), (Reach::Endpoint, Retry::Never), "{body}");
    }
    // Gemini's limit per minute also mentions a quota, but waiting helps.
    let minute = r#"{"error":{"code":429,"status":"RESOURCE_EXHAUSTED","message":"You exceeded your current quota, please check your plan"}}"#;
    assert_eq!(classify(429, minute).retry, Retry::AfterDelay);
    let moderated = r#"{"error":{"code":403,"message":"x","metadata":{"reasons":["violence"]}}}"#;
    let filtered =
        r#"{"error":{"code":"content_filter","message":"x","innererror":{"code":"ResponsibleAIPolicyViolation"}}}"#;
    for (status, body) in [(403, moderated), (400, filtered)] {
        let class = classify(status, body);
        assert_eq!((class.reach, class.retry, class.failure.kind), (Reach::Trial, Retry::Never, FailureKind::Filtered));
    }
}

#[test]
fn the_message_names_the_helpful_flag() {
    for (body, reach, flag) in [
        (r#"{"error":{"param":"temperature","message":"x"}}"#, Reach::Endpoint, "--temperature default"),
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
        (r#"{"error":{"message":"max_tokens is too large for this prompt: 1024"}}"#, Reach::Trial, "--max-tokens"),
        (r#"{"error":{"param":"reasoning_effort","message":"x"}}"#, Reach::Endpoint, "--reasoning-effort"),
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
            Some(AdaptableField::Temperature { least: None }),
        ),
        (r#"{"error":{"param":"max_tokens","message":"max_tokens is too large: 1024"}}"#, None),
        (r#"{"error":{"param":"reasoning_effort","code":"unsupported_value","message":"x"}}"#, None),
    ] {
        assert_eq!(classify(400, body).refused_field, refused_field, "{body}");
    }
}

/// What a message must have, or nothing at all after the server's words.
const NO_REMEDY: &str = "";

/// Bodies of servers, with the status, the words of the remedy, and the kind. Rows without a remedy are causes that no
/// flag changes, or that nobody understands.
#[test]
fn remedies_come_from_the_body() {
    use FailureKind::{Filtered, RateLimit, Request};
    const WAF: &str = "<html>\r\n<head><title>403 Forbidden</title></head>\r\n<body>\r\n<center><h1>403 Forbidden</h1></center>\r\n</body>\r\n</html>";
    const CLOUDFLARE: &str = "<!DOCTYPE html><html><head><title>Attention Required! | Cloudflare</title></head><body><h1>Sorry, you have been blocked</h1></body></html>";
    let words = |message: &str| serde_json::json!({"error": {"message": message}}).to_string();
    let flat = |message: &str| serde_json::json!({"statusCode": 403, "message": message}).to_string();
    let gemini = |limit: &str| {
        serde_json::json!([{"error": {"code": 429, "status": "RESOURCE_EXHAUSTED",
            "message": format!("You exceeded your current quota. * Quota exceeded for metric: free_tier_requests, limit: {limit}, model: m\nPlease retry in 33s."),
            "details": [{"violations": [{"quotaId": "GenerateRequestsPerDayPerProjectPerModel-FreeTier"}]}]}}])
        .to_string()
    };
    for (status, body, remedy, kind) in [
        // Credit for a part of the limit.
        (402, words("This request requires more credits, or fewer max_tokens. You requested up to 1024 tokens, but can only afford 500."), "--max-tokens 500", Request),
        (402, words("You can afford at most 1,200 tokens"), "--max-tokens 1200", Request),
        // No credit.
        (402, words("Insufficient Balance"), "no credit left", Request),
        (429, words("余额不足或无可用资源包,请充值。"), "no credit left", RateLimit),
        (403, words("用户额度不足，剩余额度: ＄0.00"), "no credit left", Request),
        (400, words("您的账户已欠费"), "no credit left", Request),
        (402, words("Saldo insuficiente en su cuenta"), "no credit left", Request),
        (402, words("Solde insuffisant, veuillez recharger"), "no credit left", Request),
        (403, words("Ihr Guthaben reicht nicht aus"), "no credit left", Request),
        (402, words("残高が不足しています"), "no credit left", Request),
        (402, words("잔액이 부족합니다"), "no credit left", Request),
        (402, words("Недостаточно средств на балансе"), "no credit left", Request),
        (403, serde_json::json!({"error": {"code": "INSUFFICIENT_USER_QUOTA", "message": "x"}}).to_string(), "no credit left", Request),
        (402, words("Upgrade to the Pro plan to use this model"), "asks for payment", Request),
        // A limit of zero, of a day, of an hour.
        (429, gemini("0"), "limit of 0", RateLimit),
        (429, gemini("250"), "when the day is over", RateLimit),
        (403, flat("Out of call volume quota. Quota will be replenished in 00:12:34."), NO_REMEDY, RateLimit),
        (403, words("请求过于频繁，请稍后再试"), NO_REMEDY, RateLimit),
        (400, serde_json::json!({"__type": "ThrottlingException", "message": "Slow down"}).to_string(), NO_REMEDY, RateLimit),
        // Firewalls and gateways.
        (403, WAF.to_owned(), "firewall or gateway", Request),
        (403, CLOUDFLARE.to_owned(), "firewall or gateway", Request),
        (403, "error code: 1020".to_owned(), "firewall or gateway", Request),
        (406, "<html><head><title>Not Acceptable!</title></head><body>generated by Mod_Security</body></html>".to_owned(), "firewall or gateway", Request),
        (400, "<html><title>Request Rejected</title>The requested URL was rejected. Please consult with your administrator.".to_owned(), "firewall or gateway", Request),
        // Settings of the account, and parameters.
        (404, words("No endpoints available matching your guardrail restrictions and data policy. Configure: https://openrouter.ai/settings/privacy"), "settings of the account", Request),
        (403, words("Your organization must be verified to use the model `m`."), "settings of the account", Request),
        (403, words("Cannot access gated repo; accept the terms on its page"), "settings of the account", Request),
        (404, words("No endpoints found that can handle the requested parameters."), "--temperature default", Request),
        (400, words("None of the providers supports the parameters of the call"), "--temperature default", Request),
        // Keys, models and addresses.
        (401, words("Incorrect API key provided"), "check the key", Request),
        (401, String::new(), "check the key", Request),
        (400, words("Incorrect API key provided: k. Get one at https://x.example"), "check the key", Request),
        (403, words("Forbidden"), "check the key", Request),
        (403, String::new(), "check the key", Request),
        (403, words("The key lacks the permission model.request"), "check the key", Request),
        (403, words("Vous n'êtes pas autorisé"), "check the key", Request),
        (403, words("没有权限访问该模型"), "check the key", Request),
        (404, String::new(), "many end with /v1", Request),
        (404, "404 page not found".to_owned(), "many end with /v1", Request),
        (404, "<html><title>404 Not Found</title>".to_owned(), "many end with /v1", Request),
        (404, r#"{"detail":"Not Found"}"#.to_owned(), "many end with /v1", Request),
        (404, words("The model `m` does not exist or you do not have access to it."), "--model", Request),
        (404, words("模型不存在"), "--model", Request),
        (400, words("Model Not Exist"), "--model", Request),
        (400, words("El modelo gpt-9 no existe"), "--model", Request),
        (413, "<html><title>413 Request Entity Too Large</title>".to_owned(), "--image max-side", Request),
        // What nobody understands has the server's words alone.
        (403, words("computer says no"), NO_REMEDY, Request),
        (404, words("The session has ended"), NO_REMEDY, Request),
        (410, words("Gone with the wind"), NO_REMEDY, Request),
        (400, words("Something went wrong"), NO_REMEDY, Request),
        (422, words("Unprocessable"), NO_REMEDY, Request),
        (400, serde_json::json!({"error": {"code": "content_filter", "message": "x"}}).to_string(), NO_REMEDY, Filtered),
        (403, words("input flagged by moderation"), NO_REMEDY, Filtered),
        // Words of other causes that resemble these.
        (400, words("Invalid image for the model: 8 pixels"), NO_REMEDY, Request),
        (400, words("Image not found in the request to the model"), NO_REMEDY, Request),
        (400, words("最大令牌数量无效"), NO_REMEDY, Request),
        (400, words("Your request has been blocked: the content violates the guardrails"), NO_REMEDY, Filtered),
        (403, words("This content is not allowed"), NO_REMEDY, Request),
        (400, words("频率惩罚参数错误"), NO_REMEDY, Request),
    ] {
        let failed = classify(status, &body);
        let message = &failed.failure.message;
        assert_eq!(failed.failure.kind, kind, "{status} {body}: {message}");
        if remedy == NO_REMEDY {
            assert_eq!(message, "", "{status} {body}");
        } else {
            assert!(message.contains(remedy), "{status} {body}: {message}");
        }
        // A remedy that cannot help is not printed.
        for other in ["no credit left", "many end with /v1", "the day is over", "check the key"] {
            let is_wrong = message.contains(other) && !remedy.contains(other) && remedy != "--model";
            assert!(!is_wrong, "{status} {body}: {message}");
        }
        // A cause of one request does not stop the others.
        let is_unknown = remedy == NO_REMEDY || remedy.contains("firewall");
        assert!(!is_unknown || failed.reach != Reach::Endpoint, "{status} {body}");
    }
}

#[test]
fn optional_fields_are_named() {
    let mut parameters = parameters();
    parameters.probabilities = true;
    parameters.extra.body = serde_json::json!({"provider": {"require_parameters": true}}).as_object().unwrap().clone();
    let fields = RequestFields {
        wire: Wire::Chat,
        token_field: TokenField::MaxTokens,
        temperature: None,
        seed: None,
        stream_usage: true,
        top_logprobs: Some(20),
        thinking: None,
    };
    let sent = SentFields { parameters: &parameters, fields, has_image: true, has_key: true };
    let body = r#"{"error":{"message":"No endpoints found that can handle the requested parameters."}}"#;
    let failed = AskError::refused(404, &ApiError::from_body(body), Wire::Chat, sent);
    let flags = "leave out one of --request probabilities, --reasoning-effort, --extra-body (provider), the token limit (--request \
                 token-field=none), or choose another --model";
    assert!(failed.failure.message.contains(flags), "{failed}");
}

#[test]
fn temperatures_are_refused_in_many_words() {
    for (status, body, least) in [
        (400, r#"{"error":{"message":"invalid temperature: only 1 is allowed for this model"}}"#, None),
        (400, r#"{"error":{"message":"invalid temperature: only 0.6 is allowed for this model"}}"#, None),
        (
            422,
            r#"{"error":"Input validation error: `temperature` must be strictly positive","error_type":"validation"}"#,
            Some(1),
        ),
        (400, r#"{"error":{"message":"invalid params, temperature should be in (0, 1] (2013)"}}"#, Some(1)),
        (400, r#"{"error":{"message":"temperature 参数非法，取值范围 [0.01, 2]"}}"#, Some(1)),
        (400, r#"{"error":{"param":"temperature","message":"nope"}}"#, None),
        (422, r#"{"detail":[{"loc":["body","temperature"],"msg":"Input should be greater than 0.1"}]}"#, Some(11)),
    ] {
        let failed = classify(status, body);
        let refused = Some(AdaptableField::Temperature { least });
        assert_eq!(failed.refused_field, refused, "{body}");
        assert_eq!(failed.reach, Reach::Endpoint, "{body}");
        assert_eq!(failed.forced, ["--temperature"], "{body}");
    }
    // A message that lists the fields of the request is not about one of them.
    for body in [
        r#"{"error":{"message":"cannot process {temperature=0, max_tokens=1024, reasoning_effort=minimal}"}}"#,
        r#"{"error":{"message":"the image is too hot"}}"#,
    ] {
        assert_eq!(classify(400, body).refused_field, None, "{body}");
    }
}

#[test]
fn a_judge_is_named_by_its_own_flags() {
    let mut parameters = parameters();
    parameters.origin.is_judge = true;
    let sent = SentFields {
        parameters: &parameters,
        fields: RequestFields {
            wire: Wire::Chat,
            token_field: TokenField::MaxTokens,
            temperature: Some(0.2),
            seed: Some(1),
            stream_usage: true,
            top_logprobs: None,
            thinking: None,
        },
        has_image: false,
        has_key: true,
    };
    for (body, flag) in [
        (r#"{"error":{"param":"temperature","message":"x"}}"#, "--judge-temperature default"),
        (r#"{"error":{"message":"you can only afford 9 tokens"}}"#, "--judge-max-tokens 9"),
        (r#"{"error":{"message":"Model Not Exist"}}"#, "check --judge and --judge-base-url"),
        (r#"{"detail":[{"loc":["body","seed"],"msg":"Extra inputs are not permitted"}]}"#, "--sampling-seed none"),
    ] {
        let failed = AskError::refused(400, &ApiError::from_body(body), Wire::Chat, sent);
        assert!(failed.failure.message.contains(flag), "{body}: {failed}");
    }
}

fn status(body: &Value) -> Option<(String, u16)> {
    let error = ApiError::from_error(&find_error(body)?);
    Some((error.message.clone(), implied_status(&error)))
}

#[test]
fn errors_of_every_structure_are_found() {
    for (body, message, expected) in [
        (
            json!({"choices": null, "base_resp": {"status_code": 1026, "status_msg": "input new_sensitive"}}),
            "input new_sensitive",
            400,
        ),
        (
            json!({"base_resp": {"status_code": 1004, "status_msg": "login fail: Please carry the API secret key"}}),
            "login fail: Please carry the API secret key",
            401,
        ),
        (
            json!({"base_resp": {"status_code": 1008, "status_msg": "insufficient balance"}}),
            "insufficient balance",
            402,
        ),
        (
            json!({"base_resp": {"status_code": 1002, "status_msg": "rate limit exceeded(RPM)"}}),
            "rate limit exceeded(RPM)",
            429,
        ),
        (
            json!({"error_code": 18, "error_msg": "Open api qps request limit reached"}),
            "Open api qps request limit reached",
            429,
        ),
        (json!({"code": "10013", "msg": "内容审核不通过"}), "内容审核不通过", 400),
        (json!({"errors": [{"code": 10000, "message": "Authentication error"}]}), "Authentication error", 401),
        (json!({"Response": {"ErrorCode": 503, "ErrorMsg": "busy"}}), "busy", 503),
        (json!({"code": 7, "msg": "oops"}), "oops", 500),
    ] {
        let expected = (message.to_owned(), expected);
        assert_eq!(status(&body), Some(expected), "{body}");
    }
}

#[test]
fn bodies_without_an_error_have_none() {
    for body in [
        json!({"base_resp": {"status_code": 0, "status_msg": "success"}}),
        json!({"base_resp": {"status_code": 0, "status_msg": ""}, "choices": null}),
        json!({"code": 200, "msg": "ok"}),
        json!({"code": "success", "message": "done"}),
        json!({"usage": {"total_tokens": 5}, "model": "m"}),
        json!({"status": "in_progress", "message": "soon"}),
        json!([1]),
        json!("x"),
    ] {
        assert_eq!(find_error(&body), None, "{body}");
    }
}
