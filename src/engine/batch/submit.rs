//! Steps of a part until its batch is created: upload, creation, and the search for files and batches of a killed
//! process.

use super::driver::{Driver, Goal, StepOutcome};
use super::journal::PartEvent;
use darkqa_ask::batch_api::{BatchState, NewBatch, Readiness, RemoteBatch};
use darkqa_ask::{AskError, BatchInterface};
use darkqa_base::error::{Error, Result};
use darkqa_base::types::text::{counted, money};
use darkqa_score::answers::record::Detail;

/// Number of consecutive failed uploads or creations after which a model is stopped; chosen: 15 minutes by
/// [`hold`](Driver::hold) with the default of `--poll`.
const MAX_FAILED_CALLS: u32 = 5;

impl<D: Detail> Driver<'_, D> {
    /// Uploads the file of a part, if its batch may be created.
    pub(super) async fn upload(&mut self, part: usize) -> Result<StepOutcome> {
        if let Some(pieces) = self.required_pieces(part)? {
            return self.split(part, pieces).await;
        }
        if self.is_held(part)? {
            return Ok(StepOutcome::Waiting);
        }
        let (path, name) = (self.journal.file(part), self.remote_name(part));
        if !path.exists() {
            let why = "its file is gone".to_owned();
            return self.give_up(part, why).map(|()| StepOutcome::Moved);
        }
        let expected = self.part(part).facts.bytes;
        if path.metadata().is_ok_and(|metadata| metadata.len() != expected) {
            let problem = format!(
                "the file was changed after it was written: {expected} bytes expected; batch cancel {} frees its requests",
                self.store.folder().display()
            );
            return Err(Error::Run { path, problem });
        }
        self.say(part, "uploading");
        self.journal.record(part, PartEvent::Uploading)?;
        let purpose = self.purpose(part);
        let sent = self.server(part)?.upload(&path, &name, &purpose);
        match sent.await {
            Ok(file) => {
                if file.readiness == Readiness::Ready {
                    self.notes.ready.insert(file.id.clone());
                }
                self.journal.record(part, PartEvent::Uploaded { id: file.id })?;
                self.notes.failed_calls.remove(&part);
                Ok(StepOutcome::Moved)
            }
            Err(failure) => self.call_failed(part, &failure),
        }
    }

    /// Searches for the file of a part that may have been uploaded.
    pub(super) async fn find_file(&mut self, part: usize) -> Result<StepOutcome> {
        let name = self.remote_name(part);
        let listed = self.server(part)?.files(&self.purpose(part)).await;
        let files = match listed {
            Ok(files) => files,
            // Upload again: a second copy of a file costs nothing.
            Err(failure) if failure.is_unsupported() => {
                return self.refuse(part, "the server does not list its files");
            }
            Err(failure) => return self.check_failed(part, &failure),
        };
        let bytes = self.part(part).facts.bytes;
        let found = files.into_iter().find(|file| file.name == name && file.bytes.is_none_or(|other| other == bytes));
        let event = match found {
            Some(file) => {
                self.end_search(part);
                PartEvent::Uploaded { id: file.id }
            }
            None if !self.is_missing(part, "file") => return Ok(StepOutcome::Waiting),
            None => PartEvent::Refused { why: "the file is not at the server".to_owned() },
        };
        self.journal.record(part, event)?;
        Ok(StepOutcome::Moved)
    }

    /// Creates the batch of a part, if it may be created now and the server has processed the file.
    pub(super) async fn create(&mut self, part: usize) -> Result<StepOutcome> {
        if let Some(pieces) = self.required_pieces(part)? {
            return self.split(part, pieces).await;
        }
        if self.is_held(part)? {
            return Ok(StepOutcome::Waiting);
        }
        let Some(file) = self.part(part).files.first().cloned() else {
            return self.refuse(part, "the file has no name");
        };
        if !self.notes.ready.contains(&file) {
            match self.server(part)?.file(&file).await {
                Ok(at_server) => match at_server.readiness {
                    Readiness::Ready => self.notes.ready.insert(file.clone()),
                    Readiness::Pending => return Ok(StepOutcome::Waiting),
                    Readiness::Refused => return Err(self.unreadable_file_error(part)),
                },
                // The file was deleted, so upload it again.
                Err(failure) if failure.failure.status == Some(404) => {
                    self.journal.record(part, PartEvent::Uploading)?;
                    return self.refuse(part, "the file is not at the server any more");
                }
                Err(failure) => return self.check_failed(part, &failure),
            };
        }
        if self.part(part).in_doubt
            && let Some(step) = self.find_earlier(part).await?
        {
            return Ok(step);
        }
        let attempt = self.part(part).attempt + 1;
        self.journal.record(part, PartEvent::Creating { attempt })?;
        let (mark, url) = (self.mark(part), self.part(part).facts.url.clone());
        let new = NewBatch { file: &file, url: &url, window: &self.args.window, mark: &mark };
        match self.server(part)?.create(new).await {
            Ok(batch) => self.batch_created(part, batch.id),
            Err(failure) => self.call_failed(part, &failure),
        }
    }

    /// Searches for the batch of a part that may have been created.
    pub(super) async fn find_batch(&mut self, part: usize) -> Result<StepOutcome> {
        let listed = self.server(part)?.batches().await;
        let batches = match listed {
            Ok(batches) => batches,
            Err(failure) if failure.is_unsupported() && self.until == Goal::Cancelled => {
                return self.withdraw(part).await;
            }
            Err(failure) if failure.is_unsupported() => {
                return Err(self.unknown_batch_error(part));
            }
            Err(failure) => return self.check_failed(part, &failure),
        };
        match self.part_batch(part, batches) {
            Some(batch) => {
                self.end_search(part);
                self.batch_created(part, batch.id)
            }
            None if self.is_missing(part, "batch") => self.refuse(part, "the batch is not at the server"),
            None => Ok(StepOutcome::Waiting),
        }
    }

    /// Searches for a batch that an earlier attempt created although it seemed to fail; `None` if a new one must be
    /// created.
    async fn find_earlier(&mut self, part: usize) -> Result<Option<StepOutcome>> {
        let listed = self.server(part)?.batches().await;
        match listed {
            Ok(batches) => match self.part_batch(part, batches) {
                Some(batch) => self.batch_created(part, batch.id).map(Some),
                None => Ok(None),
            },
            Err(failure) if failure.is_unsupported() => Ok(None),
            Err(failure) => self.check_failed(part, &failure).map(Some),
        }
    }

    /// The batch of a part: that of its last attempt, or else one of an earlier attempt that has not failed.
    fn part_batch(&self, part: usize, batches: Vec<RemoteBatch>) -> Option<RemoteBatch> {
        let last_mark = self.mark(part);
        let prefix = format!("{}/{}/", self.journal.run, self.part(part).stem());
        let (last, earlier) = batches
            .into_iter()
            .filter(|batch| {
                batch.mark == last_mark || (batch.mark.starts_with(&prefix) && batch.state != BatchState::Failed)
            })
            .partition::<Vec<_>, _>(|batch| batch.mark == last_mark);
        last.into_iter().chain(earlier).next()
    }

    /// Records and prints that the batch of a part is created.
    fn batch_created(&mut self, part: usize, id: String) -> Result<StepOutcome> {
        let facts = &self.part(part).facts;
        let cost = match facts.dollars.zip(facts.most_dollars) {
            Some((expected, most)) => {
                format!(", about {} and at most {}", money(expected), money(most))
            }
            None => String::new(),
        };
        let line = format!("batch {id} of {}{cost}", counted(facts.requests, "request"));
        self.say(part, &line);
        self.journal.record(part, PartEvent::Created { id })?;
        // Wait before the first check.
        self.notes.checked.insert(part);
        Ok(StepOutcome::Moved)
    }

    /// Handles a failed upload or creation.
    fn call_failed(&mut self, part: usize, failure: &AskError) -> Result<StepOutcome> {
        if let Some(quota) = &failure.quota {
            return self.quota_reached(part, quota);
        }
        if failure.may_have_effect {
            let failed = self.notes.failed_calls.entry(part).or_default();
            *failed += 1;
            if *failed >= MAX_FAILED_CALLS {
                return Err(self.fatal(part, failure));
            }
        } else {
            let why = failure.failure.message.clone();
            self.journal.record(part, PartEvent::Refused { why })?;
            if failure.is_permanent() {
                return Err(self.fatal(part, failure));
            }
        }
        self.hold(part, failure.wait);
        let name = self.part(part).name.clone();
        self.warn_once(format!("{name}: {failure}; tried again"));
        Ok(StepOutcome::Waiting)
    }

    /// Records that the last call had no effect.
    fn refuse(&mut self, part: usize, why: &str) -> Result<StepOutcome> {
        let why = why.to_owned();
        self.journal.record(part, PartEvent::Refused { why })?;
        Ok(StepOutcome::Moved)
    }

    /// The name of a part's file at the server.
    pub(super) fn remote_name(&self, part: usize) -> String {
        format!("darkqa-{}-{}", self.journal.run, self.part(part).name)
    }

    /// The purpose of a part's file at the server.
    pub(super) fn purpose(&self, part: usize) -> String {
        let known = BatchInterface::at(&self.part(part).facts.base);
        let stated = self.args.purpose.as_deref();
        stated.unwrap_or(known.purpose()).to_owned()
    }

    /// The mark that identifies the batch of a part's last attempt at the server.
    fn mark(&self, part: usize) -> String {
        let (run, part) = (&self.journal.run, self.part(part));
        format!("{run}/{}/{}", part.stem(), part.attempt)
    }

    /// The error for a file that the server could not read.
    fn unreadable_file_error(&self, part: usize) -> Error {
        let part = self.part(part);
        let id = part.files.first().map_or("", String::as_str);
        let problem = format!("{}: the server could not read this file ({id})", part.name);
        Error::Endpoint { endpoint: part.facts.base.clone(), problem }
    }

    /// The error for a batch that may exist at a server that does not list batches.
    fn unknown_batch_error(&self, part: usize) -> Error {
        let part = self.part(part);
        Error::Endpoint {
            endpoint: part.facts.base.clone(),
            problem: format!(
                "{}: whether its batch was made is not known, and the server lists no batches; look at the server's own page: if there \
                 is none, batch cancel frees its requests",
                part.name
            ),
        }
    }
}
