//! Refusals of one request for its content: [`is_moderated`]; and replies that a limit ended, sent as a refusal:
//! [`is_out_of_tokens`].

use super::api_error::ApiError;

/// Parts of the codes and kinds of errors by which moderation rejects content, in lower case without separators (Azure:
/// content_filter, ResponsibleAIPolicyViolation; OpenAI: invalid_prompt, moderation_blocked, content_policy_violation;
/// DashScope: DataInspectionFailed).
const CODES: [&str; 9] = [
    "contentfilter",
    "contentpolicy",
    "policyviolation",
    "moderation",
    "datainspection",
    "invalidprompt",
    "sensitive",
    "safety",
    "prohibitedcontent",
];

/// Phrases for rejected content (xAI: "Content violates usage guidelines"; MiniMax 1026: "input new_sensitive"; z.AI
/// 1301: "unsafe or sensitive content", and the same in Chinese; Azure: "content management policy").
const PHRASES: [&str; 27] = [
    "content violates",
    "violates our",
    "violating our",
    "usage guidelines",
    "usage polic",
    "content polic",
    "content management policy",
    "content filter",
    "content moderation",
    "safety filter",
    "safety polic",
    "safety system",
    "safety reasons",
    "safety check",
    "unsafe",
    "nsfw",
    "sensitive content",
    "sensitive information",
    "sensitive word",
    "new_sensitive",
    "inappropriate",
    "prohibited content",
    "harmful",
    // "sensitive", "violates the rules", "not safe", "inspection of the content".
    "敏感",
    "违规",
    "不安全",
    "内容审核",
];

/// Phrases that count with status 403 alone: elsewhere they are also names of fields.
const PHRASES_OF_403: [&str; 2] = ["moderation", "flagged"];

/// Names of the token limit in refusals.
const LIMITS: [&str; 8] = [
    "max_tokens",
    "max_completion_tokens",
    "max_output_tokens",
    "max tokens",
    "max completion tokens",
    "max output tokens",
    "output limit",
    "output token limit",
];

/// Phrases for a limit that a generation has used up, as opposed to a limit that is not allowed.
const USED_UP: [&str; 4] = ["limit was reached", "tokens reached", "could not finish", "ran out of"];

/// True if moderation rejected the content of a request, as opposed to its key or its fields: the same request is
/// rejected again. Statuses of a key, a proxy and a rate are not about content, whatever the words.
pub(crate) fn is_moderated(status: u16, api_error: &ApiError) -> bool {
    let may_be_content = (400..500).contains(&status) && !matches!(status, 401 | 407 | 429);
    let is_stated = || {
        api_error.is_moderated
            || api_error.has_code_like(&CODES)
            || api_error.mentions_any(&PHRASES)
            || (status == 403 && api_error.mentions_any(&PHRASES_OF_403))
    };
    may_be_content && is_stated()
}

/// True if the server generated up to the token limit and sent an error instead of the truncated reply (Azure: "Could
/// not finish the message because max_tokens or model output limit was reached").
pub(crate) fn is_out_of_tokens(status: u16, api_error: &ApiError) -> bool {
    (400..500).contains(&status) && api_error.mentions_any(&LIMITS) && api_error.mentions_any(&USED_UP)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn error(code: &str, message: &str) -> ApiError {
        ApiError::from_error(&json!({"code": code, "message": message}))
    }

    #[test]
    fn rejected_content_is_recognized() {
        for (status, code, message) in [
            (403, "permission-denied", "Content violates usage guidelines."),
            (400, "invalid_prompt", "Invalid prompt: it was flagged"),
            (400, "1301", "System detected potentially unsafe or sensitive content"),
            (400, "1301", "系统检测到输入或生成内容可能包含不安全或敏感内容"),
            (400, "content_filter", "The prompt triggered Azure's policy"),
            (400, "ResponsibleAIPolicyViolation", "x"),
            (400, "DataInspectionFailed", "x"),
            (400, "1026", "input new_sensitive"),
            (403, "x", "your input was flagged"),
        ] {
            assert!(is_moderated(status, &error(code, message)), "{message}");
        }
    }

    #[test]
    fn other_refusals_are_not_about_content() {
        for (status, code, message) in [
            (400, "invalid_image", "the image is too small"),
            (400, "x", "model names are case-sensitive"),
            (400, "unknown_parameter", "Unrecognized argument: flagged"),
            (403, "x", "the key may not use this model"),
            (404, "model_not_found", "no such model"),
            (429, "content_filter", "x"),
            (500, "content_filter", "x"),
        ] {
            assert!(!is_moderated(status, &error(code, message)), "{message}");
        }
    }

    #[test]
    fn used_up_limit_differs_from_a_wrong_limit() {
        let azure = "Could not finish the message because max_tokens or model output limit was reached. Please try again with higher \
                     max_tokens.";
        assert!(is_out_of_tokens(400, &error("x", azure)));
        let groq = "Failed to validate JSON: max completion tokens reached before generating a valid document";
        assert!(is_out_of_tokens(400, &error("json_validate_failed", groq)));
        for message in [
            "max_tokens is too large: 1024",
            "This model's maximum context length is 4096 tokens. However, you requested 5000",
            "rate limit was reached",
        ] {
            assert!(!is_out_of_tokens(400, &error("x", message)), "{message}");
        }
        assert!(!is_out_of_tokens(500, &error("x", azure)));
    }
}
