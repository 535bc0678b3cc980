//! One reply of an endpoint on the page: the prompt that was sent, and its cost.

use serde_json::{Value, json};

use super::browser;
use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::run::{Bench, model_args};

/// 90 tokens of a prompt and one of a reply cost $0.00094.
const PRICES: &str =
    "as-of = \"2026-01-01\"\nbatch = 0.5\n[models]\nm = { input = 10, output = 40, image-tokens = 70 }\n";

#[test]
fn a_reply_has_its_prompt_and_cost() {
    let Some(mut browser) = browser() else {
        return;
    };
    let bench = Bench::with_questions(9);
    bench.file("prices.toml", PRICES);
    let template =
        "Look well.\n{{ question }}{% for choice in choices %}\n{{ choice.letter }}) {{ choice.text }}{% endfor %}";
    bench.file("prompts/choice.txt", template);
    for (run, more) in [("own", "--prompts prompts --system Briefly. --image-first"), ("built-in", "--blind-model m")] {
        let mock = MockEndpoint::start([Answer::text("A")]);
        let line = format!("--data set.jsonl --levels L0,L3 --prices prices.toml --out {run} {more}");
        bench.complete(&model_args(&mock.base_url(), &line));
        browser.window(1200, 800, "light");
        browser.go("about:blank");
        browser.go(&format!("file://{}", bench.path(&format!("{run}/report.html")).display()));
        browser.wait("document.documentElement?.dataset.ready === 'true'");
        let reading = browser.evaluate("document.querySelector('#r-reading').textContent");
        assert!(reading.as_str().unwrap().ends_with(" · 90 prompt and 1 reply tokens · $0.00094"), "{reading}");
        // Every prompt on the page was sent, text by text and in this order.
        let asked = mock.requests().into_iter().filter(|request| request.line.starts_with("POST "));
        let sent: Vec<String> = asked.map(|request| sent_text(&request.json())).collect();
        let shown = browser.evaluate("data.subjects.map((_, s) => data.items.map((_, i) => promptOf(s, i)))");
        let shown: Vec<Vec<String>> = serde_json::from_value(shown).unwrap();
        for prompt in shown.iter().flatten() {
            assert!(sent.contains(prompt), "{prompt:?}: {:?}", sent[0]);
        }
        assert_eq!(shown.iter().flatten().count(), sent.len());
        let opened = browser.evaluate("document.querySelector('#r-prompt').textContent");
        assert!(opened.as_str().unwrap().contains("What color is it, "), "{opened}");
        // Forms are shared by all items.
        assert!(browser.evaluate("data.requests.prompts.forms.length").as_u64().unwrap() <= 3);
    }
}

/// The messages of a request in the form of the page.
fn sent_text(request: &Value) -> String {
    let mut texts = Vec::new();
    for message in request["messages"].as_array().unwrap() {
        match &message["content"] {
            Value::String(text) if message["role"] == "system" => texts.push(format!("[system] {text}")),
            Value::String(text) => texts.push(text.clone()),
            parts => texts.extend(parts.as_array().unwrap().iter().map(|part| match &part["text"] {
                Value::String(text) => text.clone(),
                other => {
                    assert_eq!((other, &part["type"]), (&Value::Null, &json!("image_url")));
                    "[the image]".to_owned()
                }
            })),
        }
    }
    texts.join("\n\n")
}
