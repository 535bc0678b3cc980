//! Texts of strangers, and keys in them: nothing hidden is written to files, nothing moves a terminal, and no key is
//! stored.

use std::fs;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;

use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::run::{Bench, called, files, model_args, words};
use crate::support::snapshot::redacted;

/// A key as a gateway gives it, and two parts of it.
const KEY: &str = "gateway-0123456789-abcdefghij";
const PARTS: [&str; 2] = ["gateway-01234567", "89-abcdefghij"];

#[test]
fn quiet_run_writes_no_colours() {
    let bench = Bench::with_questions(4);
    let mock = MockEndpoint::answering(|_| Answer::error(400, "x", "no"));
    let line = "--data set.jsonl --levels L0 --retries 0 --out";
    let run = |out: &str, more: &[&str], variables: &[(&str, &str)]| {
        let url = mock.base_url();
        let args = [&model_args(&url, line)[..], &[out], more].concat();
        called(bench.command(&args).envs(variables.iter().copied()).env("OPENAI_API_KEY", KEY))
    };
    let rows = [
        ("--quiet", None),
        ("--quiet --color never", None),
        ("--quiet --color always", None),
        ("--color always", Some(("NO_COLOR", "1"))),
    ];
    for (at, (more, variable)) in rows.into_iter().enumerate() {
        let called = run(&format!("run{at}"), &words(more), variable.as_slice());
        assert!(called.code == Some(1) && !called.stderr.is_empty() || at == 3);
        assert!(!called.stderr.contains('\u{1b}'), "{more:?}: {called:?}");
        // The same text has colours where they are wanted.
        assert_eq!(called.stdout.contains('\u{1b}'), at == 3, "{called:?}");
    }
}

/// The hidden characters of a text.
fn hidden(text: &str) -> Vec<char> {
    let is_hidden = |c: &char| {
        (c.is_control() && *c != '\n' && *c != '\t') || "\u{202e}\u{2066}\u{200b}\u{2028}\u{3164}".contains(*c)
    };
    text.chars().filter(is_hidden).collect()
}

#[test]
fn captions_and_readme_escape_hidden_text() {
    let strange = r"a\u001b[31m\u009b2J\r\u202e\u2066\u200b\u2028\u3164\\input{/etc/passwd}%&.png";
    let bench = Bench::with_questions(9);
    bench.complete(&words("--model random --data set.jsonl --levels L0,L3,L5 --out run"));
    for path in files(&bench.path("run")) {
        let text = fs::read_to_string(&path).unwrap_or_default();
        if path.extension().is_some_and(|end| end == "jsonl") || path.ends_with("run/manifest.json") {
            let text = text.replace("a.png", strange);
            fs::write(&path, text.replace("\"paper\"", "\"paper\\u202e\"")).unwrap();
        }
    }
    bench.complete(&words("figures run --out figures --format pdf,svg,tex"));
    let mut kinds = 0;
    for path in files(&bench.path("figures")) {
        let text = fs::read(&path).unwrap();
        if path.extension().is_none_or(|end| end != "pdf") {
            let text = String::from_utf8(text).unwrap();
            assert_eq!(hidden(&text), [], "{}", path.display());
            kinds += 1;
        }
    }
    assert!(kinds > 3);
    let captions = fs::read_to_string(bench.path("figures/captions.txt")).unwrap();
    assert!(captions.contains("⟨U+202E⟩"), "{captions}");
    bench.complete(&words("bundle run --out run.zip"));
    let archive = fs::File::open(bench.path("run.zip")).unwrap();
    let mut archive = zip::ZipArchive::new(archive).unwrap();
    let readme = archive.by_name("run/README.md").unwrap();
    let readme = std::io::read_to_string(readme).unwrap();
    assert_eq!(hidden(&readme), [], "{readme}");
    assert!(readme.contains("paper⟨U+202E⟩"), "{readme}");
}

#[test]
fn unusable_proxy_is_an_error() {
    let bench = Bench::with_questions(1);
    let proxy = MockEndpoint::answering(|_| Answer::text("brown"));
    let address = proxy.base_url().replace("/v1", "");
    let run = |proxy: &str, more: &str| {
        let line = format!("--data set.jsonl --levels L0 --retries 0 --allow-http --out {more}");
        // Reserved by RFC 5737: nobody answers there.
        let args = model_args("http://192.0.2.1:9/v1", &line);
        called(bench.command(&args).env("HTTP_PROXY", proxy).env("OPENAI_API_KEY", KEY))
    };
    for wrong in ["socks5://user:word@127.0.0.1:1080", "127.0.0.1:port", "http//proxy"] {
        let called = run(wrong, "refused").ended(2);
        assert!(called.stderr.contains("HTTP_PROXY"), "{called:?}");
        assert!(!called.stderr.contains("word"), "{called:?}");
        assert!(!bench.path("refused").exists());
    }
    run(&address, "run").ended(0);
    let requests = proxy.requests();
    assert!(!requests.is_empty());
    insta::assert_snapshot!(redacted(&requests[0].line), @"POST http://192.0.2.1:9/v1/chat/completions HTTP/1.1");
}

#[test]
fn encoded_key_is_never_stored() {
    let encoded = STANDARD.encode(format!("Bearer {KEY}"));
    let reply = format!("brown {KEY} {encoded} {} and {}", PARTS[0], PARTS[1].replace('-', " "));
    let bench = Bench::with_questions(2);
    let run = |line: &str, answer: Answer| {
        let mock = MockEndpoint::answering(move |_| answer.clone());
        let url = mock.base_url();
        let args = model_args(&url, line);
        called(bench.command(&args).env("OPENAI_API_KEY", KEY))
    };
    let line = "--data set.jsonl --levels L0 --retries 0 --out";
    run(&format!("{line} run"), Answer::text(&reply)).ended(0);
    let refused = run(&format!("{line} refused"), Answer::error(400, "x", &reply));
    let core = &encoded[12..encoded.len() - 4];
    let pieces = [KEY, core, "0123456", "abcdefghij"];
    let read = |path: &std::path::PathBuf| fs::read_to_string(path).unwrap_or_default();
    let all: Vec<String> = files(&bench.path("")).iter().map(read).collect();
    let texts = all.iter().chain([&refused.stdout, &refused.stderr]);
    for text in texts {
        let found = pieces.iter().find(|piece| text.contains(**piece));
        assert_eq!(found, None, "{text}");
    }
    let records = fs::read_to_string(bench.path("run/records.jsonl")).unwrap();
    assert!(records.contains("brown [secret]") && records.contains("[secret] and [secret]"), "{records}");
}
