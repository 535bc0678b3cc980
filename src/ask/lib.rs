//! Stage 4, ask: sends a prompt and an image to a model and receives a [`Reply`](darkqa_base::types::Reply). The only
//! asynchronous stage.
//!
//! Before this stage, [`Prompts`] turn a question into text and [`Payload`](darkqa_pictures::Payload) encodes an image
//! as a data URL; both are CPU work. A [`Model`] receives them as the [`Message`] of a [`Call`]. [`Remote`] is a model
//! at an [`Endpoint`]. An endpoint is one server with one or several replicas, each with its own address, key,
//! connections and rate limiter; all models at the server share it. The table `vendors.toml` has the properties of
//! vendors. A [`Wire`](wire_kind::Wire) is an API; `wire/` has the form of its requests and replies.

#![allow(missing_docs, reason = "fields and variants of this workspace's own use, whose names say what they are")]
#![cfg_attr(test, allow(clippy::unwrap_used, reason = "a test may panic"))]

pub mod batch;
pub mod batch_api;
pub mod bounded_json;
mod costs;
mod endpoints;
mod failures;
mod models;
mod pace;
pub mod prompts;
mod requests;
mod secrets;
pub mod vendors;
mod wire;
mod wire_kind;
mod wordings;

pub use batch::BatchInterface;
pub use costs::{
    ChargeRatios, ImageTokenCheck, Price, PricedRequest, Prices, ReplyExcess, Reservation, Spending, TokenBound,
    Unpriced, scaling_image_tokens, stated_charge,
};
pub use endpoints::{
    Access, AccessArgs, BaseUrl, Endpoint, OPENAI_KEY, Sending, Server, sleep_running, vendor_variables,
};
pub use failures::{AskError, QuotaRefusal, Reach};
pub use models::{Local, LocalAnswer, Model, Random, Remote, Script};
pub use pace::{ConcurrencyBounds, HeldBack, PaceCause, Quota};
pub use prompts::Prompts;
pub use requests::{
    Call, ChangedSetting, Constrain, ExtraFields, ImageDetail, ImageLimit, ImagePlaces, Message, Parameters, Query,
    RequestArgs, SettingsOrigin, Temperature, Thinking, TokenField, by_flag,
};
pub use secrets::{KeyHeader, Secret, is_secret_header, is_secret_value, looks_like_key};
pub use wire::is_context_full;
pub use wire_kind::WireSetting;
pub use wordings::{PromptSet, Wording};
