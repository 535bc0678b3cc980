//! The steps of a part after its batch is made: looking at it, fetching its replies, deleting its files.

use std::collections::BTreeSet;
use std::fs;
use std::path::PathBuf;

use jiff::Timestamp;
use tokio::time::sleep;

use super::driver::{Driver, Goal, Step};
use super::event::Event;
use super::take_over::for_each_line;
use crate::ask::batch_api::{ApiResult, BatchState, RemoteBatch};
use crate::error::{Error, Result};
use darkqa_score::answers::record::Detail;

/// Bytes that a reply may have; chosen: far more than the longest reply of a reasoning model.
const MOST_REPLY_BYTES: u64 = 4 << 20;

/// How many looks at a batch that has ended wait until its files have as many lines as the server counts; chosen: 19 minutes with the
/// default of `--poll`.
const MOST_INCOMPLETE: u32 = 10;

/// The same for batches that the user cancels, who waits; chosen.
const MOST_INCOMPLETE_CANCELLED: u32 = 6;

/// How often a file is tried to be deleted; chosen.
const DELETIONS: usize = 3;

impl<D: Detail> Driver<'_, D> {
    /// Looks at the batch of a part, once between two waits.
    pub(super) async fn check_batch(&mut self, part: usize) -> Result<Step> {
        let Some(id) = self.part(part).batch.clone() else {
            return Ok(Step::Waiting);
        };
        if !self.notes.looked_at.insert(part) {
            return Ok(Step::Waiting);
        }
        if self.until == Goal::Cancelled && !self.part(part).cancelled {
            self.cancel(part, &id).await?;
        }
        let looked = self.server(part)?.batch(&id).await;
        let batch = match looked {
            Ok(batch) => batch,
            Err(failure) => return self.look_failed(part, &failure),
        };
        self.notes.refused_looks.remove(&part);
        let state = batch.state.word().to_owned();
        if state != self.part(part).state {
            self.journal.record(part, Event::Seen { state })?;
        }
        let (done, total) = (batch.counts.done, batch.counts.total);
        match &batch.state {
            BatchState::Working(word) => {
                self.say(part, &format!("{word}, {done} of {total}"));
                self.cancel_if_late(part, &id).await?;
                Ok(Step::Waiting)
            }
            BatchState::Unknown(word) => {
                let name = self.part(part).name.clone();
                self.warn_once(format!(
                    "{name}: the server states {word:?} for its batch {id}, which is not a known state; it is checked again until it has \
                     ended"
                ));
                Ok(Step::Waiting)
            }
            // A batch that failed on its way may have asked a part of its requests.
            BatchState::Failed if batch.output_file.is_none() && batch.counts.answered == 0 => {
                self.failed(part, &batch)
            }
            BatchState::Failed
            | BatchState::Completed
            | BatchState::Expired
            | BatchState::Cancelled => self.fetch(part, &batch).await,
        }
    }

    async fn cancel(&mut self, part: usize, id: &str) -> Result<()> {
        match self.server(part)?.cancel(id).await {
            Ok(()) => self.journal.record(part, Event::Cancelled),
            // It may have ended meanwhile; the look that follows tells.
            Err(failure) => {
                let name = self.part(part).name.clone();
                self.warn_once(format!("{name}: not cancelled yet: {failure}"));
                Ok(())
            }
        }
    }

    /// Cancels a batch on which the server works for longer than `--give-up`.
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

    /// Handles a batch that the server could not begin.
    fn failed(&mut self, part: usize, batch: &RemoteBatch) -> Result<Step> {
        if let Some(quota) = &batch.quota {
            return self.quota_reached(part, quota);
        }
        let problem = match batch.problem.as_str() {
            "" => "the server does not say why",
            problem => problem,
        };
        let why = format!("the batch {} failed: {problem}", batch.id);
        self.give_up(part, why.clone())?;
        let of = self.part(part);
        Err(Error::Endpoint {
            endpoint: of.facts.base.clone(),
            problem: format!("{}: {why}; none of its requests has a reply", of.name),
        })
    }

    /// Fetches the files of a batch that has ended. Each may be missing.
    async fn fetch(&mut self, part: usize, batch: &RemoteBatch) -> Result<Step> {
        let most = MOST_REPLY_BYTES * (self.part(part).facts.requests as u64 + 1);
        let files = [&batch.output_file, &batch.error_file];
        for (id, path) in files.into_iter().zip(self.fetched(part)) {
            let Some(id) = id else {
                continue;
            };
            let unfinished = path.with_extension("download");
            let loaded = self.server(part)?.download(id, &unfinished, most).await;
            match loaded {
                Err(failure) if failure.is_permanent() => {
                    let problem = format!("its file {id} cannot be fetched: {failure}");
                    return self.incomplete(part, batch, &problem);
                }
                Err(failure) => return self.look_failed(part, &failure),
                Ok(()) => {}
            }
            fs::rename(&unfinished, &path).map_err(|e| Error::file(&path, "write", e))?;
        }
        if let Some(problem) = self.missing_lines(part, batch)? {
            return self.incomplete(part, batch, &problem);
        }
        self.fetched_all(part, batch)
    }

    /// The difference between the server's counts and the lines of an ended batch's files; `None` if they agree, or if none of its trials waits
    /// any more.
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
        for path in self.fetched(part).iter().filter(|path| path.exists()) {
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
            BatchState::Completed if is_counted && counts.done < requests => format!(
                "the server counts {} of {requests} requests of a batch that is completed",
                counts.done
            ),
            BatchState::Completed if !is_counted && lines < requests => {
                format!("its files have {lines} lines for {requests} requests")
            }
            // Counts and files of a batch that ended early may come later than its state.
            BatchState::Expired | BatchState::Cancelled if !is_counted && lines == 0 => {
                "the server states neither counts nor files".to_owned()
            }
            _ if lines < counts.done && replies < counts.answered => format!(
                "the server counts {} replies, and its files have {replies}",
                counts.answered
            ),
            _ => return Ok(None),
        };
        Ok(Some(problem))
    }

    /// A look at a batch that has ended and whose files are not complete: nothing is asked again and nothing deleted.
    ///
    /// # Errors
    /// If they have not been complete for many looks. The replies that exist are imported then.
    fn incomplete(&mut self, part: usize, batch: &RemoteBatch, problem: &str) -> Result<Step> {
        let looks = self.notes.incomplete_looks.entry(part).or_default();
        *looks += 1;
        let is_cancelled = self.until == Goal::Cancelled;
        let most = if is_cancelled {
            MOST_INCOMPLETE_CANCELLED
        } else {
            MOST_INCOMPLETE
        };
        let has_ended = *looks >= most;
        let name = self.part(part).name.clone();
        let text = format!("{name}: batch {}: {problem}", batch.id);
        let states_nothing = !batch.counts.is_known();
        // A file that is named and could not be fetched may hold paid replies.
        let has_output = batch.output_file.is_none() || self.fetched(part)[0].exists();
        let is_without_work = states_nothing && has_output && batch.state != BatchState::Completed;
        if has_ended && (is_cancelled || is_without_work) {
            let has_files = batch.output_file.is_some() || batch.error_file.is_some();
            if states_nothing && !has_files {
                tracing::warn!("{text}; taken as a batch without replies");
            } else {
                tracing::warn!(
                    "{text}; its files stay at the server, and its requests may be asked and paid again"
                );
                self.notes.kept_files.insert(part);
            }
            return self.fetched_all(part, batch);
        }
        if self.until == Goal::LookedAt {
            self.warn_once(format!(
                "{text}; nothing is imported, asked again or deleted; look again later (the command of the run without --detach, or batch cancel, ends the wait)"
            ));
            return Ok(Step::Waiting);
        }
        if !has_ended {
            self.warn_once(format!("{text}; looked at again"));
            return Ok(Step::Waiting);
        }
        self.import_lines(part)?;
        let run = self.store.folder().display();
        let problem = format!(
            "{text}; nothing is asked again or deleted. The same command looks again; batch import {run} FILE imports a file of the \
             server's page; batch cancel {run} frees the rest"
        );
        Err(Error::Endpoint {
            endpoint: self.part(part).facts.base.clone(),
            problem,
        })
    }

    /// Notes that all files of a batch are fetched.
    fn fetched_all(&mut self, part: usize, batch: &RemoteBatch) -> Result<Step> {
        let files = [&batch.output_file, &batch.error_file];
        let event = Event::Fetched {
            state: batch.state.word().to_owned(),
            files: files.into_iter().flatten().cloned().collect(),
        };
        self.journal.record(part, event)?;
        self.release(part);
        Ok(Step::Moved)
    }

    /// The paths of a part's replies and of its failures.
    pub(super) fn fetched(&self, part: usize) -> [PathBuf; 2] {
        let stem = self.part(part).stem();
        ["output", "errors"].map(|kind| self.journal.folder().join(format!("{stem}.{kind}.jsonl")))
    }

    /// Deletes the files of a part at the server, unless they are to be kept.
    pub(super) async fn delete_files(&mut self, part: usize) -> Result<Step> {
        let mut event = Event::Deleted;
        if self.args.collect.keep_files || self.notes.kept_files.contains(&part) {
            event = Event::Kept;
        } else {
            for id in self.files_at_server(part).await? {
                if let Err(failure) = self.delete_file(part, &id).await? {
                    event = Event::Kept;
                    tracing::warn!("the file {id} could not be deleted at the server: {failure}");
                }
            }
        }
        self.journal.record(part, event)?;
        Ok(Step::Moved)
    }

    /// The server's names of a part's files. If the input file was uploaded more than once, that includes copies of it of which the
    /// answer was lost.
    pub(super) async fn files_at_server(&self, part: usize) -> Result<Vec<String>> {
        let of = self.part(part);
        let mut ids = of.files.clone();
        if of.uploads > 1 {
            let (name, purpose) = (self.remote_name(part), self.purpose(part));
            match self.server(part)?.files(&purpose).await {
                Ok(files) => {
                    let copies = files.into_iter().filter(|file| file.name == name);
                    ids.extend(copies.map(|file| file.id));
                    ids.sort();
                    ids.dedup();
                }
                Err(failure) => tracing::warn!(
                    "{}: copies of its file may be at the server, as {name}: {failure}",
                    of.name
                ),
            }
        }
        Ok(ids)
    }

    /// Deletes a file at the server; one that is gone is no failure.
    pub(super) async fn delete_file(&self, part: usize, id: &str) -> Result<ApiResult<()>> {
        let server = self.server(part)?;
        let mut tried = server.delete(id).await;
        for _ in 1..DELETIONS {
            match &tried {
                Err(failure) if !failure.is_permanent() => {}
                _ => break,
            }
            sleep(self.args.collect.poll).await;
            tried = server.delete(id).await;
        }
        Ok(match tried {
            Err(failure) if failure.failure.status == Some(404) => Ok(()),
            tried => tried,
        })
    }
}
