//! Request fields that a server does not take.

use darkqa_eval::internals::ask::{Parameters, Reach, Temperature};
use serde_json::{Value, json};

use super::{ask, ask_with, sending};
use crate::support::endpoint::Answer;

/// Fields that a server does not take are sent otherwise from then on, where that was left to the program.
#[test]
fn fields_are_adapted_once_for_all() {
    let refused = |param: &str, code: &str| {
        let message = format!("Unsupported: '{param}' is not supported with this model.");
        Answer::json(
            400,
            &json!({"error": {"param": param, "code": code, "message": message}}),
        )
    };
    let limit = || refused("max_tokens", "unsupported_parameter");
    let heat = || refused("temperature", "unsupported_value");
    let outcome = ask(vec![limit(), heat(), Answer::text("B")]);
    assert_eq!(outcome.result.unwrap().attempts, 3);
    let [first, second, third] = &outcome.requests[..] else {
        panic!("{:?}", outcome.requests);
    };
    assert_eq!(
        (&first["max_tokens"], &first["temperature"]),
        (&json!(1024), &json!(0.0))
    );
    assert_eq!(second["max_tokens"], Value::Null);
    assert_eq!(second["max_completion_tokens"], 1024);
    assert_eq!(
        (&third["max_completion_tokens"], &third["temperature"]),
        (&json!(1024), &Value::Null)
    );

    // What the user has said is never changed.
    let stated = Parameters {
        temperature: Temperature::Of(0.5),
        ..Parameters::new("m".into())
    };
    let outcome = ask_with(vec![heat()], sending(), stated);
    let error = outcome.result.unwrap_err();
    assert_eq!((error.reach, error.attempts), (Reach::Endpoint, 1));
    assert!(
        error.failure.message.contains("--temperature default"),
        "{error}"
    );
    // A server that takes neither name is left after both.
    let outcome = ask_with(
        vec![
            limit(),
            refused("max_completion_tokens", "unsupported_parameter"),
        ],
        sending(),
        Parameters::new("m".into()),
    );
    let error = outcome.result.unwrap_err();
    assert_eq!(
        (error.reach, error.attempts),
        (Reach::Endpoint, 2),
        "{error}"
    );
}
