//! What a file of models that came with data may not do, tables of vendors of the user's own, and settings of the run
//! in `[defaults]`.

use std::fs;

use serde_json::Value;

use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::house::House;
use crate::support::run::{Bench, Called, called, records, words};
use crate::support::snapshot::each;

fn table(id: &str, url: &str, more: &str) -> String {
    format!("[[model]]\nid = \"{id}\"\nendpoints = [\"{url}\"]\n{more}\n")
}

/// A set of questions in a folder `data`, with a file of models in it, called from outside.
fn strange(models: &str, line: &str, variables: &[(&str, &str)]) -> Called {
    let bench = Bench::with_questions(1);
    for name in ["set.jsonl", "a.png"] {
        let content = fs::read(bench.path(name)).unwrap();
        bench.file(&format!("data/{name}"), content);
    }
    bench.file("data/models.toml", models);
    bench.file("data/inside.txt", "Be brief.");
    bench.file("outside.txt", "private");
    fs::create_dir_all(bench.path("work")).unwrap();
    let line = format!("--data ../data/set.jsonl --models ../data/models.toml --levels L0 --dry-run --out run {line}");
    let mut command = bench.command(&words(&line));
    command.current_dir(bench.path("work"));
    for (name, value) in variables {
        command.env(name, value);
    }
    called(&mut command)
}

#[test]
fn supplied_file_gets_no_foreign_key() {
    const ELSEWHERE: &str = "https://evil.example/v1";
    const OPENAI: &str = "https://api.openai.com/v1";
    let key = [("OPENAI_API_KEY", "sk-0123456789")];
    let header = "headers = { X-A = { env = \"GATEWAY\" } }";
    let cases = [
        (
            ELSEWHERE,
            "key-env = \"OPENAI_API_KEY\"",
            "line 3: key-env: OPENAI_API_KEY is not a variable of evil.example's own tools",
        ),
        (OPENAI, "key-env = \"AWS_SECRET\"", "line 3: key-env: AWS_SECRET is not a variable of api.openai.com's"),
        (ELSEWHERE, header, "line 3: headers: GATEWAY is not a variable"),
        (ELSEWHERE, "", "line 2: endpoints: OPENAI_API_KEY would be sent to evil.example"),
        (OPENAI, "key-file = \"../outside.txt\"", "line 3: key-file: ../outside.txt is outside its folder"),
        (OPENAI, "system-file = \"../outside.txt\"", "line 3: system-file: ../outside.txt is outside"),
        (OPENAI, "body = \"@../outside.txt\"", "line 3: body: ../outside.txt is outside"),
        (OPENAI, "vendor = \"../data/inside.txt\"", "line 3: vendor: such a table decides"),
    ];
    for (url, more, part) in cases {
        // The lines of the file are those of the table, which begins with its head.
        let part = part.replace("line 3", "line 4").replace("line 2", "line 3");
        let refused = strange(&table("m", url, more), "", &key);
        assert_eq!(refused.code, Some(2), "{more}: {refused:?}");
        assert!(refused.stderr.contains(&part), "{more}: {}", refused.stderr);
        assert!(refused.stderr.contains("--allow models-file states that you trust it"), "{refused:?}");
    }
    let taken = [
        (ELSEWHERE, "key-env = \"none\"", ""),
        (OPENAI, "", ""),
        (OPENAI, "key-env = \"OPENAI_API_KEY\"", ""),
        (OPENAI, "system-file = \"../data/inside.txt\"", ""),
        ("http://127.0.0.1:9/v1", "", ""),
        (ELSEWHERE, "key-env = \"OPENAI_API_KEY\"", "--allow models-file"),
        (OPENAI, "system-file = \"../outside.txt\"", "--allow models-file"),
    ];
    for (url, more, line) in taken {
        let called = strange(&table("m", url, more), line, &key);
        assert_eq!(called.code, Some(0), "{more}: {called:?}");
    }
    // What [defaults] names is refused in the same way, and a variable that is not set cannot be sent.
    let defaults = format!("[defaults]\nkey-env = \"AWS_SECRET\"\n{}", table("m", OPENAI, ""));
    let refused = strange(&defaults, "", &key);
    insta::assert_snapshot!(refused.messages(), @"
    exit code: 2
    error: ../data/models.toml, line 2: key-env: AWS_SECRET is not a variable of api.openai.com's own tools, and
        the file may have come with the data from someone else; --allow models-file states that you trust it
    ");
    assert_eq!(strange(&table("m", ELSEWHERE, ""), "", &[]).code, Some(0));
}

#[test]
fn inherited_defaults_check_model_address() {
    let evil = "https://evil.example/v1";
    let variables = [("OPENAI_API_KEY", "sk-0123456789"), ("AWS_SECRET_ACCESS_KEY", "aws-0123456789")];
    let secret = "headers = { X-A = { env = \"AWS_SECRET_ACCESS_KEY\" } }";
    let none = "key-env = \"none\"";
    let cases = [
        // The header of [defaults] is another one than that of the table.
        (
            format!("{secret}\n{none}"),
            String::new(),
            "",
            "line 2: headers: AWS_SECRET_ACCESS_KEY is not a variable of evil.example's own tools",
        ),
        // A key of a flag is not sent to the address of a table, which leaves the default.
        (none.to_owned(), String::new(), "--api-key-env AWS_SECRET_ACCESS_KEY", ""),
        // A flag names a secret for an address, and the table names another address.
        (
            none.to_owned(),
            String::new(),
            "--header-env X-A=AWS_SECRET_ACCESS_KEY",
            "line 5: endpoints: AWS_SECRET_ACCESS_KEY would be sent to evil.example",
        ),
        (none.to_owned(), "allow-http = true".to_owned(), "", "line 6: allow-http: "),
        (none.to_owned(), "ca-file = \"../data/inside.txt\"".to_owned(), "", "line 6: ca-file: "),
        // Neither goes there.
        (none.to_owned(), String::new(), "", ""),
        (format!("{secret}\n{none}"), "headers = { X-B = \"b\" }".to_owned(), "", ""),
        (format!("{secret}\n{none}"), "headers = {}".to_owned(), "", ""),
    ];
    for (defaults, more, line, part) in cases {
        let file = format!("[defaults]\n{defaults}\n{}", table("m", evil, &more));
        let called = strange(&file, line, &variables);
        let code = if part.is_empty() { 0 } else { 2 };
        assert_eq!(called.code, Some(code), "{file} {line}: {called:?}");
        assert!(called.stderr.contains(part), "{}", called.stderr);
    }
}

/// The request sent with `defaults` and the keys `more` of one table for a mock server.
fn sent(defaults: &str, more: &str, line: &str) -> crate::support::endpoint::Request {
    let mock = MockEndpoint::start([Answer::text("C")]);
    let bench = Bench::with_questions(1);
    let table = table("m", &mock.base_url(), more);
    bench.file("models.toml", format!("[defaults]\n{defaults}\n{table}"));
    let line = format!("--models models.toml --data set.jsonl --levels L0 --out run {line}");
    let mut command = bench.command(&words(&line));
    command
        .env("OPENAI_API_KEY", "sk-openai-0123")
        .env("GATEWAY_KEY", "gateway-0123456789")
        .env("FLAG_KEY", "flag-0123456789")
        .env("AWS_SECRET_ACCESS_KEY", "aws-0123456789");
    let called = called(&mut command);
    assert_eq!(called.code, Some(0), "{called:?}");
    mock.requests().remove(0)
}

#[test]
fn default_key_goes_everywhere() {
    let gateway = "key-env = \"GATEWAY_KEY\"";
    let secret = "headers = { X-A = { env = \"AWS_SECRET_ACCESS_KEY\" } }";
    let bearer = |key: &str| Some(format!("Bearer {key}"));
    for (defaults, more, line, key) in [
        (gateway, "", "", bearer("gateway-0123456789")),
        // The key of a flag belongs to the address of the flags.
        (gateway, "", "--api-key-env FLAG_KEY", bearer("gateway-0123456789")),
        ("", "", "--api-key-env FLAG_KEY", bearer("sk-openai-0123")),
        ("key-env = \"none\"", "", "", None),
        ("key-env = \"none\"", gateway, "", bearer("gateway-0123456789")),
    ] {
        let request = sent(defaults, more, line);
        let found = request.header("authorization");
        assert_eq!(found, key.as_deref(), "{defaults} {more} {line}");
    }
    let request = sent(secret, "", "");
    assert_eq!(request.header("x-a"), Some("aws-0123456789"));
    // A table of headers replaces the other one whole.
    for headers in ["{ X-B = \"b\" }", "{ X-B = { env = \"GATEWAY_KEY\" } }", "{}"] {
        let request = sent(secret, &format!("headers = {headers}"), "");
        assert_eq!(request.header("x-a"), None, "{headers}");
        assert_eq!(request.header("x-b").is_some(), headers != "{}");
    }
}

#[test]
fn foreign_file_is_checked_without_key() {
    let mock = MockEndpoint::start([Answer::text("OK")]);
    let bench = Bench::new();
    let key = "key-env = \"AWS_SECRET_ACCESS_KEY\"";
    bench.file("data/models.toml", table("m", &mock.base_url(), key));
    fs::create_dir_all(bench.path("work")).unwrap();
    let call = |folder: &str, line: &str| {
        let mut command = bench.command(&words(&format!("models {line}")));
        command.env("AWS_SECRET_ACCESS_KEY", "aws-0123456789").current_dir(bench.path(folder));
        called(&mut command)
    };
    for (folder, file) in [(".", "data/models.toml"), ("work", "../data/models.toml")] {
        let refused = call(folder, &format!("{file} --check"));
        assert_eq!(refused.code, Some(2), "{refused:?}");
        let part = "line 4: key-env: AWS_SECRET_ACCESS_KEY is not a variable of 127.0.0.1's own tools";
        assert!(refused.stderr.contains(part), "{}", refused.stderr);
        // Nothing is sent without --check.
        assert_eq!(call(folder, file).code, Some(0));
    }
    assert_eq!(mock.requests().len(), 0);
    for (folder, line) in [("data", "models.toml --check"), (".", "data/models.toml --check --trust-models")] {
        let called = call(folder, line);
        assert_eq!(called.code, Some(0), "{called:?}");
    }
    assert_eq!(mock.requests().len(), 2);
}

#[test]
fn vendor_table_defines_host_requests() {
    let mock = MockEndpoint::start([Answer::text("C")]);
    let bench = Bench::with_questions(1);
    let row = "[[vendor]]\nname = \"Mine\"\nhosts = [\"127.0.0.1\"]\nkey = [\"MY_KEY\"]\nheader = \"api-key\"\ntoken-field = \"max_completion_tokens\"\n";
    bench.file("vendors.toml", row);
    let url = mock.base_url();
    let line = format!("--model m --base-url {url} --data set.jsonl --levels L0 --out run --vendor vendors.toml");
    let mut command = bench.command(&words(&line));
    command.env("MY_KEY", "secret-0123456789").env("OPENAI_API_KEY", "sk-other-0123");
    let run = called(&mut command);
    assert_eq!(run.code, Some(0), "{run:?}");
    let request = mock.requests().remove(0);
    assert_eq!(request.header("api-key"), Some("secret-0123456789"));
    assert_eq!(request.header("authorization"), None);
    assert_eq!(request.json()["max_completion_tokens"], 1024);
    // It decides no reply: without it nothing is asked again.
    let line = line.replace(" --vendor vendors.toml", "");
    bench.complete(&words(&line));
    assert_eq!(mock.requests().len(), 1);
    // Of one model in a file; what it knows is said before anything is sent.
    let ignoring = format!("{row}constrain = \"ignored\"\nimage-bytes = 10\n");
    bench.file("ignoring.toml", ignoring);
    let vendor = "vendor = \"ignoring.toml\"";
    for (more, part) in
        [("constrain = \"json\"", "Mine takes a constraint and ignores it"), ("", "more than the 0.00001 MB of Mine")]
    {
        bench.file("models.toml", table("m", &url, &format!("{vendor}\n{more}")));
        let refused = bench.call(&words("--models models.toml --data set.jsonl --levels L0 --out other"));
        assert_eq!(refused.code, Some(2), "{refused:?}");
        assert!(refused.stderr.contains(part), "{}", refused.stderr);
    }
    assert_eq!(mock.requests().len(), 1);
    bench.file("vendors.toml", row.replace("header", "headr"));
    let line = format!("{line} --vendor vendors.toml");
    let refused = bench.call(&words(&line));
    insta::assert_snapshot!(refused.messages(), @"
    exit code: 2
    error: --vendor: vendors.toml: line 5: unknown field `headr`, expected one of `name`, `hosts`, `key`,
        `key-form`, `header`, `token-field`, `thinks-beyond-limit`, `image-bytes`, `image-side`, `images`,
        `image-side-many`, `request-bytes`, `logprobs`, `batch`, `constrain`, `pin`, `account`, `addresses`; did
        you mean header?; expected tables [[vendor]] with name, hosts and key, as in src/ask/vendors.toml
    ");
}

#[test]
fn defaults_may_hold_run_settings() {
    let mock = MockEndpoint::start([Answer::text("C")]);
    let url = mock.base_url();
    let bench = Bench::with_questions(1);
    let image = |run: &str| records(&bench.path(run))[0]["image"].clone();
    let models = |defaults: &str| format!("[defaults]\n{defaults}\n{}", table("m", &url, ""));
    let line = "--models models.toml --data set.jsonl --levels L0 --out";
    let run = |out: &str, more: &str, variables: &[(&str, &str)]| {
        let line = format!("{line} {out} {more}");
        let mut command = bench.command(&words(&line));
        for (name, value) in variables {
            command.env(name, value);
        }
        let called = called(&mut command);
        assert_eq!(called.code, Some(0), "{called:?}");
    };
    bench.file("models.toml", models("image = \"jpeg:90\"\nmax_side = 32\nimage-first = true"));
    run("file", "", &[("DARKQA_MAX_SIDE", "16")]);
    let sent = image("file");
    assert_eq!((&sent["format"], &sent["width"]), (&"jpeg".into(), &32.into()), "{sent}");
    let content = mock.requests()[0].json()["messages"][0]["content"].clone();
    assert_eq!(content[0]["type"], "image_url");
    // The manifest has them, so that the images can be made again.
    let manifest: Value = serde_json::from_slice(&fs::read(bench.path("file/manifest.json")).unwrap()).unwrap();
    assert_eq!((&manifest["images"]["image"], &manifest["images"]["max-side"]), (&"jpeg:90".into(), &"32".into()));
    // A flag is above them, and they are above a variable.
    run("flag", "--max-side 24 --image png", &[]);
    let sent = image("flag");
    assert_eq!((&sent["format"], &sent["width"]), (&"png".into(), &24.into()), "{sent}");
    bench.file("models.toml", models("max-tokens = 9"));
    run("variable", "", &[("DARKQA_MAX_SIDE", "16")]);
    assert_eq!(image("variable")["width"], 16);
    let lines = [("max-side = \"wide\"", ""), ("max-side = [3]", ""), ("", "max-side = 3"), ("", "image = \"png\"")];
    let errors = lines.map(|(defaults, more)| {
        bench.file("models.toml", models(defaults) + more);
        bench.call(&words(&format!("{line} wrong"))).messages()
    });
    insta::assert_snapshot!(errors.join("\n"), @"
    exit code: 2
    error: models.toml, line 2: invalid value 'wide' for '--image max-side=<PIXELS>': invalid digit found in
        string
    exit code: 2
    error: models.toml, line 2: max-side: a text, a number or a switch expected
    exit code: 2
    error: models.toml, line 7: max-side applies to all models, because each image is made once: set it in
        [defaults], or use --max-side
    exit code: 2
    error: models.toml, line 7: image applies to all models, because each image is made once: set it in
        [defaults], or use --image
    ");
    // Where the command has no such flag, the line says so; and open questions have no choices.
    let house = House::new();
    let line =
        "openeqa --questions questions.json --frames walks --num-frames 2 --levels L0 --models models.toml --out run";
    let defaults = ["max-side = 32", "temperature = 0\nprobabilities = true"];
    let errors = each(defaults, |defaults| {
        house.0.file("models.toml", models(defaults));
        house.0.call(&words(line)).messages()
    });
    insta::assert_snapshot!(errors, @r"
    max-side = 32
      exit code: 2
      error: models.toml, line 2: max-side: this command has no --max-side
    temperature = 0 \n probabilities = true
      exit code: 2
      error: probabilities: m: open questions have no choices
    ");
}
