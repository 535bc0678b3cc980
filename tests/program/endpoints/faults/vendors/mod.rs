//! What is particular to a vendor or a server: refused fields, waits, and failures, in its own words.

mod failures;
mod fields;
mod waits;

use std::time::Duration;

use darkqa_eval::internals::ask::{Parameters, Sending};
use serde_json::{Value, json};

use super::sending;
use crate::support::endpoint::Answer;

fn plain() -> Parameters {
    Parameters::new("m".into())
}

/// An error of OpenAI with the name of the field.
fn of_field(status: u16, param: &Value, code: &Value, message: &str) -> Answer {
    let error = json!({"message": message, "type": "invalid_request_error", "param": param, "code": code});
    Answer::json(status, &json!({ "error": error }))
}

/// An error that a router passes on as text within its own.
fn routed(status: u16, message: &str) -> Answer {
    of_field(status, &Value::Null, &json!(status.to_string()), message)
}

/// No retry at all: what is answered nevertheless spent none. Nothing is turned away for long.
fn none_spent() -> Sending {
    Sending { retries: 0, patience: Duration::from_secs(2), ..sending() }
}
