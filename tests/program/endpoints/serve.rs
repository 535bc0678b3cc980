//! The built-in models behind an endpoint, asked as a client asks them.

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

use crate::support::run::{Bench, records, words};
use crate::support::table::check_rows;
use serde_json::{Value, json};

/// A server of four small rooms; it ends with the test.
struct Server {
    process: Child,
    url: String,
}

impl Server {
    fn start(bench: &Bench) -> Self {
        let args = words("serve --data rooms:frames=4,size=200x150 --port 0 --quiet");
        let mut process = bench.spawn(&args, Stdio::piped());
        let mut url = String::new();
        BufReader::new(process.stdout.take().unwrap()).read_line(&mut url).unwrap();
        let url = url.trim().to_owned();
        assert!(url.starts_with("http://127.0.0.1:") && url.ends_with("/v1"), "{url}");
        Self { process, url }
    }

    fn ask(&self, body: &Value) -> (u16, Value) {
        let runtime = tokio::runtime::Runtime::new().unwrap();
        // An error says that another test was faster.
        let _ = rustls::crypto::ring::default_provider().install_default();
        runtime.block_on(async {
            let client =
                reqwest::Client::builder().no_proxy().timeout(std::time::Duration::from_mins(1)).build().unwrap();
            let request = client.post(format!("{}/chat/completions", self.url));
            let request = request.header("content-type", "application/json");
            let reply = request.body(body.to_string()).send().await.unwrap();
            let status = reply.status().as_u16();
            let text = reply.text().await.unwrap();
            (status, serde_json::from_str(&text).unwrap_or(Value::String(text)))
        })
    }
}

impl Server {
    /// The first line of the answer to bytes that are sent as they are; empty if the server closes the connection.
    fn answer_to(&self, bytes: &str) -> String {
        let mut stream = self.connection();
        stream.write_all(bytes.as_bytes()).unwrap();
        let mut line = String::new();
        BufReader::new(stream).read_line(&mut line).unwrap();
        line.trim_end().to_owned()
    }

    fn connection(&self) -> TcpStream {
        let address = self.url.strip_prefix("http://").unwrap();
        TcpStream::connect(address.strip_suffix("/v1").unwrap()).unwrap()
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.process.kill().unwrap();
        self.process.wait().unwrap();
    }
}

const WORDS: &str = "Is it dark?\nA. yes\nB. no";

#[test]
fn served_observer_matches_program() {
    let bench = Bench::new();
    let server = Server::start(&bench);
    let replies = |model: &str, out: &str| -> BTreeMap<String, String> {
        bench.complete(&[
            "--model",
            model,
            "--base-url",
            &server.url,
            "--data",
            "rooms:frames=4,size=200x150",
            "--levels",
            "L0,L2",
            "--out",
            out,
        ]);
        records(&bench.path(out))
            .into_iter()
            .filter(|record| record["model"] == model)
            .map(|record| {
                let item = format!("{} {}", record["question"], record["condition"]);
                (item, record["reply"].to_string())
            })
            .collect()
    };
    let (here, there) = (replies("observer", "here"), replies("darkqa-observer", "there"));
    assert!(here.len() >= 30, "{}", here.len());
    // Where it sees nothing that bears on the question it guesses, there as it likes.
    let apart = here.iter().filter(|(item, reply)| there[*item] != **reply).count();
    assert!(apart * 10 <= here.len(), "{apart} of {}", here.len());
}

#[test]
fn client_errors_use_client_format() {
    let bench = Bench::new();
    let server = Server::start(&bench);
    let user = |content: Value| json!([{"role": "user", "content": content}]);
    let (status, reply) = server.ask(&json!({"model": "darkqa-random", "messages": user(json!(WORDS))}));
    assert_eq!((status, &reply["object"]), (200, &json!("chat.completion")));
    let answer = reply["choices"][0]["message"]["content"].as_str().unwrap();
    assert!(["A", "B"].contains(&answer), "{reply}");
    let parts = json!([{"type": "text", "text": WORDS}]);
    let (_, again) = server.ask(&json!({"model": "darkqa-random", "messages": user(parts), "temperature": 1}));
    assert_eq!(again["choices"][0]["message"]["content"], answer);
    let stream = json!({"model": "darkqa-observer", "messages": user(json!(WORDS)), "stream": true});
    let (status, events) = server.ask(&stream);
    let events = events.as_str().unwrap();
    assert!(status == 200 && events.starts_with("data: {") && events.ends_with("data: [DONE]\n\n"), "{events}");
    let rows = [
        (
            json!({"model": "gpt-4o", "messages": user(json!(WORDS))}),
            404,
            "is not one of darkqa-observer, darkqa-random",
        ),
        (json!({"messages": []}), 400, "missing field `model`"),
        (json!([1]), 400, "not a valid chat completion"),
        (json!({"model": "darkqa-random", "messages": user(json!("hi"))}), 400, "no choices in the text"),
        (
            json!({"model": "darkqa-observer", "messages": user(json!([
                {"type": "text", "text": WORDS},
                {"type": "image_url", "image_url": {"url": "data:image/png;base64,AAAA"}},
            ]))}),
            400,
            "image_url: ",
        ),
        (
            json!({"model": "darkqa-observer", "messages": user(json!([
                {"type": "image_url", "image_url": {"url": "file:///etc/passwd"}},
            ]))}),
            400,
            "only data URLs",
        ),
    ];
    check_rows(rows, |(body, status, part)| {
        let (found, reply) = server.ask(&body);
        let message = reply["error"]["message"].as_str().unwrap();
        assert!(found == status && message.contains(part), "{body}: {found} {reply}");
    });
}

#[test]
fn cross_site_requests_are_refused() {
    let bench = Bench::new();
    let server = Server::start(&bench);
    let host = server.url.strip_prefix("http://").unwrap();
    let host = host.strip_suffix("/v1").unwrap();
    let port = host.rsplit(':').next().unwrap();
    let body = json!({"model": "darkqa-random", "messages": [{"role": "user", "content": WORDS}]});
    let body = body.to_string();
    let post = |host: &str, headers: &str| {
        format!(
            "POST /v1/chat/completions HTTP/1.1\r\nHost: {host}\r\n{headers}Connection: close\r\nContent-Length: {}\r\n\r\n{body}",
            body.len()
        )
    };
    let json = "Content-Type: application/json; charset=utf-8\r\n";
    let rows = [
        (post(host, json), "HTTP/1.1 200 OK"),
        (post(&format!("localhost:{port}"), json), "HTTP/1.1 200 OK"),
        (post(host, &format!("{json}Origin: http://localhost:5173\r\n")), "HTTP/1.1 200 OK"),
        (post(&format!("evil.example:{port}"), json), "HTTP/1.1 421 Misdirected Request"),
        (post("127.0.0.1", json), "HTTP/1.1 421 Misdirected Request"),
        (post(host, &format!("{json}Origin: http://evil.example\r\n")), "HTTP/1.1 403 Forbidden"),
        (post(host, &format!("{json}Origin: null\r\n")), "HTTP/1.1 403 Forbidden"),
        (post(host, "Content-Type: text/plain\r\n"), "HTTP/1.1 415 Unsupported Media Type"),
        (post(host, ""), "HTTP/1.1 415 Unsupported Media Type"),
    ];
    check_rows(rows, |(request, expected)| {
        assert_eq!(server.answer_to(&request), expected, "{request}");
    });
}

#[test]
fn endless_or_nested_bodies_are_refused() {
    let bench = Bench::new();
    let server = Server::start(&bench);
    let host = server.url.strip_prefix("http://").unwrap();
    let host = host.strip_suffix("/v1").unwrap();
    let head = |length: usize| {
        format!(
            "POST /v1/chat/completions HTTP/1.1\r\nHost: {host}\r\nContent-Type: application/json\r\nConnection: close\r\n\
             Content-Length: {length}\r\n\r\n"
        )
    };
    let deep = format!("{}{}", "[".repeat(200_000), "]".repeat(200_000));
    let rows = [(head(300_000_000), "HTTP/1.1 413"), (head(deep.len()) + &deep, "HTTP/1.1 400")];
    check_rows(rows, |(request, expected)| {
        let answer = server.answer_to(&request);
        assert!(answer.starts_with(expected), "{answer}");
    });
    let words = json!([{"role": "user", "content": WORDS}]);
    let (status, _) = server.ask(&json!({"model": "darkqa-random", "messages": words}));
    assert_eq!(status, 200);
}

#[test]
fn large_images_and_many_values_are_refused() {
    let bench = Bench::new();
    let server = Server::start(&bench);
    let ask = |width: u32, height: u32| {
        let mut file = std::io::Cursor::new(Vec::new());
        image::GrayImage::new(width, height).write_to(&mut file, image::ImageFormat::Png).unwrap();
        let data = base64::Engine::encode(&base64::engine::general_purpose::STANDARD, file.into_inner());
        server.ask(&json!({"model": "darkqa-observer", "messages": [{"role": "user", "content": [
            {"type": "text", "text": "Is it dark?\nA. yes\nB. no"},
            {"type": "image_url", "image_url": {"url": format!("data:image/png;base64,{data}")}},
        ]}]}))
    };
    let (status, body) = ask(8001, 4000);
    assert_eq!(status, 413, "{body}");
    let message = body["error"]["message"].as_str().unwrap();
    assert!(message.contains("8001 × 4000 pixels; at most 32 million"), "{message}");
    let parts = vec![json!({"type": "text", "text": ""}); 100_000];
    let many = json!({"model": "darkqa-observer", "messages": [{"role": "user", "content": parts}]});
    let (status, body) = server.ask(&many);
    assert_eq!(status, 413, "{body}");
    let (status, body) = ask(400, 300);
    assert_eq!(status, 200, "{body}");
}

#[test]
fn idle_connections_block_no_one() {
    let bench = Bench::new();
    let server = Server::start(&bench);
    let mut idle: Vec<TcpStream> = (0..80).map(|_| server.connection()).collect();
    for stream in &mut idle {
        stream.write_all(b"POST /v1/chat/completions HTTP/1.1\r\nHost: a").unwrap();
    }
    let words = json!([{"role": "user", "content": WORDS}]);
    let (status, _) = server.ask(&json!({"model": "darkqa-random", "messages": words}));
    assert_eq!(status, 200);
    let mut rest = Vec::new();
    // The server ends a connection that does not finish its headers; reading then ends, too.
    let _ = idle[0].read_to_end(&mut rest);
}

#[test]
fn slow_bodies_block_no_one() {
    let bench = Bench::new();
    let server = Server::start(&bench);
    let host = server.url.strip_prefix("http://").unwrap();
    let host = host.strip_suffix("/v1").unwrap();
    let mut slow: Vec<TcpStream> = (0..16).map(|_| server.connection()).collect();
    for stream in &mut slow {
        let head = format!(
            "POST /v1/chat/completions HTTP/1.1\r\nHost: {host}\r\nContent-Type: application/json\r\nContent-Length: 9000\r\n\r\n{{"
        );
        stream.write_all(head.as_bytes()).unwrap();
    }
    // The server ends a body that does not arrive after a minute.
    let start = Instant::now();
    let words = json!([{"role": "user", "content": WORDS}]);
    let (status, _) = server.ask(&json!({"model": "darkqa-random", "messages": words}));
    assert_eq!(status, 200);
    assert!(start.elapsed() < Duration::from_secs(30));
}

#[test]
fn port_that_is_taken_is_named() {
    let bench = Bench::new();
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let port = taken.local_addr().unwrap().port().to_string();
    let line = format!("serve --data rooms:frames=1,size=64x48 --port {port}");
    let refused = bench.call(&words(&line));
    insta::assert_snapshot!(refused.messages(), @"
    exit code: 2
    error: --port: cannot listen at 127.0.0.1:[PORT]: [OS ERROR]; --port N takes another port, 0 any free one
    ");
}
