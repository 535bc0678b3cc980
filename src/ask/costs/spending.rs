//! Cost of the requests of a run in US dollars, and its limit: [`Spending`].
//!
//! Each request has a [`Reservation`] of its maximum cost until its real charge is known, so that the sum stays below
//! the limit in any order of replies.
//!
//! Charges that a server states, compared with the price table: [`ChargeRatios`].

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio::sync::Notify;

use super::prices::{Price, TokenBound, stated_charge};
use darkqa_base::types::{LostAttempts, ServiceTier, Usage};

/// Tolerance of the limit for rounding errors, as a share of the limit.
const TOLERANCE: f64 = 1e-9;

/// Assumed ratio of the excess of the next reply to the largest excess so far; chosen.
const EXCESS_FACTOR: u64 = 4;

/// Charge for one request.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Charge {
    /// Nothing: the request was refused or never sent.
    Nothing,
    /// The tokens that the server reported.
    Stated(Usage),
    /// Unknown: the server may have worked on the request, but reported no tokens.
    Unknown,
}

/// Statistics of the replies of a model that were charged more tokens than their token limit.
#[derive(Debug, Default)]
pub struct ReplyExcess {
    /// Tokens of the longest such reply; 0 without one.
    longest: AtomicU64,
    /// Maximum number of tokens beyond the limit.
    max_excess: AtomicU64,
    /// Number of such replies.
    replies: AtomicU64,
}

impl ReplyExcess {
    /// Tokens to reserve for a reply with this limit: more than the limit if the server has exceeded a limit before.
    fn bound(&self, limit: u64) -> u64 {
        let max_excess = self.max_excess.load(Ordering::Relaxed);
        limit.saturating_add(EXCESS_FACTOR.saturating_mul(max_excess))
    }

    /// Tokens of the longest reply beyond its limit; 0 without one.
    pub fn longest(&self) -> u64 {
        self.longest.load(Ordering::Relaxed)
    }

    /// Number of replies beyond their limit.
    pub fn replies(&self) -> u64 {
        self.replies.load(Ordering::Relaxed)
    }

    fn record(&self, tokens: u64, limit: u64) {
        self.replies.fetch_add(1, Ordering::Relaxed);
        self.longest.fetch_max(tokens, Ordering::Relaxed);
        self.max_excess.fetch_max(tokens - limit, Ordering::Relaxed);
    }
}

/// US dollars spent and reserved, and the limit of their sum.
#[derive(Debug)]
pub struct Spending {
    /// Limit in US dollars; `None` for no limit.
    limit: Option<f64>,
    /// Maximum cost in US dollars of batches that have not ended.
    pending_batches: f64,
    dollars: Mutex<Dollars>,
    /// Notified when the reserved sum decreases.
    released: Notify,
}

#[derive(Debug)]
struct Dollars {
    spent: f64,
    /// Sum of all reservations.
    reserved: f64,
    /// Number of reservations.
    reservations: usize,
    /// Number of retries that wait for a reservation. New requests get none before them.
    waiting: usize,
}

impl Dollars {
    fn reserve(&mut self, dollars: f64) {
        self.reserved += dollars;
        self.reservations += 1;
    }

    fn release(&mut self, dollars: f64) {
        self.reservations -= 1;
        // Exactly zero without reservations, despite rounding.
        self.reserved = match self.reservations {
            0 => 0.0,
            _ => self.reserved - dollars,
        };
    }
}

/// Price and token bound of a request to reserve money for.
#[derive(Debug, Clone)]
pub struct PricedRequest {
    pub price: Price,
    pub bound: TokenBound,
    /// Replies of the model beyond their token limit.
    pub excess: Arc<ReplyExcess>,
    /// Charges that the model's server states.
    pub charges: Arc<ChargeRatios>,
}

impl PricedRequest {
    /// Token bound; the bound of the reply is higher if the server has exceeded a token limit before.
    pub fn current_bound(&self) -> TokenBound {
        TokenBound { reply: self.excess.bound(self.bound.reply), ..self.bound }
    }

    /// Maximum cost of the request, in US dollars: at the price table, or as much dearer as the server has charged
    /// before.
    pub fn max_cost(&self) -> f64 {
        self.max_cost_within(self.current_bound())
    }

    fn max_cost_within(&self, bound: TokenBound) -> f64 {
        self.charges.factor() * self.price.max_cost(bound)
    }
}

impl Spending {
    /// Creates the spending of a run with an optional limit, of which `spent` is already spent; both in US dollars.
    pub fn new(limit: Option<f64>, spent: f64) -> Self {
        Self {
            limit,
            pending_batches: 0.0,
            dollars: Mutex::new(Dollars { spent, reserved: 0.0, reservations: 0, waiting: 0 }),
            released: Notify::new(),
        }
    }

    /// Sets the maximum cost, in US dollars, of batches that have not ended.
    #[must_use]
    pub fn with_pending_batches(self, pending_batches: f64) -> Self {
        Self { pending_batches, ..self }
    }

    /// Limit in US dollars; `None` for no limit.
    pub fn limit(&self) -> Option<f64> {
        self.limit
    }

    /// True if `additional` dollars fit into the limit, on top of all spent and reserved dollars.
    fn fits(&self, dollars: &Dollars, additional: f64) -> bool {
        let sum = dollars.spent + dollars.reserved + self.pending_batches + additional;
        self.limit.is_none_or(|limit| sum <= limit * (1.0 + TOLERANCE))
    }

    /// US dollars spent so far.
    pub fn spent(&self) -> f64 {
        self.dollars().spent
    }

    /// Adds a charge for which nothing was reserved, in US dollars.
    pub fn add(&self, charged: f64) {
        self.dollars().spent += charged;
    }

    /// US dollars reserved for requests that have not ended.
    pub fn reserved(&self) -> f64 {
        self.dollars().reserved
    }

    /// US dollars spent beyond the limit; 0 within the limit.
    pub fn overrun(&self) -> f64 {
        let over = self.limit.map_or(0.0, |limit| self.spent() - limit);
        if over > self.limit.unwrap_or(0.0) * TOLERANCE { over } else { 0.0 }
    }

    /// Reserves the maximum cost of a request; `None` if the limit does not allow it.
    pub fn reserve(self: &Arc<Self>, request: PricedRequest) -> Option<Reservation> {
        let bound = request.current_bound();
        let max_cost = request.max_cost_within(bound);
        let mut dollars = self.dollars();
        if dollars.waiting > 0 || !self.fits(&dollars, max_cost) {
            return None;
        }
        dollars.reserve(max_cost);
        drop(dollars);
        Some(Reservation {
            spending: Arc::clone(self),
            request,
            attempts: Mutex::new(Attempts { held: Held::Reserved(bound, max_cost), charged: LostAttempts::default() }),
        })
    }

    /// Waits until the reserved sum decreases.
    pub async fn released(&self) {
        self.released.notified().await;
    }

    fn dollars(&self) -> MutexGuard<'_, Dollars> {
        self.dollars.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Money reserved for one question: for one request at a time, including its retries.
#[derive(Debug)]
pub struct Reservation {
    spending: Arc<Spending>,
    request: PricedRequest,
    attempts: Mutex<Attempts>,
}

#[derive(Debug)]
struct Attempts {
    held: Held,
    /// All requests that were or may have been charged.
    charged: LostAttempts,
}

/// Reservation of a question, by the state of its current request: its token bound, and the reserved US dollars.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Held {
    /// No request is in flight or about to be sent.
    Nothing,
    /// The request is not sent yet.
    Reserved(TokenBound, f64),
    /// The request is in flight.
    Sent(TokenBound, f64),
}

impl Reservation {
    /// Reserves the maximum cost of the next request, unless it is already reserved. If the limit does not allow it,
    /// waits for other requests to end; false if there are none.
    pub async fn reserve(&self) -> bool {
        let mut waiting = None;
        loop {
            let released = self.spending.released.notified();
            tokio::pin!(released);
            // Registers for notifications now, so that no release is missed.
            released.as_mut().enable();
            {
                let mut attempts = self.attempts();
                if attempts.held != Held::Nothing {
                    return true;
                }
                let bound = self.request.current_bound();
                let max_cost = self.request.max_cost_within(bound);
                let mut dollars = self.spending.dollars();
                if self.spending.fits(&dollars, max_cost) {
                    dollars.reserve(max_cost);
                    attempts.held = Held::Reserved(bound, max_cost);
                    return true;
                }
                if dollars.reservations == 0 {
                    return false;
                }
                if waiting.is_none() {
                    dollars.waiting += 1;
                    waiting = Some(Waiting(&self.spending));
                }
            }
            released.await;
        }
    }

    /// Records that the request is sent, so that it may be charged.
    pub fn mark_sent(&self) {
        let mut attempts = self.attempts();
        if let Held::Reserved(bound, dollars) = attempts.held {
            attempts.held = Held::Sent(bound, dollars);
        }
    }

    /// Replaces the reservation of the sent request by its charge.
    pub fn settle(&self, charge: Charge) {
        let mut attempts = self.attempts();
        let Held::Sent(bound, reserved) = attempts.held else {
            return;
        };
        attempts.held = Held::Nothing;
        let price = self.request.price;
        let (stated, missing) = match charge {
            Charge::Nothing => (Usage::default(), TokenBound::default()),
            Charge::Unknown => (Usage::default(), bound),
            Charge::Stated(usage) => (usage, bound.missing_from(usage)),
        };
        // The server did not report all tokens: the missing ones count at their bound.
        if missing != TokenBound::default() {
            attempts.charged.unstated = attempts.charged.unstated.plus(missing.unstated());
        }
        attempts.charged.add(Some(stated));
        let reply = stated.completion_tokens.unwrap_or(0);
        let limit = self.request.bound.reply;
        if reply > limit {
            self.request.excess.record(reply, limit);
        }
        self.request.charges.record(price, stated, 1.0);
        let charged = price.charged(stated) + self.request.max_cost_within(missing);
        self.release(reserved, charged);
    }

    /// Ends the reservation, and returns all requests that were or may have been charged, including one in flight.
    pub fn charged(&self) -> LostAttempts {
        self.settle(Charge::Unknown);
        self.attempts().charged
    }

    /// Releases the `reserved` US dollars, and adds `charged` ones to the spent sum.
    fn release(&self, reserved: f64, charged: f64) {
        let mut dollars = self.spending.dollars();
        dollars.release(reserved);
        dollars.spent += charged;
        drop(dollars);
        self.spending.released.notify_waiters();
    }

    fn attempts(&self) -> MutexGuard<'_, Attempts> {
        self.attempts.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Reservation {
    /// A request in flight may be charged; a request that was not sent is not.
    fn drop(&mut self) {
        self.settle(Charge::Unknown);
        let held = self.attempts().held;
        if let Held::Reserved(_, reserved) = held {
            self.release(reserved, 0.0);
        }
    }
}

/// Counts a waiting retry in [`Spending`] until dropped.
struct Waiting<'a>(&'a Spending);

impl Drop for Waiting<'_> {
    fn drop(&mut self) {
        self.0.dollars().waiting -= 1;
        // New requests may get reservations again.
        self.0.released.notify_waiters();
    }
}

/// Relative difference between a stated charge and the price table from which it is said; chosen: more than rounding.
const RATIO_TOLERANCE: f64 = 0.05;

/// Ratio of the highest to the lowest charge per list price from which charges vary from reply to reply; chosen.
const VARYING: f64 = 1.1;

/// Assumed ratio of the dearest charge to the list price if the charges vary; chosen: the dearest provider of a model
/// costs about ten times the cheapest. A higher ratio replaces it once a reply has it.
const MAX_VARYING: f64 = 10.0;

/// A charge that a server states, and the price of its tokens by the table; in US dollars.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StatedAndListed {
    pub stated: f64,
    pub listed: f64,
}

/// Ratios of the charges that a server states for a model to the price table.
#[derive(Debug, Default)]
pub struct ChargeRatios(Mutex<Ratios>);

#[derive(Debug, Clone, Copy, Default)]
struct Ratios {
    /// Lowest and highest ratio; `None` without a stated charge.
    range: Option<(f64, f64)>,
    /// Sums of stated charges and of the list prices of the same requests, in US dollars.
    sums: (f64, f64),
    /// First charge that differs from the price table.
    differing: Option<StatedAndListed>,
    /// First charge that is no plausible price of its tokens.
    implausible: Option<StatedAndListed>,
    /// First service tier without a known price.
    unknown_tier: Option<ServiceTier>,
}

impl ChargeRatios {
    /// Adds the charge of a request whose tokens cost a `share` of their price.
    pub fn record(&self, price: Price, usage: Usage, share: f64) {
        let listed = share * price.list_charge(usage);
        let mut ratios = self.lock();
        if let Some(tier) = usage.service_tier.filter(|tier| price.tiers.is_unknown(*tier)) {
            ratios.unknown_tier.get_or_insert(tier);
        }
        let Some(cost) = usage.cost.filter(|_| listed > 0.0) else {
            return;
        };
        let stated = cost.dollars();
        let pair = StatedAndListed { stated, listed };
        if stated_charge(usage, listed).is_none() {
            ratios.implausible.get_or_insert(pair);
            return;
        }
        let ratio = stated / listed;
        let (lowest, highest) = ratios.range.unwrap_or((ratio, ratio));
        ratios.range = Some((lowest.min(ratio), highest.max(ratio)));
        ratios.sums.0 += stated;
        ratios.sums.1 += listed;
        if (ratio - 1.0).abs() > RATIO_TOLERANCE {
            ratios.differing.get_or_insert(pair);
        }
    }

    /// Factor by which the upper bound of the next request exceeds its list price; at least 1.
    pub fn factor(&self) -> f64 {
        let Some((lowest, highest)) = self.lock().range else {
            return 1.0;
        };
        let spread = highest / lowest;
        let is_dear = highest > 1.0 + RATIO_TOLERANCE;
        if is_dear && spread > VARYING { highest.max((highest * spread).min(MAX_VARYING)) } else { highest.max(1.0) }
    }

    /// Mean ratio of the stated charges to the list price; `None` without a stated charge.
    pub fn mean(&self) -> Option<f64> {
        let (stated, listed) = self.lock().sums;
        (listed > 0.0).then(|| stated / listed)
    }

    /// The first stated charge that differs from the price table by more than [`RATIO_TOLERANCE`].
    pub fn differing(&self) -> Option<StatedAndListed> {
        self.lock().differing
    }

    /// The first stated charge that is no plausible price of its tokens.
    pub fn implausible(&self) -> Option<StatedAndListed> {
        self.lock().implausible
    }

    /// True if a reply was at a service tier without a known price.
    pub fn has_unknown_tier(&self) -> bool {
        self.lock().unknown_tier.is_some()
    }

    fn lock(&self) -> MutexGuard<'_, Ratios> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::costs::prices::TierFactors;
    use darkqa_base::types::StatedCost;

    /// A request that costs up to 100 dollars: a prompt of 10 tokens, and a reply of 90.
    fn request() -> PricedRequest {
        PricedRequest {
            price: Price {
                input: 1e6,
                output: 1e6,
                cached_input: None,
                image_tokens: None,
                tiers: TierFactors::default(),
            },
            bound: TokenBound { prompt: 10, reply: 90 },
            excess: Arc::default(),
            charges: Arc::default(),
        }
    }

    fn usage(prompt: u64, reply: u64) -> Charge {
        Charge::Stated(Usage { prompt_tokens: Some(prompt), completion_tokens: Some(reply), ..Usage::default() })
    }

    fn spending() -> Arc<Spending> {
        Arc::new(Spending::new(Some(250.0), 0.0))
    }

    #[test]
    fn requests_reserve_their_maximum_cost() {
        let spending = spending();
        let first = spending.reserve(request()).unwrap();
        let second = spending.reserve(request()).unwrap();
        assert!(spending.reserve(request()).is_none());
        for (reservation, reply) in [(&first, 5), (&second, 90)] {
            reservation.mark_sent();
            reservation.settle(usage(10, reply));
        }
        assert!((spending.spent() - 115.0).abs() < 1e-9);
        assert!(spending.reserve(request()).is_some());
    }

    #[test]
    fn unsent_requests_cost_nothing() {
        let spending = spending();
        drop(spending.reserve(request()));
        assert_eq!(spending.spent().to_bits(), 0.0_f64.to_bits());
        let sent = spending.reserve(request()).unwrap();
        sent.mark_sent();
        drop(sent);
        assert!((spending.spent() - 100.0).abs() < 1e-9, "it may be charged");
        assert_eq!(spending.reserved().to_bits(), 0.0_f64.to_bits());
    }

    #[test]
    fn unreported_tokens_count_at_their_bound() {
        for (charge, dollars, unstated) in [
            (Charge::Nothing, 0.0, 0),
            (Charge::Unknown, 100.0, 100),
            (usage(0, 0), 100.0, 100),
            (usage(7, 0), 7.0, 0),
            (usage(0, 3), 13.0, 10),
        ] {
            let reservation = Arc::new(Spending::new(None, 0.0)).reserve(request()).unwrap();
            reservation.mark_sent();
            reservation.settle(charge);
            let spent = reservation.spending.spent();
            assert!((spent - dollars).abs() < 1e-9, "{charge:?}: {spent}");
            let charged = reservation.charged().unstated;
            let tokens = charged.prompt_tokens + charged.completion_tokens;
            assert_eq!(tokens, unstated, "{charge:?}");
        }
    }

    #[tokio::test]
    async fn retries_have_priority_over_new_requests() {
        let spending = spending();
        let retried = spending.reserve(request()).unwrap();
        let other = spending.reserve(request()).unwrap();
        retried.mark_sent();
        retried.settle(usage(10, 90));
        other.mark_sent();
        let (is_held, ()) = tokio::join!(retried.reserve(), async {
            tokio::task::yield_now().await;
            assert!(spending.reserve(request()).is_none(), "a retry waits");
            other.settle(usage(10, 5));
        });
        assert!(is_held);
        retried.mark_sent();
        retried.settle(usage(10, 90));
        assert!(!retried.reserve().await, "nothing is left to wait for");
    }

    /// A reply for which the server states a charge in US dollars, of tokens that cost 15.
    fn stated(dollars: f64) -> Charge {
        Charge::Stated(Usage {
            prompt_tokens: Some(10),
            completion_tokens: Some(5),
            cost: StatedCost::from_dollars(dollars),
            ..Usage::default()
        })
    }

    #[test]
    fn stated_charges_count_and_raise_later_reservations() {
        let (spending, request) = (spending(), request());
        let first = spending.reserve(request.clone()).unwrap();
        first.mark_sent();
        first.settle(stated(30.0));
        assert!((spending.spent() - 30.0).abs() < 1e-9);
        let second = spending.reserve(request.clone()).unwrap();
        assert!((spending.reserved() - 200.0).abs() < 1e-9);
        assert!(spending.reserve(request.clone()).is_none());
        second.mark_sent();
        // A request without a known charge counts as dear as the others.
        second.settle(Charge::Unknown);
        assert!((spending.spent() - 230.0).abs() < 1e-9);
        assert_eq!(spending.reserved().to_bits(), 0.0_f64.to_bits());
        assert!(request.charges.differing().is_some());
    }

    #[test]
    fn list_prices_stated_change_nothing() {
        let (spending, request) = (spending(), request());
        let first = spending.reserve(request.clone()).unwrap();
        first.mark_sent();
        first.settle(stated(15.0));
        let _second = spending.reserve(request.clone()).unwrap();
        assert!((spending.reserved() - 100.0).abs() < 1e-9);
        assert_eq!(request.charges.differing(), None);
    }

    #[test]
    fn implausible_charges_are_replaced_by_the_price_table() {
        let (spending, request) = (spending(), request());
        let first = spending.reserve(request.clone()).unwrap();
        first.mark_sent();
        first.settle(stated(0.0));
        assert!((spending.spent() - 15.0).abs() < 1e-9);
        assert!(request.charges.implausible().is_some());
    }

    #[test]
    fn long_replies_raise_the_bound() {
        let request = request();
        let spending = Arc::new(Spending::new(None, 0.0));
        let reservation = spending.reserve(request.clone()).unwrap();
        reservation.mark_sent();
        reservation.settle(usage(10, 91));
        assert_eq!(request.current_bound().reply, 94);
        assert_eq!((request.excess.longest(), request.excess.replies()), (91, 1));
    }

    fn price() -> Price {
        Price {
            input: 1e6,
            output: 0.0,
            cached_input: None,
            image_tokens: None,
            tiers: crate::costs::TierFactors::default(),
        }
    }

    /// Records charges for one token, which costs a dollar.
    fn ratios(charges: &[f64]) -> ChargeRatios {
        let ratios = ChargeRatios::default();
        for charge in charges {
            let usage = Usage { prompt_tokens: Some(1), cost: StatedCost::from_dollars(*charge), ..Usage::default() };
            ratios.record(price(), usage, 1.0);
        }
        ratios
    }

    #[test]
    fn the_factor_follows_the_stated_charges() {
        for (charges, factor) in [
            (&[][..], 1.0),
            (&[1.0, 1.0], 1.0),
            (&[0.4, 0.5], 1.0),
            (&[5.0], 5.0),
            (&[5.0, 5.2], 5.2),
            (&[1.0, 2.0], 4.0),
            (&[1.0, 4.0], 10.0),
            (&[1.0, 12.0], 12.0),
        ] {
            let found = ratios(charges).factor();
            assert!((found - factor).abs() < 1e-9, "{charges:?}: {found}");
        }
    }

    #[test]
    fn only_differing_charges_are_said() {
        assert_eq!(ratios(&[1.0, 1.03]).differing(), None);
        let dear = ratios(&[1.0, 5.0]);
        let expected = StatedAndListed { stated: 5.0, listed: 1.0 };
        assert_eq!(dear.differing(), Some(expected));
        assert_eq!(dear.mean(), Some(3.0));
    }

    #[test]
    fn implausible_charges_do_not_count() {
        for (charge, is_counted) in [(0.0, false), (0.001, false), (0.02, true), (99.0, true)] {
            let ratios = ratios(&[charge]);
            assert_eq!(ratios.mean().is_some(), is_counted, "{charge}");
            assert_eq!(ratios.implausible().is_none(), is_counted, "{charge}");
        }
    }
}
