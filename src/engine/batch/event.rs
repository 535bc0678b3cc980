//! Events of a part in the journal: [`Event`].

use serde::{Deserialize, Serialize};

/// Facts about a part and its file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct PartFacts {
    /// SHA-256 of the file, as 64 hexadecimal digits.
    pub sha256: String,
    /// Size of the file in bytes.
    pub bytes: u64,
    /// Number of requests.
    pub requests: usize,
    /// The model's id at the endpoint.
    pub model: String,
    /// The model's name in tables; empty in journals of earlier versions.
    #[serde(default)]
    pub name: String,
    /// The charged account: the name of the first model with the same base URL, key and headers; empty in journals of
    /// earlier versions.
    #[serde(default)]
    pub account: String,
    /// Base URL of the model's endpoint, without secrets.
    pub base: String,
    /// Path of each request, for example `/v1/chat/completions`.
    pub url: String,
    /// Expected tokens of all prompts.
    pub tokens: f64,
    /// Expected cost in US dollars, at the price of batches; `None` if the model has no known price.
    pub dollars: Option<f64>,
    /// Maximum cost of all requests in US dollars, at the price of batches; `None` if the model has no known price, and
    /// in journals of earlier versions.
    #[serde(default)]
    pub most_dollars: Option<f64>,
    /// Maximum cost of a single request, in US dollars.
    #[serde(default)]
    pub most_dollars_each: Option<f64>,
}

impl PartFacts {
    /// The scope of a limit of waiting tokens: base URL and model id.
    pub(super) fn quota_scope(&self) -> (String, String) {
        (self.base.clone(), self.model.clone())
    }

    /// Maximum cost of the requests, in US dollars; 0 if the model has no known price.
    pub(super) fn max_cost(&self) -> f64 {
        self.most_dollars.or(self.dollars).unwrap_or(0.0)
    }

    /// The number of requests whose maximum cost is within `dollars`; all if the model has no known price.
    pub(super) fn requests_within(&self, dollars: f64) -> usize {
        let each = self.most_dollars_each.unwrap_or(self.max_cost() / self.requests.max(1) as f64);
        let within = if each > 0.0 { dollars / each } else { f64::INFINITY };
        (within.max(0.0) as usize).min(self.requests)
    }

    /// True if the part asks the model with this name and id.
    pub(super) fn asks(&self, name: &str, id: &str) -> bool {
        self.model == id && (self.name.is_empty() || self.name == name)
    }
}

/// An event that has happened to a part, or that is about to happen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "event", rename_all = "snake_case")]
pub(crate) enum Event {
    /// The file of the part is written.
    Written(PartFacts),
    /// The upload begins.
    Uploading,
    /// The file is at the server.
    Uploaded {
        /// The server's id of the file.
        id: String,
    },
    /// The batch is about to be created.
    Creating {
        /// Number of attempts to create a batch of this part, including this one.
        attempt: u32,
    },
    /// The batch is created.
    Created {
        /// The server's id of the batch.
        id: String,
    },
    /// The last call had no effect.
    Refused {
        /// The server's message.
        why: String,
    },
    /// The batch was refused, because too many tokens are waiting for batches.
    QuotaReached {
        /// Maximum number of waiting tokens; `None` if the server does not state it.
        limit: Option<u64>,
    },
    /// The server reports a new state of the batch.
    Seen {
        /// The state.
        state: String,
    },
    /// The user or `--give-up` asked the server to cancel the batch.
    Cancelled,
    /// The output is downloaded into the batch folder.
    Fetched {
        /// Final state of the batch.
        state: String,
        /// The server's ids of the output file and the error file.
        files: Vec<String>,
    },
    /// The replies are in the records of the run.
    TakenOver {
        /// Number of replies.
        answered: usize,
        /// Number of requests without a reply.
        failed: usize,
    },
    /// The files at the server are deleted.
    Deleted,
    /// The files at the server are kept, or could not be deleted.
    Kept,
    /// The part is split, because it exceeds a limit.
    Split {
        /// The new parts.
        into: Vec<Piece>,
    },
    /// The part ended without a batch; its requests may be asked again.
    GaveUp {
        /// The reason.
        why: String,
    },
}

/// A new part that was split off a larger one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Piece {
    /// File name.
    pub(super) file: String,
    pub(super) facts: PartFacts,
}
