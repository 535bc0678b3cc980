//! Responses in OpenAI's format: [`Completion`] and [`RequestFault`].
//!
//! Bounds of the memory that all requests take together: [`MemoryBound`].

use std::sync::Arc;
use std::time::Duration;

use hyper::header::{CONTENT_TYPE, HeaderValue};
use hyper::{Response, StatusCode};
use jiff::Timestamp;
use serde_json::{Value, json};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

/// Content type of a JSON response.
const JSON: &str = "application/json";

/// A response with a body of the content type `kind`.
fn response(status: StatusCode, kind: &'static str, body: String) -> Response<String> {
    let mut response = Response::new(body);
    *response.status_mut() = status;
    let kind = HeaderValue::from_static(kind);
    response.headers_mut().insert(CONTENT_TYPE, kind);
    response
}

/// Form of a response: a single JSON body or a stream of events.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ReplyForm {
    Whole,
    Stream,
}

/// A successful response.
pub(super) struct Completion {
    pub(super) model: String,
    pub(super) text: String,
    pub(super) form: ReplyForm,
}

impl Completion {
    fn head(&self, object: &str) -> Value {
        json!({
            "id": "chatcmpl-darkqa-eval",
            "object": object,
            "created": Timestamp::now().as_second(),
            "model": self.model,
        })
    }

    fn whole(&self) -> Value {
        let mut whole = self.head("chat.completion");
        whole["choices"] = json!([{
            "index": 0,
            "message": {"role": "assistant", "content": self.text, "refusal": null},
            "logprobs": null,
            "finish_reason": "stop",
        }]);
        // Tokens are not counted.
        whole["usage"] = json!({"prompt_tokens": 0, "completion_tokens": 0, "total_tokens": 0});
        whole
    }

    fn events(&self) -> String {
        let delta = json!({"role": "assistant", "content": self.text});
        self.chunk(&delta, &Value::Null) + &self.chunk(&json!({}), &json!("stop")) + "data: [DONE]\n\n"
    }

    fn chunk(&self, delta: &Value, finish: &Value) -> String {
        let mut chunk = self.head("chat.completion.chunk");
        chunk["choices"] = json!([{"index": 0, "delta": delta, "finish_reason": finish}]);
        format!("data: {chunk}\n\n")
    }
}

impl From<Completion> for Response<String> {
    fn from(completion: Completion) -> Self {
        let (kind, body) = match completion.form {
            ReplyForm::Whole => (JSON, completion.whole().to_string()),
            ReplyForm::Stream => ("text/event-stream", completion.events()),
        };
        response(StatusCode::OK, kind, body)
    }
}

/// An error response.
#[derive(Debug)]
pub(super) struct RequestFault {
    status: StatusCode,
    message: String,
    parameter: Option<&'static str>,
    code: Option<&'static str>,
}

impl RequestFault {
    pub(super) fn new(status: StatusCode, message: impl Into<String>) -> Self {
        Self { status, message: message.into(), parameter: None, code: None }
    }

    /// Adds the name of the invalid parameter and an error code.
    pub(super) fn at(self, parameter: &'static str, code: &'static str) -> Self {
        Self { parameter: Some(parameter), code: Some(code), ..self }
    }
}

impl From<RequestFault> for Response<String> {
    fn from(fault: RequestFault) -> Self {
        let kind = if fault.status.is_server_error() { "server_error" } else { "invalid_request_error" };
        let error = json!({
            "message": fault.message,
            "type": kind,
            "param": fault.parameter,
            "code": fault.code,
        });
        response(fault.status, JSON, json!({ "error": error }).to_string())
    }
}

/// The response that lists the models.
pub(super) fn models<'a>(names: impl Iterator<Item = &'a str>) -> Response<String> {
    let models = names.map(|name| json!({"id": name, "object": "model", "created": 0, "owned_by": "darkqa-eval"}));
    let list = json!({"object": "list", "data": models.collect::<Vec<_>>()});
    response(StatusCode::OK, JSON, list.to_string())
}

/// Maximum time that a request waits for others to end (chosen).
const MAX_WAIT: Duration = Duration::from_secs(10);

/// Amount that all requests in flight may take together. A request waits until its share is free.
pub(super) struct MemoryBound {
    free: Arc<Semaphore>,
    /// Size of a permit: one permit is this much.
    unit: usize,
    /// In units.
    whole: usize,
    /// Name of what is bounded, with its whole amount.
    name: String,
}

impl MemoryBound {
    /// A bound of `whole` units of `unit` each.
    pub(super) fn new(whole: usize, unit: usize, name: String) -> Self {
        Self { free: Arc::new(Semaphore::new(whole)), unit, whole, name }
    }

    /// Takes a share until the returned permit is dropped.
    ///
    /// # Errors
    /// 503 if the share is not free in time.
    pub(super) async fn take(&self, amount: usize) -> Result<OwnedSemaphorePermit, RequestFault> {
        let units = amount.div_ceil(self.unit).min(self.whole) as u32;
        let free = Arc::clone(&self.free).acquire_many_owned(units);
        if let Ok(Ok(permit)) = tokio::time::timeout(MAX_WAIT, free).await {
            return Ok(permit);
        }
        let message =
            format!("the requests in flight together have {}: send fewer or smaller ones at a time", self.name);
        Err(RequestFault::new(StatusCode::SERVICE_UNAVAILABLE, message))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test(start_paused = true)]
    async fn a_share_is_taken_until_it_is_dropped() {
        let bound = MemoryBound::new(4, 1024, "4 KiB".to_owned());
        let first = bound.take(2048).await.ok();
        let second = bound.take(2000).await.ok();
        assert!(first.is_some() && second.is_some());
        let fault = bound.take(1).await.err().unwrap();
        let response = hyper::Response::<String>::from(fault);
        assert_eq!(response.status(), StatusCode::SERVICE_UNAVAILABLE);
        assert!(response.body().contains("4 KiB"), "{}", response.body());
        drop(first);
        assert!(bound.take(1).await.is_ok());
        drop(second);
        // More than the whole takes the whole.
        assert!(bound.take(1 << 20).await.is_ok());
    }
}
