//! The trials of parts, each once: [`unique`].

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::path::Path;

use crate::error::{Error, Result};
use crate::job::placed_trials::{PartLogs, PlacedTrial};
use crate::types::{Detail, Record};

/// The trials of several parts, each once, and how many replies were paid for twice.
pub(super) struct Unique {
    /// Each trial with the index of its part.
    pub(super) trials: Vec<(usize, PlacedTrial)>,
    /// Number of trials with different replies in two parts, of which the later is left out.
    pub(super) twice: usize,
}

/// The trials of these parts. Of a trial in two parts the one with a reply is taken, and of two replies that of the first part.
///
/// # Errors
/// If a trial has another image in another part, or a record cannot be read.
pub(super) fn unique<D: Detail>(folders: &[&Path], parts: Vec<Vec<PlacedTrial>>) -> Result<Unique> {
    let mut places = HashMap::new();
    let mut logs = PartLogs::of(folders);
    let mut trials: Vec<(usize, PlacedTrial)> = Vec::new();
    let mut twice = 0;
    for (part, own) in parts.into_iter().enumerate() {
        for trial in own {
            let first = match places.entry(trial.key) {
                Entry::Vacant(place) => {
                    place.insert(trials.len());
                    trials.push((part, trial));
                    continue;
                }
                Entry::Occupied(place) => &mut trials[*place.get()],
            };
            let lines = [
                logs.line(first.0, first.1.place)?,
                logs.line(part, trial.place)?,
            ];
            // A part that goes on with the work of another has a copy of its lines.
            if lines[0] == lines[1] {
                continue;
            }
            let records: [Record<D>; 2] = [
                logs.record(first.0, &lines[0])?,
                logs.record(part, &lines[1])?,
            ];
            let images = records.each_ref().map(|record| record.detail.shown());
            if images[0] != images[1] && images.iter().all(Option::is_some) {
                let problem = format!(
                    "the trial {} was shown another image than in {}: the images of one of the two have changed; merge one of them alone",
                    trial.key,
                    folders[first.0].display()
                );
                let path = folders[part].to_owned();
                return Err(Error::Run { path, problem });
            }
            match (first.1.failed(), trial.failed()) {
                (true, false) => *first = (part, trial),
                (false, false) => twice += 1,
                (_, true) => {}
            }
        }
    }
    Ok(Unique { trials, twice })
}
