//! Keys and other secrets: recognition, checks of where they are sent, and removal from text.

mod body_secrets;
mod key_form;
mod key_header;
mod key_owner;
mod private_key;
mod reply_secrets;
mod secret;
mod secret_parts;

pub(super) use body_secrets::refuse_secrets;
pub(crate) use key_form::{is_secret_header, is_secret_value, looks_like_key};
pub(crate) use key_header::KeyHeader;
pub(super) use key_owner::check_owner;
pub(super) use reply_secrets::without_secrets;
pub(super) use secret::Scrub;
pub use secret::Secret;
