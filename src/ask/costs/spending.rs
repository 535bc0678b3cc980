//! US dollars that the requests of a run cost, or may cost: [`Spending`]. Each request holds a [`Reservation`] at its upper bound until
//! its real charge is known, so that the sum stays below the limit in any order of replies.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio::sync::Notify;

use super::prices::Price;
use super::token_bound::TokenBound;
use crate::types::{LostAttempts, Usage};

/// Share of the limit by which a sum may exceed it, because of rounding.
const ROUNDING: f64 = 1e-9;

/// Factor by which a reply may exceed its limit further than any before; chosen.
const FURTHER: u64 = 4;

/// Charge for one request.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Charge {
    /// Nothing: it was refused, or never sent.
    Nothing,
    /// For the tokens that the server stated.
    Stated(Usage),
    /// Unknown: the server may have worked on it, and stated no tokens.
    Unknown,
}

/// Replies of a model that were charged more tokens than the token limit of their requests.
#[derive(Debug, Default)]
pub(crate) struct ReplyExcess {
    /// Tokens of the longest such reply; 0 if there was none.
    longest: AtomicU64,
    /// The most tokens by which one exceeded its limit.
    most: AtomicU64,
    replies: AtomicU64,
}

impl ReplyExcess {
    /// The tokens to reserve for a reply with this limit: more if the server has exceeded a limit before.
    fn bound(&self, limit: u64) -> u64 {
        let most = self.most.load(Ordering::Relaxed);
        limit.saturating_add(FURTHER.saturating_mul(most))
    }

    /// Tokens of the longest reply beyond a limit; 0 if there was none.
    pub(crate) fn longest(&self) -> u64 {
        self.longest.load(Ordering::Relaxed)
    }

    /// Number of replies beyond their limit.
    pub(crate) fn replies(&self) -> u64 {
        self.replies.load(Ordering::Relaxed)
    }

    fn note(&self, tokens: u64, limit: u64) {
        self.replies.fetch_add(1, Ordering::Relaxed);
        self.longest.fetch_max(tokens, Ordering::Relaxed);
        self.most.fetch_max(tokens - limit, Ordering::Relaxed);
    }
}

/// US dollars spent and reserved, and the limit of both.
#[derive(Debug)]
pub(crate) struct Spending {
    /// Limit in US dollars; `None` for no limit.
    limit: Option<f64>,
    /// US dollars that batches may cost until they have ended.
    elsewhere: f64,
    dollars: Mutex<Dollars>,
    /// Notified when less is reserved than before.
    released: Notify,
}

#[derive(Debug)]
struct Dollars {
    spent: f64,
    /// Dollars of all reservations.
    reserved: f64,
    /// Number of reservations.
    reservations: usize,
    /// Number of requests that wait until they can be sent again; no other request is begun before them.
    waiting: usize,
}

impl Dollars {
    fn reserve(&mut self, dollars: f64) {
        self.reserved += dollars;
        self.reservations += 1;
    }

    fn release(&mut self, dollars: f64) {
        self.reservations -= 1;
        // Exact if nothing is reserved.
        self.reserved = match self.reservations {
            0 => 0.0,
            _ => self.reserved - dollars,
        };
    }
}

/// A request that a reservation is made for.
#[derive(Debug, Clone)]
pub(crate) struct PricedRequest {
    pub(crate) price: Price,
    pub(crate) bound: TokenBound,
    /// Replies of the model beyond the token limit.
    pub(crate) excess: Arc<ReplyExcess>,
}

impl PricedRequest {
    /// The bound, with a longer reply if the model's server has exceeded the token limit before.
    pub(crate) fn current_bound(&self) -> TokenBound {
        TokenBound {
            reply: self.excess.bound(self.bound.reply),
            ..self.bound
        }
    }

    /// The most that the request can cost, in US dollars.
    pub(crate) fn most(&self) -> f64 {
        self.price.max_cost(self.current_bound())
    }
}

impl Spending {
    /// Spending with a limit, if there is one, of which this much is spent; both in US dollars.
    pub(crate) fn new(limit: Option<f64>, spent: f64) -> Self {
        Self {
            limit,
            elsewhere: 0.0,
            dollars: Mutex::new(Dollars {
                spent,
                reserved: 0.0,
                reservations: 0,
                waiting: 0,
            }),
            released: Notify::new(),
        }
    }

    /// The same spending, with batches that may cost this much in US dollars until they have ended.
    pub(crate) fn with_elsewhere(self, elsewhere: f64) -> Self {
        Self { elsewhere, ..self }
    }

    /// Limit in US dollars; `None` for no limit.
    pub(crate) fn limit(&self) -> Option<f64> {
        self.limit
    }

    /// Whether this much more is within the limit, beside all that is spent and reserved.
    fn fits(&self, dollars: &Dollars, more: f64) -> bool {
        let all = dollars.spent + dollars.reserved + self.elsewhere + more;
        self.limit
            .is_none_or(|limit| all <= limit * (1.0 + ROUNDING))
    }

    /// US dollars spent so far.
    pub(crate) fn spent(&self) -> f64 {
        self.dollars().spent
    }

    /// US dollars reserved for requests that have not ended.
    pub(crate) fn reserved(&self) -> f64 {
        self.dollars().reserved
    }

    /// US dollars by which the limit is exceeded; 0 if it is not.
    pub(crate) fn overrun(&self) -> f64 {
        let over = self.limit.map_or(0.0, |limit| self.spent() - limit);
        if over > self.limit.unwrap_or(0.0) * ROUNDING {
            over
        } else {
            0.0
        }
    }

    /// A reservation for a request, if the limit allows it beside all others.
    pub(crate) fn reserve(self: &Arc<Self>, request: PricedRequest) -> Option<Reservation> {
        let bound = request.current_bound();
        let most = request.price.max_cost(bound);
        let mut dollars = self.dollars();
        if dollars.waiting > 0 || !self.fits(&dollars, most) {
            return None;
        }
        dollars.reserve(most);
        drop(dollars);
        Some(Reservation {
            spending: Arc::clone(self),
            request,
            attempts: Mutex::new(Attempts {
                held: Held::Reserved(bound),
                charged: LostAttempts::default(),
            }),
        })
    }

    /// Waits until less is reserved than now.
    pub(crate) async fn released(&self) {
        self.released.notified().await;
    }

    fn dollars(&self) -> MutexGuard<'_, Dollars> {
        self.dollars.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The part of [`Spending`] that one question may cost: one request at a time, with its retries after each other.
#[derive(Debug)]
pub(crate) struct Reservation {
    spending: Arc<Spending>,
    request: PricedRequest,
    attempts: Mutex<Attempts>,
}

#[derive(Debug)]
struct Attempts {
    held: Held,
    /// All requests that were charged, or may have been.
    charged: LostAttempts,
}

/// Dollars that a question holds.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Held {
    /// None: no request is in flight or about to be sent.
    Nothing,
    /// Dollars of a request that is not sent yet.
    Reserved(TokenBound),
    /// Dollars of a request in flight.
    Sent(TokenBound),
}

impl Reservation {
    /// Holds the dollars of the next request. Waits for other requests to end if the limit does not allow it now; false if nothing is
    /// left to wait for.
    pub(crate) async fn hold(&self) -> bool {
        let mut waiting = None;
        loop {
            let released = self.spending.released.notified();
            tokio::pin!(released);
            // From here on, no release is missed.
            released.as_mut().enable();
            {
                let mut attempts = self.attempts();
                if attempts.held != Held::Nothing {
                    return true;
                }
                let bound = self.request.current_bound();
                let most = self.request.price.max_cost(bound);
                let mut dollars = self.spending.dollars();
                if self.spending.fits(&dollars, most) {
                    dollars.reserve(most);
                    attempts.held = Held::Reserved(bound);
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

    /// Notes that the request is sent: from here on it may be charged.
    pub(crate) fn sent(&self) {
        let mut attempts = self.attempts();
        if let Held::Reserved(bound) = attempts.held {
            attempts.held = Held::Sent(bound);
        }
    }

    /// Notes the charge of the request that was sent, and releases the rest.
    pub(crate) fn ended(&self, charge: Charge) {
        let mut attempts = self.attempts();
        let Held::Sent(bound) = attempts.held else {
            return;
        };
        attempts.held = Held::Nothing;
        let price = self.request.price;
        let (stated, missing) = match charge {
            Charge::Nothing => (Usage::default(), TokenBound::default()),
            Charge::Unknown => (Usage::default(), bound),
            Charge::Stated(usage) => (usage, bound.missing_from(usage)),
        };
        if missing != TokenBound::default() {
            attempts.charged.unstated = attempts.charged.unstated.plus(missing.unstated());
        }
        attempts.charged.add(Some(stated));
        let reply = stated.completion_tokens.unwrap_or(0);
        let limit = self.request.bound.reply;
        if reply > limit {
            self.request.excess.note(reply, limit);
        }
        let charged = price.charged(stated) + price.max_cost(missing);
        self.settle(bound, charged);
    }

    /// All requests that were charged, or may have been. A request in flight is one of them.
    pub(crate) fn charged(&self) -> LostAttempts {
        self.ended(Charge::Unknown);
        self.attempts().charged
    }

    fn settle(&self, bound: TokenBound, charged: f64) {
        let mut dollars = self.spending.dollars();
        dollars.release(self.request.price.max_cost(bound));
        dollars.spent += charged;
        drop(dollars);
        self.spending.released.notify_waiters();
    }

    fn attempts(&self) -> MutexGuard<'_, Attempts> {
        self.attempts.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Reservation {
    /// A request that is in flight may be charged; one that was not sent is not.
    fn drop(&mut self) {
        self.ended(Charge::Unknown);
        let held = self.attempts().held;
        if let Held::Reserved(bound) = held {
            self.settle(bound, 0.0);
        }
    }
}

/// A request that waits until it can be sent again, as [`Spending`] counts it.
struct Waiting<'a>(&'a Spending);

impl Drop for Waiting<'_> {
    fn drop(&mut self) {
        self.0.dollars().waiting -= 1;
        // Others may be begun again.
        self.0.released.notify_waiters();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A request that costs up to 100 dollars: a prompt of 10 tokens, and a reply of 90.
    fn request() -> PricedRequest {
        PricedRequest {
            price: Price {
                input: 1e6,
                output: 1e6,
                cached_input: None,
                image_tokens: None,
            },
            bound: TokenBound {
                prompt: 10,
                reply: 90,
            },
            excess: Arc::default(),
        }
    }

    fn usage(prompt: u64, reply: u64) -> Charge {
        Charge::Stated(Usage {
            prompt_tokens: Some(prompt),
            completion_tokens: Some(reply),
            ..Usage::default()
        })
    }

    fn spending() -> Arc<Spending> {
        Arc::new(Spending::new(Some(250.0), 0.0))
    }

    #[test]
    fn requests_reserve_the_most_they_can_cost() {
        let spending = spending();
        let first = spending.reserve(request()).unwrap();
        let second = spending.reserve(request()).unwrap();
        assert!(spending.reserve(request()).is_none());
        for (reservation, reply) in [(&first, 5), (&second, 90)] {
            reservation.sent();
            reservation.ended(usage(10, reply));
        }
        assert!((spending.spent() - 115.0).abs() < 1e-9);
        assert!(spending.reserve(request()).is_some());
    }

    #[test]
    fn a_request_that_was_never_sent_costs_nothing() {
        let spending = spending();
        drop(spending.reserve(request()));
        assert_eq!(spending.spent().to_bits(), 0.0_f64.to_bits());
        let sent = spending.reserve(request()).unwrap();
        sent.sent();
        drop(sent);
        assert!((spending.spent() - 100.0).abs() < 1e-9, "it may be charged");
        assert_eq!(spending.reserved().to_bits(), 0.0_f64.to_bits());
    }

    #[test]
    fn tokens_that_are_not_stated_count_at_their_bound() {
        for (charge, dollars, unstated) in [
            (Charge::Nothing, 0.0, 0),
            (Charge::Unknown, 100.0, 100),
            (usage(0, 0), 100.0, 100),
            (usage(7, 0), 7.0, 0),
            (usage(0, 3), 13.0, 10),
        ] {
            let reservation = Arc::new(Spending::new(None, 0.0))
                .reserve(request())
                .unwrap();
            reservation.sent();
            reservation.ended(charge);
            let own = reservation.spending.spent();
            assert!((own - dollars).abs() < 1e-9, "{charge:?}: {own}");
            let charged = reservation.charged().unstated;
            let tokens = charged.prompt_tokens + charged.completion_tokens;
            assert_eq!(tokens, unstated, "{charge:?}");
        }
    }

    #[tokio::test]
    async fn a_retry_waits_for_others_and_goes_before_new_requests() {
        let spending = spending();
        let retried = spending.reserve(request()).unwrap();
        let other = spending.reserve(request()).unwrap();
        retried.sent();
        retried.ended(usage(10, 90));
        other.sent();
        let (is_held, ()) = tokio::join!(retried.hold(), async {
            tokio::task::yield_now().await;
            assert!(spending.reserve(request()).is_none(), "a retry waits");
            other.ended(usage(10, 5));
        });
        assert!(is_held);
        retried.sent();
        retried.ended(usage(10, 90));
        assert!(!retried.hold().await, "nothing is left to wait for");
    }

    #[test]
    fn replies_beyond_their_limit_raise_the_bound() {
        let request = request();
        let spending = Arc::new(Spending::new(None, 0.0));
        let reservation = spending.reserve(request.clone()).unwrap();
        reservation.sent();
        reservation.ended(usage(10, 91));
        assert_eq!(request.current_bound().reply, 94);
        assert_eq!(
            (request.excess.longest(), request.excess.replies()),
            (91, 1)
        );
    }
}
