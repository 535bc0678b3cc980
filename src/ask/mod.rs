//! Stage 4, ask: sends a prompt and an image to a model and receives a [`Reply`](crate::types::Reply). The only
//! asynchronous stage.
//!
//! Before this stage, [`Prompts`] turn a question into text and [`Payload`](crate::pictures::Payload) encodes an image
//! as a data URL; both are CPU work. A [`Model`] receives them as the [`Message`] of a [`Call`]. [`Remote`] is a model
//! at an [`Endpoint`]. An endpoint is one server with one or several replicas, each with its own address, key,
//! connections and rate limiter; all models at the server share it. The table `vendors.toml` has the properties of
//! vendors. A [`Wire`](wire_kind::Wire) is an API; `wire/` has the form of its requests and replies.

pub(crate) mod batch;
pub(crate) mod batch_api;
pub(crate) mod bounded_json;
mod costs;
mod endpoints;
mod failures;
mod models;
mod pace;
pub(crate) mod prompts;
mod requests;
mod secrets;
pub(crate) mod vendors;
mod wire;
mod wire_kind;
mod wordings;

#[cfg(test)]
pub(crate) use pace::PaceCause;

pub(crate) use batch::BatchInterface;
pub(crate) use costs::{
    ChargeRatios, ImageTokenCheck, Price, PricedRequest, Prices, ReplyExcess, Reservation, Spending, TokenBound,
    Unpriced, scaling_image_tokens, stated_charge,
};
pub(crate) use endpoints::{AccessArgs, OPENAI_KEY, Server, sleep_running, vendor_variables};
pub(crate) use failures::QuotaRefusal;
pub(crate) use models::{Local, LocalAnswer};
pub(crate) use pace::{ConcurrencyBounds, HeldBack};
pub(crate) use requests::{ChangedSetting, ImageLimit, ImagePlaces, RequestArgs, by_flag};
pub(crate) use secrets::{KeyHeader, is_secret_header, is_secret_value, looks_like_key};
pub(crate) use wire::is_context_full;

pub use endpoints::{Access, BaseUrl, Endpoint, Sending};
pub use failures::{AskError, Reach};
pub use models::{Model, Random, Remote, Script};
pub use pace::Quota;
pub use prompts::Prompts;
pub use requests::{
    Call, Constrain, ExtraFields, ImageDetail, Message, Parameters, Query, SettingsOrigin, Temperature, Thinking,
    TokenField,
};
pub use secrets::Secret;
pub use wire_kind::WireSetting;
pub(crate) use wordings::{PromptSet, Wording};
