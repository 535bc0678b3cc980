//! The last steps of a part: its replies are taken over, or its requests are freed.

use std::collections::BTreeSet;
use std::io::{BufRead as _, BufReader};
use std::path::Path;

use super::driver::{Driver, Step};
use super::event::Event;
use super::part::Stage;
use super::replies::{Imported, ReplyCounts, ReplyImport};
use crate::ask::Model;
use crate::error::{Error, Result};
use crate::files::reading;
use crate::types::{Failure, FailureKind, TrialKey};
use darkqa_score::answers::record::Detail;

impl<'a, D: Detail> Driver<'a, D> {
    /// Reads the replies of a part into the records of the run. What has no line may be asked again.
    pub(super) fn take_over(&mut self, part: usize) -> Result<Step> {
        let Stage::Fetched { state } = self.part(part).stage.clone() else {
            return Ok(Step::Waiting);
        };
        let (counts, unread) = self.read_lines(part, Some(&state))?;
        let (answered, failed) = (counts.answered, counts.failed);
        self.say_what_is_missing(part, unread)?;
        self.say(part, &format!("{state}: {answered} answered, {failed} not"));
        self.journal
            .record(part, Event::TakenOver { answered, failed })?;
        Ok(Step::Moved)
    }

    /// Imports the replies of files that are not complete; the other requests wait for them.
    pub(super) fn import_lines(&mut self, part: usize) -> Result<()> {
        let (counts, _) = self.read_lines(part, None)?;
        let (answered, failed) = (counts.answered, counts.failed);
        if answered + failed > 0 {
            let line = format!("{answered} answered, {failed} not, as far as its files go");
            self.say(part, &line);
        }
        Ok(())
    }

    /// Reads the lines of a part's files into the records. `ended` is the state in which the batch has ended for good: what has no line
    /// has failed then. Returns the number of lines that cannot be read, too.
    fn read_lines(&mut self, part: usize, ended: Option<&str>) -> Result<(ReplyCounts, usize)> {
        let (paths, keys) = (self.fetched(part), self.keys(part)?);
        let models = self.models_of(part);
        let mut refused = BTreeSet::new();
        let (mut is_adapted, mut unread) = (false, 0);
        let server = self.servers.server(&self.part(part).facts)?;
        let mut replies = ReplyImport::new(self.store, self.manifest)?;
        for path in paths.iter().filter(|path| path.exists()) {
            for_each_line(path, |line| {
                let Some(line) = server.line(line) else {
                    unread += 1;
                    return Ok(());
                };
                let refusal = line.refusal.clone();
                let imported = replies.take(line)?;
                if let Imported::Failed(key, FailureKind::Request | FailureKind::Filtered) =
                    imported
                {
                    refused.insert(key);
                    if let Some((status, body)) = refusal {
                        for model in &models {
                            is_adapted |= model.adapt_to_refusal(status, body.as_bytes());
                        }
                    }
                }
                Ok(())
            })?;
        }
        if let Some(state) = ended {
            for key in keys.iter().flatten() {
                replies.fail(*key, without_line(state))?;
            }
        }
        let counts = replies.finish()?;
        self.notes.charged.take();
        // After a change of the requests all of them may succeed.
        if !is_adapted {
            self.refused.append(&mut refused);
        }
        Ok((counts, unread))
    }

    /// The models that a part asks: several if one is asked with images and without. A model that has another name now is known by its id.
    fn models_of(&self, part: usize) -> Vec<&'a Model> {
        let facts = &self.part(part).facts;
        let all = || self.models.iter().map(|one| (&*one.name, &*one.model));
        let named: Vec<&Model> = all()
            .filter(|(name, model)| facts.asks(name, model.name()))
            .map(|(_, model)| model)
            .collect();
        if !named.is_empty() {
            return named;
        }
        all()
            .filter(|(_, model)| model.name() == facts.model)
            .map(|(_, model)| model)
            .collect()
    }

    fn say_what_is_missing(&self, part: usize, unread: usize) -> Result<()> {
        let name = &self.part(part).name;
        let is_file_gone = self.keys(part)?.is_none();
        if unread > 0 {
            tracing::warn!(
                "{name}: lines of its output that are not those of a Batch API: {unread}; their requests are asked again"
            );
        }
        if is_file_gone {
            tracing::warn!(
                "{name} is gone from the batch folder, so that requests without a line in the output are not known; delete the batch \
                 folder when no batch is waiting at the server, to ask them again"
            );
        }
        Ok(())
    }

    /// Ends a part without a batch, and frees its requests.
    pub(super) fn give_up(&mut self, part: usize, why: String) -> Result<()> {
        let keys = self.keys(part)?;
        let mut replies = ReplyImport::new(self.store, self.manifest)?;
        for key in keys.into_iter().flatten() {
            let failure = Failure {
                kind: FailureKind::Timeout,
                status: None,
                message: why.clone(),
            };
            replies.fail(key, failure)?;
        }
        replies.finish()?;
        self.journal.record(part, Event::GaveUp { why })
    }

    /// Ends a part whose batch was not made, because the user cancels it.
    pub(super) async fn withdraw(&mut self, part: usize) -> Result<Step> {
        if !self.args.collect.keep_files {
            for id in self.files_at_server(part).await? {
                if let Err(failure) = self.delete_file(part, &id).await? {
                    tracing::warn!("the file {id} could not be deleted at the server: {failure}");
                }
            }
        }
        let why = "the batch was cancelled before it was made".to_owned();
        self.give_up(part, why)?;
        Ok(Step::Moved)
    }

    /// The trials of a part, from its file; `None` if the file is gone.
    pub(super) fn keys(&self, part: usize) -> Result<Option<Vec<TrialKey>>> {
        let path = self.journal.file(part);
        if !path.exists() {
            return Ok(None);
        }
        let mut keys = Vec::new();
        for_each_line(&path, |line| {
            keys.extend(key_of(line));
            Ok(())
        })?;
        Ok(Some(keys))
    }
}

/// The failure of a request without a line in the output of its batch.
fn without_line(state: &str) -> Failure {
    Failure {
        kind: FailureKind::Timeout,
        status: None,
        message: format!("the batch ended ({state}) without a line for this request"),
    }
}

/// The key in a line of an input file. It stands at the beginning, so that the rest of the line is not read.
pub(super) fn key_of(line: &str) -> Option<TrialKey> {
    let (id, _) = line.strip_prefix("{\"custom_id\":\"")?.split_once('"')?;
    id.parse().ok()
}

/// Calls `take` with each line of a file that is not empty. Bytes that are not UTF-8 are replaced.
pub(super) fn for_each_line(path: &Path, mut take: impl FnMut(&str) -> Result<()>) -> Result<()> {
    let unreadable = |e| Error::file(path, "read", e);
    let mut file = BufReader::new(reading::open(path).map_err(unreadable)?);
    let mut line = Vec::new();
    loop {
        line.clear();
        if file.read_until(b'\n', &mut line).map_err(unreadable)? == 0 {
            return Ok(());
        }
        let text = String::from_utf8_lossy(&line);
        if !text.trim().is_empty() {
            take(&text)?;
        }
    }
}
