//! What follows from a refused request: [`FailureClass`] says whether to send it again, what else would fail, and which flag helps.

use super::complaint::Complaint;
use super::failure::Reach;
use super::field::{AdaptableField, RequestField, SentFields, is_unsupported};
use super::wire::Wire;
use crate::types::FailureKind;

/// What to make of a refused request.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct FailureClass {
    pub(super) kind: FailureKind,
    pub(super) reach: Reach,
    /// Whether the same request may succeed later.
    pub(super) again: bool,
    /// What the user can do.
    pub(super) hint: Option<String>,
    /// The field that it was refused for.
    pub(super) refused: Option<AdaptableField>,
}

/// Codes and types that mean: no money. They come with 429 as well, where waiting does not help.
const NO_CREDIT: [&str; 4] = [
    "insufficient_quota",
    "billing_hard_limit_reached",
    "billing_not_active",
    "exceeded_current_quota_error",
];
const NO_CREDIT_WORDS: [&str; 4] = [
    "credit balance",
    "insufficient credit",
    "insufficient balance",
    "out of credits",
];

/// Codes and types that mean the same for every request, with whatever status they come.
const HOPELESS: [&str; 6] = [
    "invalid_api_key",
    "authentication_error",
    "model_not_found",
    "DeploymentNotFound",
    "account_deactivated",
    "unsupported_country_region_territory",
];

/// What LiteLLM says, with status 400, of a wrong key where it has no database of keys, and of a model it does not know.
const HOPELESS_WORDS: [&str; 2] = ["no connected db", "invalid model name passed in"];

/// Codes and types that mean: a moderator refused what was asked. Another question may pass.
const MODERATED: [&str; 5] = [
    "content_filter",
    "ResponsibleAIPolicyViolation",
    "content_policy_violation",
    "moderation_blocked",
    "data_inspection_failed",
];

/// What OpenAI, vLLM, Ollama, llama.cpp (with status 500) and OpenRouter say of an image sent to a model without eyes.
const NO_EYES: [&str; 7] = [
    "image_url is only supported by certain models",
    "is not a multimodal model",
    "does not support image",
    "does not support vision",
    "image input is not enabled",
    "image input is not supported",
    "no endpoints found that support image input",
];

/// The remedy where there is no money.
const ADD_CREDIT: &str = "the account has no credit left: add some, then go on with --resume";

impl FailureClass {
    /// The class of a refused request, by its status and by what the server said about it.
    pub(super) fn of(status: u16, complaint: &Complaint, wire: Wire, sent: SentFields<'_>) -> Self {
        let no_credit = complaint.is_any(&NO_CREDIT)
            || (matches!(status, 400 | 402 | 403 | 429) && complaint.says_any(&NO_CREDIT_WORDS));
        match status {
            429 if no_credit => Self {
                kind: FailureKind::RateLimit,
                ..Self::hopeless(ADD_CREDIT)
            },
            _ if no_credit => Self::hopeless(ADD_CREDIT),
            _ if sent.has_image && complaint.says_any(&NO_EYES) => Self::hopeless(
                "the model takes no images: choose another --model, or ask it without them by --blind",
            ),
            300..400 => {
                Self::hopeless("redirects are not followed: give the final address as --base-url")
            }
            401 if !sent.has_key => {
                Self::hopeless("no key was sent: name one by --api-key-env or --api-key-file")
            }
            401 => Self::hopeless("check the key that --api-key-env or --api-key-file names"),
            400.. if complaint.is_any(&HOPELESS) || complaint.says_any(&HOPELESS_WORDS) => {
                Self::hopeless("check the key, --model and --base-url")
            }
            400..500 if complaint.is_any(&MODERATED) || (status == 403 && moderated(complaint)) => {
                Self {
                    kind: FailureKind::Filtered,
                    ..Self::refused()
                }
            }
            402 => Self::hopeless(ADD_CREDIT),
            403 | 407 => Self::hopeless(
                "the key may not use this model from here: check the key and --model",
            ),
            404 | 410 => Self::hopeless("check --base-url (many end with /v1) and --model"),
            405 => Self::hopeless(&format!(
                "check --base-url: requests go to its path with /{} behind it",
                wire.path()
            )),
            408 | 425 => Self::passing(FailureKind::Timeout),
            413 => Self {
                hint: Some("send smaller images: --max-side, or --image jpeg:95".to_owned()),
                ..Self::refused()
            },
            429 => Self::passing(FailureKind::RateLimit),
            // 498 and 499 are Groq's and nginx' words for: no room, and: gone away.
            409 | 498 | 499 | 500.. => Self::passing(FailureKind::Server),
            _ => Self::of_field(complaint, &wire.fields(sent)),
        }
    }

    /// Every other request would fail alike.
    fn hopeless(hint: &str) -> Self {
        Self {
            reach: Reach::Endpoint,
            hint: Some(hint.to_owned()),
            ..Self::refused()
        }
    }

    /// The same request may succeed later.
    fn passing(kind: FailureKind) -> Self {
        Self {
            kind,
            again: true,
            ..Self::refused()
        }
    }

    /// This one request is refused.
    fn refused() -> Self {
        Self {
            kind: FailureKind::Request,
            reach: Reach::Trial,
            again: false,
            hint: None,
            refused: None,
        }
    }

    /// A refused request that may be about one of its fields. If the server names the field, every other request with it
    /// fails alike; if only its words do, it could be about this one request.
    fn of_field(complaint: &Complaint, fields: &[RequestField]) -> Self {
        let mut sent = fields.iter().filter(|field| field.sent);
        let (reach, field) = match sent.clone().find(|field| field.is_named(complaint)) {
            Some(field) => (Reach::Endpoint, field),
            None => match sent.find(|field| field.is_mentioned(complaint)) {
                Some(field) => (Reach::Trial, field),
                None => return Self::refused(),
            },
        };
        Self {
            reach,
            refused: field.refused.filter(|_| is_unsupported(complaint)),
            ..Self::hopeless(field.hint)
        }
    }
}

fn moderated(complaint: &Complaint) -> bool {
    complaint.moderated || complaint.says_any(&["moderation", "flagged"])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ask::field::RequestFields;
    use crate::ask::parameters::{Parameters, TokenField};

    fn parameters() -> Parameters {
        Parameters {
            reasoning_effort: Some("minimal".into()),
            ..Parameters::new("m".into())
        }
    }

    fn judged(status: u16, body: &str) -> FailureClass {
        let sent = SentFields {
            parameters: &parameters(),
            fields: RequestFields {
                token_field: TokenField::MaxTokens,
                temperature: Some(0.0),
            },
            has_image: true,
            has_key: true,
        };
        FailureClass::of(status, &Complaint::of_body(body), Wire::Chat, sent)
    }

    #[test]
    fn statuses_are_told_apart() {
        for status in [301, 302, 307, 401, 402, 403, 404, 405, 407, 410] {
            let class = judged(status, "");
            assert_eq!(
                (class.reach, class.again),
                (Reach::Endpoint, false),
                "{status}"
            );
            assert!(class.hint.is_some(), "{status}");
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
            let class = judged(status, "");
            assert_eq!((class.reach, class.again), (Reach::Trial, true), "{status}");
            assert_eq!(class.kind, kind);
        }
        for status in [400, 413, 415, 422] {
            let class = judged(status, "");
            assert_eq!(
                (class.reach, class.again),
                (Reach::Trial, false),
                "{status}"
            );
        }
    }

    #[test]
    fn words_overrule_the_status() {
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
            let class = judged(status, body);
            assert_eq!(
                (class.reach, class.again),
                (Reach::Endpoint, false),
                "{body}"
            );
        }
        // A minute's limit of Gemini speaks of quota too; waiting helps.
        let minute = r#"{"error":{"code":429,"status":"RESOURCE_EXHAUSTED","message":"You exceeded your current quota, please check your plan"}}"#;
        assert!(judged(429, minute).again);
        let moderated =
            r#"{"error":{"code":403,"message":"x","metadata":{"reasons":["violence"]}}}"#;
        let filtered = r#"{"error":{"code":"content_filter","message":"x","innererror":{"code":"ResponsibleAIPolicyViolation"}}}"#;
        for (status, body) in [(403, moderated), (400, filtered)] {
            let class = judged(status, body);
            assert_eq!(
                (class.reach, class.again, class.kind),
                (Reach::Trial, false, FailureKind::Filtered)
            );
        }
    }

    #[test]
    fn the_flag_that_mends_it_is_named() {
        for (body, reach, flag) in [
            (
                r#"{"error":{"param":"temperature","message":"x"}}"#,
                Reach::Endpoint,
                "--temperature default",
            ),
            (
                r#"{"error":{"param":"max_tokens","message":"Use 'max_completion_tokens' instead."}}"#,
                Reach::Endpoint,
                "--token-field max_completion_tokens",
            ),
            (
                r#"{"error":{"message":"Unsupported: 'max_tokens'. Use 'max_completion_tokens' instead."}}"#,
                Reach::Trial,
                "--token-field max_completion_tokens",
            ),
            (
                r#"{"error":{"param":"reasoning_effort","message":"x"}}"#,
                Reach::Endpoint,
                "--reasoning-effort",
            ),
        ] {
            let class = judged(400, body);
            assert_eq!(class.reach, reach, "{body}");
            assert!(class.hint.unwrap().contains(flag), "{body}");
        }
        // What was not sent is not to blame.
        for body in [
            r#"{"error":{"param":"max_completion_tokens","message":"x"}}"#,
            r#"{"error":{"param":"messages.[0].content.[1].image_url.detail","message":"x"}}"#,
        ] {
            assert_eq!(judged(400, body).hint, None, "{body}");
        }
    }

    #[test]
    fn a_field_that_is_not_taken_is_told_from_one_that_does_not_fit() {
        for (body, refused) in [
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
            assert_eq!(judged(400, body).refused, refused, "{body}");
        }
    }
}
