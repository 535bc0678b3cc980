//! Removes duplicate trials of shards: [`remove_duplicates`].

use std::path::Path;

use crate::error::{Error, Result};
use crate::runs::shard_records::ShardLogs;
use crate::types::{KeptTrial, Record, TrialRef, Trials};
use darkqa_score::answers::record::Detail;

/// Keeps each trial once: the one with a reply, or the one from the first shard if both have a reply. `folders` are the
/// folders of the shards, by the file numbers in the places of the trials. Returns the number of trials with different
/// replies in two shards, which were paid for twice.
///
/// # Errors
/// If the same trial has different images in two shards, or a record cannot be read.
pub(super) fn remove_duplicates<D: Detail>(trials: &mut Trials<D>, folders: &[&Path]) -> Result<usize> {
    let mut logs = ShardLogs::new(folders);
    let mut paid_twice = 0;
    trials.keep_one_per_key(|first, later| {
        if first.text().log() == later.text().log() {
            return Ok(first.or_later(later));
        }
        let lines = [logs.line(first.text())?, logs.line(later.text())?];
        // A shard that continued the work of another one has copies of its lines.
        if lines[0] == lines[1] {
            return Ok(KeptTrial::First);
        }
        check_images::<D>(&mut logs, folders, [first, later], &lines)?;
        if first.failed() && !later.failed() {
            return Ok(KeptTrial::Later);
        }
        paid_twice += usize::from(!first.failed() && !later.failed());
        Ok(KeptTrial::First)
    })?;
    Ok(paid_twice)
}

/// Checks that a trial has the same image in two shards.
fn check_images<D: Detail>(
    logs: &mut ShardLogs<'_>,
    folders: &[&Path],
    trials: [TrialRef<'_, D>; 2],
    lines: &[Vec<u8>; 2],
) -> Result<()> {
    let places = trials.map(TrialRef::text);
    let records: [Record<D>; 2] = [logs.record(places[0], &lines[0])?, logs.record(places[1], &lines[1])?];
    let images = records.each_ref().map(|record| record.detail.sent_digest());
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
