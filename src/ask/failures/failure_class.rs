//! The failure of a refused request, [`AskError::refused`]: whether to retry it, which other requests would fail, and which flag helps.

use super::complaint::Complaint;
use super::failure::{Again, AskError, Reach};
use super::wording::Wording;
use crate::ask::requests::{AdaptableField, FieldState, RequestField, SentFields, is_unsupported};
use crate::ask::wire::other_wire;
use crate::ask::wire_kind::Wire;
use crate::types::FailureKind;

/// Codes and types that mean: no credit. Some servers send them with status 429, although waiting does not help.
const NO_CREDIT: [&str; 6] = [
    "Arrearage",
    "credit_limit",
    "insufficient_quota",
    "billing_hard_limit_reached",
    "billing_not_active",
    "exceeded_current_quota_error",
];
const NO_CREDIT_WORDS: [&str; 6] = [
    "all available credits",
    "spending limit",
    "credit balance",
    "insufficient credit",
    "insufficient balance",
    "out of credits",
];

/// Codes and types that mean: moderation refused the content. Another question may be accepted.
const MODERATED: [&str; 6] = [
    "DataInspectionFailed",
    "content_filter",
    "ResponsibleAIPolicyViolation",
    "content_policy_violation",
    "moderation_blocked",
    "data_inspection_failed",
];

/// The words of servers, with status 413 or 429, for a request that is larger than a whole minute's limit: no wait helps.
const TOO_LARGE: [&str; 2] = ["request too large", "request is too large"];

/// The remedy for a request that is too large.
const SMALLER: &str = "send smaller images: --image max-side=N, or --image jpeg:95";

/// The remedy for a limit that resets once a day.
const NEXT_DAY: &str =
    "a limit for the day is reached: continue with --resume when the day is over";

/// The remedy for an account without credit.
const ADD_CREDIT: &str = "the account has no credit left: add some, then continue with --resume";

impl AskError {
    /// The failure of a refused request, from its status and the server's error. Its message is the remedy alone, empty if none is
    /// known.
    pub(in crate::ask) fn refused(
        status: u16,
        complaint: &Complaint,
        wire: Wire,
        sent: SentFields<'_>,
    ) -> Self {
        if let Some(wanted) = other_wire(complaint, wire).filter(|_| (400..500).contains(&status)) {
            return Self::from_wire(wanted);
        }
        let no_credit = complaint.has_code(&NO_CREDIT)
            || (matches!(status, 400 | 402 | 403 | 429)
                && complaint.mentions_any(&NO_CREDIT_WORDS));
        // OpenAI forbids probabilities by a status that else is about the key.
        if status == 403
            && let Some(failed) = Self::from_refused_field(complaint, wire, sent)
        {
            return failed;
        }
        if status >= 400
            && status != 401
            && !no_credit
            && let Some(wording) = Wording::find(complaint, sent.has_image)
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
            401 if !sent.has_key => Self::permanent(
                "no key was sent: set OPENAI_API_KEY, or name another variable or a file with --api-key-env or --api-key-file",
            ),
            401 => Self::permanent(
                "check the key; it is taken from OPENAI_API_KEY (for Azure AZURE_OPENAI_API_KEY) unless --api-key-env or --api-key-file names another",
            ),
            407 => Self::permanent(
                "the proxy asks for a user and password: set them in HTTP_PROXY, or name the host in NO_PROXY",
            ),
            400..500
                if complaint.has_code(&MODERATED) || (status == 403 && moderated(complaint)) =>
            {
                Self::new(FailureKind::Filtered, String::new())
            }
            402 => Self::permanent(ADD_CREDIT),
            403 => Self::permanent(
                "the key may not use this model from here: check the key and --model",
            ),
            404 | 410 => Self::permanent("check --base-url (many end with /v1) and --model"),
            405 => Self::permanent(&format!(
                "check --base-url: requests go to its path with /{} behind it",
                wire.path()
            )),
            408 | 425 => Self::transient(FailureKind::Timeout),
            413 => Self::new(FailureKind::Request, SMALLER.to_owned()),
            429 if complaint.mentions_any(&TOO_LARGE) => {
                Self::new(FailureKind::Request, SMALLER.to_owned())
            }
            429 if complaint.is_daily() => Self {
                reach: Reach::Endpoint,
                ..Self::new(FailureKind::RateLimit, NEXT_DAY.to_owned())
            },
            429 => Self::transient(FailureKind::RateLimit),
            // 424 is the status of Text Generation Inference for a generation that failed, 498 Groq's for no capacity, 499 nginx's
            // for a connection that the client closed.
            409 | 424 | 498 | 499 | 500.. => Self::transient(FailureKind::Server),
            _ => Self::from_field(complaint, &wire.fields(sent)),
        }
    }

    /// A failure that every other request would have too.
    fn permanent(hint: &str) -> Self {
        Self {
            reach: Reach::Endpoint,
            ..Self::new(FailureKind::Request, hint.to_owned())
        }
    }

    /// A failure after which the same request may succeed later.
    fn transient(kind: FailureKind) -> Self {
        Self {
            again: Again::Later,
            ..Self::new(kind, String::new())
        }
    }

    /// The failure of a request that the server takes through another wire alone.
    fn from_wire(wanted: Wire) -> Self {
        let hint = match wanted {
            Wire::Responses => "ask the model through the Responses API: --request wire=responses",
            _ => "ask for a stream: --request wire=chat-stream",
        };
        Self {
            refused_field: Some(AdaptableField::Wire(wanted)),
            ..Self::permanent(hint)
        }
    }

    /// The failure of a request that was refused for a field that the program can send in another way; `None` if it was not.
    fn from_refused_field(complaint: &Complaint, wire: Wire, sent: SentFields<'_>) -> Option<Self> {
        Some(Self::from_field(complaint, &wire.fields(sent)))
            .filter(|failed| failed.refused_field.is_some())
    }

    /// The failure of a request that may have been refused for one of its fields. If the server names the field, every other
    /// request with it fails too, and so does every request if the server refuses what is not sent any more. If only the text mentions it, the
    /// cause may be this request alone.
    fn from_field(complaint: &Complaint, fields: &[RequestField<'_>]) -> Self {
        let with = |state| fields.iter().filter(move |field| field.state == state);
        let mut withdrawn = with(FieldState::Withdrawn);
        let mut by_param = with(FieldState::Sent).filter(|field| field.is_param(complaint));
        let mut named = with(FieldState::Sent).filter(|field| field.is_named(complaint));
        let (reach, field) = match by_param.next().or_else(|| named.next()) {
            Some(field) => (Reach::Endpoint, field),
            None if withdrawn.any(|field| field.is_named(complaint)) => {
                return Self::permanent("the server refuses a field that is no longer sent");
            }
            None => match with(FieldState::Sent).find(|field| field.is_mentioned(complaint)) {
                Some(field) => (Reach::Trial, field),
                None => return Self::new(FailureKind::Request, String::new()),
            },
        };
        Self {
            reach,
            // A number of tokens that is too large is not called unsupported.
            refused_field: field.adaptable.filter(|adaptable| {
                *adaptable == AdaptableField::TopLogprobs || is_unsupported(complaint)
            }),
            ..Self::permanent(field.hint)
        }
    }
}

fn moderated(complaint: &Complaint) -> bool {
    complaint.moderated || complaint.mentions_any(&["moderation", "flagged"])
}

#[cfg(test)]
mod tests;
