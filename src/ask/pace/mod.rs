//! When to send, and how much at once.
//!
//! All requests to one endpoint pass one [`Gate`], which keeps to what the user allows (`--rpm`, `--tpm`), to what the server
//! says is left ([`Allowance`]) and to the pauses it asks for ([`asked_wait`]). How many are on the wire at once is another
//! matter, the [`Window`]'s: a long pause must not narrow it, nor a wide one shorten the pause.

mod allowance;
mod gate;
mod learned;
mod wait;
mod window;

pub(super) use allowance::Allowance;
pub(super) use gate::Gate;
pub(super) use wait::asked_wait;
pub(super) use window::Window;

pub use gate::Quota;
pub(crate) use window::Bounds;
