//! Files and batches as a server describes them: [`RemoteFile`], [`RemoteBatch`].

use serde_json::Value;

use crate::ask::failures::{Complaint, QuotaRefusal};
use crate::ask::secrets::Scrub;

/// A file at a server.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct RemoteFile {
    /// The server's name of the file.
    pub id: String,
    /// The name under which it was uploaded; empty if the server does not state it.
    pub name: String,
    /// The number of bytes; `None` if the server does not state it.
    pub bytes: Option<u64>,
    /// Whether a batch may be made of it.
    pub readiness: Readiness,
}

/// Whether a batch may be made of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Readiness {
    /// It may.
    Ready,
    /// The server is still reading the file, as Azure does after an upload.
    Pending,
    /// The server could not read the file.
    Refused,
}

impl RemoteFile {
    /// The file in a server's object; `None` if the object has no id.
    pub(super) fn read(object: &Value) -> Option<Self> {
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

/// The state of a batch.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum BatchState {
    /// The server works on it; in the server's word.
    Working(String),
    /// The server has ended it, with replies to all or some requests.
    Completed,
    /// The server could not begin it.
    Failed,
    /// Its time is over; there may be replies to some requests.
    Expired,
    /// It was cancelled; there may be replies to some requests.
    Cancelled,
    /// A word that is not known; the batch may still be worked on.
    Unknown(String),
}

impl BatchState {
    /// The states of OpenAI's batches in any case, and the words that other servers have for them.
    pub(super) fn read(word: &str) -> Self {
        match word.to_lowercase().as_str() {
            working @ ("validating" | "queued" | "pending" | "running" | "in_progress"
            | "finalizing" | "cancelling" | "canceling") => Self::Working(working.to_owned()),
            "completed" | "succeeded" => Self::Completed,
            "failed" => Self::Failed,
            "expired" => Self::Expired,
            "cancelled" | "canceled" => Self::Cancelled,
            other => Self::Unknown(Scrub::default().line(other)),
        }
    }

    /// The word for the state.
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

/// The numbers of requests in a batch.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct RequestCounts {
    /// Requests with a reply.
    pub answered: u64,
    /// Requests with a reply or a failure.
    pub done: u64,
    /// All requests; 0 while the server has not counted them.
    pub total: u64,
}

impl RequestCounts {
    /// Whether the server has counted anything.
    pub(crate) fn is_stated(self) -> bool {
        self.total > 0 || self.done > 0
    }
}

/// A batch at a server.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct RemoteBatch {
    /// The server's name of the batch.
    pub id: String,
    /// The state of the batch.
    pub state: BatchState,
    /// The file of replies; `None` if there is none.
    pub output_file: Option<String>,
    /// The file of failed requests; `None` if there is none.
    pub error_file: Option<String>,
    /// The numbers of requests.
    pub counts: RequestCounts,
    /// The first error of a batch that failed, with its line; empty if there is none.
    pub problem: String,
    /// The refusal of a batch that failed because too many tokens wait; `None` if it failed for another reason.
    pub quota: Option<QuotaRefusal>,
    /// The mark that the program gave the batch; empty if it has none.
    pub mark: String,
}

impl RemoteBatch {
    /// The batch in a server's object; `None` if the object has no id or no state.
    pub(super) fn read(object: &Value, scrub: &Scrub) -> Option<Self> {
        let errors = object.get("errors").and_then(|errors| {
            let list = errors.get("data").unwrap_or(errors);
            list.as_array().cloned()
        });
        let errors = errors.unwrap_or_default();
        let counts = object.get("request_counts");
        let count = |name| counts.and_then(|counts| counts.get(name)?.as_u64());
        let mark = object.get("metadata").and_then(|data| text(data, MARK));
        Some(Self {
            id: text(object, "id")?,
            state: BatchState::read(&scrub.line(&text(object, "status")?)),
            output_file: text(object, "output_file_id"),
            error_file: text(object, "error_file_id"),
            counts: RequestCounts {
                answered: count("completed").unwrap_or(0),
                done: count("completed")
                    .unwrap_or(0)
                    .saturating_add(count("failed").unwrap_or(0)),
                total: count("total").unwrap_or(0),
            },
            problem: errors
                .first()
                .map_or_else(String::new, |e| problem(e, scrub)),
            quota: errors.iter().find_map(|error| {
                let complaint = Complaint::from_error(error);
                QuotaRefusal::from_complaint(&complaint, scrub)
            }),
            mark: mark.unwrap_or_default(),
        })
    }
}

/// The field of a batch's metadata that holds the mark of the program.
pub(super) const MARK: &str = "darkqa";

/// An error of a batch, with the line of the input file that it is about.
fn problem(error: &Value, scrub: &Scrub) -> String {
    let complaint = Complaint::from_error(error);
    let text = scrub.line(&complaint.message);
    let text = match &complaint.code {
        Some(code) => format!("{text} ({})", scrub.line(code)),
        None => text,
    };
    match error.get("line").and_then(Value::as_u64) {
        Some(line) => format!("line {line}: {text}"),
        None => text,
    }
}

/// A field that is a text with at least one character.
fn text(object: &Value, field: &str) -> Option<String> {
    let text = object.get(field)?.as_str()?;
    (!text.is_empty()).then(|| text.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn states_are_read_in_any_case_and_unknown_ones_are_kept() {
        for (word, state) in [
            ("in_progress", BatchState::Working("in_progress".into())),
            ("IN_PROGRESS", BatchState::Working("in_progress".into())),
            ("COMPLETED", BatchState::Completed),
            ("canceled", BatchState::Cancelled),
            ("expired", BatchState::Expired),
            ("FAILED", BatchState::Failed),
            ("dreaming", BatchState::Unknown("dreaming".into())),
        ] {
            assert_eq!(BatchState::read(word), state, "{word}");
        }
    }

    #[test]
    fn a_failed_batch_names_its_line_or_its_quota() {
        let read = |errors: Value| {
            let object = json!({"id": "b", "status": "failed", "errors": errors});
            RemoteBatch::read(&object, &Scrub::default()).unwrap()
        };
        let line = read(json!({"object": "list", "data": [
            {"code": "invalid_json_line", "message": "not JSON", "param": null, "line": 7},
        ]}));
        assert_eq!(line.problem, "line 7: not JSON (invalid_json_line)");
        assert_eq!(line.quota, None);
        let full = read(
            json!({"data": [{"code": "token_limit_exceeded", "line": null, "message":
            "Enqueued token limit reached for m in organization o. Limit: 2,000,000 enqueued tokens."}]}),
        );
        let quota = full.quota.unwrap();
        assert_eq!(quota.limit, Some(2_000_000));
        assert_eq!(read(Value::Null).quota, None);
    }
}
