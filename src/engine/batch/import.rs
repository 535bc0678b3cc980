//! Final steps of a part of a batch run: import its replies, or give up its requests.

use std::collections::{BTreeMap, BTreeSet};
use std::io::{BufRead as _, BufReader};
use std::path::Path;

use super::driver::{Driver, Step};
use super::event::Event;
use super::part::Stage;
use super::replies::{ReplyCounts, ReplyImport};
use crate::ask::Model;
use crate::error::{Error, Result};
use crate::files::reading;
use crate::types::{Failure, FailureKind, TrialKey};
use darkqa_score::answers::record::Detail;

impl<'a, D: Detail> Driver<'a, D> {
    /// Imports the replies of a part whose batch has ended. Requests without a line in the output fail as timeouts and
    /// may be retried.
    pub(super) fn import_replies(&mut self, part: usize) -> Result<Step> {
        let Stage::Fetched { state } = self.part(part).stage.clone() else {
            return Ok(Step::Waiting);
        };
        let (counts, unparsed) = self.import_files(part, Some(&state))?;
        let (answered, failed) = (counts.answered, counts.failed);
        self.warn_if_incomplete(part, unparsed)?;
        self.say(part, &format!("{state}: {answered} answered, {failed} not"));
        self.journal.record(part, Event::TakenOver { answered, failed })?;
        Ok(Step::Moved)
    }

    /// Imports the replies that incomplete files already contain. Requests without a line keep waiting.
    pub(super) fn import_lines(&mut self, part: usize) -> Result<()> {
        let (counts, _) = self.import_files(part, None)?;
        let (answered, failed) = (counts.answered, counts.failed);
        if answered + failed > 0 {
            let line = format!("{answered} answered, {failed} not, as far as its files go");
            self.say(part, &line);
        }
        Ok(())
    }

    /// Imports the replies in a part's files. Returns the counts of replies and the number of lines that cannot be
    /// parsed.
    ///
    /// `ended` is the final state of the batch, if it has ended: requests without a line fail then.
    fn import_files(&mut self, part: usize, ended: Option<&str>) -> Result<(ReplyCounts, usize)> {
        let (paths, keys) = (self.output_paths(part), self.keys(part)?);
        let models = self.models_of(part);
        let (mut refused, mut content) = (BTreeSet::new(), BTreeSet::new());
        let (mut is_adapted, mut unparsed) = (false, 0);
        let server = self.servers.server(&self.part(part).facts)?;
        let mut replies = ReplyImport::new(self.store, self.manifest)?;
        let mut refusals = BTreeMap::new();
        for path in paths.iter().filter(|path| path.exists()) {
            for_each_line(path, |line| {
                let Some(mut line) = server.line(line) else {
                    unparsed += 1;
                    return Ok(());
                };
                if let (Some(refusal), Ok(key)) = (line.refusal.take(), line.id.parse::<TrialKey>()) {
                    refusals.entry(key).or_insert(refusal);
                }
                replies.add_line(line)
            })?;
        }
        for (key, kind) in replies.failures() {
            match kind {
                FailureKind::Filtered => {
                    self.refused.insert(key);
                }
                FailureKind::Request => {
                    refused.insert(key);
                    if let Some((status, body)) = refusals.get(&key) {
                        for model in &models {
                            is_adapted |= model.adapt_to_refusal(*status, body.as_bytes());
                        }
                        if models.iter().any(|model| model.may_refuse_content(*status, body.as_bytes())) {
                            content.insert(key);
                        }
                    }
                }
                _ => {}
            }
        }
        if !is_adapted {
            for key in replies.filter_refused(&content)? {
                refused.remove(&key);
            }
        }
        if let Some(state) = ended {
            for key in keys.iter().flatten() {
                replies.fail(*key, missing_line_failure(state));
            }
        }
        let counts = replies.finish()?;
        self.notes.charged.take();
        // Once a model adapts its requests, refused requests may succeed: do not record any as refused.
        if !is_adapted {
            self.refused.append(&mut refused);
        }
        Ok((counts, unparsed))
    }

    /// Models that a part asks: several if a model is asked both with images and without. If no name matches, because
    /// the model was renamed, models match by their id at the endpoint.
    fn models_of(&self, part: usize) -> Vec<&'a Model> {
        let facts = &self.part(part).facts;
        let named: Vec<&Model> =
            self.models.iter().filter(|one| facts.asks(&one.name, one.model.name())).map(|one| &*one.model).collect();
        if !named.is_empty() {
            return named;
        }
        self.models.iter().map(|one| &*one.model).filter(|model| model.name() == facts.model).collect()
    }

    /// Warns of output lines that cannot be parsed, and of an input file that is missing.
    fn warn_if_incomplete(&self, part: usize, unparsed: usize) -> Result<()> {
        let name = &self.part(part).name;
        let is_file_gone = self.keys(part)?.is_none();
        if unparsed > 0 {
            tracing::warn!(
                "{name}: lines of its output that are not those of a Batch API: {unparsed}; their requests are asked again"
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

    /// Gives up a part: every request fails as a timeout with the message `why`, so that it may be retried.
    pub(super) fn give_up(&mut self, part: usize, why: String) -> Result<()> {
        let keys = self.keys(part)?;
        let mut replies = ReplyImport::new(self.store, self.manifest)?;
        for key in keys.into_iter().flatten() {
            let failure = Failure { kind: FailureKind::Timeout, status: None, message: why.clone() };
            replies.fail(key, failure);
        }
        replies.finish()?;
        self.journal.record(part, Event::GaveUp { why })
    }

    /// Gives up a part that the user cancels before its batch is created. Deletes its files at the server, unless the
    /// user keeps files.
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

    /// Trial keys of a part, read from its input file; `None` if the file is missing.
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

/// Failure of a request that has no line in the output of its batch.
fn missing_line_failure(state: &str) -> Failure {
    Failure {
        kind: FailureKind::Timeout,
        status: None,
        message: format!("the batch ended ({state}) without a line for this request"),
    }
}

/// Parses the trial key of a line of an input file. `custom_id` is the first field, so the rest of the line is not
/// parsed.
pub(super) fn key_of(line: &str) -> Option<TrialKey> {
    let (id, _) = line.strip_prefix("{\"custom_id\":\"")?.split_once('"')?;
    id.parse().ok()
}

/// Calls `take` with each non-blank line of a file. Invalid UTF-8 is replaced.
pub(super) fn for_each_line(path: &Path, mut take: impl FnMut(&str) -> Result<()>) -> Result<()> {
    let mut file = BufReader::new(reading::open(path).map_err(|e| Error::file(path, "read", e))?);
    let mut line = Vec::new();
    loop {
        line.clear();
        if file.read_until(b'\n', &mut line).map_err(|e| Error::file(path, "read", e))? == 0 {
            return Ok(());
        }
        let text = String::from_utf8_lossy(&line);
        if !text.trim().is_empty() {
            take(&text)?;
        }
    }
}
