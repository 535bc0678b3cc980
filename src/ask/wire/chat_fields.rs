//! Fields of chat completion requests that servers may refuse: [`fields`].

use crate::ask::requests::{AdaptableField, Constrain, FieldState, RequestField, SentFields, Temperature, TokenField};
use crate::ask::wire_kind::Wire;

/// Remedy for a server without token probabilities.
pub(super) const OMIT_PROBABILITIES: &str = "leave --request probabilities out: the server states none";

/// Remedy for a server without a seed.
const OMIT_SEED: &str = "send no seed: --sampling-seed none, or leave seed out of the file of models";

/// Name of `top_logprobs` in the refusals of Text Generation Inference.
const TGI_TOP_LOGPROBS: &str = "top_n_tokens";

/// Fields that a server may refuse.
pub(super) fn fields(sent: SentFields<'_>) -> Vec<RequestField<'static>> {
    [sampling_fields(sent), format_fields(sent)].concat()
}

/// Fields that control sampling.
fn sampling_fields(sent: SentFields<'_>) -> Vec<RequestField<'static>> {
    let parameters = sent.parameters;
    let is_omitted = parameters.token_field == TokenField::Omit;
    let current = sent.fields.token_field;
    let limit_state = |field| FieldState::until_refused(current == field, is_omitted || current != TokenField::Omit);
    Vec::from([
        RequestField {
            name: "temperature",
            state: FieldState::until_refused(
                sent.fields.temperature.is_some(),
                parameters.temperature == Temperature::Server,
            ),
            adaptable: Some(AdaptableField::Temperature { least: None }),
            hint: "leave the temperature to the server: --temperature default",
        },
        RequestField {
            name: "top_p",
            state: FieldState::sent_if(parameters.top_p.is_some()),
            adaptable: None,
            hint: "leave --top-p out: the model takes no other than its own",
        },
        RequestField {
            name: "seed",
            state: FieldState::until_refused(sent.fields.seed.is_some(), parameters.seed.is_none()),
            adaptable: Some(AdaptableField::Seed),
            hint: OMIT_SEED,
        },
        RequestField {
            name: "max_tokens",
            state: limit_state(TokenField::MaxTokens),
            adaptable: Some(AdaptableField::TokenField),
            hint: "send the limit in another field: --request token-field=max_completion_tokens (or none), or another --max-tokens",
        },
        RequestField {
            name: "max_completion_tokens",
            state: limit_state(TokenField::MaxCompletionTokens),
            adaptable: Some(AdaptableField::TokenField),
            hint: "send the limit in another field: --request token-field=max_tokens (or none), or another --max-tokens",
        },
        RequestField {
            name: "reasoning_effort",
            state: FieldState::sent_if(sent.fields.effort(parameters).is_some()),
            adaptable: None,
            hint: "leave --reasoning-effort (or --thinking) out, or give a value the model takes",
        },
    ])
}

/// Fields that control the form of images and replies.
fn format_fields(sent: SentFields<'_>) -> Vec<RequestField<'static>> {
    let parameters = sent.parameters;
    Vec::from([
        RequestField {
            name: "detail",
            state: FieldState::sent_if(sent.has_image && parameters.detail.is_some()),
            adaptable: None,
            hint: "leave --image detail out, or give a value the server takes",
        },
        RequestField {
            name: "response_format",
            state: FieldState::sent_if(parameters.constrain == Constrain::Json),
            adaptable: None,
            hint: "leave --request constrain out: the server does not take it",
        },
        RequestField {
            name: "structured_outputs",
            state: FieldState::sent_if(parameters.constrain == Constrain::Choice),
            adaptable: None,
            hint: "leave --request constrain out, or try --request constrain=json",
        },
        RequestField {
            name: "logprobs",
            state: FieldState::until_refused(sent.fields.top_logprobs.is_some(), !parameters.probabilities),
            adaptable: Some(AdaptableField::Logprobs),
            hint: OMIT_PROBABILITIES,
        },
        RequestField {
            name: "top_logprobs",
            state: FieldState::sent_if(sent.fields.top_logprobs.is_some()),
            adaptable: Some(AdaptableField::TopLogprobs),
            hint: OMIT_PROBABILITIES,
        },
        RequestField {
            name: TGI_TOP_LOGPROBS,
            state: FieldState::sent_if(sent.fields.top_logprobs.is_some()),
            adaptable: Some(AdaptableField::TopLogprobs),
            hint: OMIT_PROBABILITIES,
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
