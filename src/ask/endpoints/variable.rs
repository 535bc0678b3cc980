//! Environment variables: [`variable`].

use std::env;

/// Value of an environment variable; `None` if it is unset or blank.
pub(super) fn variable(name: &str) -> Option<String> {
    env::var(name).ok().filter(|text| !text.trim().is_empty())
}
