//! Files of models: many models, each with its own endpoint and settings, in one run.

use std::collections::BTreeMap;
use std::fs;
use std::time::Duration;

use serde_json::{Value, json};

use crate::support::endpoint::{Answer, MockEndpoint, Request};
use crate::support::house::House;
use crate::support::run::{Bench, Called, called, files, model_args, records, words};
use crate::support::snapshot::{each, redacted};

/// A folder with questions and this file of models.
fn bench(questions: usize, models: &str) -> Bench {
    let bench = Bench::with_questions(questions);
    bench.file("models.toml", models);
    bench
}

const RUN: &str = "--models models.toml --data set.jsonl --levels L0 --retries 0 --out run";

fn call(bench: &Bench, line: &str) -> Called {
    bench.call(&words(&format!("{RUN} {line}")))
}

fn complete(bench: &Bench, line: &str) {
    let called = call(bench, line);
    assert_eq!(called.code, Some(0), "{called:?}");
}

/// The error of a call that must be refused.
fn refusal(models: &str, line: &str) -> String {
    let bench = bench(1, models);
    let called = call(&bench, line);
    assert_eq!(called.code, Some(2), "{called:?}");
    assert!(!bench.path("run").exists());
    called.stderr
}

/// Keys of the records of a run by model and question.
fn keys(bench: &Bench, run: &str) -> BTreeMap<(String, String), String> {
    let text = |record: &Value, field: &str| record[field].as_str().unwrap().to_owned();
    let records = records(&bench.path(run));
    records
        .iter()
        .map(|record| {
            let place = (text(record, "model"), text(record, "question"));
            (place, text(record, "key"))
        })
        .collect()
}

#[test]
fn one_run_asks_several_endpoints() {
    let (one, two) = (MockEndpoint::start([Answer::text("A")]), MockEndpoint::start([Answer::text("C")]));
    let bench = bench(
        3,
        &format!(
            r#"
[defaults]
max-tokens = 64
[[model]]
name = "First"
id = "org/first"
endpoints = ["{}"]
body = {{ chat_template_kwargs = {{ enable_thinking = false }} }}
[[model]]
id = "second"
endpoints = ["{}"]
key-env = "SECOND_KEY"
headers = {{ X-Team = "a", X-Auth = {{ env = "GATEWAY" }} }}
omit = ["temperature"]
system = "Be brief."
[[model]]
name = "words"
id = "second"
endpoints = ["{}"]
view = "blind"
[[model]]
id = "random"
"#,
            one.base_url(),
            two.base_url(),
            two.base_url()
        ),
    );
    let mut command = bench.command(&words(RUN));
    command.env("SECOND_KEY", "second-key-0123456789").env("GATEWAY", "gateway-0123456789");
    command.env("OPENAI_API_KEY", "openai-key-0123456789").env("RUST_LOG", "trace");
    let run = called(&mut command);
    assert_eq!(run.code, Some(0), "{run:?}");
    let (first, second) = (one.requests(), two.requests());
    assert_eq!((first.len(), second.len()), (3, 6));
    let body = first[0].json();
    assert_eq!((&body["model"], &body["max_tokens"]), (&json!("org/first"), &json!(64)));
    assert_eq!(body["chat_template_kwargs"]["enable_thinking"], false);
    let seen: Vec<_> = second.iter().filter(|request| request.header("x-auth").is_some()).collect();
    assert_eq!(seen.len(), 3);
    for request in seen {
        let body = request.json();
        assert_eq!(request.header("authorization"), Some("Bearer second-key-0123456789"));
        assert_eq!(request.header("x-team"), Some("a"));
        assert!(body.get("temperature").is_none());
        assert_eq!(body["messages"][0]["content"], "Be brief.");
        // The image was made once for all.
        let image = &body["messages"][1]["content"][1];
        assert_eq!(*image, first[0].json()["messages"][0]["content"][1]);
    }
    let names: Vec<String> = keys(&bench, "run").into_keys().map(|(model, _)| model).collect();
    for name in ["First", "second", "words", "random"] {
        assert_eq!(names.iter().filter(|other| *other == name).count(), 3, "{name}");
    }
    let manifest: Value = serde_json::from_slice(&fs::read(bench.path("run/manifest.json")).unwrap()).unwrap();
    let models = manifest["settings"]["models"].as_array().unwrap();
    assert_eq!(models.len(), 4);
    assert_eq!(models[1]["key"], "the variable SECOND_KEY");
    assert_eq!(models[1]["headers"], json!(["X-Team", "X-Auth"]));
    insta::assert_snapshot!(run.lines_with("First"), @"
    exit code: 0
    First       0.0   0.0 +56.1
    ");
    for file in files(&bench.path("run")) {
        let text = String::from_utf8_lossy(&fs::read(&file).unwrap()).into_owned();
        assert!(!text.contains("-0123456789"), "{}", file.display());
    }
    assert!(!run.stderr.contains("-0123456789"));
}

/// The token limit that is sent, with these layers.
fn limit_sent(models: &str, line: &str, variable: Option<&str>) -> Value {
    let mock = MockEndpoint::start([Answer::text("A")]);
    let bench = bench(1, &models.replace("URL", &mock.base_url()));
    let mut command = bench.command(&words(&format!("{RUN} {line}")));
    if let Some(value) = variable {
        command.env("DARKQA_MAX_TOKENS", value);
    }
    let called = called(&mut command);
    assert_eq!(called.code, Some(0), "{called:?}");
    mock.requests()[0].json()["max_tokens"].clone()
}

#[test]
fn model_overrides_flags_override_defaults() {
    const BARE: &str = "[[model]]\nid = \"m\"\nendpoints = [\"URL\"]\n";
    let defaults = format!("[defaults]\nmax-tokens = 12\n{BARE}");
    let own = format!("{defaults}max_tokens = 14\n");
    assert_eq!(limit_sent(BARE, "", None), 1024);
    assert_eq!(limit_sent(BARE, "", Some("11")), 11);
    assert_eq!(limit_sent(&defaults, "", Some("11")), 12);
    assert_eq!(limit_sent(&defaults, "--max-tokens 13", Some("11")), 13);
    assert_eq!(limit_sent(&own, "--max-tokens 13", Some("11")), 14);
    assert_eq!(limit_sent(&own, "--max-tokens 13 --set m.max-tokens=15", None), 15);
}

#[test]
fn overridden_flag_is_reported_once() {
    let mock = MockEndpoint::start([Answer::text("A")]);
    let url = mock.base_url();
    let table = |id: &str| format!("[[model]]\nid = \"{id}\"\nendpoints = [\"{url}\"]\nmax-tokens = 14\n");
    let bench = bench(1, &(table("m") + &table("n")));
    let stderr = call(&bench, "--max-tokens 13").stderr;
    assert_eq!(stderr.matches("models with their own max-tokens").count(), 1, "{stderr}");
    assert!(!call(&bench, "").stderr.contains("of their own"));
}

#[test]
fn file_errors_name_their_line() {
    let table = |line: &str| format!("[[model]]\nid = \"m\"\nendpoints = [\"http://127.0.0.1:9/v1\"]\n{line}\n");
    let lines = [
        "max-token = 3",
        "base-url = \"a\"",
        "api_key = \"a\"",
        "model = \"a\"",
        "qqqq = 3",
        "rpm = \"many\"",
        "temperature = \"hot\"",
        "view = \"both eyes\"",
        "price = { input = 1 }",
        "limit = 0",
        "headers = { X-A = 3 }",
        "body = { temperature = 1 }",
        "max-side = 300",
        "name = \"\"",
        "key-env = \"NOWHERE_KEY\"",
    ];
    let errors = each(lines, |line| redacted(&refusal(&table(line), "")));
    insta::assert_snapshot!(errors, @r#"
    max-token = 3
      error: models.toml, line 4: there is no key max-token; did you mean max-tokens?
    base-url = "a"
      error: models.toml, line 4: there is no key base-url; did you mean endpoints?
    api_key = "a"
      error: models.toml, line 4: there is no key api-key; did you mean key-env?
    model = "a"
      error: models.toml, line 4: there is no key model; did you mean id?
    qqqq = 3
      error: models.toml, line 4: there is no key qqqq
    rpm = "many"
      error: models.toml, line 4: rpm: invalid value 'many' for '--rpm <N>': invalid digit found in string
    temperature = "hot"
      error: models.toml, line 4: temperature: invalid value 'hot' for '--temperature <T|auto|default>': a number
          from 0 on, auto or default expected
    view = "both eyes"
      error: models.toml, line 4: view: image, blind or both expected
    price = { input = 1 }
      error: models.toml, line 4: price: missing field `output`; { input = 2.5, output = 10 } expected, dollars per
          million tokens
    limit = 0
      error: models.toml, line 4: limit: a whole number from 1 on expected
    headers = { X-A = 3 }
      error: models.toml, line 4: headers: { NAME = "value", NAME = { env = "VARIABLE" } } expected
    body = { temperature = 1 }
      error: models.toml, line 2: m: --extra-body: temperature is set by the program: use --temperature
    max-side = 300
      error: models.toml, line 4: max-side applies to all models, because each image is made once: set it in
          [defaults], or use --max-side
    name = ""
      error: models.toml, line 4: name: a text expected
    key-env = "NOWHERE_KEY"
      error: models.toml, line 2: m: --api-key-env: the variable NOWHERE_KEY is not set
    "#);
    let error = refusal("[defaults]\nid = \"m\"\n[[model]]\nid = \"random\"", "");
    insta::assert_snapshot!(redacted(&error), @"error: models.toml, line 2: id belongs to one model: it cannot be in [defaults]");
    let error = refusal("[[model]]\nname = \"m\"", "");
    insta::assert_snapshot!(
        redacted(&error),
        @"error: models.toml, line 2: a model without id: what the endpoint calls it, or random, observer, script:FILE"
    );
    let secret = refusal(&table("key-env = \"sk-0123456789\""), "");
    assert!(secret.contains("line 4") && !secret.contains("0123"), "{secret}");
    let flags = ["--set n.rpm=3", "--set m.rpms=3", "--set m.id=n", "--only n"];
    let errors = each(flags, |flag| redacted(&refusal(&table(""), flag)));
    insta::assert_snapshot!(errors, @"
    --set n.rpm=3
      error: --set: n.rpm: no model of this name; the models are m
    --set m.rpms=3
      error: --set: there is no key rpms; did you mean rpm?
    --set m.id=n
      error: --set: id identifies the model, and cannot be set
    --only n
      error: --only: n: no model of this name; the models are m
    ");
}

#[test]
fn models_with_same_trials_are_refused() {
    let table = |name: &str, more: &str| {
        format!("[[model]]\nname = \"{name}\"\nid = \"m\"\nendpoints = [\"http://127.0.0.1:9/v1\"]\n{more}\n")
    };
    let error = refusal(&(table("a", "") + &table("b", "rpm = 3")), "");
    insta::assert_snapshot!(redacted(&error), @"
    error: --model: a and b differ in nothing that decides the reply: leave one of them out, with its flag or its
        view in a file of models; if they are two deployments, set deployment there
    ");
    let error = refusal(&(table("a", "") + &table("a", "temperature = 1")), "");
    insta::assert_snapshot!(redacted(&error), @"error: --model: a is named twice; in a file of models, give each its own name");
    let bench = bench(1, &(table("a", "") + &table("b", "deployment = \"fp8\"")));
    let called = call(&bench, "--dry-run");
    assert_eq!(called.code, Some(0), "{called:?}");
    for name in ["a", "b"] {
        assert!(called.stdout.lines().any(|line| line.trim_start().starts_with(name)), "{}", called.stdout);
    }
}

#[test]
fn flags_and_file_make_same_trials() {
    let mock = MockEndpoint::start([Answer::text("A")]);
    let url = mock.base_url();
    let bench = bench(2, &format!("[[model]]\nid = \"m\"\nendpoints = [\"{url}\"]\nmax-tokens = 9\nview = \"both\"\n"));
    complete(&bench, "");
    let asked = mock.requests().len();
    assert_eq!(asked, 4);
    // By flags, the same run; under another name, too, and only what is new is asked.
    let flags = "--blind-model m --data set.jsonl --levels L0 --max-tokens 9 --out run";
    bench.complete(&model_args(&url, flags));
    bench.file(
        "models.toml",
        format!("[[model]]\nname = \"Renamed\"\nid = \"m\"\nendpoints = [\"{url}\"]\nmax-tokens = 9\n"),
    );
    complete(&bench, "");
    assert_eq!(mock.requests().len(), asked);
    let summary = || fs::read_to_string(bench.path("run/summary.csv")).unwrap();
    assert!(summary().contains("Renamed,image") && !summary().contains("\nm,"), "{}", summary());
    // The name back, in a report alone, too.
    bench.complete(&model_args(&url, flags));
    bench.complete(&["report", "run"]);
    assert!(summary().contains("m,blind") && !summary().contains("Renamed"), "{}", summary());
    bench.file(
        "models.toml",
        format!("[[model]]\nname = \"New\"\nid = \"m\"\nendpoints = [\"{url}\"]\nmax-tokens = 8\n"),
    );
    complete(&bench, "");
    assert_eq!(mock.requests().len(), asked + 2);
}

#[test]
fn fatal_answer_stops_one_model_alone() {
    let refused = MockEndpoint::start([Answer::error(401, "invalid_api_key", "no such key")]);
    let good = MockEndpoint::start([Answer::text("A")]);
    let table = |id: &str, url: &str| format!("[[model]]\nid = \"{id}\"\nendpoints = [\"{url}\"]\n");
    let bench = bench(8, &(table("locked", &refused.base_url()) + &table("open", &good.base_url())));
    let run = call(&bench, "");
    assert_eq!(run.code, Some(1), "{run:?}");
    assert_eq!((refused.requests().len(), good.requests().len()), (1, 8));
    assert!(
        run.stdout
            .lines()
            .last()
            .is_some_and(|last| { last.starts_with("! not asked any further: ") && last.contains("locked: ") }),
        "{run:?}"
    );
    insta::assert_snapshot!(run.lines_with("open"), @"
    exit code: 1
    open · 8 questions · 1 frame · 8 replies, 0 failed · intervals by question
     open         L0   95 %
    ");
    let line = RUN.replace("--out run", "--out fast --fail-fast --concurrency 1");
    let fast = bench.call(&words(&line));
    assert_eq!(fast.code, Some(2), "{fast:?}");
    let refusals = refused.requests().len();
    assert_eq!(refusals, 2);
    // The same command asks it again, and nothing else.
    let answered = good.requests().len();
    assert_eq!(call(&bench, "").code, Some(1));
    assert_eq!((refused.requests().len(), good.requests().len()), (3, answered));
}

#[test]
fn models_and_questions_can_be_selected() {
    let mock = MockEndpoint::start([Answer::text("A")]);
    let url = mock.base_url();
    let table = |id: &str, more: &str| format!("[[model]]\nid = \"{id}\"\nendpoints = [\"{url}\"]\n{more}\n");
    let bench = bench(5, &(table("m-1.5", "limit = 2") + &table("m-1", "") + &table("left", "")));
    complete(&bench, "--only m-1.5,m-1 --set m-1.5.max-tokens=7");
    let sent = |model: &str| {
        mock.requests()
            .into_iter()
            .map(|request| request.json())
            .filter(|body| body["model"] == *model)
            .collect::<Vec<Value>>()
    };
    assert_eq!((sent("m-1.5").len(), sent("m-1").len(), sent("left").len()), (2, 5, 0));
    assert_eq!(sent("m-1.5")[0]["max_tokens"], 7);
    assert_eq!(sent("m-1")[0]["max_tokens"], 1024);
}

#[test]
fn slow_model_does_not_delay_others() {
    let slow = MockEndpoint::answering(|_| {
        std::thread::sleep(Duration::from_millis(120));
        Answer::text("A")
    });
    let fast = MockEndpoint::answering(|_| {
        std::thread::sleep(Duration::from_millis(5));
        Answer::text("A")
    });
    let table =
        |id: &str, url: &str| format!("[[model]]\nid = \"{id}\"\nendpoints = [\"{url}\"]\nconcurrency = \"1\"\n");
    let bench = bench(12, &(table("slow", &slow.base_url()) + &table("fast", &fast.base_url())));
    complete(&bench, "");
    let records = records(&bench.path("run"));
    let last = |model: &str| records.iter().rposition(|record| record["model"] == model).unwrap();
    assert!(last("fast") < last("slow"), "{} {}", last("fast"), last("slow"));
    assert!(last("fast") <= 15, "fast ended as number {} of 24", last("fast"));
}

#[test]
fn model_price_decides_its_cost() {
    let table = "[[model]]\nid = \"unpriced\"\nendpoints = [\"http://127.0.0.1:9/v1\"]\n";
    let error = call(&bench(1, table), "--max-cost 5").stderr;
    insta::assert_snapshot!(redacted(&error), @"
    error: --max-cost: the price of unpriced is not in the table of [DATE]; add it to your own table and name that
        with --prices FILE, or set price in a file of models
    ");
    let bench = bench(1, &format!("{table}price = {{ input = 1000000, output = 0, image-tokens = 100 }}\n"));
    let called = call(&bench, "--max-cost 500000000 --dry-run --json");
    let forecast: Value = serde_json::from_str(&called.stdout).unwrap();
    let dollars = forecast.to_string();
    assert!(dollars.contains("unpriced"), "{dollars}");

    let called = call(&bench, "--max-cost 5 --concurrency 1");
    assert_eq!(called.code, Some(3), "{called:?}");
    // The report knows the price, too: 90 tokens of a prompt at a dollar each.
    let mock = MockEndpoint::start([Answer::text("A")]);
    let priced = format!(
        "[[model]]\nname = \"A name\"\nid = \"m\"\nendpoints = [\"{}\"]\nprice = {{ input = 1000000, output = 0 }}\n",
        mock.base_url()
    );
    let bench = self::bench(1, &priced);
    complete(&bench, "");
    let page = fs::read_to_string(bench.path("run/report.html")).unwrap();
    assert!(page.contains("$90"), "the cost is on the page");
}

#[test]
fn models_command_shows_resolved_settings() {
    let mock = MockEndpoint::start([Answer::text("B"), Answer::text("A"), Answer::error(401, "x", "no")]);
    let url = mock.base_url();
    let bench = bench(
        1,
        &format!(
            "[[model]]\nname = \"A\"\nid = \"a\"\nview = \"both\"\nendpoints = [\"{url}\"]\nkey-env = \"A_KEY\"\nbody = {{ top_k = 1 }}\n[[model]]\nid = \"b\"\nendpoints = [\"{url}\"]\n[[model]]\nid = \"random\"\n"
        ),
    );
    let shown = bench.complete(&["models", "models.toml"]);
    for part in ["A (image)", "id        a", &url, "none: A_KEY is not set", "\"top_k\":1", "digest", "random"] {
        assert!(shown.contains(part), "{part}: {shown}");
    }
    assert!(mock.requests().is_empty());
    let mut command = bench.command(&["models", "models.toml", "--check", "--quiet"]);
    let checked = called(command.env("A_KEY", "secret-0123456789"));
    for part in ["A: \"B\" about a red image, of which B is true, in ", "A: \"A\" without an image", "b: FAILED"] {
        assert!(checked.stdout.contains(part), "{part}: {checked:?}");
    }
    assert!(!checked.stdout.contains("secret-0123"));
    let bodies = mock.requests();
    let images = bodies.iter().map(|request| {
        let body = request.json().to_string();
        body.matches("data:image/png").count()
    });
    assert_eq!(images.collect::<Vec<_>>(), [1, 0, 1]);
}

#[test]
fn open_questions_take_file_of_models() {
    let house = House::new();
    let mock = MockEndpoint::start([Answer::text("A table.")]);
    let url = mock.base_url();
    house.0.file("models.toml", format!(
        "[defaults]\nmax-tokens = 50\n[[model]]\nname = \"One\"\nid = \"m\"\nendpoints = [\"{url}\"]\nlimit = 1\n[[model]]\nid = \"n\"\nendpoints = [\"{url}\"]\nseed = 7\n"
    ));
    let line = "openeqa --questions questions.json --frames walks --num-frames 2 --image-size 32 --levels L0 --models models.toml --out run";
    house.0.complete(&words(line));
    let bodies: Vec<Value> = mock.requests().iter().map(Request::json).collect();
    let of = |model: &str| bodies.iter().filter(|body| body["model"] == *model).cloned().collect::<Vec<_>>();
    assert_eq!((of("m").len(), of("n").len()), (1, 3));
    assert_eq!((&of("m")[0]["seed"], &of("n")[0]["seed"]), (&json!(1234), &json!(7)));
    assert_eq!(of("m")[0]["max_tokens"], 50);
    let house_models = "[[model]]\nid = \"random\"\n";
    house.0.file("models.toml", house_models);
    let called = house.0.call(&words(line));
    insta::assert_snapshot!(called.messages(), @"
    exit code: 2
    error: --model: a model that can answer open questions expected
    ");
}

#[test]
fn headers_enter_the_trial_key() {
    let mock = MockEndpoint::start([Answer::text("A")]);
    let url = mock.base_url();
    let table = |name: &str, header: &str, more: &str| {
        format!(
            "[[model]]\nname = \"{name}\"\nid = \"m\"\nendpoints = [\"{url}\"]\nheaders = {{ X-Beta = \"{header}\" }}\n{more}\n"
        )
    };
    let decides = "reply-headers = [\"x-beta\"]";
    let bench = bench(1, &(table("one", "1", decides) + &table("two", "2", decides) + &table("none", "3", "")));
    complete(&bench, "");
    let keys: std::collections::BTreeSet<String> = keys(&bench, "run").into_values().collect();
    assert_eq!((keys.len(), mock.requests().len()), (3, 3));
    let error = refusal(&(table("one", "1", "") + &table("two", "2", "")), "");
    insta::assert_snapshot!(redacted(&error), @"
    error: --model: one and two differ in nothing that decides the reply: leave one of them out, with its flag or
        its view in a file of models; if they are two deployments, set deployment there
    ");
    let error = refusal(&table("one", "1", "reply-headers = [\"x-other\"]"), "");
    insta::assert_snapshot!(redacted(&error), @"
    error: models.toml, line 3: one: reply-headers: x-other: no header of this name with a value in headers: only
        such a one can decide replies
    ");
}

#[test]
fn vendor_notes_come_before_requests() {
    let table =
        |id: &str, url: &str, more: &str| format!("[[model]]\nid = \"{id}\"\nendpoints = [\"{url}\"]\n{more}\n");
    let anthropic = table("claude-opus-5", "https://api.anthropic.com/v1", "constrain = \"json\"");
    let error = refusal(&anthropic, "--dry-run");
    insta::assert_snapshot!(
        redacted(&error),
        @"error: --request constrain: Anthropic takes a constraint and ignores it, so it would be none; leave it out"
    );
    for (base, name) in [
        ("https://api.anthropic.com/v1", "Anthropic takes the request"),
        ("https://generativelanguage.googleapis.com/v1beta/openai", "Gemini states no"),
        ("https://api.mistral.ai/v1", "Mistral states no"),
        ("https://api.groq.com/openai/v1", "Groq states no"),
    ] {
        let error = refusal(&table("m", base, "probabilities = true"), "--dry-run");
        assert!(error.contains(&format!("--request probabilities: {name}")), "{error}");
    }
    let some = table("m", "https://api.openai.com/v1", "probabilities = true");
    let called = call(&bench(1, &some), "--dry-run");
    assert_eq!(called.code, Some(0), "{called:?}");
    let mixed = table("q/m", "https://openrouter.ai/api/v1", "");
    let pinned = table("q/n", "https://openrouter.ai/api/v1", "body = { provider = { order = [\"a\"] } }");
    let called = call(&bench(1, &(mixed + &pinned)), "--dry-run");
    assert_eq!(called.code, Some(0), "{called:?}");
    assert!(called.stderr.contains("q/m: OpenRouter may answer") && !called.stderr.contains("q/n"), "{called:?}");
}

#[test]
fn misspelled_built_in_model_is_refused() {
    let bench = Bench::with_questions(1);
    let called = bench.call(&words("--model rndom --data set.jsonl --out run"));
    assert_eq!(called.code, Some(2));
    insta::assert_snapshot!(called.messages(), @"
    exit code: 2
    error: --model: rndom: did you mean random? To ask an endpoint for a model of this name: --models FILE, or
        --base-url
    ");
    let mock = MockEndpoint::start([Answer::text("A")]);
    let url = mock.base_url();
    bench.complete(&["--model", "rndom", "--base-url", &url, "--data", "set.jsonl", "--levels", "L0", "--out", "run"]);
    assert_eq!(mock.requests()[0].json()["model"], "rndom");
}
