//! Stage 4, ask: sends a prompt and an image to a model and receives a [`Reply`](crate::types::Reply). The only asynchronous
//! stage.
//!
//! [`Prompts`] turn a question into text, [`Payload`](crate::picture::Payload) an image into the text of a data URL; both are CPU work and done before.
//! A [`Model`] takes the two as the [`Message`] of a [`Call`]. [`Remote`] is a model at an [`Endpoint`]. The endpoint is one server,
//! at one or several addresses: each replica has its key, connections and pauses. All models at that server share it. What is known
//! of vendors is a table, `vendors.toml`. A [`Wire`](wire_kind::Wire) defines the form of requests and replies: files of one API in
//! `wire/`.

pub(crate) mod batch;
pub(crate) mod batch_api;
mod batch_interface;
mod costs;
mod endpoints;
mod failures;
mod models;
mod pace;
pub(crate) mod prompts;
mod replies;
mod requests;
mod secrets;
mod vendors;
mod wire;
mod wire_kind;

pub(crate) use batch_interface::BatchInterface;
pub(crate) use costs::{
    Price, PricedRequest, Prices, ReplyExcess, Reservation, Spending, TokenBound,
};
pub use endpoints::{Access, BaseUrl, Endpoint, Sending};
pub(crate) use endpoints::{AccessArgs, OPENAI_KEY, Server, sleep_running, vendor_variables};
pub(crate) use failures::QuotaRefusal;
pub use failures::{AskError, Reach};
pub(crate) use models::{Local, LocalAnswer};
pub use models::{Model, Random, Remote, Script};
pub(crate) use pace::ConcurrencyBounds;
pub use pace::Quota;
pub use prompts::Prompts;
pub use requests::{
    Call, Constrain, ExtraFields, ImageDetail, Message, Parameters, Query, Temperature, Thinking,
    TokenField,
};
pub(crate) use requests::{ImageLimit, ImagePlaces, RequestArgs, by_flag};
pub use secrets::Secret;
pub(crate) use secrets::{KeyHeader, is_secret_name, is_secret_value, looks_like_key};
pub use wire_kind::WireSetting;
