//! The value of a flag that was not typed: [`LayeredValue`].

use std::ffi::OsString;

/// The value of one flag from the environment or a file.
pub(super) struct LayeredValue {
    /// The source of the value for messages: a variable, or a file and a key in it.
    pub(super) origin: String,
    pub(super) values: Vec<OsString>,
}
