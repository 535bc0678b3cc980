//! Classification of refused requests, [`AskError::refused`]: whether to retry, which other requests would fail, and
//! which flag helps.
//!
//! The rules go by the evidence: numbers, codes and fields in the body first, then the words of `wordings.toml` and of
//! [`vocabulary`], the status last. If no rule finds the cause, the message has the server's words and no remedy.
//!
//! The HTTP status that the words of an error imply which a server sent with a success status: [`implied_status`].

#[cfg(test)]
mod tests;

use std::sync::LazyLock;

use regex::Regex;

use super::api_error::ApiError;
use super::ask_error::{AskError, Reach, Retry};
use super::vocabulary::{self, Wording, is_moderated, is_out_of_tokens};
use crate::requests::{
    AdaptableField, FieldState, RequestField, SentFields, for_judge, is_unsupported, least_temperature,
};
use crate::wire::requested_wire;
use crate::wire_kind::Wire;
use darkqa_base::types::FailureKind;

/// Phrases for a request larger than the limit of a whole minute (status 413 or 429): waiting does not help.
const TOO_LARGE: [&str; 2] = ["request too large", "request is too large"];

/// Remedy for a request that is too large.
const SMALLER: &str = "send smaller images: --image max-side=N, or --image jpeg:95";

/// Remedy for a limit that resets once a day.
const NEXT_DAY: &str = "a limit for the day is reached: continue with --resume when the day is over";

/// Remedy for an account without credit.
const ADD_CREDIT: &str = "the account has no credit left: add some, then continue with --resume";

/// Remedy for a payment of an unknown kind.
const PAY: &str = "the server asks for payment, credit or a plan: the same command continues after it";

/// Remedy for a limit of 0.
const NO_QUOTA: &str = "the account has a limit of 0 for this model, which no waiting changes: enable billing at the server, or choose another \
     --model";

/// Remedy for a key that is wrong.
const CHECK_KEY: &str = "check the key; it is taken from OPENAI_API_KEY (for Azure AZURE_OPENAI_API_KEY) unless --api-key-env or --api-key-file \
     names another";

/// Remedy for a key that lacks a right.
const CHECK_RIGHT: &str = "the key may not use this model from here: check the key and --model";

/// Remedy for an address or a model that the server does not have.
const CHECK_ADDRESS: &str = "check --base-url (many end with /v1) and --model";

/// Remedy for a model that the server does not have.
const CHECK_MODEL: &str = "the server knows no model of this name: check --model and --base-url";

/// Remedy for settings of the account.
const CHANGE_SETTINGS: &str =
    "the settings of the account exclude the request: change them at the server, or choose another --model";

/// Cause of a web page instead of the API's answer.
const PAGE: &str = "a web page, not the API: a firewall or gateway in front of the server may block requests with images, which its operator can \
     allow; or --base-url leads to a web site";

/// Cause of a refusal by a firewall.
const BLOCKED: &str =
    "a firewall or gateway in front of the server blocks the request; its operator can allow requests with images";

/// Matches the number of tokens for which the credit is enough. Group 1 is the number.
static AFFORDABLE: LazyLock<Regex> = LazyLock::new(|| {
    Regex::new(r"(?i)\bafford\D{0,30}?(\d[\d,]*)").unwrap_or_else(|e| unreachable!("a test compiles it: {e}"))
});

/// Matches a statement that a model does not exist.
static NO_MODEL: LazyLock<Regex> = LazyLock::new(|| {
    Regex::new(
        r"(?ix)(?:model|deployment|engine|模型|モデル|모델|modèle|модель)[^.;!?。！？]{0,60}?
        (?:not\ exist|n't\ exist|not\ found|cannot\ be\ found|no\ existe|no\ encontrado|n'existe\ pas|introuvable|nicht\ gefunden
        |existiert\ nicht|não\ encontrado|não\ existe|не\ найден|не\ существует|不存在|未找到|找不到|存在しません|見つかりません
        |찾을\ 수\ 없)
        |(?:unknown|no\ such|could\ not\ find|cannot\ find|unable\ to\ find)\s+(?:the\ |a\ )?(?:model|deployment|engine)\b
        |invalid\ model(?:\ name|\ id|:|=)",
    )
    .unwrap_or_else(|e| unreachable!("a test compiles it: {e}"))
});

impl AskError {
    /// Classifies a refused request by its status and the server's error. The message is only the remedy; empty if none
    /// is known.
    pub fn refused(status: u16, api_error: &ApiError, wire: Wire, sent: SentFields<'_>) -> Self {
        let mut failed = Self::by_evidence(status, api_error, wire, sent)
            .unwrap_or_else(|| Self::by_status(status, api_error, wire, sent));
        if sent.parameters.origin.is_judge {
            failed.failure.message = for_judge(&failed.failure.message);
        }
        failed
    }

    /// Classifies a refusal by what the server says; `None` if it says nothing that decides.
    fn by_evidence(status: u16, api_error: &ApiError, wire: Wire, sent: SentFields<'_>) -> Option<Self> {
        let is_refusal = (400..500).contains(&status);
        if let Some(wanted) = requested_wire(api_error, wire).filter(|_| is_refusal) {
            return Some(Self::needs_wire(wanted));
        }
        if is_refusal && let Some(failed) = Self::from_limits(status, api_error) {
            return Some(failed);
        }
        let no_credit = api_error.has_code_like(&vocabulary::CREDIT_CODES)
            || (is_refusal && api_error.mentions_any(&vocabulary::CREDIT));
        if no_credit {
            let failed = Self::permanent(ADD_CREDIT);
            return Some(if status == 429 { failed.of_kind(FailureKind::RateLimit) } else { failed });
        }
        // OpenAI refuses logprobs with a status that otherwise concerns the key.
        if status == 403
            && let Some(failed) = Self::from_refused_field(api_error, wire, sent)
        {
            return Some(failed);
        }
        if status >= 400
            && status != 401
            && let Some(wording) = Wording::find(api_error, sent.has_image)
        {
            return Some(Self { reach: wording.reach(), ..Self::permanent(&wording.hint()) });
        }
        if is_moderated(status, api_error) {
            return Some(Self::new(FailureKind::Filtered, String::new()));
        }
        if matches!(status, 400 | 403 | 404 | 406 | 410 | 422) || (status == 405 && api_error.page.is_some()) {
            return Self::from_words(status, api_error, wire, sent);
        }
        None
    }

    /// Classifies a refusal by a limit in numbers: tokens that the credit pays for, or a limit of 0.
    fn from_limits(status: u16, api_error: &ApiError) -> Option<Self> {
        if let Some(found) = AFFORDABLE.captures(&api_error.message) {
            let tokens = found[1].replace(',', "");
            let remedy = format!(
                "the credit pays for replies of {tokens} tokens at most: --max-tokens {tokens} or less, or add credit"
            );
            return Some(Self {
                forced: &["--max-tokens"],
                ..Self::permanent(if tokens == "0" { ADD_CREDIT } else { &remedy })
            });
        }
        let is_zero = api_error.has_zero_limit && matches!(status, 400 | 403 | 404 | 429);
        is_zero.then(|| Self::permanent(NO_QUOTA).of_kind(FailureKind::RateLimit))
    }

    /// Classifies a refusal with a status that has many causes by the server's words.
    fn from_words(status: u16, api_error: &ApiError, wire: Wire, sent: SentFields<'_>) -> Option<Self> {
        let mentions = |words: &[&str]| api_error.mentions_any(words);
        let field = Self::from_field(api_error, &wire.fields(sent));
        if field.reach == Reach::Endpoint {
            return Some(field);
        }
        if mentions(&vocabulary::NO_PARAMETERS) {
            return Some(Self::without_parameters(sent));
        }
        let is_about_content = mentions(&vocabulary::CONTENT);
        let is_of_firewall = (mentions(&vocabulary::FIREWALL) && !is_about_content)
            || api_error.page.as_ref().is_some_and(|page| vocabulary::FIREWALL.iter().any(|word| page.contains(word)));
        if is_of_firewall && !matches!(status, 404 | 410) {
            return Some(Self::alike(BLOCKED));
        }
        if status == 403 && api_error.page.is_some() {
            return Some(Self::alike(PAGE));
        }
        if mentions(&vocabulary::SETTINGS) && !is_about_content {
            return Some(Self::permanent(CHANGE_SETTINGS));
        }
        let is_rate = mentions(&vocabulary::RATE) || api_error.has_code_like(&["throttl", "ratelimit"]);
        if is_rate || (status == 403 && api_error.wait.is_some()) {
            return Some(if api_error.is_daily() {
                Self::permanent(NEXT_DAY).of_kind(FailureKind::RateLimit)
            } else {
                Self::transient(FailureKind::RateLimit)
            });
        }
        if matches!(status, 400 | 422) && mentions(&vocabulary::WRONG_KEY) {
            return Some(Self::permanent(CHECK_KEY));
        }
        (status == 400 && NO_MODEL.is_match(&api_error.message)).then(|| Self::permanent(CHECK_MODEL))
    }

    /// Classifies a refusal whose words do not decide, by its status.
    fn by_status(status: u16, api_error: &ApiError, wire: Wire, sent: SentFields<'_>) -> Self {
        let says_nothing = api_error.message.is_empty();
        let mentions = |words: &[&str]| api_error.mentions_any(words);
        match status {
            300..=399 => Self::permanent("redirects are not followed: give the final address as --base-url"),
            401 if !sent.has_key => Self::permanent(
                "no key was sent: set OPENAI_API_KEY, or name another variable or a file with --api-key-env or --api-key-file",
            ),
            401 => Self::permanent(CHECK_KEY),
            407 => Self::permanent(
                "the proxy asks for a user and password: set them in HTTP_PROXY, or name the host in NO_PROXY",
            ),
            402 => Self::permanent(PAY),
            403 if says_nothing => Self::of_status(CHECK_RIGHT),
            403 if mentions(&vocabulary::CONTENT) => Self::of_status(""),
            403 if mentions(&vocabulary::WRONG_KEY) => Self::permanent(CHECK_RIGHT),
            403 if mentions(&vocabulary::NO_RIGHT) || mentions(&vocabulary::MODEL) => Self::of_status(CHECK_RIGHT),
            404 | 410 if says_nothing => Self::of_status(CHECK_ADDRESS),
            404 | 410
                if api_error.page.is_some()
                    || mentions(&vocabulary::MODEL)
                    || mentions(&vocabulary::PATH)
                    || api_error.names(&sent.parameters.model) =>
            {
                Self::permanent(CHECK_ADDRESS)
            }
            // The words say something else, which may concern this request alone.
            403 | 404 | 410 => Self::of_status(""),
            405 => {
                Self::permanent(&format!("check --base-url: requests go to its path with /{} behind it", wire.path()))
            }
            408 | 425 => Self::transient(FailureKind::Timeout),
            413 => Self::new(FailureKind::Request, SMALLER.to_owned()),
            429 if api_error.mentions_any(&TOO_LARGE) => Self::new(FailureKind::Request, SMALLER.to_owned()),
            429 if api_error.is_daily() => Self::permanent(NEXT_DAY).of_kind(FailureKind::RateLimit),
            429 => Self::transient(FailureKind::RateLimit),
            // 424: failed generation (Text Generation Inference); 498: no capacity (Groq); 499: connection closed by
            // the client (nginx).
            409 | 424 | 498 | 499 | 500.. => Self::transient(FailureKind::Server),
            _ => Self::from_field(api_error, &wire.fields(sent)),
        }
    }

    /// Error of a provider that takes not all of the fields sent, without saying which it refuses.
    fn without_parameters(sent: SentFields<'_>) -> Self {
        let flags = sent.optional_flags();
        Self {
            forced: &["--temperature", "--sampling-seed", "--top-p", "--max-tokens"],
            ..Self::permanent(&format!(
                "the provider lacks a parameter of the request: leave out one of {}, or choose another --model",
                flags.join(", ")
            ))
        }
    }

    /// The same error of another kind.
    fn of_kind(mut self, kind: FailureKind) -> Self {
        self.failure.kind = kind;
        self
    }

    /// Error that other requests of this size may have too.
    fn alike(hint: &str) -> Self {
        Self { reach: Reach::Alike, ..Self::permanent(hint) }
    }

    /// Error that every other request would have too.
    fn permanent(hint: &str) -> Self {
        Self { reach: Reach::Endpoint, ..Self::new(FailureKind::Request, hint.to_owned()) }
    }

    /// Error that every other request would have too, by the meaning of its status.
    fn of_status(hint: &str) -> Self {
        Self { reach: Reach::ByStatus, ..Self::permanent(hint) }
    }

    /// Error after which the same request may succeed later.
    fn transient(kind: FailureKind) -> Self {
        Self { retry: Retry::AfterDelay, ..Self::new(kind, String::new()) }
    }

    /// Error of a request that the server accepts only through another API.
    fn needs_wire(wanted: Wire) -> Self {
        let hint = match wanted {
            Wire::Responses => "ask the model through the Responses API: --request wire=responses",
            _ => "ask for a stream: --request wire=chat-stream",
        };
        Self { refused_field: Some(AdaptableField::Wire(wanted)), forced: &["--wire"], ..Self::permanent(hint) }
    }

    /// Error of a request that was refused for a field that the program can send in another way; `None` for other
    /// refusals.
    fn from_refused_field(api_error: &ApiError, wire: Wire, sent: SentFields<'_>) -> Option<Self> {
        Some(Self::from_field(api_error, &wire.fields(sent))).filter(|failed| failed.refused_field.is_some())
    }

    /// Error of a request that may have been refused for one of its fields.
    ///
    /// If the server names a sent field as the cause, every other request with it fails too. If it names a field that
    /// is no longer sent, every request fails. If the text only mentions a field, the cause may be this request alone.
    fn from_field(api_error: &ApiError, fields: &[RequestField<'_>]) -> Self {
        let in_state = |state| fields.iter().filter(move |field| field.state == state);
        let named = in_state(FieldState::Sent)
            .find(|field| field.is_param(api_error))
            .or_else(|| in_state(FieldState::Sent).find(|field| field.is_named(api_error)))
            .or_else(|| RequestField::subject(fields, api_error));
        let (reach, field) = if let Some(field) = named {
            (Reach::Endpoint, field)
        } else if in_state(FieldState::Withdrawn).any(|field| field.is_named(api_error)) {
            return Self::permanent("the server refuses a field that is no longer sent");
        } else if let Some(field) = in_state(FieldState::Sent).find(|field| field.is_mentioned(api_error)) {
            (Reach::Trial, field)
        } else {
            return Self::new(FailureKind::Request, String::new());
        };
        // Servers do not call a too large number of logprobs unsupported, and have many words for a temperature that
        // they refuse.
        let adaptable = field.adaptable.filter(|adaptable| match adaptable {
            AdaptableField::TopLogprobs => true,
            AdaptableField::Temperature { .. } | AdaptableField::Seed => {
                reach == Reach::Endpoint || is_unsupported(api_error)
            }
            _ => is_unsupported(api_error),
        });
        Self {
            reach,
            refused_field: adaptable.map(|adaptable| match adaptable {
                AdaptableField::Temperature { .. } => {
                    AdaptableField::Temperature { least: least_temperature(&api_error.message) }
                }
                other => other,
            }),
            forced: field.forced_flags(),
            ..Self::permanent(field.hint)
        }
    }
}

/// The HTTP status that an error implies which came with a success status: its code, or what its words mean. Without
/// either it is a failure of the server, which may pass.
pub(crate) fn implied_status(api_error: &ApiError) -> u16 {
    if let Some(status) = api_error.status() {
        return status;
    }
    let is_credit = api_error.has_code_like(&vocabulary::CREDIT_CODES) || api_error.mentions_any(&vocabulary::CREDIT);
    if is_moderated(400, api_error) || is_out_of_tokens(400, api_error) {
        400
    } else if is_credit {
        402
    } else if api_error.mentions_any(&vocabulary::RATE) {
        429
    } else if api_error.mentions_any(&vocabulary::WRONG_KEY) {
        401
    } else {
        500
    }
}
