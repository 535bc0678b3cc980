//! A mock endpoint on raw TCP: [`MockEndpoint`] plays a script of [`Answer`]s and records what it was sent.
//!
//! It writes bytes, not HTTP library calls: replies cut short, connections dropped and lengths that lie cannot be made
//! otherwise.

use std::collections::VecDeque;
use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread;

use serde_json::{Value, json};

/// A request as it arrived.
#[derive(Debug, Clone)]
pub struct Request {
    /// `POST /v1/chat/completions HTTP/1.1`
    pub line: String,
    /// Names in lower case, in the order sent.
    pub headers: Vec<(String, String)>,
    pub body: Vec<u8>,
}

impl Request {
    /// The one value of a header, `None` where it was not sent.
    pub fn header(&self, name: &str) -> Option<&str> {
        let mut values = self.headers.iter().filter(|(n, _)| n == name);
        let value = values.next().map(|(_, value)| value.as_str());
        assert!(values.next().is_none(), "{name} was sent twice");
        value
    }

    pub fn json(&self) -> Value {
        serde_json::from_slice(&self.body).unwrap()
    }
}

/// One reply of the script.
#[derive(Debug, Clone)]
pub struct Answer {
    status: u16,
    headers: Vec<(String, String)>,
    body: Vec<u8>,
    manner: Manner,
}

#[derive(Debug, Clone, Copy)]
enum Manner {
    Whole,
    /// The body as it stands, without a status line or headers of our making; then the connection closes.
    Raw,
    /// The head at once, the body byte by byte with a pause in milliseconds.
    Drip(u64),
    /// So many bytes of the body, whose whole length was announced; then the connection closes.
    Cut(usize),
    /// The connection closes without a byte.
    Dropped,
    /// Nothing, until the client goes away.
    Silent,
    /// The head and half the body, then nothing until the client goes away.
    Stuck,
}

impl Answer {
    /// A status with a body.
    pub fn new(status: u16, body: impl Into<Vec<u8>>) -> Self {
        Self {
            status,
            headers: vec![("content-type".into(), "application/json".into())],
            body: body.into(),
            manner: Manner::Whole,
        }
    }

    /// A status with a JSON body.
    pub fn json(status: u16, body: &Value) -> Self {
        Self::new(status, body.to_string())
    }

    /// A whole chat completion.
    pub fn text(text: &str) -> Self {
        Self::message(&json!({"role": "assistant", "content": text}), "stop")
    }

    /// A chat completion with this message.
    pub fn message(message: &Value, finish: &str) -> Self {
        Self::json(
            200,
            &json!({
                "id": "chatcmpl-1", "object": "chat.completion", "created": 1, "model": "mock-1",
                "choices": [{"index": 0, "message": message, "finish_reason": finish}],
                "usage": {"prompt_tokens": 90, "completion_tokens": 1, "total_tokens": 91},
            }),
        )
    }

    /// A stream of these events.
    pub fn stream(events: &[&str]) -> Self {
        let events = events.iter().map(|event| format!("data: {event}\n\n"));
        Self::new(200, events.collect::<String>()).header("content-type", "text/event-stream")
    }

    /// A whole chat completion as a stream of one piece.
    pub fn streamed_text(text: &str) -> Self {
        let choice = json!({"index": 0, "delta": {"content": text}, "finish_reason": "stop"});
        Self::stream(&[&json!({"choices": [choice]}).to_string(), "[DONE]"])
    }

    /// A complete chat completion with this number of prompt tokens.
    pub fn message_charged(text: &str, prompt_tokens: u64) -> Self {
        let message = json!({"role": "assistant", "content": text});
        Self::json(
            200,
            &json!({
                "model": "mock-1", "choices": [{"index": 0, "message": message, "finish_reason": "stop"}],
                "usage": {"prompt_tokens": prompt_tokens, "completion_tokens": 1},
            }),
        )
    }

    /// An error in OpenAI's shape.
    pub fn error(status: u16, code: &str, message: &str) -> Self {
        let error = json!({"message": message, "type": "x", "param": null, "code": code});
        Self::json(status, &json!({ "error": error }))
    }

    /// The same with one more header; `content-type` replaces the one there is.
    pub fn header(mut self, name: &str, value: &str) -> Self {
        self.headers.retain(|(n, _)| n != name);
        self.headers.push((name.into(), value.into()));
        self
    }

    pub fn cut(mut self, after: usize) -> Self {
        self.manner = Manner::Cut(after);
        self
    }

    /// These bytes and nothing else.
    pub fn raw(bytes: impl Into<Vec<u8>>) -> Self {
        Self { manner: Manner::Raw, ..Self::new(200, bytes) }
    }

    pub fn drip(mut self, milliseconds: u64) -> Self {
        self.manner = Manner::Drip(milliseconds);
        self
    }

    pub fn dropped() -> Self {
        Self { manner: Manner::Dropped, ..Self::new(200, "") }
    }

    pub fn silent() -> Self {
        Self { manner: Manner::Silent, ..Self::new(200, "") }
    }

    pub fn stuck() -> Self {
        Self { manner: Manner::Stuck, ..Self::text("B") }
    }

    /// Writes it; says whether the connection can be used again.
    fn write(&self, stream: &mut TcpStream) -> std::io::Result<bool> {
        if matches!(self.manner, Manner::Raw) {
            stream.write_all(&self.body)?;
            return Ok(false);
        }
        let mut head = format!("HTTP/1.1 {} Status\r\ncontent-length: {}\r\n", self.status, self.body.len());
        for (name, value) in &self.headers {
            head.extend([name, ": ", value, "\r\n"]);
        }
        head += "\r\n";
        let sent = match self.manner {
            Manner::Whole => self.body.len(),
            Manner::Cut(after) => after,
            Manner::Stuck => self.body.len() / 2,
            Manner::Drip(_) => 0,
            Manner::Dropped | Manner::Raw => return Ok(false),
            Manner::Silent => {
                drain(stream);
                return Ok(false);
            }
        };
        stream.write_all(head.as_bytes())?;
        stream.write_all(&self.body[..sent])?;
        if matches!(self.manner, Manner::Stuck) {
            drain(stream);
        }
        if let Manner::Drip(milliseconds) = self.manner {
            for byte in self.body.chunks(1) {
                thread::sleep(std::time::Duration::from_millis(milliseconds));
                stream.write_all(byte)?;
            }
            return Ok(true);
        }
        Ok(sent == self.body.len())
    }
}

/// Waits until the other side closes.
fn drain(stream: &mut TcpStream) {
    let _ = stream.read_to_end(&mut Vec::new());
}

/// The endpoint: one thread a connection.
pub struct MockEndpoint {
    address: SocketAddr,
    shared: Arc<Shared>,
}

struct Shared {
    answer: Box<dyn Fn(&Request) -> Answer + Send + Sync>,
    requests: Mutex<Vec<Request>>,
    closing: AtomicBool,
}

impl MockEndpoint {
    /// One that answers in the order of the requests; the last answer is given again for ever.
    pub fn start(answers: impl IntoIterator<Item = Answer>) -> Self {
        let answers: VecDeque<Answer> = answers.into_iter().collect();
        let answers = Mutex::new(answers);
        Self::posted(move |_| {
            let mut answers = answers.lock().unwrap();
            if answers.len() > 1 { answers.pop_front().unwrap() } else { answers[0].clone() }
        })
    }

    /// One that looks at what it is asked.
    pub fn answering(answer: impl Fn(&Value) -> Answer + Send + Sync + 'static) -> Self {
        Self::posted(move |request| answer(&request.json()))
    }

    /// One that knows nothing but questions: what else it is asked for is not there.
    fn posted(answer: impl Fn(&Request) -> Answer + Send + Sync + 'static) -> Self {
        Self::serving(Box::new(move |request| {
            if request.line.starts_with("GET ") {
                return Answer::new(404, "");
            }
            answer(request)
        }))
    }

    /// One that looks at the whole request.
    pub fn watching(answer: impl Fn(&Request) -> Answer + Send + Sync + 'static) -> Self {
        Self::serving(Box::new(answer))
    }

    /// Starts it on a free port of this machine.
    pub fn serving(answer: Box<dyn Fn(&Request) -> Answer + Send + Sync>) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap();
        let shared = Arc::new(Shared { answer, requests: Mutex::new(Vec::new()), closing: AtomicBool::new(false) });
        thread::spawn({
            let shared = shared.clone();
            move || {
                for stream in listener.incoming() {
                    if shared.closing.load(Ordering::SeqCst) {
                        break;
                    }
                    let shared = shared.clone();
                    // A client that goes away in the midst of things is part of many tests.
                    thread::spawn(move || stream.and_then(|stream| shared.serve(stream)));
                }
            }
        });
        Self { address, shared }
    }

    pub fn base_url(&self) -> String {
        format!("http://{}/v1", self.address)
    }

    /// Bytes received so far.
    pub fn requests(&self) -> Vec<Request> {
        self.shared.requests.lock().unwrap().clone()
    }
}

impl Drop for MockEndpoint {
    fn drop(&mut self) {
        self.shared.closing.store(true, Ordering::SeqCst);
        let _ = TcpStream::connect(self.address);
    }
}

impl Shared {
    fn serve(&self, mut stream: TcpStream) -> std::io::Result<()> {
        let mut reader = BufReader::new(stream.try_clone()?);
        while let Some(request) = read(&mut reader)? {
            self.requests.lock().unwrap().push(request.clone());
            let answer = (self.answer)(&request);
            if !answer.write(&mut stream)? {
                break;
            }
        }
        Ok(())
    }
}

/// Reads one request; `None` where the connection was closed before it.
fn read(reader: &mut BufReader<TcpStream>) -> std::io::Result<Option<Request>> {
    let mut line = String::new();
    if reader.read_line(&mut line)? == 0 {
        return Ok(None);
    }
    let mut headers = Vec::new();
    loop {
        let mut header = String::new();
        reader.read_line(&mut header)?;
        let Some((name, value)) = header.trim_end().split_once(':') else {
            break;
        };
        headers.push((name.to_lowercase(), value.trim().to_owned()));
    }
    let length = headers.iter().find(|(name, _)| name == "content-length");
    let mut body = vec![0; length.map_or(0, |(_, length)| length.parse().unwrap())];
    reader.read_exact(&mut body)?;
    Ok(Some(Request { line: line.trim_end().to_owned(), headers, body }))
}
