//! Files of settings, and what a mock endpoint answers.

use serde_json::{Value, json};

use crate::support::run::Bench;

pub(super) fn make(bench: &Bench) {
    let source = |name: &str| {
        let path = format!("{}/{name}", env!("CARGO_MANIFEST_DIR"));
        std::fs::read(path).unwrap()
    };
    bench.file("rules.toml", source("src/questions/rules.toml"));
    bench.file("camera.toml", source("src/light/camera/nikon-d850.toml"));
    bench.file("prompts/choice.txt", source("prompts/choice.txt"));
    bench.file("prompts/blind.txt", source("prompts/blind.txt"));
    bench
        .file("darkqa.toml", "levels = \"L0,L3\"\nseed = 7\ngain = 1.5\nvariant = \"both\"\nquiet = true\nlimit = 3\n");
    bench.file("rooms.toml", "quiet = true\n\n[rooms]\nframes = 2\nsize = \"32x32\"\nseed = 9\n");
    bench.file("plain.toml", "quiet = true\ncolor = \"never\"\n");
    bench.file(
        "prices.toml",
        "as-of = \"2026-01-01\"\nbatch = 0.5\n[models]\nm = { input = 10, output = 5.5, image-tokens = 70 }\n",
    );
    bench.file(
        "models.toml",
        "[defaults]\nmax-tokens = 64\n[[model]]\nname = \"First\"\nid = \"org/first\"\nendpoints = [\"http://127.0.0.1:PORTS/v1\"]\nbody = { chat_template_kwargs = { enable_thinking = false } }\n[[model]]\nid = \"second\"\nendpoints = [\"http://127.0.0.1:PORTS/v1\"]\nheaders = { X-Team = \"a\" }\nomit = [\"temperature\"]\nsystem = \"Be brief.\"\n[[model]]\nname = \"words\"\nid = \"third\"\nendpoints = [\"http://127.0.0.1:PORTS/v1\"]\nview = \"blind\"\n",
    );
    bench.file(
        "script.jsonl",
        "{\"question\": \"q0\", \"condition\": \"L0\", \"reply\": \"B\"}\n{\"question\": \"q1\", \"reply\": \"(C) brown\"}\n{\"default\": \"A\"}\n",
    );
    bench.file("judge.jsonl", "{\"default\": \"5\"}\n");
    replies(bench);
    let body = chat_request().to_string();
    bench.file(
        "request/whole.http",
        format!(
            "POST /v1/chat/completions HTTP/1.1\r\nHost: 127.0.0.1:PORTS\r\nContent-Type: application/json\r\nContent-Length: {}\r\nConnection: close\r\n\r\n{body}",
            body.len()
        ),
    );
    bench.file("request/body.json", body);
}

/// Requests of a client to `serve`.
fn chat_request() -> Value {
    json!({
        "model": "darkqa-observer", "temperature": 0, "max_tokens": 9,
        "messages": [{"role": "user", "content": [
            {"type": "text", "text": "Is it dark?\nA. yes\nB. no"},
            {"type": "image_url", "image_url": {"url": "data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAAAAAA6fptVAAAACklEQVR4nGNgAAAAAgABSK+kcQAAAABJRU5ErkJggg=="}},
        ]}],
    })
}

/// Replies of an endpoint: of chats, of a Batch API, and refusals.
fn replies(bench: &Bench) {
    let alternatives =
        json!([{"token": "A", "logprob": -0.1}, {"token": "B", "logprob": -2.5}, {"token": " C", "logprob": -9.0}]);
    let token = json!({"token": "A", "logprob": -0.1, "top_logprobs": alternatives});
    let chat = json!({
        "id": "chatcmpl-1", "object": "chat.completion", "created": 1, "model": "mock-1", "system_fingerprint": "fp",
        "choices": [{
            "index": 0, "finish_reason": "stop", "logprobs": {"content": [token]},
            "message": {"role": "assistant", "content": "The answer is (B) blue.", "reasoning_content": "It is blue.", "refusal": null},
        }],
        "usage": {"prompt_tokens": 90, "completion_tokens": 1, "total_tokens": 91, "completion_tokens_details": {"reasoning_tokens": 7}},
    });
    bench.file("reply/chat.json", chat.to_string());
    let body = chat.to_string();
    bench.file(
        "reply/chat.http",
        format!(
            "HTTP/1.1 200 OK\r\nContent-Type: application/json\r\nx-ratelimit-remaining-requests: 59\r\nx-ratelimit-reset-requests: 1s\r\nx-ratelimit-limit-tokens: 90000\r\nContent-Length: {}\r\n\r\n{body}",
            body.len()
        ),
    );
    let error = json!({"error": {"message": "Rate limit reached for m in organization o: try again in 20ms.", "type": "requests", "param": null, "code": "rate_limit_exceeded"}}).to_string();
    bench.file(
        "reply/refusal.http",
        format!(
            "HTTP/1.1 429 Too Many Requests\r\nContent-Type: application/json\r\nRetry-After: 0\r\nx-ratelimit-reset-tokens: 6m0s\r\nContent-Length: {}\r\nConnection: close\r\n\r\n{error}",
            error.len()
        ),
    );
    let file = json!({"id": "file-1", "object": "file", "bytes": 120, "created_at": 1, "filename": "requests.jsonl", "purpose": "batch", "status": "processed"});
    bench.file("reply/POST-files.json", file.to_string());
    let batch = json!({
        "id": "batch_1", "object": "batch", "endpoint": "/v1/chat/completions", "errors": null, "input_file_id": "file-1",
        "completion_window": "24h", "status": "completed", "output_file_id": "file-2", "error_file_id": null,
        "created_at": 1, "request_counts": {"total": 3, "completed": 3, "failed": 0}, "metadata": {},
    });
    bench.file("reply/POST-batches.json", batch.to_string());
    bench.file("reply/GET-batches-id.json", batch.to_string());
}
