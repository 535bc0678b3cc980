//! The main job from the outside: the program is called as a user calls it.

mod adapted;
mod conditions;
mod failures;
mod interruption;
mod large;
mod outputs;
mod probabilities;
mod requests;
mod resume;
mod untouched;

use serde_json::Value;

/// A field of a record; empty if it is not a text.
fn text<'a>(record: &'a Value, key: &str) -> &'a str {
    record[key].as_str().unwrap_or("")
}
