//! Keys and other secrets: recognition, checks of where they are sent, and removal from text.

mod key_form;
mod secret;

pub(super) use secret::{Scrub, refuse_secrets, without_secrets};

pub use key_form::{KeyHeader, is_secret_header, is_secret_value, looks_like_key};

pub use secret::Secret;
