//! Advances the parts of a batch run, step by step, until nothing is left to do: [`Driver`].
//!
//! The journal records each upload and each creation of a batch before the call, so the driver may be stopped at any
//! time.
//!
//! Conditions for creating the batch of a part: limits of waiting tokens, waits requested by the server, and
//! `--max-cost`.

use std::cell::Cell;
use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use tokio::time::{Instant, sleep};

use super::file::{SHARE_OF_QUOTA, StoppedModels};
use super::journal::{BatchPart, Journal, PartEvent, PartFacts, Stage};
use super::servers::{BatchRunArgs, BatchServers};
use crate::costs::{Budget, InFlightCost, MoneySettings, RunModels};
use crate::images::progress::Progress;
use crate::models::ModelUnderTest;
use darkqa_ask::batch_api::BatchServer;
use darkqa_ask::{AskError, BaseUrl, QuotaRefusal};
use darkqa_base::error::{Error, Result};
use darkqa_base::types::TrialKey;
use darkqa_base::types::manifests::RunManifest;
use darkqa_score::answers::record::Detail;
use darkqa_store::Store;

/// Maximum wait between two checks of the batches, as a multiple of `--poll`; chosen: 5 minutes with the default of 10
/// s.
const MAX_WAIT_POLLS: u32 = 30;

/// Minimum search time for a file or batch that may exist at the server, as a multiple of `--poll`; chosen.
const MIN_SEARCH_POLLS: u32 = 6;

/// Minimum search time for a file or batch that may exist at the server; chosen: the server's lists may be late.
const MIN_SEARCH: Duration = Duration::from_mins(1);

/// The shortest `--poll` for which [`MIN_SEARCH`] applies to a server on this machine; chosen.
const MIN_SEARCH_FROM_POLL: Duration = Duration::from_millis(200);

/// Number of consecutive refused checks of a part that ends the command; chosen.
const MAX_REFUSED_CHECKS: u32 = 10;

/// The outcome of a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum StepOutcome {
    /// The part advanced, and the next step may follow at once.
    Moved,
    /// The part has to wait.
    Waiting,
}

/// Goal of a driver: how far it advances the parts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Goal {
    /// All replies are in the records.
    Imported,
    /// The batches are created, as far as the server accepts them.
    Submitted,
    /// Each batch is checked once; nothing is submitted.
    Checked,
    /// All batches are cancelled or have ended, and their replies are in the records.
    Cancelled,
}

/// Why the driver stopped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Driven {
    /// The goal is reached.
    Reached,
    /// The next part would exceed `--max-cost`.
    OverBudget,
}

/// The parts of a run, with everything needed to advance them.
pub(super) struct Driver<'a, D> {
    pub(super) store: &'a mut Store<D>,
    pub(super) manifest: &'a RunManifest,
    pub(super) journal: &'a mut Journal,
    pub(super) servers: &'a BatchServers,
    /// Models of all phases of the run, used to adapt their requests and to price their replies; empty if no model is
    /// asked again.
    pub(super) models: &'a [&'a ModelUnderTest],
    pub(super) args: &'a BatchRunArgs,
    /// Cost limits; `None` if nothing is submitted.
    pub(super) money: Option<&'a MoneySettings>,
    pub(super) progress: &'a Progress,
    pub(super) until: Goal,
    /// Trials that the server refused and would refuse again.
    pub(super) refused: &'a mut BTreeSet<TrialKey>,
    /// Models whose parts are left as they are.
    pub(super) stopped: &'a mut StoppedModels,
    pub(super) notes: Notes,
}

/// State that a driver keeps only in memory, while it runs.
#[derive(Debug, Default)]
pub(super) struct Notes {
    /// Files at servers that are ready for use in a batch.
    pub(super) ready: BTreeSet<String>,
    /// Time at which the file or batch was first not found, by part.
    pub(super) missing_since: BTreeMap<usize, Instant>,
    /// Time until which nothing is submitted and number of refusals so far, by address and model.
    pub(super) holds: BTreeMap<(String, String), (Instant, u32)>,
    /// Refusals of a batch because too many tokens were waiting, by part.
    pub(super) refused_parts: BTreeMap<usize, u32>,
    /// Consecutive uploads and creations that failed at the server, by part.
    pub(super) failed_calls: BTreeMap<usize, u32>,
    /// Consecutive checks that the server refused, by part.
    pub(super) refused_checks: BTreeMap<usize, u32>,
    /// Consecutive checks of an ended batch with incomplete files, by part.
    pub(super) incomplete_checks: BTreeMap<usize, u32>,
    /// Parts whose files stay at the server, because they were incomplete.
    pub(super) kept_files: BTreeSet<usize>,
    /// Parts checked since the last wait.
    pub(super) checked: BTreeSet<usize>,
    /// Total charge for the stored replies in US dollars; `None` if it must be recomputed.
    pub(super) charged: Cell<Option<f64>>,
    /// The last state printed, by part.
    pub(super) printed: BTreeMap<usize, String>,
    /// Warnings that have been printed.
    pub(super) warned: BTreeSet<String>,
}

impl<D: Detail> Driver<'_, D> {
    /// Advances all parts until the goal is reached or the budget is used up. If a server refuses a call in a way that
    /// would stop every further call for a model, the parts of that model are left as they are.
    ///
    /// # Errors
    /// If a file cannot be written, the server of a part is unknown, or a server refuses a call and the settings end
    /// the run with the first stopped model.
    pub(super) async fn drive(&mut self) -> Result<Driven> {
        let poll = self.args.collect.poll;
        let mut wait = poll;
        loop {
            let mut moved = false;
            self.notes.checked.clear();
            let mut part = 0;
            // The list may grow: the pieces of a divided part are appended.
            while part < self.journal.parts.len() {
                while self.step_or_stop(part).await? == StepOutcome::Moved {
                    moved = true;
                }
                part += 1;
            }
            if self.is_reached()? {
                return Ok(Driven::Reached);
            }
            if self.is_over_budget()? {
                return Ok(Driven::OverBudget);
            }
            wait = if moved { poll } else { (wait * 3 / 2).min(poll * MAX_WAIT_POLLS) };
            sleep(wait).await;
        }
    }

    /// Runs one step of a part, unless its model is stopped. Stops the model if its server refuses the call in a way
    /// that would stop every further call.
    async fn step_or_stop(&mut self, part: usize) -> Result<StepOutcome> {
        if self.is_stopped(part) {
            return Ok(StepOutcome::Waiting);
        }
        match self.step(part).await {
            Err(error @ Error::Endpoint { .. }) if !self.money.is_some_and(|money| money.fail_fast) => {
                self.progress.print_on_terminal(&format!("stopped: {error}"));
                let facts = &self.journal.parts[part].facts;
                self.stopped.add_part(facts, error);
                Ok(StepOutcome::Waiting)
            }
            step => step,
        }
    }

    async fn step(&mut self, part: usize) -> Result<StepOutcome> {
        if self.is_left_alone(part) {
            let base = &self.part(part).facts.base;
            let line = format!("batches at {base} are left alone; name that address, with its key");
            self.warn_once(line);
            return Ok(StepOutcome::Waiting);
        }
        match &self.part(part).stage {
            Stage::Written | Stage::Uploading | Stage::Uploaded if self.until == Goal::Cancelled => {
                self.withdraw(part).await
            }
            Stage::Written => self.upload(part).await,
            Stage::Uploading => self.find_file(part).await,
            Stage::Uploaded => self.create(part).await,
            Stage::Creating => self.find_batch(part).await,
            Stage::Created => self.check_batch(part).await,
            Stage::Fetched { .. } => self.import_replies(part),
            Stage::Imported => self.delete_files(part).await,
            Stage::Ended => Ok(StepOutcome::Waiting),
        }
    }

    /// True if the goal is reached, or no part can advance any more.
    fn is_reached(&self) -> Result<bool> {
        if (0..self.journal.parts.len()).all(|part| self.is_final(part)) {
            return Ok(true);
        }
        Ok(match self.until {
            Goal::Imported | Goal::Cancelled => false,
            Goal::Checked => true,
            Goal::Submitted => {
                let mut nothing_to_submit = true;
                for (index, part) in self.journal.parts.iter().enumerate() {
                    let is_submitted = part.stage == Stage::Created || self.is_final(index);
                    nothing_to_submit &= is_submitted || self.is_held(index)?;
                }
                nothing_to_submit
            }
        })
    }

    fn is_final(&self, part: usize) -> bool {
        self.part(part).stage == Stage::Ended || self.is_left_alone(part) || self.is_stopped(part)
    }

    /// True if the command only checks or cancels batches, and no flag names the server of this part.
    fn is_left_alone(&self, part: usize) -> bool {
        let submits_nothing = matches!(self.until, Goal::Checked | Goal::Cancelled);
        let part = self.part(part);
        submits_nothing && part.stage != Stage::Ended && !self.servers.has(&part.facts.base)
    }

    /// True if the model of a part is stopped.
    fn is_stopped(&self, part: usize) -> bool {
        self.stopped.has_part(&self.part(part).facts)
    }

    pub(super) fn part(&self, part: usize) -> &BatchPart {
        &self.journal.parts[part]
    }

    /// The server of a part.
    pub(super) fn server(&self, part: usize) -> Result<&BatchServer> {
        self.servers.server(&self.part(part).facts)
    }

    /// Prints a warning, unless it has been printed before.
    pub(super) fn warn_once(&mut self, line: String) {
        if !self.notes.warned.contains(&line) {
            tracing::warn!("{line}");
            self.notes.warned.insert(line);
        }
    }

    /// Prints the state of a part, if it differs from the last one printed.
    pub(super) fn say(&mut self, part: usize, what: &str) {
        let before = self.notes.printed.insert(part, what.to_owned());
        if before.as_deref() != Some(what) {
            let line = format!("{}: {what}", self.part(part).name);
            self.progress.print_on_terminal(&line);
        }
    }

    /// Builds the error for a failed call that would fail again.
    pub(super) fn fatal(&self, part: usize, failure: &AskError) -> Error {
        let part = self.part(part);
        Error::Endpoint {
            endpoint: part.facts.base.clone(),
            problem: format!(
                "{}: {failure}; the batches of this run stay as they are, and the same command continues",
                part.name
            ),
        }
    }

    /// Handles a failed check of a part: it is repeated later, and counted if the failure is permanent.
    ///
    /// # Errors
    /// If the last [`MAX_REFUSED_CHECKS`] checks of the part failed permanently, or one did under [`Goal::Checked`]:
    /// the key or the address is wrong.
    pub(super) fn check_failed(&mut self, part: usize, failure: &AskError) -> Result<StepOutcome> {
        tracing::debug!("{}: {failure}", self.part(part).name);
        if failure.is_permanent() {
            let refused = self.notes.refused_checks.entry(part).or_default();
            *refused += 1;
            if *refused >= MAX_REFUSED_CHECKS || self.until == Goal::Checked {
                return Err(self.fatal(part, failure));
            }
        }
        let name = self.part(part).name.clone();
        self.warn_once(format!("{name}: {failure}; tried again"));
        Ok(StepOutcome::Waiting)
    }

    /// True if the file or batch of a part has been missing for long enough to conclude that it does not exist.
    /// Otherwise warns that the search continues. `what` is `file` or `batch`.
    pub(super) fn is_missing(&mut self, part: usize, what: &str) -> bool {
        let now = Instant::now();
        let since = *self.notes.missing_since.entry(part).or_insert(now);
        let search_time = self.search_time(part);
        let is_missing = now - since >= search_time;
        if is_missing {
            self.notes.missing_since.remove(&part);
        } else {
            self.warn_once(format!(
                "{}: the server does not list its {what}; looked for again for {} s, as a list may be late",
                self.part(part).name,
                search_time.as_secs_f64()
            ));
        }
        is_missing
    }

    /// Ends the search for a part's file or batch. A later search has the full time again.
    pub(super) fn end_search(&mut self, part: usize) {
        self.notes.missing_since.remove(&part);
    }

    /// How long to search for the file or batch of a part. A server on this machine with a `--poll` below
    /// [`MIN_SEARCH_FROM_POLL`] is assumed to have up-to-date lists.
    fn search_time(&self, part: usize) -> Duration {
        let poll = self.args.collect.poll;
        let base = self.part(part).facts.base.parse::<BaseUrl>();
        let is_local = base.is_ok_and(|base| base.is_loopback());
        if is_local && poll < MIN_SEARCH_FROM_POLL {
            return poll * MIN_SEARCH_POLLS;
        }
        MIN_SEARCH.max(poll * MIN_SEARCH_POLLS)
    }
}

/// Wait after the first refusal, as a multiple of `--poll`; chosen: a minute with the default of 10 s.
const FIRST_HOLD: u32 = 6;

/// Number of refusals after which a part is split, if nothing else of this run is waiting; chosen.
const REFUSALS_TO_SPLIT: u32 = 3;

/// Maximum number of times that the wait is doubled; chosen: up to half an hour.
const MAX_DOUBLINGS: u32 = 5;

impl<D: Detail> Driver<'_, D> {
    /// True if a part has to wait before its batch is created.
    pub(super) fn is_held(&self, part: usize) -> Result<bool> {
        let held = self.part(part);
        if !held.is_unsubmitted() {
            return Ok(false);
        }
        if matches!(self.until, Goal::Checked | Goal::Cancelled) {
            return Ok(true);
        }
        let scope = held.facts.quota_scope();
        let hold = self.notes.holds.get(&scope);
        if hold.is_some_and(|(until, _)| Instant::now() < *until) {
            return Ok(true);
        }
        let waiting: f64 = self
            .journal
            .parts
            .iter()
            .filter(|other| other.is_out() && other.facts.quota_scope() == scope)
            // Batches of a stopped model are not checked any more, so waiting for them would never end.
            .filter(|other| !self.stopped.has_part(&other.facts))
            .map(|other| other.facts.tokens)
            .sum();
        let is_full =
            self.token_limit(part).is_some_and(|limit| waiting > 0.0 && waiting + held.facts.tokens > limit as f64);
        Ok(is_full || !self.is_affordable(held)?)
    }

    /// Maximum number of tokens waiting for batches of a part's model; `None` if unknown.
    fn token_limit(&self, part: usize) -> Option<u64> {
        let scope = self.part(part).facts.quota_scope();
        let flag = self.args.enqueued_tokens.map(std::num::NonZeroU64::get);
        self.journal.limits.get(&scope).copied().or(flag)
    }

    /// The number of pieces into which a part must be split, because it exceeds the token limit or `--max-cost`, or was
    /// refused several times although nothing else of this run is waiting; `None` if it need not be split.
    pub(super) fn required_pieces(&self, part: usize) -> Result<Option<usize>> {
        if matches!(self.until, Goal::Checked | Goal::Cancelled) {
            return Ok(None);
        }
        let facts = &self.part(part).facts;
        if let Some(requests) = self.requests_within_budget(facts)? {
            return Ok(Some(facts.requests.div_ceil(requests)));
        }
        let Some(limit) = self.token_limit(part) else {
            return Ok(None);
        };
        let limit = limit as f64;
        let refusals = self.notes.refused_parts.get(&part).copied().unwrap_or(0);
        // A single request is tried first, because its tokens are only estimated.
        if facts.tokens > limit && (facts.requests > 1 || refusals > 0) {
            let pieces = (facts.tokens / (SHARE_OF_QUOTA * limit)).ceil() as usize;
            return Ok(Some(pieces));
        }
        let scope = facts.quota_scope();
        let is_alone = !self.journal.parts.iter().any(|other| other.is_out() && other.facts.quota_scope() == scope);
        let is_refused = refusals >= REFUSALS_TO_SPLIT && facts.requests > 1;
        Ok((is_alone && is_refused).then_some(2))
    }

    /// True if the maximum cost of a part is within the remaining budget.
    fn is_affordable(&self, part: &BatchPart) -> Result<bool> {
        let remaining = self.remaining_budget()?;
        Ok(remaining.is_none_or(|remaining| part.facts.max_cost() <= remaining))
    }

    /// The number of requests of a part within the remaining budget, if it is some but not all, and no open batch could
    /// free more budget.
    fn requests_within_budget(&self, facts: &PartFacts) -> Result<Option<usize>> {
        let has_open_cost = self.journal.max_open_cost() > 0.0;
        let Some(remaining) = self.remaining_budget()?.filter(|_| !has_open_cost) else {
            return Ok(None);
        };
        let requests = facts.requests_within(remaining);
        let is_some = (1..facts.requests).contains(&requests) && facts.max_cost() > remaining;
        Ok(is_some.then_some(requests))
    }

    /// The rest of `--max-cost` in US dollars, after all charges and the maximum cost of open batches; `None` without a
    /// limit.
    fn remaining_budget(&self) -> Result<Option<f64>> {
        let Some(money) = self.money else {
            return Ok(None);
        };
        let Some(max_cost) = money.max_cost else {
            return Ok(None);
        };
        let charged = if let Some(charged) = self.notes.charged.get() {
            charged
        } else {
            let run_models = RunModels { models: self.models, manifest: Some(self.manifest) };
            let trials = self.store.trials()?;
            Budget::for_run(money, &[], run_models, &trials)?.charged()
        };
        self.notes.charged.set(Some(charged));
        let killed = InFlightCost::open(self.store.folder())?.killed();
        let remaining = max_cost - charged - killed - self.journal.max_open_cost();
        Ok(Some(remaining))
    }

    /// True if no batch is open, and no unsubmitted part is within the remaining budget.
    pub(super) fn is_over_budget(&self) -> Result<bool> {
        let parts: Vec<&BatchPart> =
            self.journal.parts.iter().filter(|part| !self.stopped.has_part(&part.facts)).collect();
        let unsubmitted: Vec<&BatchPart> = parts.iter().copied().filter(|part| part.is_unsubmitted()).collect();
        if unsubmitted.is_empty() || parts.iter().any(|part| part.is_out()) {
            return Ok(false);
        }
        for part in unsubmitted {
            if self.is_affordable(part)? {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Records that a batch was refused because too many tokens are waiting. A part that must be split advances at
    /// once.
    pub(super) fn quota_reached(&mut self, part: usize, quota: &QuotaRefusal) -> Result<StepOutcome> {
        let limit = quota.limit;
        self.journal.record(part, PartEvent::QuotaReached { limit })?;
        self.hold(part, None);
        *self.notes.refused_parts.entry(part).or_default() += 1;
        let facts = &self.part(part).facts;
        let line = match limit {
            Some(limit) => format!(
                "{}: at most {limit} tokens may wait for batches; further ones are submitted when others have ended",
                facts.model
            ),
            None => format!(
                "{}: too many tokens wait for batches ({}); further ones are submitted later",
                facts.model, quota.message
            ),
        };
        self.warn_once(line);
        Ok(match self.required_pieces(part)? {
            Some(_) => StepOutcome::Moved,
            None => StepOutcome::Waiting,
        })
    }

    /// Submits nothing of the part's model for some time: as long as the server `requested`, or else 1, 2, 4 … 30
    /// minutes with the default `--poll`.
    pub(super) fn hold(&mut self, part: usize, requested: Option<Duration>) {
        let scope = self.part(part).facts.quota_scope();
        let refusals = self.notes.holds.get(&scope).map_or(0, |(_, n)| *n);
        let default = self.args.collect.poll * (FIRST_HOLD << refusals.min(MAX_DOUBLINGS));
        let until = Instant::now() + requested.unwrap_or(default);
        self.notes.holds.insert(scope, (until, refusals + 1));
    }

    /// Ends the wait of a model, because one of its batches has ended.
    pub(super) fn release(&mut self, part: usize) {
        let scope = self.part(part).facts.quota_scope();
        self.notes.holds.remove(&scope);
    }
}
