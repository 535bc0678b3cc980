//! One input file and its batch: [`Part`].

use super::event::{Event, PartFacts};

/// How far a part has come.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Stage {
    /// Its file is written.
    Written,
    /// Its file may be at the server.
    Uploading,
    /// Its file is at the server.
    Uploaded,
    /// Its batch may have been made.
    Creating,
    /// Its batch is made, and not known to have ended.
    Created,
    /// Its replies are in the batch folder.
    Fetched {
        /// The state in which the batch ended.
        state: String,
    },
    /// Its replies are in the records.
    TakenOver,
    /// Nothing is left to do.
    Ended,
}

/// One input file and its batch.
#[derive(Debug, Clone)]
pub(crate) struct Part {
    /// Name of the file in the batch folder.
    pub(super) name: String,
    pub(super) facts: PartFacts,
    pub(super) stage: Stage,
    /// How often a batch of this part was to be made.
    pub(super) attempt: u32,
    /// Whether a batch that was to be made was refused or not found, so that it may exist all the same.
    pub(super) in_doubt: bool,
    /// How often its file was to be uploaded.
    pub(super) uploads: u32,
    /// The server's names of its files: the input file first.
    pub(super) files: Vec<String>,
    /// The server's name of the batch; `None` before it is made.
    pub(super) batch: Option<String>,
    /// When the batch was made, in UTC; empty before.
    pub(super) created: String,
    /// The last state that the server named, or why the part ended without a batch; empty before.
    pub(super) state: String,
    /// Whether the server was asked to cancel the batch.
    pub(super) cancelled: bool,
    /// Numbers of replies and of requests without a reply, after they were taken over.
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

    /// Whether its requests are at the server, or may be.
    pub(super) fn is_out(&self) -> bool {
        matches!(self.stage, Stage::Creating | Stage::Created)
    }

    /// Whether its batch costs something that the records do not have yet, or may cost it.
    pub(super) fn may_cost(&self) -> bool {
        self.is_out() || matches!(self.stage, Stage::Fetched { .. })
    }

    /// Whether its batch still has to be made.
    pub(super) fn is_unsubmitted(&self) -> bool {
        matches!(
            self.stage,
            Stage::Written | Stage::Uploading | Stage::Uploaded
        )
    }

    /// Changes the part by what happened to it at a time in UTC.
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
                Stage::Fetched {
                    state: state.clone(),
                }
            }
            Event::TakenOver { answered, failed } => {
                self.outcome = Some((*answered, *failed));
                Stage::TakenOver
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
