//! Words of servers by which the cause of a refusal is recognized, in several languages: one list a cause, in lower
//! case.
//!
//! Unlike the patterns of `wordings.toml`, they are not copied from one server. A list has only words that no other
//! cause uses.

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
