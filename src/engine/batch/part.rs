//! An input file and its batch: [`Part`].

use super::event::{Event, PartFacts};

/// Progress of a part.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Stage {
    /// The file is written.
    Written,
    /// The file may be at the server.
    Uploading,
    /// The file is at the server.
    Uploaded,
    /// The batch may exist at the server.
    Creating,
    /// The batch exists, and is not known to have ended.
    Created,
    /// The output is in the batch folder.
    Fetched {
        /// Final state of the batch.
        state: String,
    },
    /// The replies are in the records.
    Imported,
    /// Nothing is left to do.
    Ended,
}

/// An input file and its batch.
#[derive(Debug, Clone)]
pub(crate) struct Part {
    /// Name of the file in the batch folder.
    pub(super) name: String,
    pub(super) facts: PartFacts,
    pub(super) stage: Stage,
    /// Number of attempts to create a batch.
    pub(super) attempt: u32,
    /// True if a creation was refused or its batch was not found, so that a batch may exist all the same.
    pub(super) in_doubt: bool,
    /// Number of attempts to upload the file.
    pub(super) uploads: u32,
    /// Ids of the files at the server, the input file first.
    pub(super) files: Vec<String>,
    /// Id of the batch at the server; `None` before it is created.
    pub(super) batch: Option<String>,
    /// Time at which the batch was created, in UTC; empty before.
    pub(super) created: String,
    /// Last state reported by the server, or the reason why the part ended without a batch; empty before.
    pub(super) state: String,
    /// True if the server was asked to cancel the batch.
    pub(super) cancelled: bool,
    /// Numbers of requests with and without a reply; `None` before the replies are imported.
    pub(super) outcome: Option<(usize, usize)>,
}

impl Part {
    pub(super) fn new(name: &str, facts: PartFacts) -> Self {
        Self {
            name: name.to_owned(),
            facts,
            stage: Stage::Written,
            attempt: 0,
            in_doubt: false,
            uploads: 0,
            files: Vec::new(),
            batch: None,
            created: String::new(),
            state: String::new(),
            cancelled: false,
            outcome: None,
        }
    }

    /// The name without the extension.
    pub(super) fn stem(&self) -> &str {
        self.name.strip_suffix(".jsonl").unwrap_or(&self.name)
    }

    /// True if the batch exists or may exist at the server.
    pub(super) fn is_out(&self) -> bool {
        matches!(self.stage, Stage::Creating | Stage::Created)
    }

    /// True if the batch may have costs that are not in the records yet.
    pub(super) fn may_cost(&self) -> bool {
        self.is_out() || matches!(self.stage, Stage::Fetched { .. })
    }

    /// True if the batch is still to be created.
    pub(super) fn is_unsubmitted(&self) -> bool {
        matches!(self.stage, Stage::Written | Stage::Uploading | Stage::Uploaded)
    }

    /// Updates the part by an event at a time in UTC.
    pub(super) fn apply(&mut self, event: &Event, at: &str) {
        self.stage = match event {
            Event::Written(facts) => {
                self.facts = facts.clone();
                Stage::Written
            }
            Event::Uploading => {
                self.uploads += 1;
                Stage::Uploading
            }
            Event::Uploaded { id } => {
                self.files = vec![id.clone()];
                Stage::Uploaded
            }
            Event::Creating { attempt } => {
                self.attempt = *attempt;
                Stage::Creating
            }
            Event::Created { id } => {
                self.batch = Some(id.clone());
                self.state.clear();
                at.clone_into(&mut self.created);
                Stage::Created
            }
            Event::Refused { .. } if self.stage == Stage::Creating => {
                self.in_doubt = true;
                Stage::Uploaded
            }
            Event::Refused { .. } => Stage::Written,
            Event::QuotaReached { .. } => {
                self.batch = None;
                Stage::Uploaded
            }
            Event::Seen { state } => {
                self.state.clone_from(state);
                return;
            }
            Event::Cancelled => {
                self.cancelled = true;
                return;
            }
            Event::Fetched { state, files } => {
                self.state.clone_from(state);
                self.files.extend(files.iter().cloned());
                Stage::Fetched { state: state.clone() }
            }
            Event::TakenOver { answered, failed } => {
                self.outcome = Some((*answered, *failed));
                Stage::Imported
            }
            Event::Split { .. } => {
                "divided into smaller parts".clone_into(&mut self.state);
                Stage::Ended
            }
            Event::GaveUp { why } => {
                self.state.clone_from(why);
                Stage::Ended
            }
            Event::Deleted | Event::Kept => Stage::Ended,
        };
    }
}
