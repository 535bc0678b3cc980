//! Stage 4, ask: sends a prompt and an image to a model and receives a [`Reply`](crate::types::Reply). The only asynchronous
//! stage.
//!
//! [`Prompts`] turn a question into text, [`Payload`] an image into the text of a data URL; both are CPU work and done before.
//! A [`Model`] takes the two as the [`Message`] of a [`Call`]. [`Remote`] is a model at an [`Endpoint`]. The endpoint has the
//! address, key, connections and pauses of one server; all models at that server share it. A [`Wire`] defines the form of
//! requests and replies: one file an API, in `wire/`.

mod access;
pub(crate) mod batch;
pub(crate) mod batch_api;
mod body;
mod call;
mod complaint;
mod connection;
mod constraint;
mod endpoint;
mod escapes;
mod failure;
mod failure_class;
mod field;
mod image_limit;
mod image_tokens;
mod key_header;
mod local;
mod model;
pub(crate) mod openeqa;
mod pace;
mod parameters;
mod payload;
mod plain_png;
mod prices;
mod prompt;
mod random;
mod remote;
mod script;
mod secret;
mod sending;
mod server;
mod url;
mod wire;

pub use access::Access;
pub use call::{Call, Message, Query};
pub use endpoint::Endpoint;
pub use failure::{AskError, Reach};
pub(crate) use image_limit::ImageLimit;
pub(crate) use key_header::KeyHeader;
pub(crate) use local::{Local, LocalAnswer};
pub use model::Model;
pub(crate) use pace::Bounds;
pub use pace::Quota;
pub use parameters::{Constrain, ImageDetail, Parameters, Temperature, TokenField};
pub(crate) use payload::{ImageArgs, png};
pub use payload::{Payload, PayloadFormat};
pub(crate) use prices::{Price, Prices};
pub use prompt::Prompts;
pub use random::Random;
pub use remote::Remote;
pub use script::Script;
pub use secret::Secret;
pub use sending::Sending;
pub(crate) use server::{AccessArgs, Server};
pub use url::BaseUrl;
pub use wire::Wire;
