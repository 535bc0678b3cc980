//! Costs of answers and marks: the estimate, and the budget.

use serde_json::{Value, json};

use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::house::House;

#[test]
fn a_dry_run_says_what_it_would_take_and_sends_nothing() {
    let house = House::new();
    let silent = MockEndpoint::start([Answer::error(400, "bad", "must not be asked")]);
    let base = silent.base_url();
    let called = house.call(&[
        "--model",
        "gpt-4o",
        "--base-url",
        &base,
        "--judge",
        "gpt-4o-mini",
        "--out",
        "run",
        "--dry-run",
        "--json",
    ]);
    assert_eq!(called.code, Some(0), "{called:?}");
    let told: Value = serde_json::from_str(&called.stdout).unwrap();
    // Three questions at three levels, and as many marks.
    assert_eq!(
        (&told["lines"][0]["requests"], &told["lines"][1]["requests"]),
        (&json!(9), &json!(9))
    );
    assert_eq!(told["lines"][1]["model"], "gpt-4o-mini (judge)");
    assert_eq!((&told["trials"], &told["images"]), (&json!(18), &json!(18)));
    assert!(told["lines"][0]["dollars"].as_f64().unwrap() > 0.0);
    assert!(told["bytes"].as_f64().unwrap() > 9.0 * 3.0 * 100.0);
    assert!(silent.requests().is_empty() && !house.0.path("run").exists());
}

#[test]
fn a_budget_holds_for_answers_and_marks_together() {
    let house = House::new();
    let usage = json!({"prompt_tokens": 100_000, "completion_tokens": 10});
    let body = json!({"choices": [{"message": {"content": "5"}, "finish_reason": "stop"}], "usage": usage});
    let mock = MockEndpoint::start([Answer::json(200, &body)]);
    let base = mock.base_url();
    // 0.25 dollars a reply of gpt-4o.
    let flags = [
        "--model",
        "gpt-4o",
        "--judge",
        "gpt-4o",
        "--base-url",
        &base,
        "--levels",
        "L0",
        "--out",
        "run",
    ];
    let called = house.call(&[&flags[..], &["--max-cost", "1.1"]].concat());
    assert_eq!(called.code, Some(130), "{called:?}");
    assert_eq!(mock.requests().len(), 4);
    let called = house.call(&[&flags[..], &["--max-cost", "9"]].concat());
    assert_eq!(called.code, Some(0), "{called:?}");
    // Three answers and, as they are alike but about three questions, three marks.
    assert_eq!(mock.requests().len(), 6);
}
