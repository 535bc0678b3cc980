//! The response, a [`Completion`] or a [`RequestFault`], in OpenAI's format.

use axum::Json;
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use jiff::Timestamp;
use serde_json::{Value, json};

/// The form of a response: one JSON body or a stream of events.
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
        let chunk = |delta: Value, finish: Value| {
            let mut chunk = self.head("chat.completion.chunk");
            chunk["choices"] = json!([{"index": 0, "delta": delta, "finish_reason": finish}]);
            format!("data: {chunk}\n\n")
        };
        let delta = json!({"role": "assistant", "content": self.text});
        chunk(delta, Value::Null) + &chunk(json!({}), json!("stop")) + "data: [DONE]\n\n"
    }
}

impl IntoResponse for Completion {
    fn into_response(self) -> Response {
        match self.form {
            ReplyForm::Whole => Json(self.whole()).into_response(),
            ReplyForm::Stream => {
                let kind = [(header::CONTENT_TYPE, "text/event-stream")];
                (kind, self.events()).into_response()
            }
        }
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
        Self {
            status,
            message: message.into(),
            parameter: None,
            code: None,
        }
    }

    /// The same error, with the name of the wrong parameter and a code.
    pub(super) fn at(self, parameter: &'static str, code: &'static str) -> Self {
        Self {
            parameter: Some(parameter),
            code: Some(code),
            ..self
        }
    }
}

impl IntoResponse for RequestFault {
    fn into_response(self) -> Response {
        let kind = if self.status.is_server_error() {
            "server_error"
        } else {
            "invalid_request_error"
        };
        let error = json!({
            "message": self.message,
            "type": kind,
            "param": self.parameter,
            "code": self.code,
        });
        (self.status, Json(json!({ "error": error }))).into_response()
    }
}

/// The response with the list of models.
pub(super) fn models<'a>(names: impl Iterator<Item = &'a str>) -> Response {
    let models = names.map(
        |name| json!({"id": name, "object": "model", "created": 0, "owned_by": "darkqa-eval"}),
    );
    let list = json!({"object": "list", "data": models.collect::<Vec<_>>()});
    Json(list).into_response()
}
