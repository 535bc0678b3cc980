//! The times at which requests are sent, and the number of requests in flight.
//!
//! All requests to one endpoint pass one [`Gate`]. It follows the user's limits (`--rpm`, `--tpm`), the remaining limits that the
//! server reports ([`RateLimits`]) and the pauses that it asks for ([`asked_wait`]). The number in flight is set separately by the
//! [`Window`]: a long pause must not narrow the window, and a wide window must not shorten a pause.

mod allowance;
mod gate;
mod learned;
mod quota;
mod wait;
mod wait_words;
mod window;

pub(super) use allowance::RateLimits;
pub(super) use gate::Gate;
pub(super) use wait::{asked_wait, protobuf_duration};
pub(super) use wait_words::wait_in_words;
pub(super) use window::Window;

pub use quota::Quota;
pub(crate) use window::Bounds;
