//! Shapes of replies in which an answer is found.

use darkqa_base::types::Finish;
use serde_json::json;

use super::{PIECE, ask, completion, gzipped};
use crate::support::endpoint::Answer;
use crate::support::table::check_rows;

/// Replies that are answers at the first request, with the text that is read and why the model stopped.
#[test]
#[expect(clippy::too_many_lines, reason = "a table")]
fn message_is_found_in_every_shape() {
    let b = r#"{"role":"assistant","content":"B"}"#;
    let plain = completion(b);
    let http = |head: &str, body: &str| Answer::raw(format!("{head}\r\n\r\n{body}"));
    let cases: Vec<(&str, Answer, &str, Finish)> = vec![
        ("plain", Answer::text("B"), "B", Finish::Stop),
        ("a bare minimum", Answer::new(200, r#"{"choices":[{"message":{"content":"B"}}]}"#), "B", Finish::Unknown),
        (
            "text parts",
            Answer::new(200, completion(r#"{"content":[{"type":"text","text":"B"},{"type":"text","text":"."}]}"#)),
            "B.",
            Finish::Stop,
        ),
        (
            "thinking parts",
            Answer::new(
                200,
                completion(
                    r#"{"content":[{"type":"thinking","thinking":[{"type":"text","text":"A"}]},{"type":"text","text":"B"}]}"#,
                ),
            ),
            "B",
            Finish::Stop,
        ),
        (
            "reasoning apart",
            Answer::new(200, completion(r#"{"content":"B","reasoning_content":"A","reasoning":"A"}"#)),
            "B",
            Finish::Stop,
        ),
        (
            "no content",
            Answer::message(&json!({"content": null, "reasoning_content": "A? B?"}), "length"),
            "",
            Finish::Length,
        ),
        ("a missing content", Answer::message(&json!({"role": "assistant"}), "stop"), "", Finish::Stop),
        ("filtered", Answer::message(&json!({"content": null}), "content_filter"), "", Finish::Filter),
        ("refused, as Claude says it", Answer::message(&json!({"content": ""}), "refusal"), "", Finish::Filter),
        (
            "a tool call",
            Answer::message(&json!({"content": null, "tool_calls": []}), "tool_calls"),
            "",
            Finish::Other("tool_calls".into()),
        ),
        (
            "choices out of order",
            Answer::new(
                200,
                r#"{"choices":[{"index":1,"message":{"content":"A"}},{"index":0,"message":{"content":"B"}}]}"#,
            ),
            "B",
            Finish::Unknown,
        ),
        (
            "odd extras",
            Answer::new(
                200,
                r#"{"error":null,"usage":null,"model":7,"timings":{},"choices":[{"index":0,"message":{"content":"B"},"finish_reason":"STOP","x":[]}]}"#,
            ),
            "B",
            Finish::Stop,
        ),
        ("blank lines first", Answer::new(200, format!("\n\n \r\n{plain}")), "B", Finish::Stop),
        ("a byte order mark", Answer::new(200, format!("\u{FEFF}{plain}")), "B", Finish::Stop),
        (
            "bytes that are no text",
            Answer::new(200, [b"{\"choices\":[{\"message\":{\"content\":\"B\xff\"}}]}".as_slice()].concat()),
            "B\u{FFFD}",
            Finish::Unknown,
        ),
        (
            "half a surrogate pair",
            Answer::new(200, completion(r#"{"content":"B \ud83d"}"#)),
            "B \u{FFFD}",
            Finish::Stop,
        ),
        (
            "another content type",
            Answer::new(200, plain.clone()).header("content-type", "text/plain"),
            "B",
            Finish::Stop,
        ),
        ("compressed", gzipped(plain.as_bytes()), "B", Finish::Stop),
        (
            "an event stream",
            Answer::stream(&[PIECE, r#"{"choices":[{"index":0,"delta":{},"finish_reason":"stop"}]}"#, "[DONE]"]),
            "B",
            Finish::Stop,
        ),
        (
            "an event stream without an end mark",
            Answer::stream(&[r#"{"choices":[{"index":0,"delta":{"content":"B"},"finish_reason":"length"}]}"#]),
            "B",
            Finish::Length,
        ),
        ("HTTP/1.0 without a length", http("HTTP/1.0 200 OK", &plain), "B", Finish::Stop),
        (
            "chunks",
            Answer::raw(format!(
                "HTTP/1.1 200 OK\r\ntransfer-encoding: chunked\r\n\r\n{:x};x=1\r\n{plain}\r\n0\r\nx-trailer: 1\r\n\r\n",
                plain.len()
            )),
            "B",
            Finish::Stop,
        ),
        (
            "an interim reply",
            Answer::raw(format!(
                "HTTP/1.1 103 Early Hints\r\nlink: </x>\r\n\r\nHTTP/1.1 200 OK\r\ncontent-length: {}\r\n\r\n{plain}",
                plain.len()
            )),
            "B",
            Finish::Stop,
        ),
        ("a slow body", Answer::text("B").drip(1), "B", Finish::Stop),
    ];
    check_rows(cases, |(name, answer, text, finish)| {
        let outcome = ask(vec![answer]);
        let reply = outcome.result.unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!((reply.text.as_str(), &reply.finish), (text, &finish), "{name}");
        assert_eq!((reply.attempts, outcome.requests.len()), (1, 1), "{name}");
    });
    let refused = json!({"content": null, "refusal": "The answer is A, but I cannot say so."});
    let reply = ask(vec![Answer::message(&refused, "stop")]).result.unwrap();
    assert_eq!(reply.text, "");
    assert!(reply.refusal.unwrap().starts_with("The answer"));
}

/// Tokens in the names of each vendor: of prompt, reply and cache.
#[test]
fn tokens_are_read_in_every_shape() {
    let cases = [
        (
            "OpenAI",
            json!({"prompt_tokens": 90, "completion_tokens": 1, "prompt_tokens_details": {"cached_tokens": 64}}),
            (Some(90), Some(1), Some(64)),
        ),
        (
            "Anthropic",
            json!({"prompt_tokens": 90, "completion_tokens": 1, "cache_read_input_tokens": 80}),
            (Some(90), Some(1), Some(80)),
        ),
        (
            "nothing from a cache",
            json!({"prompt_tokens": 90, "prompt_tokens_details": {"cached_tokens": 0}}),
            (Some(90), None, None),
        ),
        ("no numbers", json!({"prompt_tokens": "many"}), (None, None, None)),
    ];
    check_rows(cases, |(name, usage, expected)| {
        let completion = json!({"choices": [{"message": {"content": "B"}}], "usage": usage});
        let reply = ask(vec![Answer::json(200, &completion)]).result.unwrap();
        let usage = reply.usage.unwrap_or_default();
        let tokens = (usage.prompt_tokens, usage.completion_tokens, usage.cached_tokens);
        assert_eq!(tokens, expected, "{name}");
    });
}
