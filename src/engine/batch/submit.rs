//! The steps of a part until its batch is made: upload, creation, and the search for what a killed process may have made.

use super::driver::{Driver, Goal, Step};
use super::event::Event;
use crate::ask::batch_api::{BatchState, NewBatch, Readiness, RemoteBatch};
use crate::ask::{AskError, BatchInterface};
use crate::error::{Error, Result};
use crate::report::forecast::money;
use darkqa_score::answers::record::Detail;

/// How many uploads or creations in a row at which the server fails end the work for a model; chosen: 15 minutes by
/// [`hold`](Driver::hold) with the default of `--poll`.
const MOST_FAILED: u32 = 5;

impl<D: Detail> Driver<'_, D> {
    /// Uploads the file of a part, if its batch may be made.
    pub(super) async fn upload(&mut self, part: usize) -> Result<Step> {
        if let Some(pieces) = self.too_large(part)? {
            return self.split(part, pieces).await;
        }
        if self.is_held(part)? {
            return Ok(Step::Waiting);
        }
        let (path, name) = (self.journal.file(part), self.remote_name(part));
        if !path.exists() {
            let why = "its file is gone".to_owned();
            return self.give_up(part, why).map(|()| Step::Moved);
        }
        let (bytes, of) = (path.metadata().map(|file| file.len()), self.part(part));
        if bytes.is_ok_and(|bytes| bytes != of.facts.bytes) {
            let expected = of.facts.bytes;
            let problem = format!(
                "the file was changed after it was written: {expected} bytes expected; batch cancel {} frees its requests",
                self.store.folder().display()
            );
            return Err(Error::Run { path, problem });
        }
        self.say(part, "uploading");
        self.journal.record(part, Event::Uploading)?;
        let purpose = self.purpose(part);
        let sent = self.server(part)?.upload(&path, &name, &purpose);
        match sent.await {
            Ok(file) => {
                if file.readiness == Readiness::Ready {
                    self.notes.ready.insert(file.id.clone());
                }
                self.journal.record(part, Event::Uploaded { id: file.id })?;
                self.notes.failed_calls.remove(&part);
                Ok(Step::Moved)
            }
            Err(failure) => self.not_made(part, &failure),
        }
    }

    /// Looks for the file of a part that may have been uploaded.
    pub(super) async fn find_file(&mut self, part: usize) -> Result<Step> {
        let name = self.remote_name(part);
        let listed = self.server(part)?.files(&self.purpose(part)).await;
        let files = match listed {
            Ok(files) => files,
            // A second copy of a file costs nothing.
            Err(failure) if failure.is_unsupported() => {
                return self.refuse(part, "the server does not list its files");
            }
            Err(failure) => return self.look_failed(part, &failure),
        };
        let bytes = self.part(part).facts.bytes;
        let mut files = files.into_iter();
        let found =
            files.find(|file| file.name == name && file.bytes.is_none_or(|other| other == bytes));
        let event = match found {
            Some(file) => {
                self.was_found(part);
                Event::Uploaded { id: file.id }
            }
            None if !self.is_missing(part, "file") => return Ok(Step::Waiting),
            None => Event::Refused {
                why: "the file is not at the server".to_owned(),
            },
        };
        self.journal.record(part, event)?;
        Ok(Step::Moved)
    }

    /// Makes the batch of a part, if it may be made now and the server has read the file.
    pub(super) async fn create(&mut self, part: usize) -> Result<Step> {
        if let Some(pieces) = self.too_large(part)? {
            return self.split(part, pieces).await;
        }
        if self.is_held(part)? {
            return Ok(Step::Waiting);
        }
        let Some(file) = self.part(part).files.first().cloned() else {
            return self.refuse(part, "the file has no name");
        };
        if !self.notes.ready.contains(&file) {
            match self.server(part)?.file(&file).await {
                Ok(at_server) => match at_server.readiness {
                    Readiness::Ready => self.notes.ready.insert(file.clone()),
                    Readiness::Pending => return Ok(Step::Waiting),
                    Readiness::Refused => return Err(self.unread(part)),
                },
                // It was deleted, so it is uploaded again.
                Err(failure) if failure.failure.status == Some(404) => {
                    self.journal.record(part, Event::Uploading)?;
                    return self.refuse(part, "the file is not at the server any more");
                }
                Err(failure) => return self.look_failed(part, &failure),
            };
        }
        if self.part(part).in_doubt
            && let Some(step) = self.find_earlier(part).await?
        {
            return Ok(step);
        }
        let attempt = self.part(part).attempt + 1;
        self.journal.record(part, Event::Creating { attempt })?;
        let (mark, url) = (self.mark(part), self.part(part).facts.url.clone());
        let new = NewBatch {
            file: &file,
            url: &url,
            window: &self.args.window,
            mark: &mark,
        };
        match self.server(part)?.create(new).await {
            Ok(batch) => self.created(part, batch.id),
            Err(failure) => self.not_made(part, &failure),
        }
    }

    /// Looks for the batch of a part that may have been made.
    pub(super) async fn find_batch(&mut self, part: usize) -> Result<Step> {
        let listed = self.server(part)?.batches().await;
        let batches = match listed {
            Ok(batches) => batches,
            Err(failure) if failure.is_unsupported() && self.until == Goal::Cancelled => {
                return self.withdraw(part).await;
            }
            Err(failure) if failure.is_unsupported() => return Err(self.unknown(part)),
            Err(failure) => return self.look_failed(part, &failure),
        };
        match self.part_batch(part, batches) {
            Some(batch) => {
                self.was_found(part);
                self.created(part, batch.id)
            }
            None if self.is_missing(part, "batch") => {
                self.refuse(part, "the batch is not at the server")
            }
            None => Ok(Step::Waiting),
        }
    }

    /// Looks for a batch that an earlier attempt made all the same; `None` if a new one is to be made.
    async fn find_earlier(&mut self, part: usize) -> Result<Option<Step>> {
        let listed = self.server(part)?.batches().await;
        match listed {
            Ok(batches) => match self.part_batch(part, batches) {
                Some(batch) => self.created(part, batch.id).map(Some),
                None => Ok(None),
            },
            Err(failure) if failure.is_unsupported() => Ok(None),
            Err(failure) => self.look_failed(part, &failure).map(Some),
        }
    }

    /// The batch of a part: of its last attempt, else one of an earlier attempt that the server did not refuse.
    fn part_batch(&self, part: usize, batches: Vec<RemoteBatch>) -> Option<RemoteBatch> {
        let last = self.mark(part);
        let any = format!("{}/{}/", self.journal.run, self.part(part).stem());
        let is_ours = |batch: &RemoteBatch| {
            batch.mark == last
                || (batch.mark.starts_with(&any) && batch.state != BatchState::Failed)
        };
        let (own, earlier): (Vec<_>, Vec<_>) = batches
            .into_iter()
            .filter(is_ours)
            .partition(|batch| batch.mark == last);
        own.into_iter().chain(earlier).next()
    }

    fn created(&mut self, part: usize, id: String) -> Result<Step> {
        let facts = &self.part(part).facts;
        let cost = match facts.dollars.zip(facts.most_dollars) {
            Some((expected, most)) => {
                format!(", about {} and at most {}", money(expected), money(most))
            }
            None => String::new(),
        };
        let line = format!("batch {id} of {} requests{cost}", facts.requests);
        self.say(part, &line);
        self.journal.record(part, Event::Created { id })?;
        // The first look is worth a wait.
        self.notes.looked_at.insert(part);
        Ok(Step::Moved)
    }

    /// Handles an upload or a creation that did not succeed.
    fn not_made(&mut self, part: usize, failure: &AskError) -> Result<Step> {
        if let Some(quota) = &failure.quota {
            return self.quota_reached(part, quota);
        }
        if failure.may_have_effect {
            let failed = self.notes.failed_calls.entry(part).or_default();
            *failed += 1;
            if *failed >= MOST_FAILED {
                return Err(self.fatal(part, failure));
            }
        } else {
            let why = failure.failure.message.clone();
            self.journal.record(part, Event::Refused { why })?;
            if failure.is_permanent() {
                return Err(self.fatal(part, failure));
            }
        }
        self.hold(part, failure.wait);
        let name = self.part(part).name.clone();
        self.warn_once(format!("{name}: {failure}; tried again"));
        Ok(Step::Waiting)
    }

    /// Notes that nothing was made by the last call.
    fn refuse(&mut self, part: usize, why: &str) -> Result<Step> {
        let why = why.to_owned();
        self.journal.record(part, Event::Refused { why })?;
        Ok(Step::Moved)
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

    /// The mark by which the batch of a part is found again.
    fn mark(&self, part: usize) -> String {
        let (run, part) = (&self.journal.run, self.part(part));
        format!("{run}/{}/{}", part.stem(), part.attempt)
    }

    /// The error for a file that the server could not read.
    fn unread(&self, part: usize) -> Error {
        let part = self.part(part);
        let id = part.files.first().map_or("", String::as_str);
        let problem = format!("{}: the server could not read this file ({id})", part.name);
        Error::Endpoint {
            endpoint: part.facts.base.clone(),
            problem,
        }
    }

    /// The error for a batch that may or may not exist, at a server that lists none.
    fn unknown(&self, part: usize) -> Error {
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
