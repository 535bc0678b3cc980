//! Imports the output of a Batch API into a run: [`import`].

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::fmt::Write;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::ask::batch::{BatchLine, with_letter};
use crate::ask::{Constrain, TokenBound};
use crate::error::{Error, Result};
use crate::files::reading;
use crate::runs::changed_settings;
use crate::store::{Store, StoredTrial};
use crate::types::flags::read_word;
use crate::types::manifests::RunManifest;
use crate::types::{Failure, FailureKind, Finish, LostAttempts, Record, Reply, TrialKey, Unstated, Usage};
use darkqa_score::answers::record::{Detail, answered};

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
pub(crate) fn import<D: Detail>(store: &mut Store<D>, manifest: &RunManifest, files: &[PathBuf]) -> Result<String> {
    let folder = store.folder().to_owned();
    let mut replies = ReplyImport::new(store, manifest)?;
    if replies.blanks.is_empty() {
        let problem =
            "this run has written no requests for a batch; write them first, by batch export or openeqa --batch"
                .to_owned();
        return Err(Error::Run { path: folder, problem });
    }
    for path in files {
        let file = reading::open(path).map_err(|e| Error::file(path, "read", e))?;
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
    let value = changed_settings::current(manifest, model, "--constrain");
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
