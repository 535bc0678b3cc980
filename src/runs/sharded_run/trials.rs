//! The trials of parts, each once: [`each_once`].

use std::path::Path;

use crate::error::{Error, Result};
use crate::runs::placed_trials::PartLogs;
use crate::types::{KeptTrial, Record, TrialRef, Trials};
use darkqa_score::answers::record::Detail;

/// Keeps each trial of these parts once, whose folders are numbered as the places of the trials: of a trial in two parts the one with a
/// reply, and of two replies that of the first part. Returns the number of trials with different replies in two parts, which were paid
/// for twice.
///
/// # Errors
/// If a trial has another image in another part, or a record cannot be read.
pub(super) fn each_once<D: Detail>(trials: &mut Trials<D>, folders: &[&Path]) -> Result<usize> {
    let mut logs = PartLogs::new(folders);
    let mut twice = 0;
    trials.each_key_once(|first, later| {
        if first.text().log() == later.text().log() {
            return Ok(first.or_later(later));
        }
        let lines = [logs.line(first.text())?, logs.line(later.text())?];
        // A part that goes on with the work of another has a copy of its lines.
        if lines[0] == lines[1] {
            return Ok(KeptTrial::First);
        }
        check_images::<D>(&mut logs, folders, [first, later], &lines)?;
        if first.failed() && !later.failed() {
            return Ok(KeptTrial::Later);
        }
        twice += usize::from(!first.failed() && !later.failed());
        Ok(KeptTrial::First)
    })?;
    Ok(twice)
}

/// Checks that the same image was shown in two parts.
fn check_images<D: Detail>(
    logs: &mut PartLogs<'_>,
    folders: &[&Path],
    trials: [TrialRef<'_, D>; 2],
    lines: &[Vec<u8>; 2],
) -> Result<()> {
    let places = trials.map(TrialRef::text);
    let records: [Record<D>; 2] = [
        logs.record(places[0], &lines[0])?,
        logs.record(places[1], &lines[1])?,
    ];
    let images = records.each_ref().map(|record| record.detail.shown());
    if images[0] == images[1] || images.iter().any(Option::is_none) {
        return Ok(());
    }
    let problem = format!(
        "the trial {} was shown another image than in {}: the images of one of the two have changed; merge one of them alone",
        trials[1].key(),
        folders[places[0].log()].display()
    );
    let path = folders[places[1].log()].to_owned();
    Err(Error::Run { path, problem })
}
