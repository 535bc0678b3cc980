//! A mock server with files and batches, by OpenAI's interface: [`MockBatches`]. What becomes of each batch is a
//! [`Course`].

use std::collections::BTreeMap;
use std::sync::{Arc, Condvar, Mutex};
use std::time::Duration;

use serde_json::{Value, json};

use super::endpoint::{Answer, MockEndpoint, Request};

/// Course of one batch.
#[derive(Clone)]
pub struct Course {
    /// The refusal of its creation.
    refused: Option<Answer>,
    /// The state at each look; the last stays.
    states: Vec<String>,
    /// The errors of a batch that fails.
    errors: Value,
    /// Outcome of the request with this number.
    line: fn(usize) -> Line,
    order: Order,
    /// The text of each answer.
    text: &'static str,
    /// Looks at which the output file has no name yet.
    late: usize,
    /// The tokens of each answer.
    tokens: u64,
    /// Requests that the server does not count.
    uncounted: usize,
    /// Whether the server counts nothing before its output file has a name.
    is_late_to_count: bool,
}

/// Outcome of one request.
#[derive(Debug, Clone, Copy)]
pub enum Line {
    /// The right answer.
    Right,
    /// A response with this status and message.
    Status(u16, &'static str),
    /// A reply without text, with this finish reason.
    Ended(&'static str),
    /// A line of the error file: the batch ended before it.
    Expired,
    /// No line at all.
    Absent,
}

/// How the lines of an output file stand in it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Order {
    AsSent,
    Reversed,
    /// Each line twice, the second one with another answer.
    Twice,
    /// The last line is cut.
    Cut,
    /// The file is empty.
    Empty,
    /// Each line after a failure of the same request.
    AfterFailures,
}

impl Course {
    /// A batch that is seen in these states, with a right answer to each request.
    pub fn of(states: &str) -> Self {
        Self {
            refused: None,
            states: states.split(' ').map(str::to_owned).collect(),
            errors: Value::Null,
            line: |_| Line::Right,
            order: Order::AsSent,
            text: "C",
            late: 0,
            tokens: 1,
            uncounted: 0,
            is_late_to_count: false,
        }
    }

    /// A batch of which the server does not count so many requests.
    pub fn uncounted(self, uncounted: usize) -> Self {
        Self { uncounted, ..self }
    }

    /// A batch whose output file is named only after `late` polls.
    pub fn late(self, late: usize) -> Self {
        Self { late, ..self }
    }

    /// No counts before the output file has a name.
    pub fn late_to_count(self) -> Self {
        Self { is_late_to_count: true, ..self }
    }

    /// A batch whose answers are charged `tokens` tokens each.
    pub fn tokens(self, tokens: u64) -> Self {
        Self { tokens, ..self }
    }

    pub fn text(self, text: &'static str) -> Self {
        Self { text, ..self }
    }

    pub fn lines(self, line: fn(usize) -> Line) -> Self {
        Self { line, ..self }
    }

    pub fn order(self, order: Order) -> Self {
        Self { order, ..self }
    }

    /// A batch that fails with an error.
    pub fn failing(code: &str, message: &str, line: &Value) -> Self {
        let error = json!({"code": code, "message": message, "param": null, "line": line});
        Self { errors: json!({"object": "list", "data": [error]}), ..Self::of("validating failed") }
    }

    /// A batch whose creation is refused.
    pub fn refused(answer: Answer) -> Self {
        Self { refused: Some(answer), ..Self::of("failed") }
    }
}

/// Something that goes wrong with one request.
#[derive(Clone)]
pub enum Fault {
    /// The request is not carried out, and answered so.
    Instead(Answer),
    /// The request is carried out, and the connection closes without an answer.
    CutAfter,
    /// Nothing is answered before the request is carried out.
    HoldBefore,
    /// The request is carried out, and nothing is answered.
    HoldAfter,
}

/// A file at the server.
#[derive(Debug, Clone)]
pub struct StoredFile {
    pub id: String,
    pub name: String,
    pub content: Vec<u8>,
    /// How often it is pending when it is looked at.
    pending: usize,
    pub deleted: bool,
}

/// A batch at the server.
pub struct StoredBatch {
    pub id: String,
    pub body: Value,
    /// The requests of its input file.
    pub requests: Vec<Value>,
    course: Course,
    looks: usize,
    cancelled: bool,
    output: Option<String>,
    errors: Option<String>,
}

/// State of the server.
#[derive(Default)]
pub struct Server {
    pub files: Vec<StoredFile>,
    pub batches: Vec<StoredBatch>,
    /// Every request, as `POST files`, without ids.
    pub log: Vec<String>,
    courses: Vec<Course>,
    faults: BTreeMap<usize, Fault>,
    /// Faults of the first requests of a kind.
    kind_faults: Vec<(String, Fault)>,
    /// How often a file is pending after its upload.
    pending: usize,
    /// The most bytes of a file.
    most: Option<usize>,
    /// Whether a request is held.
    held: bool,
    /// The answer to a direct request; by default the right one.
    chat: Option<fn(&Value) -> Answer>,
}

pub struct MockBatches {
    endpoint: MockEndpoint,
    shared: Arc<(Mutex<Server>, Condvar)>,
}

impl MockBatches {
    /// A server that takes the batches through these courses; the last is that of all further ones.
    pub fn start(courses: impl IntoIterator<Item = Course>) -> Self {
        let server = Server { courses: courses.into_iter().collect(), ..Server::default() };
        let shared = Arc::new((Mutex::new(server), Condvar::new()));
        let endpoint = MockEndpoint::serving(Box::new({
            let shared = shared.clone();
            move |request| {
                let mut server = shared.0.lock().unwrap();
                let answer = server.answer(request);
                shared.1.notify_all();
                answer
            }
        }));
        Self { endpoint, shared }
    }

    /// Direct requests are answered so.
    pub fn chat(&self, answer: fn(&Value) -> Answer) {
        self.with(|server| server.chat = Some(answer));
    }

    pub fn base_url(&self) -> String {
        self.endpoint.base_url()
    }

    /// Looks at or changes what the server holds.
    pub fn with<T>(&self, act: impl FnOnce(&mut Server) -> T) -> T {
        act(&mut self.shared.0.lock().unwrap())
    }

    /// The first request of this kind, as `POST files`, meets a fault; several faults of a kind meet its first
    /// requests.
    pub fn fault(&self, kind: &str, fault: Fault) {
        self.with(|server| server.kind_faults.push((kind.to_owned(), fault)));
    }

    /// The request with this number, counted from 0, meets a fault.
    pub fn fault_at(&self, number: usize, fault: Fault) {
        self.with(|server| server.faults.insert(number, fault));
    }

    /// Files are pending for this number of polls after their upload.
    pub fn pending(&self, looks: usize) {
        self.with(|server| server.pending = looks);
    }

    /// Files of more bytes are refused.
    pub fn most_bytes(&self, most: usize) {
        self.with(|server| server.most = Some(most));
    }

    /// Waits until a request is held; false if none is within the time.
    pub fn wait_until_held(&self, time: Duration) -> bool {
        let (server, changed) = &*self.shared;
        let server = server.lock().unwrap();
        let waited = changed.wait_timeout_while(server, time, |server| !server.held);
        waited.unwrap().0.held
    }

    /// Requests are held no more.
    pub fn release(&self) {
        self.with(|server| {
            server.faults.clear();
            server.kind_faults.clear();
            server.held = false;
        });
    }

    /// The ids of the requests of all batches that were begun, batch by batch.
    pub fn asked(&self) -> Vec<Vec<String>> {
        self.with(|server| {
            server
                .batches
                .iter()
                .filter(|batch| batch.is_begun())
                .map(|batch| batch.requests.iter().map(|one| one["custom_id"].as_str().unwrap().to_owned()).collect())
                .collect()
        })
    }

    /// Every request that arrived.
    pub fn requests(&self) -> Vec<Request> {
        self.endpoint.requests()
    }

    /// How many requests of a kind arrived, as `POST batches`.
    pub fn count(&self, kind: &str) -> usize {
        self.with(|server| server.log.iter().filter(|one| *one == kind).count())
    }
}

impl Server {
    fn answer(&mut self, request: &Request) -> Answer {
        let mut words = request.line.split(' ');
        let (method, target) = (words.next().unwrap(), words.next().unwrap());
        let target = target.strip_prefix("/v1/").unwrap_or(target);
        let (path, query) = target.split_once('?').unwrap_or((target, ""));
        let path: Vec<&str> = path.split('/').collect();
        let kind = match path[..] {
            [kind, _] if kind != "chat" => format!("{method} {kind}/id"),
            [kind, _, what] => format!("{method} {kind}/id/{what}"),
            _ => format!("{method} {}", path.join("/")),
        };
        let number = self.log.len();
        self.log.push(kind.clone());
        let of_kind = self.kind_faults.iter().position(|(of, _)| *of == kind);
        let fault = match of_kind {
            Some(place) => Some(self.kind_faults.remove(place).1),
            None => self.faults.remove(&number),
        };
        match fault {
            Some(Fault::Instead(answer)) => answer,
            Some(Fault::HoldBefore) => {
                self.held = true;
                Answer::silent()
            }
            Some(Fault::HoldAfter) => {
                self.carry_out(method, &path, query, request);
                self.held = true;
                Answer::silent()
            }
            Some(Fault::CutAfter) => {
                self.carry_out(method, &path, query, request);
                Answer::dropped()
            }
            None => self.carry_out(method, &path, query, request),
        }
    }

    fn carry_out(&mut self, method: &str, path: &[&str], query: &str, request: &Request) -> Answer {
        match (method, path) {
            ("POST", ["files"]) => self.upload(request),
            ("GET", ["files"]) => {
                let files = self.files.iter().filter(|file| !file.deleted);
                page(&files.map(StoredFile::object).collect::<Vec<_>>(), query)
            }
            ("GET", ["files", id]) => self.with_file(id, |file| {
                let object = file.object();
                file.pending = file.pending.saturating_sub(1);
                Answer::json(200, &object)
            }),
            ("GET", ["files", id, "content"]) => self.with_file(id, |file| Answer::new(200, file.content.clone())),
            ("DELETE", ["files", id]) => self.with_file(id, |file| {
                file.deleted = true;
                Answer::json(200, &json!({"id": file.id, "object": "file", "deleted": true}))
            }),
            ("POST", ["batches"]) => self.create(&request.json()),
            ("GET", ["batches"]) => {
                let batches = self.batches.iter().map(StoredBatch::object);
                page(&batches.collect::<Vec<_>>(), query)
            }
            ("GET", ["batches", id]) => self.look(id),
            ("POST", ["batches", id, "cancel"]) => self.cancel(id),
            ("POST", ["chat", "completions"]) => match self.chat {
                Some(chat) => chat(&request.json()),
                None => Answer::text("C"),
            },
            _ => Answer::error(404, "not_found", "no such route"),
        }
    }

    /// Adds files and batches of other programs.
    pub fn add_strangers(&mut self, count: usize) {
        for i in 0..count {
            self.store(format!("stranger-{i}.jsonl"), b"{}\n".to_vec());
            let mut course = Course::of("failed");
            course.errors = json!({"data": []});
            self.courses.insert(0, course.clone());
            self.batches.push(StoredBatch {
                id: format!("stranger_{i}"),
                body: json!({"metadata": null}),
                requests: Vec::new(),
                course,
                looks: 0,
                cancelled: false,
                output: None,
                errors: None,
            });
        }
    }

    /// All batches complete at the next look.
    pub fn end_batches(&mut self) {
        for batch in &mut self.batches {
            batch.course.states = vec!["completed".to_owned()];
        }
    }

    fn with_file(&mut self, id: &str, act: impl FnOnce(&mut StoredFile) -> Answer) -> Answer {
        let mut files = self.files.iter_mut();
        match files.find(|file| file.id == id && !file.deleted) {
            Some(file) => act(file),
            None => Answer::error(404, "not_found", "no such file"),
        }
    }

    fn upload(&mut self, request: &Request) -> Answer {
        let (purpose, name, content) = form(&request.body);
        if purpose != "batch" {
            return Answer::error(400, "invalid_purpose", "the purpose must be batch");
        }
        if self.most.is_some_and(|most| content.len() > most) {
            return Answer::error(413, "too_large", "the file is too large");
        }
        let id = self.store(name, content);
        let file = self.files.last_mut().unwrap();
        file.pending = self.pending;
        let _ = id;
        Answer::json(200, &file.object())
    }

    fn store(&mut self, name: String, content: Vec<u8>) -> String {
        let id = format!("file-{}", self.files.len() + 1);
        self.files.push(StoredFile { id: id.clone(), name, content, pending: 0, deleted: false });
        id
    }

    fn create(&mut self, body: &Value) -> Answer {
        let number = self.batches.len();
        let course = self.courses.get(number).or(self.courses.last());
        let course = course.unwrap().clone();
        let id = body["input_file_id"].as_str().unwrap_or_default();
        let file = self.files.iter().find(|file| file.id == id && !file.deleted);
        let wrong = match file {
            None => Some("no such file"),
            Some(file) if file.pending > 0 => Some("the file is not processed"),
            _ if body["endpoint"] != "/v1/chat/completions" => Some("unknown endpoint"),
            _ if body["completion_window"] != "24h" => Some("unknown window"),
            Some(_) => None,
        };
        if let Some(wrong) = wrong {
            return Answer::error(400, "invalid_request", wrong);
        }
        let text = String::from_utf8(file.unwrap().content.clone()).unwrap();
        let requests = text.lines().map(|line| serde_json::from_str(line).unwrap());
        let batch = StoredBatch {
            id: format!("batch_{}", number + 1),
            body: body.clone(),
            requests: requests.collect(),
            looks: 0,
            cancelled: false,
            output: None,
            errors: None,
            course,
        };
        let refused = batch.course.refused.clone();
        let object = batch.object();
        // A refused one takes its place in the courses.
        self.batches.push(batch);
        refused.unwrap_or_else(|| Answer::json(200, &object))
    }

    fn look(&mut self, id: &str) -> Answer {
        let Some(place) = self.batches.iter().position(|one| one.id == id) else {
            return Answer::error(404, "not_found", "no such batch");
        };
        self.batches[place].looks += 1;
        let state = self.batches[place].state().to_lowercase();
        let has_ended = ["completed", "expired", "cancelled"].contains(&&*state);
        if has_ended && self.batches[place].output.is_none() && self.batches[place].errors.is_none() {
            let [output, errors] = self.batches[place].results();
            if !output.is_empty() {
                let id = self.store("output.jsonl".into(), output);
                self.batches[place].output = Some(id);
            }
            if !errors.is_empty() {
                let id = self.store("errors.jsonl".into(), errors);
                self.batches[place].errors = Some(id);
            }
        }
        Answer::json(200, &self.batches[place].object())
    }

    fn cancel(&mut self, id: &str) -> Answer {
        let Some(batch) = self.batches.iter_mut().find(|one| one.id == id) else {
            return Answer::error(404, "not_found", "no such batch");
        };
        if !batch.cancelled {
            batch.cancelled = true;
            batch.looks = 0;
            batch.course.states = ["cancelling", "cancelling", "cancelled"].map(str::to_owned).to_vec();
        }
        Answer::json(200, &batch.object())
    }
}

impl StoredFile {
    fn object(&self) -> Value {
        let status = if self.pending > 0 { "pending" } else { "processed" };
        json!({
            "id": self.id, "object": "file", "bytes": self.content.len(), "created_at": 1, "filename": self.name,
            "purpose": "batch", "status": status,
        })
    }
}

impl StoredBatch {
    /// Whether it was not refused at once, and got past its validation.
    fn is_begun(&self) -> bool {
        self.course.refused.is_none() && self.course.errors.is_null()
    }

    fn state(&self) -> &str {
        let states = &self.course.states;
        let place = self.looks.saturating_sub(1).min(states.len() - 1);
        &states[place]
    }

    fn object(&self) -> Value {
        let total = self.requests.len();
        let has_ended = self.output.is_some() || self.errors.is_some();
        let right = (0..total).map(|i| (self.course.line)(i)).filter(|line| matches!(line, Line::Right)).count();
        let is_silent = self.course.is_late_to_count && self.looks <= self.course.late;
        let counted = if is_silent { 0 } else { total };
        let (completed, failed) =
            if has_ended && !is_silent { (right - self.course.uncounted, total - right) } else { (0, 0) };
        json!({
            "id": self.id, "object": "batch", "endpoint": self.body["endpoint"],
            "errors": if self.state() == "failed" { self.course.errors.clone() } else { Value::Null },
            "input_file_id": self.body["input_file_id"], "completion_window": "24h", "status": self.state(),
            "output_file_id": self.output.as_ref().filter(|_| self.looks > self.course.late), "error_file_id": self.errors,
            "created_at": 1, "metadata": self.body["metadata"],
            "request_counts": {"total": counted, "completed": completed, "failed": failed},
        })
    }

    fn completion(&self, text: &str) -> Value {
        json!({
            "model": "m-1", "choices": [{"index": 0, "message": {"content": text}, "finish_reason": "stop"}],
            "usage": {"prompt_tokens": 90, "completion_tokens": self.course.tokens},
        })
    }

    /// The files of replies and of failures.
    fn results(&self) -> [Vec<u8>; 2] {
        let (mut output, mut errors) = (Vec::new(), Vec::new());
        for (i, request) in self.requests.iter().enumerate() {
            match (self.course.line)(i) {
                Line::Right => output.push(reply(request, 200, &self.completion(self.course.text))),
                Line::Ended(word) => {
                    let mut completion = self.completion("");
                    completion["choices"][0]["finish_reason"] = word.into();
                    output.push(reply(request, 200, &completion));
                }
                Line::Status(status, message) => {
                    let body = json!({"error": {"message": message, "type": "x", "param": null, "code": null}});
                    errors.push(reply(request, status, &body));
                }
                Line::Expired => {
                    let error = json!({"code": "batch_expired", "message": "too late"});
                    errors
                        .push(json!({"id": "b", "custom_id": request["custom_id"], "response": null, "error": error}));
                }
                Line::Absent => {}
            }
        }
        match self.course.order {
            Order::Reversed => output.reverse(),
            Order::Twice => {
                let again = self.requests.iter();
                output.extend(again.map(|one| reply(one, 200, &self.completion("A"))));
            }
            Order::AfterFailures => {
                let body = json!({"error": {"message": "first try"}});
                let failures = self.requests.iter().map(|one| reply(one, 500, &body));
                output.splice(0..0, failures);
            }
            Order::AsSent | Order::Cut | Order::Empty => {}
        }
        let text = |lines: Vec<Value>| {
            let lines: Vec<String> = lines.iter().map(|line| format!("{line}\n")).collect();
            lines.concat().into_bytes()
        };
        let (mut output, errors) = (text(output), text(errors));
        match self.course.order {
            Order::Cut => output.truncate(output.len() - 40),
            // A file without lines is one all the same.
            Order::Empty => output = b"\n".to_vec(),
            Order::AsSent | Order::Reversed | Order::Twice | Order::AfterFailures => {}
        }
        [output, errors]
    }
}

fn reply(request: &Value, status: u16, body: &Value) -> Value {
    let response = json!({"status_code": status, "request_id": "r", "body": body});
    json!({"id": "b", "custom_id": request["custom_id"], "response": response, "error": null})
}

/// One page of a list, of two items, so that lists have several pages.
fn page(items: &[Value], query: &str) -> Answer {
    let after = query.split('&').find_map(|pair| pair.strip_prefix("after="));
    let start = after.map_or(0, |after| {
        let place = items.iter().position(|item| item["id"] == after);
        place.map_or(items.len(), |place| place + 1)
    });
    let end = (start + 2).min(items.len());
    Answer::json(200, &json!({"object": "list", "data": items[start..end], "has_more": end < items.len()}))
}

/// The purpose, the name and the content of an uploaded file.
fn form(body: &[u8]) -> (String, String, Vec<u8>) {
    let find = |from: usize, what: &[u8]| {
        let place = body[from..].windows(what.len()).position(|window| window == what);
        from + place.unwrap()
    };
    let boundary = body[..find(0, b"\r\n")].to_vec();
    let text = |from: usize, to: usize| String::from_utf8(body[from..to].to_vec()).unwrap();
    let purpose = find(0, b"\r\n\r\n") + 4;
    let file = find(purpose, b"filename=\"") + 10;
    let content = find(file, b"\r\n\r\n") + 4;
    let tail = [b"\r\n", &boundary[..], b"--\r\n"].concat();
    assert!(body.ends_with(&tail), "the form has no end");
    (
        text(purpose, find(purpose, b"\r\n")),
        text(file, find(file, b"\"")),
        body[content..body.len() - tail.len()].to_vec(),
    )
}
