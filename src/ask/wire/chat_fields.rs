//! The fields of a chat completion's request that servers may refuse: [`fields`].

use crate::ask::requests::{
    AdaptableField, Constrain, FieldState, RequestField, SentFields, Temperature, TokenField,
};
use crate::ask::wire_kind::Wire;

/// The remedy for a server that states no probabilities.
pub(super) const PROBABILITIES: &str = "leave --request probabilities out: the server states none";

/// The number of likeliest tokens, as Text Generation Inference calls it in its refusals.
const TOP_TOKENS: &str = "top_n_tokens";

/// The fields that a server may refuse.
pub(super) fn fields(sent: SentFields<'_>) -> Vec<RequestField<'static>> {
    [&sampling(sent)[..], &form(sent)].concat()
}

/// The fields that decide how tokens are drawn.
fn sampling(sent: SentFields<'_>) -> Vec<RequestField<'static>> {
    let parameters = sent.parameters;
    let never = parameters.token_field == TokenField::Omit;
    let now = sent.fields.token_field;
    let limit = |field| FieldState::until_refused(now == field, never || now != TokenField::Omit);
    Vec::from([
        RequestField {
            name: "temperature",
            state: FieldState::until_refused(
                sent.fields.temperature.is_some(),
                parameters.temperature == Temperature::Server,
            ),
            adaptable: Some(AdaptableField::Temperature),
            hint: "leave the temperature to the server: --temperature default",
        },
        RequestField {
            name: "top_p",
            state: FieldState::set(parameters.top_p.is_some()),
            adaptable: None,
            hint: "leave --top-p out: the model takes no other than its own",
        },
        RequestField {
            name: "max_tokens",
            state: limit(TokenField::MaxTokens),
            adaptable: Some(AdaptableField::TokenField),
            hint: "send the limit in another field: --request token-field=max_completion_tokens (or none), or another --max-tokens",
        },
        RequestField {
            name: "max_completion_tokens",
            state: limit(TokenField::MaxCompletionTokens),
            adaptable: Some(AdaptableField::TokenField),
            hint: "send the limit in another field: --request token-field=max_tokens (or none), or another --max-tokens",
        },
        RequestField {
            name: "reasoning_effort",
            state: FieldState::set(sent.fields.effort(parameters).is_some()),
            adaptable: None,
            hint: "leave --reasoning-effort (or --thinking) out, or give a value the model takes",
        },
    ])
}

/// The fields that decide the form of images and replies.
fn form(sent: SentFields<'_>) -> Vec<RequestField<'static>> {
    let parameters = sent.parameters;
    Vec::from([
        RequestField {
            name: "detail",
            state: FieldState::set(sent.has_image && parameters.detail.is_some()),
            adaptable: None,
            hint: "leave --image detail out, or give a value the server takes",
        },
        RequestField {
            name: "response_format",
            state: FieldState::set(parameters.constrain == Constrain::Json),
            adaptable: None,
            hint: "leave --request constrain out: the server does not take it",
        },
        RequestField {
            name: "structured_outputs",
            state: FieldState::set(parameters.constrain == Constrain::Choice),
            adaptable: None,
            hint: "leave --request constrain out, or try --request constrain=json",
        },
        RequestField {
            name: "logprobs",
            state: FieldState::until_refused(
                sent.fields.top_logprobs.is_some(),
                !parameters.probabilities,
            ),
            adaptable: Some(AdaptableField::Logprobs),
            hint: PROBABILITIES,
        },
        RequestField {
            name: "top_logprobs",
            state: FieldState::set(sent.fields.top_logprobs.is_some()),
            adaptable: Some(AdaptableField::TopLogprobs),
            hint: PROBABILITIES,
        },
        RequestField {
            name: TOP_TOKENS,
            state: FieldState::set(sent.fields.top_logprobs.is_some()),
            adaptable: Some(AdaptableField::TopLogprobs),
            hint: PROBABILITIES,
        },
        RequestField {
            name: "stream_options",
            state: FieldState::until_refused(
                sent.fields.wire == Wire::ChatStream && sent.fields.stream_usage,
                sent.fields.stream_usage,
            ),
            adaptable: Some(AdaptableField::StreamUsage),
            hint: "ask without a stream: --request wire=chat",
        },
    ])
}
