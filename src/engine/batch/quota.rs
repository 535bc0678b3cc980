//! Conditions for creating the batch of a part: limits of waiting tokens, waits requested by the server, and
//! `--max-cost`.

use std::time::Duration;

use tokio::time::Instant;

use super::driver::{Driver, Goal, Step};
use super::event::{Event, PartFacts};
use super::part::Part;
use super::requests::SHARE_OF_QUOTA;
use crate::ask::QuotaRefusal;
use crate::engine::costs::{Budget, InFlightCost, RunModels};
use crate::error::Result;
use darkqa_score::answers::record::Detail;

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
    fn is_affordable(&self, part: &Part) -> Result<bool> {
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
        let parts: Vec<&Part> = self.journal.parts.iter().filter(|part| !self.stopped.has_part(&part.facts)).collect();
        let unsubmitted: Vec<&Part> = parts.iter().copied().filter(|part| part.is_unsubmitted()).collect();
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
    pub(super) fn quota_reached(&mut self, part: usize, quota: &QuotaRefusal) -> Result<Step> {
        let limit = quota.limit;
        self.journal.record(part, Event::QuotaReached { limit })?;
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
            Some(_) => Step::Moved,
            None => Step::Waiting,
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
