//! The times at which requests are sent, and the number of requests in flight.
//!
//! All requests to one endpoint pass one [`Gate`]. It obeys the user's limits (`--rpm`, `--tpm`), the remaining limits
//! that the server reports ([`RateLimits`]) and the pauses that the server asks for ([`rate_limits`]). The [`Window`]
//! controls the number in flight independently: a long pause must not narrow the window, and a wide window must not
//! shorten a pause.

mod gate;
mod rate_limits;
mod wait_words;
mod window;

pub(super) use gate::Gate;
pub(super) use rate_limits::{RateLimits, retry_after};
pub(super) use wait_words::{wait_in_field, wait_in_words};
pub(super) use window::Window;

pub use gate::{HeldBack, PaceCause};
pub use window::ConcurrencyBounds;

pub use rate_limits::Quota;
