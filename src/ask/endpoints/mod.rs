//! Endpoints: their addresses, connections, replicas and settings.

mod access;
mod account_key;
mod attempts;
mod connection;
mod connection_fault;
mod custom_certificates;
mod custom_headers;
mod endpoint;
mod load_balancer;
mod proxy;
mod replica;
mod sending;
mod served_model;
mod server;
mod time_limit;
mod url;
mod variable;

pub use access::Access;
pub(super) use connection::{Connection, Deadline, HttpResponse};
pub use endpoint::Endpoint;
pub(super) use load_balancer::ModelIndex;
pub use sending::Sending;
pub(crate) use server::{AccessArgs, OPENAI_KEY, Server, vendor_variables};
pub(crate) use time_limit::sleep_running;
pub use url::BaseUrl;
