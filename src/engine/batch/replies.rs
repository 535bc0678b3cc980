//! Imports the output of a Batch API into a run: [`import`].
//!
//! Final steps of a part of a batch run: import its replies, or give up its requests.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::fmt::Write;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::driver::{Driver, StepOutcome};
use super::journal::{PartEvent, Stage};
use darkqa_ask::batch::{BatchLine, with_letter};
use darkqa_ask::{Constrain, Model, TokenBound};
use darkqa_base::error::{Error, Result};
use darkqa_base::files;
use darkqa_base::types::flags::read_word;
use darkqa_base::types::manifests::RunManifest;
use darkqa_base::types::{Failure, FailureKind, Finish, LostAttempts, Record, Reply, TrialKey, Unstated, Usage};
use darkqa_runs::renamed;
use darkqa_score::answers::record::{Detail, answered};
use darkqa_store::{Store, StoredTrial};

/// Numbers of lines by outcome.
#[derive(Debug, Default)]
pub(super) struct ReplyCounts {
    pub(super) answered: usize,
    pub(super) failed: usize,
    /// Lines of trials that were imported before, or answered in another way.
    imported_before: usize,
    /// Lines whose id belongs to no batch of this run.
    unknown: usize,
}

/// Import of replies to the trials of a run that are waiting for a batch.
pub(super) struct ReplyImport<'a, D> {
    store: &'a mut Store<D>,
    manifest: &'a RunManifest,
    /// Records of the trials in batches, without outcomes.
    blanks: HashMap<TrialKey, Record<D>>,
    waiting: BTreeSet<TrialKey>,
    /// Trials with an earlier reply that did not count, because another try might have ended in another way.
    asked_again: BTreeSet<TrialKey>,
    /// The first failure of each waiting trial. It is stored at the end, because a later line may have the reply.
    failures: BTreeMap<TrialKey, FailedTrial<D>>,
    pub(super) counts: ReplyCounts,
}

/// A trial without an outcome, and the failure of its request.
struct FailedTrial<D> {
    blank: Record<D>,
    failure: Failure,
    /// Finish reason of a reply that does not count.
    finish: Option<Finish>,
}

impl<'a, D: Detail> ReplyImport<'a, D> {
    /// An import into a run.
    pub(super) fn new(store: &'a mut Store<D>, manifest: &'a RunManifest) -> Result<Self> {
        let blanks = store.batch_trials()?.into_iter();
        Ok(Self {
            blanks: blanks.map(|blank| (blank.key, blank)).collect(),
            waiting: store.pending_in_batches()?,
            asked_again: store.trials()?.iter().filter(|trial| trial.may_heal()).map(|trial| trial.key).collect(),
            failures: BTreeMap::new(),
            store,
            manifest,
            counts: ReplyCounts::default(),
        })
    }

    /// Stores the reply of a line, or keeps its failure, if its trial is waiting for a batch.
    pub(super) fn add_line(&mut self, line: BatchLine) -> Result<()> {
        let key = line.id.parse::<TrialKey>().ok();
        let Some(blank) = key.and_then(|key| self.blanks.get(&key)) else {
            self.counts.unknown += 1;
            return Ok(());
        };
        let has_failed = self.failures.contains_key(&blank.key);
        if !self.waiting.contains(&blank.key) || (has_failed && line.result.is_err()) {
            self.counts.imported_before += 1;
            return Ok(());
        }
        let mut blank = blank.clone().in_batch();
        let bound = std::mem::take(&mut blank.lost.unstated);
        let reply = match line.result {
            Ok(reply) => reply,
            Err(failure) => {
                blank.lost.add(line.charged);
                if line.charged.is_none() && may_be_charged(failure.kind) {
                    blank.lost.unstated = bound;
                }
                let failed = FailedTrial { blank, failure, finish: None };
                self.failures.insert(failed.blank.key, failed);
                return Ok(());
            }
        };
        // A word that is not known means a broken generation or the model's own end: the next batch asks once more. A
        // trial that ends so twice is the model's.
        if reply.may_heal && !self.asked_again.contains(&blank.key) {
            if !has_failed {
                let failed = FailedTrial::from_doubtful(blank, bound, reply);
                self.failures.insert(failed.blank.key, failed);
            }
            return Ok(());
        }
        self.waiting.remove(&blank.key);
        if self.failures.remove(&blank.key).is_some() {
            self.counts.imported_before += 1;
        }
        let unstated = match reply.usage {
            _ if bound.is_none() => bound,
            Some(usage) => unstated_rest(bound, usage),
            None => bound,
        };
        let lost = LostAttempts { unstated, ..reply.lost };
        self.counts.answered += 1;
        let constrain = constrain(self.manifest, &blank.model)?;
        let choices = blank.detail.choices().len();
        let reply = Reply { attempts: 1, lost, ..with_letter(reply, constrain, choices) };
        self.store.append(&answered(blank, reply)?)
    }

    /// Keeps the failure of a trial without a line, if it is waiting for a batch.
    pub(super) fn fail(&mut self, key: TrialKey, failure: Failure) {
        if self.waiting.contains(&key)
            && !self.failures.contains_key(&key)
            && let Some(blank) = self.blanks.get(&key)
        {
            let mut blank = blank.clone().in_batch();
            blank.lost = LostAttempts::default();
            let failed = FailedTrial { blank, failure, finish: None };
            self.failures.insert(key, failed);
        }
    }

    /// Trials whose request failed, with the kind of failure.
    pub(super) fn failures(&self) -> impl Iterator<Item = (TrialKey, FailureKind)> {
        self.failures.iter().map(|(key, failed)| (*key, failed.failure.kind))
    }

    /// Decides about trials that may have been refused for their content, if the run has answers to others. Refused
    /// before in the same words, a trial is stored as a reply that a filter withheld; else it is asked once more.
    /// Returns the trials that are not to be left out of the next batch.
    pub(super) fn filter_refused(&mut self, content: &BTreeSet<TrialKey>) -> Result<Vec<TrialKey>> {
        if content.is_empty() || self.store.trials()?.iter().all(StoredTrial::failed) {
            return Ok(Vec::new());
        }
        let earlier: BTreeMap<TrialKey, String> = self
            .store
            .records()?
            .into_iter()
            .filter(|record| content.contains(&record.key))
            .filter_map(|record| {
                let failure = record.failure?;
                (failure.kind == FailureKind::Request).then_some((record.key, failure.message))
            })
            .collect();
        for (key, message) in earlier {
            let failed = self.failures.get(&key);
            if failed.is_none_or(|failed| failed.failure.message != message) {
                continue;
            }
            if let Some(FailedTrial { blank, failure, .. }) = self.failures.remove(&key) {
                let reply = Reply {
                    refusal: Some(refusal_words(&failure)),
                    finish: Finish::Filter,
                    lost: blank.lost,
                    ..Reply::local(String::new())
                };
                self.waiting.remove(&key);
                self.counts.answered += 1;
                self.store.append(&answered(blank, reply)?)?;
            }
        }
        Ok(content.iter().copied().collect())
    }

    /// Number of waiting trials without a reply or failure.
    fn waiting(&self) -> usize {
        self.waiting.len() - self.failures.len()
    }

    /// Stores the failures, and syncs the records to disk; returns the numbers of lines.
    pub(super) fn finish(mut self) -> Result<ReplyCounts> {
        for failed in std::mem::take(&mut self.failures).into_values() {
            self.counts.failed += 1;
            let record = failed.blank.with_failure(failed.failure, 1);
            self.store.append(&Record { finish: failed.finish, ..record })?;
        }
        self.store.sync()?;
        Ok(self.counts)
    }
}

impl<D> FailedTrial<D> {
    /// A trial whose reply may end in another way at another try; `bound` is the bound of its tokens.
    fn from_doubtful(mut blank: Record<D>, bound: Unstated, reply: Reply) -> Self {
        blank.lost.add(reply.usage);
        if reply.usage.is_none() {
            blank.lost.unstated = bound;
        }
        let end = match &reply.finish {
            Finish::Other(word) => format!("a finish_reason {word:?} that is not known"),
            _ => "thoughts and no answer".to_owned(),
        };
        let failure = Failure {
            kind: FailureKind::Response,
            status: None,
            message: format!("the batch says: {end}; asked once more"),
        };
        Self { blank, failure, finish: Some(reply.finish.shorten()) }
    }
}

/// Status and words of a refusal, as those of a single request are stored.
fn refusal_words(failure: &Failure) -> String {
    let words = failure.message.trim_start_matches("the batch says: ");
    match failure.status {
        Some(status) => {
            let words = words.trim_start_matches(&status.to_string()).trim_start();
            format!("{status}: {words}")
        }
        None => words.to_owned(),
    }
}

/// The part of a token bound that the server's stated tokens leave open.
fn unstated_rest(bound: Unstated, usage: Usage) -> Unstated {
    let tokens = TokenBound { prompt: bound.prompt_tokens, reply: bound.completion_tokens };
    match tokens.missing_from(usage) {
        missing if missing == TokenBound::default() => Unstated::default(),
        missing => missing.unstated(),
    }
}

/// True if a failed request without stated tokens may have been charged.
fn may_be_charged(kind: FailureKind) -> bool {
    matches!(kind, FailureKind::Server | FailureKind::Response)
}

/// Imports the replies in output and error files; returns a summary. Each reply is imported once, even if a file is
/// imported again.
///
/// # Errors
/// If the run has written no batch, or a line is not in the format of a Batch API. Earlier replies stay imported.
pub fn import<D: Detail>(store: &mut Store<D>, manifest: &RunManifest, files: &[PathBuf]) -> Result<String> {
    let folder = store.folder().to_owned();
    let mut replies = ReplyImport::new(store, manifest)?;
    if replies.blanks.is_empty() {
        let problem =
            "this run has written no requests for a batch; write them first, by batch export or openeqa --batch"
                .to_owned();
        return Err(Error::Run { path: folder, problem });
    }
    for path in files {
        let file = files::open(path).map_err(|e| Error::file(path, "read", e))?;
        for (i, line) in BufReader::new(file).lines().enumerate() {
            let line = line.map_err(|e| Error::file(path, "read", e))?;
            if line.trim().is_empty() {
                continue;
            }
            let line = BatchLine::read(&line).ok_or_else(|| not_a_line(path, i + 1))?;
            replies.add_line(line)?;
        }
    }
    let waiting = replies.waiting();
    Ok(summary(&replies.finish()?, waiting))
}

fn not_a_line(path: &Path, line: usize) -> Error {
    let problem = "not a line of a Batch API's output: {\"custom_id\", \"response\", \"error\"} expected";
    Error::line(path, line, problem)
}

/// The constraint on the replies of a model, from the manifest.
fn constrain(manifest: &RunManifest, model: &str) -> Result<Constrain> {
    let value = renamed::current(manifest, model, "--constrain");
    let name = value.as_ref().and_then(Value::as_str);
    name.map_or(Ok(Constrain::None), read_word)
}

fn summary(counts: &ReplyCounts, waiting: usize) -> String {
    let ReplyCounts { answered, failed, imported_before, unknown } = counts;
    let mut text = format!("replies: {answered} imported, {failed} failed");
    if *imported_before > 0 {
        let _ = write!(text, ", {imported_before} imported before");
    }
    if *unknown > 0 {
        let _ = write!(text, ", {unknown} of another run");
    }
    if waiting > 0 {
        let _ = write!(text, ", {waiting} still waiting for a batch");
    }
    text.push('\n');
    if *failed > 0 {
        text.push_str("failed requests are asked again by the next batch export, or by the evaluation itself\n");
    }
    text
}

impl<'a, D: Detail> Driver<'a, D> {
    /// Imports the replies of a part whose batch has ended. Requests without a line in the output fail as timeouts and
    /// may be retried.
    pub(super) fn import_replies(&mut self, part: usize) -> Result<StepOutcome> {
        let Stage::Fetched { state } = self.part(part).stage.clone() else {
            return Ok(StepOutcome::Waiting);
        };
        let (counts, unparsed) = self.import_files(part, Some(&state))?;
        let (answered, failed) = (counts.answered, counts.failed);
        self.warn_if_incomplete(part, unparsed)?;
        self.say(part, &format!("{state}: {answered} answered, {failed} not"));
        self.journal.record(part, PartEvent::TakenOver { answered, failed })?;
        Ok(StepOutcome::Moved)
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
        self.journal.record(part, PartEvent::GaveUp { why })
    }

    /// Gives up a part that the user cancels before its batch is created. Deletes its files at the server, unless the
    /// user keeps files.
    pub(super) async fn withdraw(&mut self, part: usize) -> Result<StepOutcome> {
        if !self.args.collect.keep_files {
            for id in self.files_at_server(part).await? {
                if let Err(failure) = self.delete_file(part, &id).await? {
                    tracing::warn!("the file {id} could not be deleted at the server: {failure}");
                }
            }
        }
        let why = "the batch was cancelled before it was made".to_owned();
        self.give_up(part, why)?;
        Ok(StepOutcome::Moved)
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
    let mut file = BufReader::new(files::open(path).map_err(|e| Error::file(path, "read", e))?);
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

#[cfg(test)]
mod tests {
    use super::*;
    use darkqa_base::types::Digest;

    #[test]
    fn the_key_of_a_line_is_its_first_field() {
        let key = format!("{}", TrialKey::from(Digest::from_bytes(b"trial")));
        assert_eq!(
            key_of(&format!("{{\"custom_id\":\"{key}\",\"body\":{{}}}}")).map(|key| key.to_string()),
            Some(key.clone())
        );
        for line in ["", "{}", "{\"custom_id\":\"x\"}", "{\"body\":{},\"custom_id\":\"\"}"] {
            assert_eq!(key_of(line), None, "{line}");
        }
    }

    #[test]
    fn lines_are_read_to_the_end_without_blank_ones() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("lines");
        std::fs::write(&path, b"a\n\n  \nb\xff\nlast").unwrap();
        let mut lines = Vec::new();
        for_each_line(&path, |line| {
            lines.push(line.to_owned());
            Ok(())
        })
        .unwrap();
        assert_eq!(lines, ["a\n", "b\u{fffd}\n", "last"]);
    }

    #[test]
    fn only_failures_at_the_server_may_be_charged() {
        assert!(may_be_charged(FailureKind::Server) && may_be_charged(FailureKind::Response));
        assert!(!may_be_charged(FailureKind::Timeout) && !may_be_charged(FailureKind::RateLimit));
    }

    #[test]
    fn a_refusal_states_its_status_once() {
        let words = |status, message: &str| {
            refusal_words(&Failure { kind: FailureKind::Response, status, message: message.to_owned() })
        };
        assert_eq!(words(Some(400), "the batch says: 400 too long"), "400: too long");
        assert_eq!(words(Some(400), "too long"), "400: too long");
        assert_eq!(words(None, "the batch says: too long"), "too long");
    }
}
