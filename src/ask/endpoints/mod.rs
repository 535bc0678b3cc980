//! Endpoints: their addresses, connections, replicas and settings.

mod access;
mod connection;
mod connection_fault;
mod endpoint;
mod own_certificate;
mod own_headers;
mod proxy;
mod replica;
mod sending;
mod server;
mod service;
mod time_limit;
mod url;
mod variable;

pub use access::Access;
pub(super) use connection::{Connection, Deadline, HttpReply};
pub use endpoint::Endpoint;
pub use sending::Sending;
pub(crate) use server::{AccessArgs, OPENAI_KEY, Server, own_variables};
pub(super) use service::ModelNumber;
pub(crate) use time_limit::sleep_running;
pub use url::BaseUrl;
