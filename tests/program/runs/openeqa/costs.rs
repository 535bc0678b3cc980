//! Costs of answers and marks: the estimate, and the budget.

use serde_json::{Value, json};

use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::house::House;
use crate::support::run::{called, words};

#[test]
fn open_dry_run_sends_nothing() {
    let house = House::new();
    let silent = MockEndpoint::start([Answer::error(400, "bad", "must not be asked")]);
    let base = silent.base_url();
    let called =
        house.call(&words(&format!("--model gpt-4o --base-url {base} --judge gpt-4o-mini --out run --dry-run --json")));
    assert_eq!(called.code, Some(0), "{called:?}");
    let estimate: Value = serde_json::from_str(&called.stdout).unwrap();
    // Three questions at three levels, and as many marks.
    assert_eq!((&estimate["lines"][0]["requests"], &estimate["lines"][1]["requests"]), (&json!(9), &json!(9)));
    assert_eq!(estimate["lines"][1]["model"], "gpt-4o-mini (judge)");
    assert_eq!((&estimate["trials"], &estimate["images"]), (&json!(18), &json!(15)));
    // Each of the nine requests about a walk has its three frames.
    assert_eq!(estimate["images_sent"], json!(27));
    assert_eq!(estimate["few_sources"], json!({"number": 2, "needed": 8, "of": "walk"}));
    // More frames than a walk has are shown several times, and made once.
    let short = house.0.call(&words(&format!(
        "openeqa --questions questions.json --frames walks --num-frames 7 --image-size 48 --levels L0,L2,L4 --variant noise --model gpt-4o \
         --base-url {base} --judge gpt-4o-mini --out run --dry-run --json"
    )));
    assert_eq!(short.code, Some(0), "{short:?}");
    let repeated: Value = serde_json::from_str(&short.stdout).unwrap();
    assert_eq!((&repeated["images_sent"], &repeated["images"]), (&json!(63), &json!(21)));
    insta::assert_snapshot!(short.messages(), @"
    exit code: 0
     WARN 2 of 2 walks have fewer frames than --num-frames 7: they are shown several times in a request, as
        upstream does (the 5 frames of hm3d-v0/000-a, for example); --num-frames 5 shows each once at most, and
        costs less
    ");
    assert!(estimate["lines"][0]["dollars"].as_f64().unwrap() > 0.0);
    assert!(estimate["bytes"].as_f64().unwrap() > 9.0 * 3.0 * 100.0);
    assert!(silent.requests().is_empty() && !house.0.path("run").exists());
}

#[test]
fn budget_covers_answers_and_marks() {
    let house = House::new();
    let usage = json!({"prompt_tokens": 100_000, "completion_tokens": 10});
    let body = json!({"choices": [{"message": {"content": "5"}, "finish_reason": "stop"}], "usage": usage});
    let mock = MockEndpoint::start([Answer::json(200, &body)]);
    let base = mock.base_url();
    // 0.25 dollars a reply of gpt-4o.
    let call = |dollars: &str| {
        house.call(&words(&format!(
            "--model gpt-4o --judge gpt-4o --base-url {base} --levels L0 --out run --max-cost {dollars}"
        )))
    };
    let called = call("1.1");
    assert_eq!(called.code, Some(3), "{called:?}");
    assert_eq!(mock.requests().len(), 4);
    let called = call("9");
    assert_eq!(called.code, Some(0), "{called:?}");
    // Three answers and, as they are alike but about three questions, three marks.
    assert_eq!(mock.requests().len(), 6);
}

#[test]
fn file_model_cost_counts_for_marks() {
    let house = House::new();
    let usage = json!({"prompt_tokens": 100_000, "completion_tokens": 10});
    let body = json!({"choices": [{"message": {"content": "5"}, "finish_reason": "stop"}], "usage": usage});
    let mock = MockEndpoint::start([Answer::json(200, &body)]);
    let base = mock.base_url();
    // The name in tables has no price; the id costs 0.25 dollars a reply.
    let models = format!("[[model]]\nname = \"A name\"\nid = \"gpt-4o\"\nendpoints = [\"{base}\"]\n");
    house.0.file("models.toml", models);
    let called = house.call(&words(&format!(
        "--models models.toml --judge gpt-4o --judge-base-url {base} --levels L0 --out run --max-cost 1.1"
    )));
    assert_eq!(called.code, Some(3), "{called:?}");
    assert_eq!(mock.requests().len(), 4);
}

/// Groq takes 5 images in a request: said by the estimate, and refused before anything is sent. A blind model is shown
/// none.
#[test]
fn excess_images_per_vendor_are_refused() {
    let house = House::new();
    let call = |frames: &str, more: &str| {
        let line = format!(
            "openeqa --questions questions.json --frames walks --image-size 48 --judge m --base-url https://api.groq.com/openai/v1 \
             --num-frames {frames} --out run {more}"
        );
        called(house.0.command(&words(&line)).env("GROQ_API_KEY", "none"))
    };
    let six = "6 images in a request are more than the 5 of Groq";
    let estimate = call("6", "--model m --dry-run");
    assert!(estimate.stdout.contains(six), "{estimate:?}");
    for more in ["--dry-run --model m", "--dry-run --blind-model m"] {
        let frames = if more.contains("blind") { "6" } else { "5" };
        let fits = call(frames, more);
        assert_eq!(fits.code, Some(0), "{fits:?}");
        assert!(!fits.stdout.contains("more than the 5"), "{fits:?}");
    }
    let refused = call("6", "--model m --retries 0");
    insta::assert_snapshot!(refused.messages(), @"
    exit code: 2
     WARN 2 of 2 walks have fewer frames than --num-frames 6: they are shown several times in a request, as
        upstream does (the 5 frames of hm3d-v0/000-a, for example); --num-frames 5 shows each once at most, and
        costs less
    error: request: 6 images in a request are more than the 5 of Groq; show fewer frames, or ask another endpoint
    ");
}
