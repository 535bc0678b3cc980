//! The state of a run's parts as text: [`lines`].

use std::collections::BTreeMap;
use std::fmt::Write as _;

use super::journal::Journal;
use super::part::{Part, Stage};

/// One line a part: its file, requests, batch and state.
///
/// `states` has the states of parts that the server was just asked about, by name.
pub(super) fn lines(journal: &Journal, states: &BTreeMap<String, String>) -> String {
    let mut text = String::new();
    for part in &journal.parts {
        let batch = part.batch.as_deref().unwrap_or("no batch");
        let _ = writeln!(
            text,
            "{}: {} requests to {}, {batch}, {}",
            part.name,
            part.facts.requests,
            part.facts.model,
            states
                .get(&part.name)
                .cloned()
                .unwrap_or_else(|| state(part))
        );
    }
    text
}

/// The state of a part, in words.
fn state(part: &Part) -> String {
    match (&part.stage, part.outcome) {
        (Stage::Written | Stage::Uploading | Stage::Uploaded, _) => "not submitted yet".to_owned(),
        (Stage::Creating, _) => "being submitted".to_owned(),
        (Stage::Created, _) if part.state.is_empty() => "submitted".to_owned(),
        (Stage::Fetched { state }, _) => format!("{state}, fetched"),
        (Stage::TakenOver | Stage::Ended, Some((answered, failed))) => {
            format!("{}: {answered} answered, {failed} not", part.state)
        }
        (Stage::Created | Stage::TakenOver | Stage::Ended, _) => part.state.clone(),
    }
}
