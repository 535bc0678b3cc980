//! The times at which requests are sent, and the number of requests in flight.
//!
//! All requests to one endpoint pass one [`Gate`]. It obeys the user's limits (`--rpm`, `--tpm`), the remaining limits
//! that the server reports ([`RateLimits`]) and the pauses that the server asks for ([`retry_after()`]). The [`Window`]
//! controls the number in flight independently: a long pause must not narrow the window, and a wide window must not
//! shorten a pause.

mod gate;
mod held_back;
mod learned_rate;
mod quota;
mod rate_limits;
mod retry_after;
mod wait_words;
mod window;

pub(super) use gate::Gate;
pub(super) use rate_limits::RateLimits;
pub(super) use retry_after::retry_after;
pub(super) use wait_words::{wait_in_field, wait_in_words};
pub(super) use window::Window;

pub(crate) use held_back::HeldBack;
#[cfg(test)]
pub(crate) use held_back::PaceCause;
pub use quota::Quota;
pub(crate) use window::ConcurrencyBounds;
