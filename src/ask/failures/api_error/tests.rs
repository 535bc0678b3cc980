use super::*;

#[test]
fn errors_of_every_shape_are_parsed() {
    for (body, message, code) in [
        (r#"{"error":{"message":"m","type":"t","code":"c"}}"#, "m", Some("c")),
        (r#"{"error":{"message":"m","code":502}}"#, "m", Some("502")),
        (r#"{"error":"m"}"#, "m", None),
        (r#"{"object":"error","message":"m","code":400}"#, "m", Some("400")),
        (r#"{"detail":"m"}"#, "m", None),
        (r#"{"detail":[{"loc":["body"],"msg":"m"},{"msg":"n"}]}"#, "m; n", None),
        (r#"{"type":"error","error":{"type":"overloaded_error","message":"m"}}"#, "m", None),
        (r#"{"type":"about:blank","title":"m","status":422}"#, "m", Some("422")),
        (r#"{"error":{"message":"m","metadata":{"raw":"r"}}}"#, "m: r", None),
        (r#"{"error":{"odd":1}}"#, r#"{"odd":1}"#, None),
        ("<html><head><TITLE> 413 Too Large </TITLE>é", "an HTML page titled \"413 Too Large\"", None),
        ("\n<!DOCTYPE html><p>", "an HTML page without a title", None),
        (r#"{"error_code":336503,"error_msg":"m"}"#, "m", Some("336503")),
        (r#"{"statusCode":403,"message":"m"}"#, "m", Some("403")),
        (" upstream\n", "upstream", None),
        ("", "", None),
    ] {
        let api_error = ApiError::from_body(body);
        assert_eq!(api_error.message, message, "{body}");
        assert_eq!(api_error.code.as_deref(), code, "{body}");
    }
}

#[test]
fn nested_errors_are_parsed() {
    for (body, message, code, param) in [
        (r#"[{"error":{"message":"m","code":429}}]"#, "m", Some("429"), None),
        (
            r#"{"object":"error","message":{"detail":[{"type":"extra_forbidden","loc":["body","max_completion_tokens"],"msg":"Extra inputs are not permitted"}]}}"#,
            "max_completion_tokens: Extra inputs are not permitted",
            None,
            Some("max_completion_tokens"),
        ),
        (
            r#"{"error":{"message":"litellm.BadRequestError: {\"error\":{\"message\":\"deep\",\"param\":\"temperature\"}}","code":"400"}}"#,
            "deep",
            Some("400"),
            Some("temperature"),
        ),
        (r#"{"detail":[{"loc":["body","logprobs"],"msg":"m"}]}"#, "logprobs: m", None, Some("logprobs")),
        // Five levels: the fourth remains JSON text.
        (
            r#"{"error":{"message":{"message":{"message":{"message":{"message":"x"}}}}}}"#,
            r#"{"message":{"message":"x"}}"#,
            None,
            None,
        ),
        // A JSON object that is not an error remains part of the message.
        (r#"{"error":{"message":"use {\"a\": 1}"}}"#, r#"use {"a": 1}"#, None, None),
    ] {
        let api_error = ApiError::from_body(body);
        assert_eq!(api_error.message, message, "{body}");
        assert_eq!(api_error.code.as_deref(), code, "{body}");
        assert_eq!(api_error.param.as_deref(), param, "{body}");
    }
}

fn gemini(id: &str) -> String {
    format!(
        r#"[{{"error":{{"code":429,"message":"You exceeded your current quota.","details":[{{"violations":[{{"quotaId":"{id}"}}]}},{{"@type":"type.googleapis.com/google.rpc.RetryInfo","retryDelay":"45.837906927s"}}]}}}}]"#
    )
}

#[test]
fn waits_and_daily_limits_are_parsed() {
    for (body, seconds, is_daily) in [
        (gemini("GenerateRequestsPerMinutePerProject"), Some(45.837_906_927), false),
        (gemini("GenerateRequestsPerDayPerProject"), Some(45.837_906_927), true),
        (
            r#"{"error":{"message":"m","metadata":{"retry_after_seconds":7,"headers":{"RETRY-AFTER":"9"}}}}"#.to_owned(),
            Some(9.0),
            false,
        ),
        (r#"{"error":"loading","estimated_time":20.5}"#.to_owned(), Some(20.5), false),
        (
            r#"{"error":{"message":"Rate limit reached on requests per day (RPD): Limit 200. Please try again in 7m12s."}}"#.to_owned(),
            Some(432.0),
            true,
        ),
        (r#"{"error":{"message":"slow down"}}"#.to_owned(), None, false),
    ] {
        let api_error = ApiError::from_body(&body);
        let wait = api_error.wait.map(|wait| wait.as_secs_f64());
        assert_eq!(wait, seconds, "{body}");
        assert_eq!(api_error.is_daily(), is_daily, "{body}");
    }
}

#[test]
fn limits_of_zero_are_found() {
    for (body, is_zero) in [
        (r#"{"error":{"message":"Quota exceeded for metric: x, limit: 0, model: m"}}"#, true),
        (r#"{"error":{"message":"You have a quota of 0."}}"#, true),
        (r#"{"error":{"message":"Limit 0, Used 0, Requested 900"}}"#, true),
        (r#"{"error":{"message":"x","details":[{"violations":[{"quotaId":"a","quotaValue":"0"}]}]}}"#, true),
        (r#"{"error":{"message":"limit: 0.5"}}"#, false),
        (r#"{"error":{"message":"limit: 05"}}"#, false),
        (r#"{"error":{"message":"limit: 250"}}"#, false),
        (r#"{"error":{"message":"x","details":[{"violations":[{"quotaValue":"50"}]}]}}"#, false),
    ] {
        assert_eq!(ApiError::from_body(body).has_zero_limit, is_zero, "{body}");
    }
}

#[test]
fn a_body_without_an_error_has_none() {
    for body in
        [r#"{"choices":[],"error":null}"#, r#"{"choices":[],"error":""}"#, r#"{"error":{},"message":""}"#, r"{}", r"[]"]
    {
        assert_eq!(ApiError::from_json(&serde_json::from_str(body).unwrap()), None, "{body}");
    }
}
