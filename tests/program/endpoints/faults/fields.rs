//! Request fields that a server does not take.

use darkqa_eval::internals::ask::{Parameters, Reach, Temperature, Thinking};
use serde_json::{Value, json};

use super::{ask, ask_with, sending};
use crate::support::endpoint::Answer;
use crate::support::snapshot::redacted;

/// Fields that a server does not take are sent otherwise from then on, where that was left to the program.
#[test]
fn fields_are_adapted_once_for_all() {
    let refused = |param: &str, code: &str| {
        let message = format!("Unsupported: '{param}' is not supported with this model.");
        Answer::json(400, &json!({"error": {"param": param, "code": code, "message": message}}))
    };
    let limit = || refused("max_tokens", "unsupported_parameter");
    let heat = || refused("temperature", "unsupported_value");
    let outcome = ask(vec![limit(), heat(), Answer::text("B")]);
    assert_eq!(outcome.result.unwrap().attempts, 3);
    let [first, second, third] = &outcome.requests[..] else {
        panic!("{:?}", outcome.requests);
    };
    assert_eq!((&first["max_tokens"], &first["temperature"]), (&json!(1024), &json!(0.0)));
    assert_eq!(second["max_tokens"], Value::Null);
    assert_eq!(second["max_completion_tokens"], 1024);
    assert_eq!((&third["max_completion_tokens"], &third["temperature"]), (&json!(1024), &Value::Null));

    // What the user has said is never changed.
    let stated = Parameters { temperature: Temperature::Of(0.5), ..Parameters::new("m".into()) };
    let outcome = ask_with(vec![heat()], sending(), stated);
    let error = outcome.result.unwrap_err();
    assert_eq!((error.reach, error.attempts), (Reach::Endpoint, 1));
    insta::assert_snapshot!(redacted(&error.failure.message), @"
    http://127.0.0.1:[PORT]/v1 answered 400: Unsupported: 'temperature' is not supported with this model. (leave
        the temperature to the server: --temperature default)
    ");
    // A server that takes neither name gets no limit; one that refuses what is not sent any more is left.
    let neither = || refused("max_completion_tokens", "unsupported_parameter");
    let outcome = ask(vec![limit(), neither(), Answer::text("B")]);
    assert_eq!(outcome.result.unwrap().attempts, 3);
    let last = &outcome.requests[2];
    assert!(last.get("max_tokens").is_none() && last.get("max_completion_tokens").is_none());
    let outcome = ask(vec![limit(), neither()]);
    let error = outcome.result.unwrap_err();
    assert_eq!((error.reach, error.attempts), (Reach::Endpoint, 3), "{error}");
    let outcome = ask(vec![heat(), heat()]);
    let error = outcome.result.unwrap_err();
    assert_eq!((error.reach, error.attempts), (Reach::Endpoint, 2), "{error}");
}

/// Lists of details name the field by its place.
#[test]
fn field_is_found_by_detail_location() {
    let details = json!({"object": "error", "message": {"detail": [
        {"type": "extra_forbidden", "loc": ["body", "max_tokens"], "msg": "Extra inputs are not permitted"},
    ]}});
    let outcome = ask(vec![Answer::json(422, &details), Answer::text("B")]);
    assert_eq!(outcome.result.unwrap().attempts, 2);
    assert_eq!(outcome.requests[1]["max_completion_tokens"], 1024);
}

/// What the table says of servers on this machine; a model without such a switch is the server's to refuse.
#[test]
fn thinking_uses_field_of_server() {
    let off = || Parameters { thinking: Some(Thinking::Off), ..Parameters::new("m".into()) };
    let outcome = ask_with(vec![Answer::text("B")], sending(), off());
    outcome.result.unwrap();
    let body = &outcome.requests[0];
    assert_eq!(body["chat_template_kwargs"], json!({"enable_thinking": false}));
    assert!(body.get("reasoning_effort").is_none() && body.get("switch").is_none());
    let refusal = Answer::error(400, "unknown_parameter", "Unknown parameter: 'chat_template_kwargs'.");
    let outcome = ask_with(vec![refusal], sending(), off());
    let error = outcome.result.unwrap_err();
    assert_eq!((error.reach, error.attempts), (Reach::Endpoint, 1));
    insta::assert_snapshot!(redacted(&error.failure.message), @"
    http://127.0.0.1:[PORT]/v1 answered 400: Unknown parameter: 'chat_template_kwargs'. (leave --thinking out: the
        model or its server has no such switch)
    ");
    // Nothing is said unless it is asked for.
    let outcome = ask(vec![Answer::text("B")]);
    assert!(outcome.requests[0].get("chat_template_kwargs").is_none());
}
