//! Files and batches as a server describes them: [`RemoteFile`], [`RemoteBatch`].

use serde_json::Value;

use crate::ask::failures::{ApiError, QuotaRefusal};
use crate::ask::secrets::Scrub;

/// A file at a server.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct RemoteFile {
    /// Id of the file at the server.
    pub id: String,
    /// Name under which it was uploaded; empty if the server does not report it.
    pub name: String,
    /// Size in bytes; `None` if the server does not report it.
    pub bytes: Option<u64>,
    /// Whether a batch can be created from it.
    pub readiness: Readiness,
}

/// Whether a batch can be created from a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Readiness {
    /// A batch can be created.
    Ready,
    /// The server is still processing the file, as Azure does after an upload.
    Pending,
    /// The server could not read the file.
    Refused,
}

impl RemoteFile {
    /// Parses a file object; `None` if it has no id.
    pub(super) fn from_json(object: &Value) -> Option<Self> {
        let status = object.get("status").and_then(Value::as_str);
        let readiness = match status.unwrap_or_default().to_lowercase().as_str() {
            "pending" | "running" | "uploading" | "processing" => Readiness::Pending,
            "error" | "failed" => Readiness::Refused,
            _ => Readiness::Ready,
        };
        Some(Self {
            id: object.get("id")?.as_str()?.to_owned(),
            name: text(object, "filename").unwrap_or_default(),
            bytes: object.get("bytes").and_then(Value::as_u64),
            readiness,
        })
    }
}

/// State of a batch.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum BatchState {
    /// The server is working on it; with the server's name of the state.
    Working(String),
    /// Completed, with replies to all or some requests.
    Completed,
    /// The server could not start it.
    Failed,
    /// Its completion window has ended; some requests may have replies.
    Expired,
    /// Cancelled; some requests may have replies.
    Cancelled,
    /// An unknown state; the server may still be working on it.
    Unknown(String),
}

impl BatchState {
    /// Parses the name of a state, of OpenAI or of another server, ignoring case.
    pub(super) fn from_name(word: &str) -> Self {
        match word.to_lowercase().as_str() {
            working @ ("validating" | "queued" | "pending" | "running" | "in_progress" | "finalizing"
            | "cancelling" | "canceling") => Self::Working(working.to_owned()),
            "completed" | "succeeded" => Self::Completed,
            "failed" => Self::Failed,
            "expired" => Self::Expired,
            "cancelled" | "canceled" => Self::Cancelled,
            other => Self::Unknown(Scrub::default().line(other)),
        }
    }

    /// Name of the state.
    pub(crate) fn word(&self) -> &str {
        match self {
            Self::Working(word) | Self::Unknown(word) => word,
            Self::Completed => "completed",
            Self::Failed => "failed",
            Self::Expired => "expired",
            Self::Cancelled => "cancelled",
        }
    }
}

/// Numbers of requests in a batch.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct RequestCounts {
    /// Requests with a reply.
    pub answered: u64,
    /// Requests with a reply or a failure.
    pub done: u64,
    /// All requests; 0 until the server has counted them.
    pub total: u64,
}

impl RequestCounts {
    /// True if the server reports counts.
    pub(crate) fn is_known(self) -> bool {
        self.total > 0 || self.done > 0
    }
}

/// A batch at a server.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct RemoteBatch {
    /// Id of the batch at the server.
    pub id: String,
    /// State of the batch.
    pub state: BatchState,
    /// Id of the file of replies; `None` if it does not exist.
    pub output_file: Option<String>,
    /// Id of the file of failed requests; `None` if it does not exist.
    pub error_file: Option<String>,
    /// Numbers of requests.
    pub counts: RequestCounts,
    /// First error of a failed batch, with its line; empty without one.
    pub problem: String,
    /// Refusal because too many tokens are enqueued; `None` if the batch did not fail or failed for another reason.
    pub quota: Option<QuotaRefusal>,
    /// Mark of the program in the metadata; empty if it has none.
    pub mark: String,
}

impl RemoteBatch {
    /// Parses a batch object; `None` if it has no id or no state.
    pub(super) fn from_json(object: &Value, scrub: &Scrub) -> Option<Self> {
        let errors = object
            .get("errors")
            .and_then(|errors| errors.get("data").unwrap_or(errors).as_array())
            .map_or(&[][..], Vec::as_slice);
        let counts = object.get("request_counts");
        let mark = object.get("metadata").and_then(|data| text(data, MARK));
        Some(Self {
            id: text(object, "id")?,
            state: BatchState::from_name(&scrub.line(&text(object, "status")?)),
            output_file: text(object, "output_file_id"),
            error_file: text(object, "error_file_id"),
            counts: RequestCounts {
                answered: count(counts, "completed"),
                done: count(counts, "completed").saturating_add(count(counts, "failed")),
                total: count(counts, "total"),
            },
            problem: errors.first().map_or_else(String::new, |e| problem(e, scrub)),
            quota: errors.iter().find_map(|error| {
                let api_error = ApiError::from_error(error);
                QuotaRefusal::from_api_error(&api_error, scrub)
            }),
            mark: mark.unwrap_or_default(),
        })
    }
}

/// Number of requests by its name in `request_counts`; 0 if absent.
fn count(counts: Option<&Value>, name: &str) -> u64 {
    counts.and_then(|counts| counts.get(name)?.as_u64()).unwrap_or(0)
}

/// Field of a batch's metadata with the mark of the program.
pub(super) const MARK: &str = "darkqa";

/// Message of a batch error, with the line number in the input file.
fn problem(error: &Value, scrub: &Scrub) -> String {
    let api_error = ApiError::from_error(error);
    let text = scrub.line(&api_error.message);
    let text = match &api_error.code {
        Some(code) => format!("{text} ({})", scrub.line(code)),
        None => text,
    };
    match error.get("line").and_then(Value::as_u64) {
        Some(line) => format!("line {line}: {text}"),
        None => text,
    }
}

/// A non-empty string in a field of an object.
fn text(object: &Value, field: &str) -> Option<String> {
    let text = object.get(field)?.as_str()?;
    (!text.is_empty()).then(|| text.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn states_are_parsed_in_any_case() {
        for (word, state) in [
            ("in_progress", BatchState::Working("in_progress".into())),
            ("IN_PROGRESS", BatchState::Working("in_progress".into())),
            ("COMPLETED", BatchState::Completed),
            ("canceled", BatchState::Cancelled),
            ("expired", BatchState::Expired),
            ("FAILED", BatchState::Failed),
            ("dreaming", BatchState::Unknown("dreaming".into())),
        ] {
            assert_eq!(BatchState::from_name(word), state, "{word}");
        }
    }

    fn failed_batch(errors: &Value) -> RemoteBatch {
        let object = json!({"id": "b", "status": "failed", "errors": errors});
        RemoteBatch::from_json(&object, &Scrub::default()).unwrap()
    }

    #[test]
    fn a_failed_batch_has_its_line_or_quota() {
        let line = failed_batch(&json!({"object": "list", "data": [
            {"code": "invalid_json_line", "message": "not JSON", "param": null, "line": 7},
        ]}));
        assert_eq!(line.problem, "line 7: not JSON (invalid_json_line)");
        assert_eq!(line.quota, None);
        let full = failed_batch(&json!({"data": [{"code": "token_limit_exceeded", "line": null, "message":
            "Enqueued token limit reached for m in organization o. Limit: 2,000,000 enqueued tokens."}]}));
        let quota = full.quota.unwrap();
        assert_eq!(quota.limit, Some(2_000_000));
        assert_eq!(failed_batch(&Value::Null).quota, None);
    }
}
