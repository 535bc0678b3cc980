//! Stage 4, ask: sends a prompt and an image to a model and receives a [`Reply`](crate::types::Reply). The only asynchronous
//! stage.
//!
//! [`Prompts`] turn a question into text, [`Payload`](crate::picture::Payload) an image into the text of a data URL; both are CPU work and done before.
//! A [`Model`] takes the two as the [`Message`] of a [`Call`]. [`Remote`] is a model at an [`Endpoint`]. The endpoint is one server,
//! at one or several addresses: each replica has its key, connections and pauses. All models at that server share it. What is known
//! of vendors is a table, `vendors.toml`. A [`Wire`](wire_kind::Wire) defines the form of requests and replies: files of one API in
//! `wire/`.

mod access;
pub(crate) mod batch;
pub(crate) mod batch_api;
mod batch_interface;
mod body;
mod body_secrets;
mod bounded_json;
mod call;
mod complaint;
mod connection;
mod connection_fault;
mod constraint;
mod endpoint;
mod escapes;
mod extra_fields;
mod failure;
mod failure_class;
mod field;
mod image_limit;
mod image_tokens;
mod key_form;
mod key_header;
mod key_owner;
mod local;
mod model;
pub(crate) mod openeqa;
mod own_certificate;
mod own_headers;
mod pace;
mod parameters;
mod prices;
mod prompt;
mod proxy;
mod quota_refusal;
mod random;
mod remote;
mod replica;
mod reply_secrets;
mod request;
mod script;
mod secret;
mod secret_parts;
mod sending;
mod server;
mod service;
mod spending;
mod thinking;
mod time_limit;
mod token_bound;
mod token_field;
mod url;
mod variable;
mod vendor;
mod vendor_batch;
mod vendor_table;
mod wire;
mod wire_kind;
mod wording;

pub use access::Access;
pub(crate) use batch_interface::BatchInterface;
pub(crate) use call::ImagePlaces;
pub use call::{Call, Message, Query};
pub use endpoint::Endpoint;
pub use extra_fields::ExtraFields;
pub(crate) use extra_fields::RequestArgs;
pub use failure::{AskError, Reach};
pub(crate) use image_limit::ImageLimit;
pub(crate) use key_form::{is_secret_name, is_secret_value, looks_like_key};
pub(crate) use key_header::KeyHeader;
pub(crate) use local::{Local, LocalAnswer};
pub use model::Model;
pub(crate) use pace::Bounds;
pub use pace::Quota;
pub(crate) use parameters::by_flag;
pub use parameters::{Constrain, ImageDetail, Parameters, Temperature};
pub(crate) use prices::{Price, Prices};
pub use prompt::Prompts;
pub(crate) use quota_refusal::QuotaRefusal;
pub use random::Random;
pub use remote::Remote;
pub use script::Script;
pub use secret::Secret;
pub use sending::Sending;
pub(crate) use server::{AccessArgs, OPENAI_KEY, Server, own_variables};
pub(crate) use spending::{PricedRequest, ReplyExcess, Reservation, Spending};
pub use thinking::Thinking;
pub(crate) use time_limit::sleep_running;
pub(crate) use token_bound::TokenBound;
pub use token_field::TokenField;
pub use url::BaseUrl;
pub use wire_kind::WireSetting;
