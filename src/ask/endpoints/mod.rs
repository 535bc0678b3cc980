//! Endpoints: their addresses, connections, replicas and settings.

mod access;
mod connection;
mod endpoint;
mod load_balancer;
mod replica;
pub(crate) mod server;
mod url;

pub use access::Access;
pub use endpoint::Endpoint;
pub use load_balancer::Sending;
pub use url::BaseUrl;

pub(super) use connection::{Connection, Deadline, HttpResponse};
pub(super) use load_balancer::ModelIndex;

pub use connection::sleep_running;
pub use server::{AccessArgs, OPENAI_KEY, Server, vendor_variables};
