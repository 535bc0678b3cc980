//! How each model of a file is asked: its API, its switch for thinking, and the probabilities of choices.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;

use serde_json::{Value, json};

use crate::support::endpoint::{Answer, MockEndpoint, Request};
use crate::support::run::{Bench, Called, model_args, records, words};
use crate::support::snapshot::redacted;

const RUN: &str = "--models models.toml --data set.jsonl --levels L0 --retries 0 --out run";

/// An endpoint that answers by each API in its own form.
fn endpoint() -> MockEndpoint {
    MockEndpoint::watching(|request| {
        let body = match &*request.body {
            [] => return Answer::new(404, ""),
            _ => request.json(),
        };
        if request.line.contains("/v1/responses") {
            return Answer::json(
                200,
                &json!({
                    "status": "completed", "model": body["model"],
                    "output": [{"type": "message", "content": [{"type": "output_text", "text": "C"}]}],
                    "usage": {"input_tokens": 90, "output_tokens": 1},
                }),
            );
        }
        if body["stream"] == true {
            return Answer::streamed_text("C");
        }
        Answer::text("C")
    })
}

fn bench(models: &str) -> Bench {
    let bench = Bench::with_questions(1);
    bench.file("models.toml", models);
    bench
}

fn call(bench: &Bench, line: &str) -> Called {
    bench.call(&words(&format!("{RUN} {line}")))
}

fn table(id: &str, url: &str, more: &str) -> String {
    format!("[[model]]\nid = \"{id}\"\nendpoints = [\"{url}\"]\n{more}\n")
}

/// The request of each model, by its name.
fn by_model(requests: &[Request]) -> BTreeMap<String, &Request> {
    requests
        .iter()
        .filter(|request| !request.body.is_empty())
        .map(|request| {
            let body = request.json();
            (body["model"].as_str().unwrap().to_owned(), request)
        })
        .collect()
}

#[test]
fn each_model_has_own_wire() {
    let mock = endpoint();
    let url = mock.base_url();
    let bench = bench(&format!(
        "[defaults]\nsystem = \"Be brief.\"\nwire = \"chat-stream\"\n{}{}{}",
        table(
            "response",
            &url,
            "wire = \"responses\"\nbody = { metadata = { team = \"a\" }, reasoning = { summary = \"auto\" } }\nreasoning-effort = \"low\""
        ),
        table("streamed", &url, ""),
        table("whole", &url, "wire = \"chat\"\nthinking = \"off\"\nbody = { top_k = 1 }"),
    ));
    let run = call(&bench, "");
    assert_eq!(run.code, Some(0), "{run:?}");
    let requests = mock.requests();
    let sent = by_model(&requests);
    insta::assert_snapshot!(redacted(&sent["response"].line), @"POST /v1/responses HTTP/1.1");
    let response = sent["response"].json();
    assert_eq!(response["instructions"], "Be brief.");
    assert_eq!(response["input"].as_array().unwrap().len(), 1);
    assert_eq!(response["metadata"], json!({"team": "a"}));
    assert_eq!(response["reasoning"], json!({"effort": "low", "summary": "auto"}));
    assert!(response.get("messages").is_none());
    for (model, is_stream) in [("streamed", true), ("whole", false)] {
        assert!(sent[model].line.contains("/v1/chat/completions "));
        let body = sent[model].json();
        assert_eq!(body["messages"][0]["content"], "Be brief.");
        assert_eq!(body.get("stream").is_some(), is_stream, "{body}");
        assert!(body.get("instructions").is_none());
    }
    let whole = sent["whole"].json();
    assert_eq!(whole["top_k"], 1);
    assert_eq!(whole["chat_template_kwargs"], json!({"enable_thinking": false}));
    assert!(sent["streamed"].json().get("chat_template_kwargs").is_none());
    // The same again asks nothing: by each wire a reply was kept.
    let asked = requests.len();
    assert_eq!(call(&bench, "").code, Some(0));
    assert_eq!(mock.requests().len(), asked);
}

#[test]
fn trial_key_follows_reply_settings() {
    let mock = endpoint();
    let url = mock.base_url();
    let key = |more: &str| -> String {
        let bench = bench(&table("m", &url, more));
        let run = call(&bench, "");
        assert_eq!(run.code, Some(0), "{more}: {run:?}");
        records(&bench.path("run"))[0]["key"].as_str().unwrap().to_owned()
    };
    let plain = key("");
    for same in [
        "wire = \"chat\"",
        "wire = \"chat-stream\"",
        "token-field = \"max_completion_tokens\"",
        "probabilities = false",
    ] {
        assert_eq!(key(same), plain, "{same}");
    }
    let others = [
        "wire = \"responses\"",
        "thinking = \"off\"",
        "thinking = \"on\"",
        "probabilities = true",
        "deployment = \"fp8\"",
        "body = { top_k = 1 }",
    ];
    let keys: BTreeSet<String> = others.into_iter().map(key).collect();
    assert_eq!(keys.len(), others.len());
    assert!(!keys.contains(&plain));
    // By flags it is the same trial.
    let bench = Bench::with_questions(1);
    let flags = "--data set.jsonl --levels L0 --wire responses --out run";
    bench.complete(&model_args(&url, flags));
    let by_flag = records(&bench.path("run"))[0]["key"].clone();
    assert!(keys.contains(by_flag.as_str().unwrap()));
}

#[test]
fn model_is_above_flag_for_probabilities() {
    let mock = endpoint();
    let url = mock.base_url();
    let models = table("with", &url, "") + &table("without", &url, "probabilities = false");
    let bench = bench(&models);
    let run = call(&bench, "--probabilities");
    insta::assert_snapshot!(run.messages(), @"
    exit code: 0
     WARN models.toml: models with their own probabilities are not changed; the flag applies to the others (--set
        NAME.KEY=VALUE overrides both)
    ");
    let requests = mock.requests();
    let sent = by_model(&requests);
    assert_eq!(sent["with"].json()["top_logprobs"], 20);
    assert!(sent["without"].json().get("logprobs").is_none());
    // A model that draws its replies cannot have any, and the message names its line.
    bench.file("models.toml", table("hot", &url, "temperature = 1\nprobabilities = true"));
    let refused = call(&bench, "--dry-run");
    insta::assert_snapshot!(refused.messages(), @"
    exit code: 2
    error: models.toml, line 2: hot: --request probabilities: the probabilities of tokens depend on the
        temperature: --temperature 0, auto or default expected
    ");
}

#[test]
fn fields_repeating_flags_are_refused() {
    let mock = endpoint();
    let url = mock.base_url();
    let switch = "body = { chat_template_kwargs = { enable_thinking = false } }";
    for (more, part) in [
        (format!("thinking = \"off\"\n{switch}"), "chat_template_kwargs is set by --thinking"),
        (
            "constrain = \"json\"\nbody = { response_format = { type = \"text\" } }".to_owned(),
            "response_format is set by --request constrain",
        ),
        (
            "constrain = \"json\"\nwire = \"responses\"\nbody = { text = { verbosity = \"low\" } }".to_owned(),
            "text is set by --request constrain",
        ),
        (
            "reasoning-effort = \"low\"\nwire = \"responses\"\nbody = { reasoning = { effort = \"high\" } }".to_owned(),
            "reasoning.effort is set by --reasoning-effort",
        ),
        (
            "probabilities = true\nwire = \"responses\"\nbody = { include = [] }".to_owned(),
            "include is set by --request probabilities",
        ),
        ("body = { instructions = \"a\" }".to_owned(), "use --system"),
    ] {
        let bench = bench(&table("m", &url, &more));
        let refused = call(&bench, "");
        assert_eq!(refused.code, Some(2), "{more}: {refused:?}");
        assert!(refused.stderr.contains(part), "{more}: {}", refused.stderr);
    }
    assert!(mock.requests().iter().all(|request| request.body.is_empty()));
    // Alone, each of them is taken.
    for alone in [switch, "thinking = \"off\"", "body = { include = [] }"] {
        let bench = bench(&table("m", &url, alone));
        assert_eq!(call(&bench, "").code, Some(0), "{alone}");
    }
}

#[test]
fn listing_shows_wire_of_models() {
    let mock = endpoint();
    let bench = bench(&table("m", &mock.base_url(), "wire = \"responses\""));
    assert_eq!(call(&bench, "").code, Some(0));
    let manifest: Value = serde_json::from_slice(&fs::read(bench.path("run/manifest.json")).unwrap()).unwrap();
    assert_eq!(manifest["settings"]["models"][0]["wire"], "responses");
}
