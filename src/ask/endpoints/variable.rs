//! The value of an environment variable: [`variable`].

use std::env;

/// The value of an environment variable; `None` if it is not set or blank.
pub(super) fn variable(name: &str) -> Option<String> {
    env::var(name).ok().filter(|text| !text.trim().is_empty())
}
