//! The state of a run's parts as text: [`lines`].

use crate::types::text::counted;
use std::collections::BTreeMap;
use std::fmt::Write as _;

use super::journal::Journal;
use super::part::{Part, Stage};

/// One line per part, with its file, requests, batch and state. `states` are current states from the server, by name of
/// the part.
pub(super) fn lines(journal: &Journal, states: &BTreeMap<String, String>) -> String {
    let mut text = String::new();
    for part in &journal.parts {
        let batch = part.batch.as_deref().unwrap_or("no batch");
        let _ = writeln!(
            text,
            "{}: {} to {}, {batch}, {}",
            part.name,
            counted(part.facts.requests, "request"),
            part.facts.model,
            states.get(&part.name).cloned().unwrap_or_else(|| state_words(part))
        );
    }
    text
}

/// The state of a part, in words.
fn state_words(part: &Part) -> String {
    match (&part.stage, part.outcome) {
        (Stage::Written | Stage::Uploading | Stage::Uploaded, _) => "not submitted yet".to_owned(),
        (Stage::Creating, _) => "being submitted".to_owned(),
        (Stage::Created, _) if part.state.is_empty() => "submitted".to_owned(),
        (Stage::Fetched { state }, _) => format!("{state}, fetched"),
        (Stage::Imported | Stage::Ended, Some((answered, failed))) => {
            format!("{}: {answered} answered, {failed} not", part.state)
        }
        (Stage::Created | Stage::Imported | Stage::Ended, _) => part.state.clone(),
    }
}
