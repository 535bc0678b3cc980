//! When the batch of a part may be made: limits of waiting tokens, waits that the server asked for, and `--max-cost`.

use std::time::Duration;

use tokio::time::Instant;

use super::driver::{Driver, Goal, Step};
use super::event::{Event, PartFacts};
use super::part::Part;
use super::requests::SHARE_OF_QUOTA;
use crate::ask::QuotaRefusal;
use crate::engine::costs::{Answering, Budget, InFlightCost};
use crate::error::Result;
use darkqa_score::answers::record::Detail;

/// How many looks long nothing is submitted after the first refusal; chosen: a minute with the default of 10 s.
const FIRST_HOLD: u32 = 6;

/// How often a part is refused before it is divided, if nothing else of this run waits; chosen.
const REFUSALS_TO_SPLIT: u32 = 3;

/// How often that time doubles; chosen: up to half an hour.
const MOST_DOUBLINGS: u32 = 5;

impl<D: Detail> Driver<'_, D> {
    /// Whether a part has to wait before its batch is made.
    pub(super) fn is_held(&self, part: usize) -> Result<bool> {
        let of = self.part(part);
        if !of.is_unsubmitted() {
            return Ok(false);
        }
        if matches!(self.until, Goal::LookedAt | Goal::Cancelled) {
            return Ok(true);
        }
        let place = of.facts.place();
        let hold = self.notes.holds.get(&place);
        if hold.is_some_and(|(until, _)| Instant::now() < *until) {
            return Ok(true);
        }
        // Those of a stopped model are not looked at any more, so nobody waits for them.
        let out = |other: &&Part| {
            other.is_out() && other.facts.place() == place && !self.stopped.has_part(&other.facts)
        };
        let waiting: f64 = self
            .journal
            .parts
            .iter()
            .filter(out)
            .map(|other| other.facts.tokens)
            .sum();
        let limit = self.limit(part);
        let is_full = |limit: u64| waiting > 0.0 && waiting + of.facts.tokens > limit as f64;
        Ok(limit.is_some_and(is_full) || !self.is_affordable(of)?)
    }

    /// The number of tokens that may wait for batches of a part's model; `None` if it is not known.
    fn limit(&self, part: usize) -> Option<u64> {
        let learned = self.journal.limits.get(&self.part(part).facts.place());
        let flag = self.args.enqueued_tokens.map(std::num::NonZeroU64::get);
        learned.copied().or(flag)
    }

    /// Into how many pieces a part must be divided, because it is larger than what may wait or than what `--max-cost` allows, or was
    /// refused several times although nothing of this run waits; `None` if it may stay.
    pub(super) fn too_large(&self, part: usize) -> Result<Option<usize>> {
        if matches!(self.until, Goal::LookedAt | Goal::Cancelled) {
            return Ok(None);
        }
        let of = self.part(part);
        if let Some(requests) = self.requests_within_budget(&of.facts)? {
            return Ok(Some(of.facts.requests.div_ceil(requests)));
        }
        let Some(limit) = self.limit(part) else {
            return Ok(None);
        };
        let limit = limit as f64;
        let refusals = self.notes.refused_parts.get(&part).copied().unwrap_or(0);
        // A request alone is tried: its tokens are only estimated.
        if of.facts.tokens > limit && (of.facts.requests > 1 || refusals > 0) {
            let pieces = (of.facts.tokens / (SHARE_OF_QUOTA * limit)).ceil() as usize;
            return Ok(Some(pieces));
        }
        let place = of.facts.place();
        let mut others = self.journal.parts.iter();
        let is_alone = !others.any(|other| other.is_out() && other.facts.place() == place);
        let is_refused = refusals >= REFUSALS_TO_SPLIT && of.facts.requests > 1;
        Ok((is_alone && is_refused).then_some(2))
    }

    /// Whether a part at its upper bound, with all that was charged and all that batches may cost, is within `--max-cost`.
    fn is_affordable(&self, part: &Part) -> Result<bool> {
        let left = self.left()?;
        Ok(left.is_none_or(|left| part.facts.most_cost() <= left))
    }

    /// The number of requests of a part that `--max-cost` allows, if it allows some, but not all, and no batch is out whose end would
    /// allow more.
    fn requests_within_budget(&self, facts: &PartFacts) -> Result<Option<usize>> {
        let is_waited_for = self.journal.most_dollars() > 0.0;
        let Some(left) = self.left()?.filter(|_| !is_waited_for) else {
            return Ok(None);
        };
        let requests = facts.requests_within(left);
        let is_some = (1..facts.requests).contains(&requests) && facts.most_cost() > left;
        Ok(is_some.then_some(requests))
    }

    /// Remaining US dollars of `--max-cost`, after all charges and the upper bounds of batches; `None` without a limit.
    fn left(&self) -> Result<Option<f64>> {
        let limit = self.money.and_then(|money| Some((money, money.max_cost?)));
        let Some((money, max_cost)) = limit else {
            return Ok(None);
        };
        let charged = if let Some(charged) = self.notes.charged.get() {
            charged
        } else {
            let answering = Answering {
                models: self.models,
                manifest: Some(self.manifest),
            };
            let trials = self.store.trials()?;
            Budget::for_run(money, &[], answering, &trials)?.charged()
        };
        self.notes.charged.set(Some(charged));
        let killed = InFlightCost::open(self.store.folder())?.killed();
        let left = max_cost - charged - killed - self.journal.most_dollars();
        Ok(Some(left))
    }

    /// Whether nothing is out, and no part that is left is within `--max-cost`.
    pub(super) fn is_over_budget(&self) -> Result<bool> {
        let parts = &self.journal.parts;
        let open = parts
            .iter()
            .filter(|part| !self.stopped.has_part(&part.facts));
        let (mut left, mut is_out) = (Vec::new(), false);
        for part in open {
            is_out |= part.is_out();
            left.extend(Some(part).filter(|part| part.is_unsubmitted()));
        }
        if left.is_empty() || is_out {
            return Ok(false);
        }
        for part in left {
            if self.is_affordable(part)? {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Notes that a batch was refused because too many tokens wait. A part that is too large goes on at once, to be divided.
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
        Ok(match self.too_large(part)? {
            Some(_) => Step::Moved,
            None => Step::Waiting,
        })
    }

    /// Submits nothing of the part's model for a time: as long as the server asked, else 1, 2, 4 … 30 minutes with the default `--poll`.
    pub(super) fn hold(&mut self, part: usize, asked: Option<Duration>) {
        let place = self.part(part).facts.place();
        let refusals = self.notes.holds.get(&place).map_or(0, |(_, n)| *n);
        let own = self.args.collect.poll * (FIRST_HOLD << refusals.min(MOST_DOUBLINGS));
        let until = Instant::now() + asked.unwrap_or(own);
        self.notes.holds.insert(place, (until, refusals + 1));
    }

    /// Ends the waits of a model, because a batch of it has ended.
    pub(super) fn release(&mut self, part: usize) {
        let place = self.part(part).facts.place();
        self.notes.holds.remove(&place);
    }
}
