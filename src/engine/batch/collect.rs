//! Steps of a part after its batch is created: checking it, downloading its output, deleting its files.

use std::collections::BTreeSet;
use std::fs;
use std::path::PathBuf;

use jiff::Timestamp;
use tokio::time::sleep;

use super::driver::{Driver, Goal, StepOutcome};
use super::journal::{BatchPart, PartEvent};
use super::replies::for_each_line;
use darkqa_ask::batch_api::{ApiResult, BatchState, RemoteBatch};
use darkqa_base::error::{Error, Result};
use darkqa_score::answers::record::Detail;

/// Maximum size of a reply in bytes; chosen: far more than the longest reply of a reasoning model.
const MAX_REPLY_BYTES: u64 = 4 << 20;

/// Maximum number of checks of an ended batch that wait until its files have as many lines as the server counts;
/// chosen: 19 minutes with the default of `--poll`.
const MAX_INCOMPLETE: u32 = 10;

/// The same for batches that the user cancels; chosen to be lower, because the user waits.
const MAX_INCOMPLETE_CANCELLED: u32 = 6;

/// Maximum number of attempts to delete a file; chosen.
const MAX_DELETIONS: usize = 3;

impl<D: Detail> Driver<'_, D> {
    /// Checks the batch of a part, at most once between two waits.
    pub(super) async fn check_batch(&mut self, part: usize) -> Result<StepOutcome> {
        let Some(id) = self.part(part).batch.clone() else {
            return Ok(StepOutcome::Waiting);
        };
        if !self.notes.checked.insert(part) {
            return Ok(StepOutcome::Waiting);
        }
        if self.until == Goal::Cancelled && !self.part(part).cancelled {
            self.cancel(part, &id).await?;
        }
        let batch = match self.server(part)?.batch(&id).await {
            Ok(batch) => batch,
            Err(failure) => return self.check_failed(part, &failure),
        };
        self.notes.refused_checks.remove(&part);
        let state = batch.state.word().to_owned();
        if state != self.part(part).state {
            self.journal.record(part, PartEvent::Seen { state })?;
        }
        let (done, total) = (batch.counts.done, batch.counts.total);
        match &batch.state {
            BatchState::Working(word) => {
                self.say(part, &format!("{word}, {done} of {total}"));
                self.cancel_if_late(part, &id).await?;
                Ok(StepOutcome::Waiting)
            }
            BatchState::Unknown(word) => {
                let name = self.part(part).name.clone();
                self.warn_once(format!(
                    "{name}: the server states {word:?} for its batch {id}, which is not a known state; it is checked again until it has \
                     ended"
                ));
                Ok(StepOutcome::Waiting)
            }
            BatchState::Failed if batch.output_file.is_none() && batch.counts.answered == 0 => {
                self.batch_failed(part, &batch)
            }
            // A batch that failed midway may have answered some of its requests.
            BatchState::Failed | BatchState::Completed | BatchState::Expired | BatchState::Cancelled => {
                self.fetch(part, &batch).await
            }
        }
    }

    async fn cancel(&mut self, part: usize, id: &str) -> Result<()> {
        match self.server(part)?.cancel(id).await {
            Ok(()) => self.journal.record(part, PartEvent::Cancelled),
            // The batch may have ended before; the next check finds out.
            Err(failure) => {
                let name = self.part(part).name.clone();
                self.warn_once(format!("{name}: not cancelled yet: {failure}"));
                Ok(())
            }
        }
    }

    /// Cancels a batch that has not ended after `--give-up`.
    async fn cancel_if_late(&mut self, part: usize, id: &str) -> Result<()> {
        let created = self.part(part).created.parse::<Timestamp>().ok();
        let (Some(hours), Some(created)) = (self.args.give_up, created) else {
            return Ok(());
        };
        let worked_hours = Timestamp::now().duration_since(created).as_secs_f64() / 3600.0;
        if worked_hours < hours || self.part(part).cancelled {
            return Ok(());
        }
        self.warn_once(format!(
            "{}: cancelled, as it has not ended after {hours} hours (--give-up)",
            self.part(part).name
        ));
        self.cancel(part, id).await
    }

    /// Gives up a batch that failed without any reply.
    ///
    /// # Errors
    /// Always, unless the batch failed because too many tokens are waiting.
    fn batch_failed(&mut self, part: usize, batch: &RemoteBatch) -> Result<StepOutcome> {
        if let Some(quota) = &batch.quota {
            return self.quota_reached(part, quota);
        }
        let problem = match batch.problem.as_str() {
            "" => "the server does not say why",
            problem => problem,
        };
        let why = format!("the batch {} failed: {problem}", batch.id);
        self.give_up(part, why.clone())?;
        let part = self.part(part);
        Err(Error::Endpoint {
            endpoint: part.facts.base.clone(),
            problem: format!("{}: {why}; none of its requests has a reply", part.name),
        })
    }

    /// Downloads the files of an ended batch. Either file may not exist.
    async fn fetch(&mut self, part: usize, batch: &RemoteBatch) -> Result<StepOutcome> {
        let max_bytes = MAX_REPLY_BYTES * (self.part(part).facts.requests as u64 + 1);
        let files = [&batch.output_file, &batch.error_file];
        for (id, path) in files.into_iter().zip(self.output_paths(part)) {
            let Some(id) = id else {
                continue;
            };
            let unfinished = path.with_extension("download");
            let download = self.server(part)?.download(id, &unfinished, max_bytes);
            match download.await {
                Err(failure) if failure.is_permanent() => {
                    let problem = format!("its file {id} cannot be fetched: {failure}");
                    return self.incomplete(part, batch, &problem);
                }
                Err(failure) => return self.check_failed(part, &failure),
                Ok(()) => {}
            }
            fs::rename(&unfinished, &path).map_err(|e| Error::file(&path, "write", e))?;
        }
        if let Some(problem) = self.missing_lines(part, batch)? {
            return self.incomplete(part, batch, &problem);
        }
        self.all_fetched(part, batch)
    }

    /// The difference between the server's counts and the lines of an ended batch's files, in words. `None` if they
    /// agree, or if no trial of the batch is waiting any more.
    fn missing_lines(&self, part: usize, batch: &RemoteBatch) -> Result<Option<String>> {
        let Some(keys) = self.keys(part)? else {
            return Ok(None);
        };
        let waiting = self.store.pending_in_batches()?;
        if !keys.iter().any(|key| waiting.contains(key)) {
            return Ok(None);
        }
        let server = self.server(part)?;
        let (mut lines, mut replies) = (BTreeSet::new(), BTreeSet::new());
        for path in self.output_paths(part).iter().filter(|path| path.exists()) {
            for_each_line(path, |line| {
                let line = server.line(line);
                let key = line.as_ref().and_then(|line| line.id.parse().ok());
                if let (Some(line), Some(key)) = (line, key.filter(|key| keys.contains(key))) {
                    lines.insert(key);
                    replies.extend(line.result.is_ok().then_some(key));
                }
                Ok(())
            })?;
        }
        let (lines, replies) = (lines.len() as u64, replies.len() as u64);
        let (counts, requests) = (batch.counts, keys.len() as u64);
        let is_counted = counts.is_known();
        let problem = match batch.state {
            BatchState::Completed if is_counted && counts.done < requests => {
                format!("the server counts {} of {requests} requests of a batch that is completed", counts.done)
            }
            BatchState::Completed if !is_counted && lines < requests => {
                format!("its files have {lines} lines for {requests} requests")
            }
            // Counts and files of a batch that ended early may arrive later than its state.
            BatchState::Expired | BatchState::Cancelled if !is_counted && lines == 0 => {
                "the server states neither counts nor files".to_owned()
            }
            _ if lines < counts.done && replies < counts.answered => {
                format!("the server counts {} replies, and its files have {replies}", counts.answered)
            }
            _ => return Ok(None),
        };
        Ok(Some(problem))
    }

    /// Handles an ended batch with incomplete files: nothing is asked again or deleted.
    ///
    /// # Errors
    /// If the files have been incomplete in too many checks. The existing replies are then imported.
    fn incomplete(&mut self, part: usize, batch: &RemoteBatch, problem: &str) -> Result<StepOutcome> {
        let checks = self.notes.incomplete_checks.entry(part).or_default();
        *checks += 1;
        let is_cancelled = self.until == Goal::Cancelled;
        let max_checks = if is_cancelled { MAX_INCOMPLETE_CANCELLED } else { MAX_INCOMPLETE };
        let is_last_check = *checks >= max_checks;
        let name = self.part(part).name.clone();
        let text = format!("{name}: batch {}: {problem}", batch.id);
        let states_nothing = !batch.counts.is_known();
        // An output file that could not be downloaded may contain paid replies.
        let has_output = batch.output_file.is_none() || self.output_paths(part)[0].exists();
        let did_nothing = states_nothing && has_output && batch.state != BatchState::Completed;
        if is_last_check && (is_cancelled || did_nothing) {
            let has_files = batch.output_file.is_some() || batch.error_file.is_some();
            if states_nothing && !has_files {
                tracing::warn!("{text}; taken as a batch without replies");
            } else {
                tracing::warn!("{text}; its files stay at the server, and its requests may be asked and paid again");
                self.notes.kept_files.insert(part);
            }
            return self.all_fetched(part, batch);
        }
        if self.until == Goal::Checked {
            self.warn_once(format!(
                "{text}; nothing is imported, asked again or deleted; look again later (the command of the run without --detach, or batch cancel, ends the wait)"
            ));
            return Ok(StepOutcome::Waiting);
        }
        if !is_last_check {
            self.warn_once(format!("{text}; looked at again"));
            return Ok(StepOutcome::Waiting);
        }
        self.import_lines(part)?;
        let run = self.store.folder().display();
        let problem = format!(
            "{text}; nothing is asked again or deleted. The same command looks again; batch import {run} FILE imports a file of the \
             server's page; batch cancel {run} frees the rest"
        );
        Err(Error::Endpoint { endpoint: self.part(part).facts.base.clone(), problem })
    }

    /// Records that all files of a batch are downloaded.
    fn all_fetched(&mut self, part: usize, batch: &RemoteBatch) -> Result<StepOutcome> {
        let files = [&batch.output_file, &batch.error_file];
        let event = PartEvent::Fetched {
            state: batch.state.word().to_owned(),
            files: files.into_iter().flatten().cloned().collect(),
        };
        self.journal.record(part, event)?;
        self.release(part);
        Ok(StepOutcome::Moved)
    }

    /// The local paths of a part's output file and error file.
    pub(super) fn output_paths(&self, part: usize) -> [PathBuf; 2] {
        let stem = self.part(part).stem();
        ["output", "errors"].map(|kind| self.journal.folder().join(format!("{stem}.{kind}.jsonl")))
    }

    /// Deletes the files of a part at the server, unless they are kept.
    pub(super) async fn delete_files(&mut self, part: usize) -> Result<StepOutcome> {
        let mut event = PartEvent::Deleted;
        if self.args.collect.keep_files || self.notes.kept_files.contains(&part) {
            event = PartEvent::Kept;
        } else {
            for id in self.files_at_server(part).await? {
                if let Err(failure) = self.delete_file(part, &id).await? {
                    event = PartEvent::Kept;
                    tracing::warn!("the file {id} could not be deleted at the server: {failure}");
                }
            }
        }
        self.journal.record(part, event)?;
        Ok(StepOutcome::Moved)
    }

    /// The ids of a part's files at the server. If the input file was uploaded more than once, this includes copies
    /// whose upload seemed to fail.
    pub(super) async fn files_at_server(&self, part: usize) -> Result<Vec<String>> {
        let BatchPart { name: part_name, files, uploads, .. } = self.part(part);
        let mut ids = files.clone();
        if *uploads > 1 {
            let (name, purpose) = (self.remote_name(part), self.purpose(part));
            match self.server(part)?.files(&purpose).await {
                Ok(files) => {
                    let copies = files.into_iter().filter(|file| file.name == name);
                    ids.extend(copies.map(|file| file.id));
                    ids.sort();
                    ids.dedup();
                }
                Err(failure) => {
                    tracing::warn!("{part_name}: copies of its file may be at the server, as {name}: {failure}");
                }
            }
        }
        Ok(ids)
    }

    /// Deletes a file at the server. A missing file counts as deleted.
    pub(super) async fn delete_file(&self, part: usize, id: &str) -> Result<ApiResult<()>> {
        let server = self.server(part)?;
        let mut result = server.delete(id).await;
        for _ in 1..MAX_DELETIONS {
            match &result {
                Err(failure) if !failure.is_permanent() => {}
                _ => break,
            }
            sleep(self.args.collect.poll).await;
            result = server.delete(id).await;
        }
        Ok(match result {
            Err(failure) if failure.failure.status == Some(404) => Ok(()),
            result => result,
        })
    }
}
