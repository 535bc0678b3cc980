//! What users add to requests: keys by address, headers, fields of the body, words of a system message.

use std::fs;

use serde_json::{Value, json};

use crate::support::endpoint::{Answer, MockEndpoint, Request};
use crate::support::run::{Bench, Called, called, files, model_args, records, words};
use crate::support::snapshot::redacted;

const SECRET: &str = "gateway-0123456789abcdef";

/// A run of one question without an image at this endpoint, with these variables.
fn run(bench: &Bench, url: &str, line: &[&str], variables: &[(&str, &str)]) -> Called {
    let fixed = "--data set.jsonl --limit 1 --blind --retries 0 --out";
    let args = [&model_args(url, fixed)[..], line].concat();
    let mut command = bench.command(&args);
    for (name, value) in variables {
        command.env(name, value);
    }
    called(&mut command)
}

/// The request of such a run, which must end well.
fn request(line: &[&str], variables: &[(&str, &str)]) -> (Bench, Request) {
    let bench = Bench::with_questions(1);
    let mock = MockEndpoint::start([Answer::text("A")]);
    let args = [&["run"], line].concat();
    let called = run(&bench, &mock.base_url(), &args, variables);
    assert_eq!(called.code, Some(0), "{called:?}");
    let request = mock.requests().remove(0);
    (bench, request)
}

/// The error of a call that must be refused.
fn refusal(url: &str, line: &[&str], variables: &[(&str, &str)]) -> String {
    let bench = Bench::with_questions(1);
    let called = run(&bench, url, &[&["run"], line].concat(), variables);
    assert_eq!(called.code, Some(2), "{called:?}");
    assert!(!bench.path("run").exists());
    called.stderr
}

#[test]
fn key_goes_only_to_vendor() {
    const ANTHROPIC: &str = "https://api.anthropic.com/v1";
    let openai = [("OPENAI_API_KEY", "sk-openai-0123456789")];
    let error = refusal(ANTHROPIC, &[], &openai);
    insta::assert_snapshot!(redacted(&error), @"
    error: ANTHROPIC_API_KEY: no key for https://api.anthropic.com/v1: set this variable (OPENAI_API_KEY is set,
        and is not sent to another vendor unless --api-key-env names it), or name another with --api-key-env NAME
        or a file with --api-key-file FILE; name your own server with --base-url URL; --api-key-env none sends no
        key
    ");
    let gemini = "https://generativelanguage.googleapis.com/v1beta/openai";
    let error = refusal(gemini, &[], &[]);
    insta::assert_snapshot!(redacted(&error), @"
    error: GEMINI_API_KEY, GOOGLE_API_KEY: no key for https://generativelanguage.googleapis.com/v1beta/openai: set
        one of these variables, or name another with --api-key-env NAME or a file with --api-key-file FILE; name
        your own server with --base-url URL; --api-key-env none sends no key
    ");
    assert!(!error.contains("is set, and"), "{error}");
    // A server that is not in the table may want any key, as ever.
    let (_, request) = request(&[], &openai);
    assert_eq!(request.header("authorization"), Some("Bearer sk-openai-0123456789"));
}

#[test]
fn key_given_as_name_is_hidden() {
    for key in ["sk-proj-0123", "AIzaSyAbc", "gsk_abcdef", "0123456789abcdef0123"] {
        let error = refusal("https://h.example/v1", &["--api-key-env", key], &[]);
        assert!(error.contains("--api-key-env: the name of a variable"), "{error}");
        assert!(!error.contains(key), "{error}");
    }
    let error = refusal("https://h.example/v1", &["--api-key-env", "MY_KEY"], &[]);
    insta::assert_snapshot!(redacted(&error), @"error: --api-key-env: the variable MY_KEY is not set");
}

#[test]
fn headers_are_sent_and_secrets_hidden() {
    let bench = Bench::with_questions(1);
    let echo = Answer::error(400, "bad", &format!("{SECRET} may not do that"));
    let mock = MockEndpoint::start([echo, Answer::text(&format!("A {SECRET}"))]);
    let line = ["run", "--header", "X-Team: vision", "--header-env", "X-Auth=GATEWAY"];
    let variables = [("GATEWAY", SECRET), ("RUST_LOG", "trace")];
    for code in [1, 0] {
        let called = run(&bench, &mock.base_url(), &line, &variables);
        assert_eq!(called.code, Some(code), "{called:?}");
        assert!(!called.stderr.contains(SECRET) && !called.stdout.contains(SECRET));
    }
    for request in mock.requests() {
        assert_eq!(request.header("x-team"), Some("vision"));
        assert_eq!(request.header("x-auth"), Some(SECRET));
    }
    for file in files(&bench.path("run")) {
        let content = fs::read(&file).unwrap();
        let text = String::from_utf8_lossy(&content);
        assert!(!text.contains(SECRET), "{}", file.display());
    }
    assert!(records(&bench.path("run"))[1]["reply"] == "A [secret]");
}

#[test]
fn secret_header_needs_https() {
    let variables = [("GATEWAY", SECRET), ("OPENAI_API_KEY", "sk-0123456789")];
    let url = "http://h.example/v1";
    let error = refusal(url, &["--header-env", "X-Auth=GATEWAY"], &variables[..1]);
    insta::assert_snapshot!(redacted(&error), @"
    error: --base-url: the key would be sent unencrypted to http://h.example/v1; use https://, or --allow http on
        a network that you trust
    ");
    let twice = ["--header-env", "Authorization=GATEWAY"];
    let error = refusal("http://127.0.0.1:9/v1", &twice, &variables);
    insta::assert_snapshot!(redacted(&error), @"
    error: --header: authorization is sent already, with the key or the account: leave it out of --header and
        --header-env, or the key with --api-key-env none
    ");
    let error = refusal("http://127.0.0.1:9/v1", &["--header-env", "X-A=NOWHERE"], &[]);
    insta::assert_snapshot!(redacted(&error), @"error: --header-env: the variable NOWHERE is not set");
}

#[test]
fn extra_body_merges_and_drops_fields() {
    let body = r#"{"chat_template_kwargs": {"enable_thinking": false}, "stop": ["\"url\":\"\""], "max": {"a": {}}}"#;
    let line = ["--extra-body", body, "--omit-field", "temperature", "--system", "Answer briefly."];
    let (bench, request) = request(&line, &[]);
    let mut sent = request.json();
    let question = sent["messages"][1]["content"].take();
    insta::assert_snapshot!(redacted(question.as_str().unwrap()), @"
    What color is it, 0?
    A. red
    B. blue
    C. brown
    The image is not shown: where the question cannot be answered without it, choose the most plausible option.
    Answer with the option's letter from the given choices directly.
    ");
    let expected = json!({
        "model": "m", "max_tokens": 1024, "max": {"a": {}},
        "chat_template_kwargs": {"enable_thinking": false}, "stop": ["\"url\":\"\""],
        "messages": [{"role": "system", "content": "Answer briefly."}, {"role": "user", "content": null}],
    });
    assert_eq!(sent, expected);
    let manifest: Value = serde_json::from_slice(&fs::read(bench.path("run/manifest.json")).unwrap()).unwrap();
    let model = &manifest["columns"]["model"]["m"];
    assert_eq!(model["--system"], "Answer briefly.");
    assert_eq!(model["--omit-field"], json!(["temperature"]));
    // From a file, and with an image, whose place is found behind whatever the fields hold.
    bench.file("body.json", body);
    let mock = MockEndpoint::start([Answer::text("A")]);
    let url = mock.base_url();
    let flags = "--data set.jsonl --limit 1 --levels L0 --extra-body @body.json --out seen";
    bench.complete(&model_args(&url, flags));
    let mut sent = mock.requests()[0].json();
    let image = sent["messages"][0]["content"][1]["image_url"]["url"].take();
    assert!(image.as_str().unwrap().starts_with("data:image/png;base64,"));
    assert_eq!(sent["stop"], json!(["\"url\":\"\""]));
}

#[test]
fn program_fields_are_refused_by_name() {
    let url = "http://127.0.0.1:9/v1";
    let error = refusal(url, &["--extra-body", r#"{"temperature": 1}"#], &[]);
    insta::assert_snapshot!(redacted(&error), @"error: --extra-body: temperature is set by the program: use --temperature");
    let error = refusal(url, &["--extra-body", r#"{"response_format": {}}"#, "--constrain", "json"], &[]);
    insta::assert_snapshot!(
        redacted(&error),
        @"error: --extra-body: response_format is set by --request constrain; leave one of them out"
    );
}

/// Bodies are written to the manifest and to files of batches.
#[test]
fn secret_in_body_is_refused() {
    let bench = Bench::with_questions(1);
    let mock = MockEndpoint::start([Answer::text("C")]);
    let body = format!("{{\"litellm\": {{\"api_key\": \"{SECRET}\"}}}}");
    bench.file("body.json", &body);
    let table = format!("[[model]]\nid = \"m\"\nendpoints = [\"{}\"]\nbody = \"@body.json\"\n", mock.base_url());
    bench.file("models.toml", table);
    let url = mock.base_url();
    let flags = ["--model", "m", "--base-url", &url, "--extra-body"];
    for words in
        [[&flags[..], &[&*body]].concat(), [&flags[..], &["@body.json"]].concat(), vec!["--models", "models.toml"]]
    {
        let line = ["--data", "set.jsonl", "--levels", "L0", "--out", "run"];
        let refused = bench.call(&[&line[..], &words].concat());
        assert_eq!(refused.code, Some(2), "{refused:?}");
        let part = "api_key looks like a secret";
        assert!(refused.stderr.contains(part), "{}", refused.stderr);
        assert!(!refused.stderr.contains(SECRET), "{}", refused.stderr);
        assert!(!bench.path("run").exists(), "{words:?}");
    }
    assert_eq!(mock.requests().len(), 0);
}

#[test]
fn refused_field_of_user_is_named() {
    let bench = Bench::with_questions(1);
    let refused = json!({"error": {"message": "unknown parameter", "param": "top_k", "code": "unknown_parameter"}});
    let mock = MockEndpoint::start([Answer::json(400, &refused)]);
    let line = ["run", "--extra-body", r#"{"top_k": 1}"#];
    let called = run(&bench, &mock.base_url(), &line, &[]);
    insta::assert_snapshot!(called.messages(), @"
    exit code: 2
    error: http://127.0.0.1:[PORT]/v1: m: http://127.0.0.1:[PORT]/v1 answered 400: unknown parameter (leave this
        field out of --extra-body, or give a value that the server takes) (replies so far are stored; the same
        command continues)
    ");
    assert_eq!(mock.requests().len(), 1);
}

/// Keys of trials of the version before the fields of the user: where none of them is set, they are the same.
#[test]
fn trial_keys_ignore_absent_fields() {
    let key = |line: &str| {
        let (bench, _) = request(&words(line), &[]);
        records(&bench.path("run"))[0]["key"].as_str().unwrap().to_owned()
    };
    let plain = key("");
    assert_eq!(plain, PLAIN_KEY);
    assert_eq!(key("--header X-Team:vision --header-env X-A=PATH"), plain);
    let mut keys = vec![plain];
    for line in ["--system Look!", "--extra-body {\"a\":null}", "--omit-field seed"] {
        keys.push(key(line));
    }
    keys.sort();
    keys.dedup();
    assert_eq!(keys.len(), 4);
}

const PLAIN_KEY: &str = "925308aaa6dac64b2b07f5933d05d91a";
