//! An event of a part, as in the state file: [`Event`].

use serde::{Deserialize, Serialize};

/// Facts about a part from its file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct PartFacts {
    /// SHA-256 of the file, as 64 hexadecimal digits.
    pub sha256: String,
    /// Size of the file in bytes.
    pub bytes: u64,
    /// Number of requests.
    pub requests: usize,
    /// The model that is asked, as the endpoint names it.
    pub model: String,
    /// The model's name in tables; empty in the journals of earlier versions.
    #[serde(default)]
    pub name: String,
    /// The account that is charged: the name of the first model with the same address, key and headers; empty in the journals of earlier
    /// versions.
    #[serde(default)]
    pub account: String,
    /// Address of the model's endpoint, without secrets.
    pub base: String,
    /// The path of each request, as `/v1/chat/completions`.
    pub url: String,
    /// Expected tokens of all prompts.
    pub tokens: f64,
    /// Expected cost in US dollars, at the price of batches; `None` if the model has no known price.
    pub dollars: Option<f64>,
    /// The most that all requests can cost, in US dollars at the price of batches; `None` if the model has no known price, and in the
    /// journals of earlier versions.
    #[serde(default)]
    pub most_dollars: Option<f64>,
    /// The most that one of the requests can cost.
    #[serde(default)]
    pub most_dollars_each: Option<f64>,
}

impl PartFacts {
    /// The scope of a limit of waiting tokens: address and model.
    pub(super) fn place(&self) -> (String, String) {
        (self.base.clone(), self.model.clone())
    }

    /// The most that the requests can cost, in US dollars; 0 if the model has no known price.
    pub(super) fn most_cost(&self) -> f64 {
        self.most_dollars.or(self.dollars).unwrap_or(0.0)
    }

    /// The number of requests that can cost this much in US dollars together; all if the model has no known price.
    pub(super) fn requests_within(&self, dollars: f64) -> usize {
        let each = self.most_dollars_each;
        let each = each.unwrap_or(self.most_cost() / self.requests.max(1) as f64);
        let within = if each > 0.0 {
            dollars / each
        } else {
            f64::INFINITY
        };
        (within.max(0.0) as usize).min(self.requests)
    }

    /// Whether a model of this name and id is the one that is asked.
    pub(super) fn asks(&self, name: &str, id: &str) -> bool {
        self.model == id && (self.name.is_empty() || self.name == name)
    }
}

/// Something that happened to a part, or is about to happen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "event", rename_all = "snake_case")]
pub(crate) enum Event {
    /// The file of the part is written; its requests are the part's from here on.
    Written(PartFacts),
    /// The upload begins.
    Uploading,
    /// The file is at the server.
    Uploaded {
        /// The server's name of the file.
        id: String,
    },
    /// The batch is about to be made.
    Creating {
        /// How often a batch of this part was to be made, this time included.
        attempt: u32,
    },
    /// The batch is made.
    Created {
        /// The server's name of the batch.
        id: String,
    },
    /// Nothing was made by the last call.
    Refused {
        /// The server's words.
        why: String,
    },
    /// The batch was refused, because too many tokens wait for batches.
    QuotaReached {
        /// The number of tokens that may wait; `None` if the server does not state it.
        limit: Option<u64>,
    },
    /// The server named another state of the batch than before.
    Seen {
        /// The state.
        state: String,
    },
    /// The user or `--give-up` asked the server to cancel the batch.
    Cancelled,
    /// The replies are in the batch folder.
    Fetched {
        /// The state in which the batch ended.
        state: String,
        /// The server's names of the files of replies and of failures.
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
    /// The files at the server were to be kept, or could not be deleted.
    Kept,
    /// The part is divided, because it is larger than what the server lets wait.
    Split {
        /// The parts that it became.
        into: Vec<Piece>,
    },
    /// The part ended without a batch; its requests may be asked again.
    GaveUp {
        /// The reason.
        why: String,
    },
}

/// A part that was a piece of a larger one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Piece {
    /// Name of its file.
    pub(super) file: String,
    pub(super) facts: PartFacts,
}
