//! Classification of refused requests, [`AskError::refused`]: whether to retry, which other requests would fail, and which flag helps.

use super::api_error::ApiError;
use super::ask_error::{AskError, Reach, Retry};
use super::moderation::is_moderated;
use super::wording::Wording;
use crate::ask::requests::{AdaptableField, FieldState, RequestField, SentFields, is_unsupported};
use crate::ask::wire::requested_wire;
use crate::ask::wire_kind::Wire;
use crate::types::FailureKind;

/// Error codes and kinds for an account without credit. Some servers send them with status 429, although waiting does not help.
const NO_CREDIT: [&str; 6] = [
    "Arrearage",
    "credit_limit",
    "insufficient_quota",
    "billing_hard_limit_reached",
    "billing_not_active",
    "exceeded_current_quota_error",
];

/// Phrases for an account without credit.
const NO_CREDIT_PHRASES: [&str; 6] = [
    "all available credits",
    "spending limit",
    "credit balance",
    "insufficient credit",
    "insufficient balance",
    "out of credits",
];

/// Phrases for a request larger than the limit of a whole minute (status 413 or 429): waiting does not help.
const TOO_LARGE: [&str; 2] = ["request too large", "request is too large"];

/// Remedy for a request that is too large.
const SMALLER: &str = "send smaller images: --image max-side=N, or --image jpeg:95";

/// Remedy for a limit that resets once a day.
const NEXT_DAY: &str =
    "a limit for the day is reached: continue with --resume when the day is over";

/// Remedy for an account without credit.
const ADD_CREDIT: &str = "the account has no credit left: add some, then continue with --resume";

impl AskError {
    /// Classifies a refused request by its status and the server's error. The message is only the remedy; empty if none is known.
    pub(in crate::ask) fn refused(
        status: u16,
        api_error: &ApiError,
        wire: Wire,
        sent: SentFields<'_>,
    ) -> Self {
        if let Some(wanted) =
            requested_wire(api_error, wire).filter(|_| (400..500).contains(&status))
        {
            return Self::needs_wire(wanted);
        }
        let no_credit = api_error.has_code(&NO_CREDIT)
            || (matches!(status, 400 | 402 | 403 | 429)
                && api_error.mentions_any(&NO_CREDIT_PHRASES));
        // OpenAI refuses logprobs with a status that otherwise concerns the key.
        if status == 403
            && let Some(failed) = Self::from_refused_field(api_error, wire, sent)
        {
            return failed;
        }
        if status >= 400
            && status != 401
            && !no_credit
            && let Some(wording) = Wording::find(api_error, sent.has_image)
        {
            return Self {
                reach: wording.reach(),
                ..Self::permanent(&wording.hint())
            };
        }
        match status {
            429 if no_credit => Self {
                reach: Reach::Endpoint,
                ..Self::new(FailureKind::RateLimit, ADD_CREDIT.to_owned())
            },
            _ if no_credit => Self::permanent(ADD_CREDIT),
            300..400 => {
                Self::permanent("redirects are not followed: give the final address as --base-url")
            }
            401 if !sent.has_key => Self::by_status(
                "no key was sent: set OPENAI_API_KEY, or name another variable or a file with --api-key-env or --api-key-file",
            ),
            401 => Self::by_status(
                "check the key; it is taken from OPENAI_API_KEY (for Azure AZURE_OPENAI_API_KEY) unless --api-key-env or --api-key-file names another",
            ),
            407 => Self::permanent(
                "the proxy asks for a user and password: set them in HTTP_PROXY, or name the host in NO_PROXY",
            ),
            400..429 | 430..500 if is_moderated(status, api_error) => {
                Self::new(FailureKind::Filtered, String::new())
            }
            402 => Self::by_status(ADD_CREDIT),
            403 => Self::by_status(
                "the key may not use this model from here: check the key and --model",
            ),
            404 | 410 => Self::by_status("check --base-url (many end with /v1) and --model"),
            405 => Self::by_status(&format!(
                "check --base-url: requests go to its path with /{} behind it",
                wire.path()
            )),
            408 | 425 => Self::transient(FailureKind::Timeout),
            413 => Self::new(FailureKind::Request, SMALLER.to_owned()),
            429 if api_error.mentions_any(&TOO_LARGE) => {
                Self::new(FailureKind::Request, SMALLER.to_owned())
            }
            429 if api_error.is_daily() => Self {
                reach: Reach::Endpoint,
                ..Self::new(FailureKind::RateLimit, NEXT_DAY.to_owned())
            },
            429 => Self::transient(FailureKind::RateLimit),
            // 424: failed generation (Text Generation Inference); 498: no capacity (Groq); 499: connection closed by the client
            // (nginx).
            409 | 424 | 498 | 499 | 500.. => Self::transient(FailureKind::Server),
            _ => Self::from_field(api_error, &wire.fields(sent)),
        }
    }

    /// Error that every other request would have too.
    fn permanent(hint: &str) -> Self {
        Self {
            reach: Reach::Endpoint,
            ..Self::new(FailureKind::Request, hint.to_owned())
        }
    }

    /// Error that every other request would have too, by the meaning of its status.
    fn by_status(hint: &str) -> Self {
        Self {
            reach: Reach::ByStatus,
            ..Self::permanent(hint)
        }
    }

    /// Error after which the same request may succeed later.
    fn transient(kind: FailureKind) -> Self {
        Self {
            retry: Retry::AfterDelay,
            ..Self::new(kind, String::new())
        }
    }

    /// Error of a request that the server accepts only through another API.
    fn needs_wire(wanted: Wire) -> Self {
        let hint = match wanted {
            Wire::Responses => "ask the model through the Responses API: --request wire=responses",
            _ => "ask for a stream: --request wire=chat-stream",
        };
        Self {
            refused_field: Some(AdaptableField::Wire(wanted)),
            ..Self::permanent(hint)
        }
    }

    /// Error of a request that was refused for a field that the program can send in another way; `None` for other refusals.
    fn from_refused_field(api_error: &ApiError, wire: Wire, sent: SentFields<'_>) -> Option<Self> {
        Some(Self::from_field(api_error, &wire.fields(sent)))
            .filter(|failed| failed.refused_field.is_some())
    }

    /// Error of a request that may have been refused for one of its fields.
    ///
    /// If the server names a sent field as the cause, every other request with it fails too. If it names a field that is no longer sent,
    /// every request fails. If the text only mentions a field, the cause may be this request alone.
    fn from_field(api_error: &ApiError, fields: &[RequestField<'_>]) -> Self {
        let in_state = |state| fields.iter().filter(move |field| field.state == state);
        let named = in_state(FieldState::Sent)
            .find(|field| field.is_param(api_error))
            .or_else(|| in_state(FieldState::Sent).find(|field| field.is_named(api_error)));
        let (reach, field) = if let Some(field) = named {
            (Reach::Endpoint, field)
        } else if in_state(FieldState::Withdrawn).any(|field| field.is_named(api_error)) {
            return Self::permanent("the server refuses a field that is no longer sent");
        } else if let Some(field) =
            in_state(FieldState::Sent).find(|field| field.is_mentioned(api_error))
        {
            (Reach::Trial, field)
        } else {
            return Self::new(FailureKind::Request, String::new());
        };
        Self {
            reach,
            // Servers do not call a too large number of logprobs unsupported.
            refused_field: field.adaptable.filter(|adaptable| {
                *adaptable == AdaptableField::TopLogprobs || is_unsupported(api_error)
            }),
            ..Self::permanent(field.hint)
        }
    }
}

#[cfg(test)]
mod tests;
