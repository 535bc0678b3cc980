//! Words of servers by which the cause of a refusal is recognized, in several languages: one list a cause, in lower
//! case.
//!
//! Unlike the patterns of `wordings.toml`, they are not copied from one server. A list has only words that no other
//! cause uses.
//!
//! Refusals of one request for its content: [`is_moderated`]; and replies that a limit ended, sent as a refusal:
//! [`is_out_of_tokens`].
//!
//! Causes and remedies of server errors, recognized by their wording: [`Wording::find`], with the table
//! `wordings.toml`.

use std::sync::LazyLock;

use serde::Deserialize;

use super::api_error::ApiError;
use super::ask_error::Reach;

/// Credit that is used up, in codes without separators.
pub(super) const CREDIT_CODES: [&str; 13] = [
    "insufficientquota",
    "insufficientuserquota",
    "insufficientbalance",
    "insufficientcredit",
    "insufficientfund",
    "notenoughcredit",
    "notenoughbalance",
    "creditlimit",
    "balancenotenough",
    "arrearage",
    "billinghardlimit",
    "billingnotactive",
    "exceededcurrentquotaerror",
];

/// Credit that is used up.
pub(super) const CREDIT: [&str; 45] = [
    "all available credits",
    "spending limit",
    "spend limit",
    "credit balance",
    "credit limit exceeded",
    "insufficient credit",
    "insufficient balance",
    "insufficient account balance",
    "insufficient fund",
    "insufficient quota",
    "insufficient_quota",
    "insufficient user quota",
    "out of credit",
    "not enough credit",
    "not enough balance",
    "no credits",
    "more credits",
    "balance is too low",
    "balance is not enough",
    "balance not enough",
    "account balance",
    "payment required",
    "included credits",
    // Chinese
    "余额",
    "欠费",
    "充值",
    "额度不足",
    "额度已用",
    "餘額",
    "欠費",
    // Japanese and Korean
    "残高",
    "クレジットが不足",
    "잔액",
    "크레딧이 부족",
    // Spanish, Portuguese, Italian
    "saldo ",
    "créditos insuf",
    "crediti insuf",
    // French, German, Dutch
    "solde insuffisant",
    "crédits insuffisants",
    "crédit insuffisant",
    "guthaben",
    "onvoldoende tegoed",
    // Russian, Turkish, Polish
    "недостаточно средств",
    "bakiye",
    "niewystarczając",
];

/// A limit of requests or tokens a time.
pub(super) const RATE: [&str; 25] = [
    "rate limit",
    "ratelimit",
    "rate-limit",
    "too many requests",
    "throttl",
    "call volume quota",
    "call rate limit",
    "quota will be",
    "quota exceeded",
    "exceeded your quota",
    "requests per",
    "request limit",
    "qps limit",
    // Chinese, Japanese, Korean
    "限流",
    "过于频繁",
    "频率限制",
    "请求频率",
    "调用频率",
    "速率限制",
    "レート制限",
    "요청 한도",
    // Spanish, French, German, Portuguese
    "demasiadas solicitudes",
    "trop de requêtes",
    "zu viele anfragen",
    "muitas solicitações",
];

/// A key that is wrong.
pub(super) const WRONG_KEY: [&str; 34] = [
    "api key",
    "api-key",
    "apikey",
    "api_key",
    "api secret key",
    "secret key",
    "access key",
    "access token",
    "auth token",
    "invalid token",
    "token is invalid",
    "token expired",
    "expired token",
    "credential",
    "unauthorized",
    "unauthenticated",
    "authenticat",
    "authorization",
    "login fail",
    "subscription key",
    // Chinese, Japanese, Korean
    "密钥",
    "鉴权",
    "认证失败",
    "无效的令牌",
    "令牌无效",
    "令牌已过期",
    "apiキー",
    "認証",
    "인증",
    // Spanish, French, German, Portuguese, Russian
    "clave de api",
    "clé api",
    "api-schlüssel",
    "chave de api",
    "ключ api",
];

/// A key that lacks a right.
pub(super) const NO_RIGHT: [&str; 27] = [
    "permission",
    "forbidden",
    "not allowed",
    "not permitted",
    "access denied",
    "denied access",
    "no access",
    "not have access",
    "does not have",
    "not authorized",
    "not authorised",
    "not entitled",
    "not granted",
    "restricted",
    "scope",
    // Chinese, Japanese, Korean
    "权限",
    "无权",
    "禁止",
    "未授权",
    "拒绝",
    "権限",
    "アクセス",
    "권한",
    // Spanish, French, German, Portuguese
    "permiso",
    "autoris",
    "berechtig",
    "permissão",
];

/// The word for a model.
pub(super) const MODEL: [&str; 8] = ["model", "deployment", "engine", "模型", "モデル", "모델", "modèle", "модель"];

/// A path that the server does not have.
pub(super) const PATH: [&str; 16] = [
    "not found",
    "notfound",
    "no route",
    "no static resource",
    "unknown url",
    "invalid url",
    "unknown path",
    "unknown endpoint",
    "cannot post",
    "resource",
    "route",
    "request url",
    "unrecognized request",
    "/chat/completions",
    "/responses",
    "404",
];

/// Settings of the account, which its owner changes at the server.
pub(super) const SETTINGS: [&str; 20] = [
    "guardrail",
    "data policy",
    "data-policy",
    "privacy settings",
    "/settings",
    "account settings",
    "zero data retention",
    "terms of service",
    "terms of use",
    "accept the terms",
    "agree to",
    "license agreement",
    "gated repo",
    "gated model",
    "must be verified",
    "verify your",
    "has not been used in project",
    // Chinese: not activated, real name
    "未开通",
    "开通",
    "实名",
];

/// A firewall or gateway in front of the server.
pub(super) const FIREWALL: [&str; 20] = [
    "firewall",
    "error code: 10",
    "you have been blocked",
    "has been blocked",
    "request blocked",
    "request is blocked",
    "request rejected",
    "url was rejected",
    "incapsula",
    "imperva",
    "sucuri",
    "mod_security",
    "modsecurity",
    "captcha",
    "attention required",
    "web application protection",
    " waf",
    "waf ",
    "防火墙",
    "ファイアウォール",
];

/// Parameters that no provider takes, without the name of one.
pub(super) const NO_PARAMETERS: [&str; 6] = [
    "requested parameter",
    "parameters you requested",
    "support the parameters",
    "supports the parameters",
    "support these parameters",
    "support all parameters",
];

/// The content of a request, which a moderator refuses: it is neither a key nor a setting.
pub(super) const CONTENT: [&str; 14] = [
    "content",
    "safety",
    "moderation",
    "moderator",
    "sensitive",
    "inappropriate",
    "flagged",
    "violat",
    "harmful",
    "内容",
    "违规",
    "敏感",
    "contenido",
    "contenu",
];

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

/// A cause of refused requests, with the text patterns that indicate it.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Wording {
    cause: String,
    remedy: String,
    reach: WordingReach,
    /// True if only requests with images can have this cause.
    #[serde(default)]
    images: bool,
    patterns: Vec<String>,
}

/// Requests that fail for a cause.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase")]
enum WordingReach {
    All,
    Size,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct Wordings {
    wording: Vec<Wording>,
}

/// The built-in table; a test parses it.
static WORDINGS: LazyLock<Wordings> =
    LazyLock::new(|| toml::from_str(include_str!("../wordings.toml")).unwrap_or_default());

impl Wording {
    /// Finds the cause of an error; `None` if the table does not have it.
    pub(crate) fn find(api_error: &ApiError, has_image: bool) -> Option<&'static Self> {
        let texts = api_error.lower_case_texts();
        WORDINGS.wording.iter().find(|wording| {
            (has_image || !wording.images)
                && wording.patterns.iter().any(|pattern| texts.iter().any(|text| text.contains(pattern)))
        })
    }

    /// Requests that fail for this cause.
    pub(super) fn reach(&self) -> Reach {
        match self.reach {
            WordingReach::All => Reach::Endpoint,
            WordingReach::Size => Reach::Alike,
        }
    }

    /// Cause and remedy, as one text.
    pub(super) fn hint(&self) -> String {
        format!("{}: {}", self.cause, self.remedy)
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

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

    #[test]
    fn the_table_is_complete() {
        let all: Wordings = toml::from_str(include_str!("../wordings.toml")).unwrap();
        let mut patterns: Vec<&String> = all.wording.iter().flat_map(|wording| &wording.patterns).collect();
        assert!(patterns.iter().all(|p| **p == p.to_lowercase() && p.len() > 8));
        let count = patterns.len();
        patterns.sort();
        patterns.dedup();
        assert_eq!(patterns.len(), count);
    }

    fn flat(message: &str) -> String {
        json!({"object": "error", "message": message, "type": "BadRequestError", "code": 400}).to_string()
    }

    fn wording_error(message: &str) -> String {
        json!({"error": {"message": message}}).to_string()
    }

    #[test]
    fn server_errors_have_a_cause() {
        for (body, flag) in [
            (flat("facebook/opt-125m is not a multimodal model None"), "--blind"),
            (json!({"error": "Model does not support images. Please use a model that does."}).to_string(), "--blind"),
            (wording_error("Error in iterating prediction stream: ValueError: Vision add-on is not loaded, but images were provided for processing"), "--blind"),
            (wording_error("this model is missing data required for image input"), "--blind"),
            (wording_error("image input is not supported by this server"), "--blind"),
            (wording_error("Failed to deserialize the JSON body into the target type: messages[1]: unknown variant `image_url`, expected `text` at line 1 column 690848"), "--blind"),
            (wording_error("Failed to deserialize the JSON body into the target type: messages[1]: data did not match any variant of untagged enum ChatCompletionRequestContent at line 1 column 18231"), "--blind"),
            (wording_error("messages[1].content must be a string"), "--blind"),
            (json!({"object": "Error", "message": "Image input is not enabled for this model", "code": 3051}).to_string(), "--blind"),
            (wording_error("prompting with images is incompatible with system messages"), "--system"),
            (flat("At most 0 image(s) may be provided in one request."), "--blind"),
            (flat("At most 1 image(s) may be provided in one request."), "--limit-mm-per-prompt"),
            (flat("This model's maximum context length is 4096 tokens. However, you requested 5000 tokens"), "--max-tokens"),
            (flat("The decoder prompt (length 5000) is longer than the maximum model length of 4096."), "--image max-side"),
            (flat("Multimodal prompt is too long after expanding multimodal tokens. After expanding len(req.origin_input_ids_unpadded)=5192 => 6153 >= 5489."), "--image max-side"),
            (flat("The input (61709 tokens) is longer than the model's context length (40960 tokens)."), "--image max-side"),
            (flat("The request exceeds the model context length."), "--image max-side"),
            (wording_error("internal error happened, status code ResponseType.INPUT_LENGTH_ERROR"), "--image max-side"),
            (json!({"error": {"code": 400, "message": "too long", "type": "exceed_context_size_error", "n_ctx": 256}}).to_string(), "--image max-side"),
            (json!({"error": "Trying to keep the first 111490 tokens when context the overflows. However, the model is loaded with context length of only 32768 tokens"}).to_string(), "--image max-side"),
            (json!({"error": {"message": "Please reduce the length of the messages or completion.", "code": "context_length_exceeded"}}).to_string(), "--image max-side"),
            (json!([{"error": {"code": 400, "message": "Bad key", "details": [{"reason": "API_KEY_INVALID"}]}}]).to_string(), "--api-key-env"),
        ] {
            let wording = Wording::find(&ApiError::from_body(&body), true);
            let hint = wording.unwrap_or_else(|| panic!("{body}")).hint();
            assert!(hint.contains(flag), "{body}: {hint}");
        }
        let text = ApiError::from_body(r#"{"error":{"message":"m is not a multimodal model"}}"#);
        assert!(Wording::find(&text, false).is_none(), "no image was sent");
        let other = ApiError::from_body(r#"{"error":{"message":"the image is too small"}}"#);
        assert!(Wording::find(&other, true).is_none());
    }
}
