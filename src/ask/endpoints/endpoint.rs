//! A server at one or several addresses, with retries and load balancing: [`Endpoint`].
//!
//! The requests of one question: [`QuestionAttempts`].

use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use backon::{BackoffBuilder as _, ExponentialBuilder};
use reqwest::header::HeaderMap;
use tokio::sync::{OnceCell, watch};
use tokio::time::{Instant, sleep, timeout};
use tracing::{debug, warn};

use super::access::Access;
use super::load_balancer::{Failover, LoadBalancer, ModelIndex, Sending};
use super::replica::Replica;
use super::url::BaseUrl;
use crate::batch_api::BatchServer;
use crate::costs::{Charge, Reservation};
use crate::failures::{AskError, Reach, Retry, Unfinished};
use crate::pace::{Gate, HeldBack, Quota, RateLimits};
use crate::requests::Request;
use crate::vendors::Vendor;
use crate::wire_kind::Wire;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::text::counted;
use darkqa_base::types::{FailureKind, LostAttempts, Reply};

/// Maximum wait between retries if the server does not ask for one; chosen. A server may ask for longer waits.
const MAX_DELAY: Duration = Duration::from_secs(30);

/// Maximum time for the comparison of replicas before the first request; chosen.
const COMPARE_TIMEOUT: Duration = Duration::from_secs(3);

/// Time without an accepted request after which the user is warned that the run waits; at most half of
/// [`Sending::patience`]. Chosen: pauses because of limits per minute are mostly shorter.
const LONG_REFUSAL: Duration = Duration::from_secs(20);

/// Maximum time of a refusal with status 503 by a server that is starting; chosen: such a server does not begin to work
/// on the request.
const QUICK_REFUSAL: Duration = Duration::from_secs(10);

/// Maximum time between two requests to a server that is starting; chosen: large models load for minutes.
const MAX_START_DELAY: Duration = Duration::from_secs(5);

/// Phrases for a server that is starting, in lower case.
const STARTING: [&str; 4] = ["loading", "starting", "warming up", "initializing"];

/// A server of one replica, or of several replicas that serve the same models.
///
/// With several replicas, a request goes to one with few requests in flight. Requests about the same images go to the
/// same replica if its load allows it, to reuse its prefix cache. A request that one replica cannot serve goes to
/// another without using a retry.
#[derive(Debug)]
pub struct Endpoint {
    replicas: Vec<Replica>,
    sending: Sending,
    /// Limiter of the user's quota for all replicas together; `None` with one replica, whose own gate does it.
    quota: Option<Gate>,
    load_balancer: LoadBalancer,
    /// By model id: set after the replicas' descriptions of the model were compared.
    compared: Mutex<HashMap<String, Arc<OnceCell<()>>>>,
    closing: watch::Sender<bool>,
    /// True after the first reply or the first warning about a failed connection.
    connection_reported: AtomicBool,
    /// Number of replies so far.
    replies: AtomicU64,
    /// True if the user was warned, after the last reply, that the endpoint refuses all requests.
    refusal_reported: AtomicBool,
}

impl Endpoint {
    /// Prepares an endpoint at one address; nothing is sent yet.
    ///
    /// # Errors
    /// If a key would be sent unencrypted to another machine, or if two keys are set.
    pub fn open(access: Access, sending: Sending) -> Result<Self> {
        Self::from_addresses(vec![access], sending)
    }

    /// Prepares an endpoint with a replica at each address; nothing is sent yet. The user's limits apply to all
    /// replicas together.
    ///
    /// # Errors
    /// As [`Endpoint::open`], or if there is no address.
    pub fn from_addresses(addresses: Vec<Access>, sending: Sending) -> Result<Self> {
        let count = addresses.len();
        let replica_sending = if count > 1 {
            Sending { quota: Quota::default(), concurrency: sending.concurrency.per_replica(count), ..sending }
        } else {
            sending
        };
        let replicas =
            addresses.into_iter().map(|access| Replica::open(access, replica_sending)).collect::<Result<Vec<_>>>()?;
        if replicas.is_empty() {
            return Err(Error::usage("--base-url", "an address expected"));
        }
        Ok(Self {
            load_balancer: LoadBalancer::new(replicas.iter().map(|replica| replica.base().to_string())),
            quota: (count > 1).then(|| Gate::new(sending.quota)),
            replicas,
            sending,
            compared: Mutex::default(),
            closing: watch::Sender::new(false),
            connection_reported: AtomicBool::new(false),
            replies: AtomicU64::new(0),
            refusal_reported: AtomicBool::new(false),
        })
    }

    /// Adds a model with this id. Its state at the replicas is separate from that of other models.
    pub fn add_model(&self, id: &str) -> ModelIndex {
        self.load_balancer.add_model(id.to_owned())
    }

    /// Maximum number of requests in flight at the moment, at all replicas that accept this model, within
    /// [`Sending::concurrency`].
    pub fn width(&self, model: ModelIndex) -> usize {
        let width: usize = self.accepting_replicas(model).map(Replica::width).sum();
        width.max(1)
    }

    /// Replicas that accept requests to a model.
    fn accepting_replicas(&self, model: ModelIndex) -> impl Iterator<Item = &Replica> {
        self.replicas
            .iter()
            .enumerate()
            .filter(move |(index, _)| self.load_balancer.accepts(model, *index))
            .map(|(_, replica)| replica)
    }

    /// The base URL of the first replica; its `Display` form has no user name, password and query string.
    #[must_use]
    pub fn base(&self) -> &BaseUrl {
        self.replicas[0].base()
    }

    /// Vendor of the first replica; `None` if no table lists its host.
    pub fn vendor(&self) -> Option<&'static Vendor> {
        self.replicas[0].vendor()
    }

    pub fn has_key(&self) -> bool {
        self.replicas[0].has_key()
    }

    /// Maximum number of retries of a question after charged requests without a reply.
    pub fn paid_retries(&self) -> u32 {
        self.sending.paid_retries
    }

    /// Time for which requests had to wait for their turn so far.
    pub fn held_back(&self) -> HeldBack {
        self.replicas
            .iter()
            .map(|replica| &replica.gate)
            .chain(&self.quota)
            .map(Gate::held_back)
            .fold(HeldBack::default(), HeldBack::longest)
    }

    /// Headers of every request through this API, for each replica.
    pub fn headers(&self, wire: Wire) -> Result<Vec<HeaderMap>> {
        self.replicas.iter().map(|replica| replica.headers(wire)).collect()
    }

    /// Client for the Files and Batch APIs of the first replica.
    ///
    /// # Errors
    /// If a header value has characters that HTTP does not allow.
    pub fn batch_server(&self) -> Result<BatchServer> {
        let first = &self.replicas[0];
        let headers = first.headers(Wire::Chat)?;
        let connection = first.connection.clone();
        Ok(BatchServer::new(connection, headers, self.sending.timeout))
    }

    /// True if both endpoints use the same account for files and batches: the same address, key and headers.
    ///
    /// # Errors
    /// If a header value has characters that HTTP does not allow.
    pub fn shares_account_with(&self, other: &Self) -> Result<bool> {
        let (own, other) = (&self.replicas[0], &other.replicas[0]);
        let is_same_base = own.base() == other.base();
        Ok(is_same_base && own.headers(Wire::Chat)? == other.headers(Wire::Chat)?)
    }

    /// Stops further requests: requests in flight finish, waiting requests fail at once.
    pub fn close(&self) {
        self.closing.send_replace(true);
    }

    /// Waits until the endpoint is closed.
    async fn closed(&self) {
        // The sender lives as long as the endpoint, so only a change can end this wait.
        let _ = self.closing.subscribe().wait_for(|closing| *closing).await;
    }

    /// Awaits a future, or fails as soon as the endpoint is closed.
    async fn unless_closed<T>(&self, future: impl Future<Output = T>) -> Result<T, AskError> {
        let message = "the run ended before it was asked";
        tokio::select! {
            biased;
            () = self.closed() => Err(AskError {
                reach: Reach::Interrupted,
                ..AskError::new(FailureKind::Connection, message.to_owned())
            }),
            value = future => Ok(value),
        }
    }

    /// Sends a request, with retries after temporary failures. While the endpoint accepts no requests, the request
    /// waits without using a retry, for at most [`Sending::patience`]. The future may be dropped at any time.
    pub async fn ask(&self, request: &Request<'_>) -> Result<Reply, AskError> {
        if self.replicas.len() > 1 {
            self.compared(&request.sent.parameters.model)
                .get_or_init(|| async {
                    // Slower servers are not compared.
                    let _ = timeout(COMPARE_TIMEOUT, self.compare_replicas(request)).await;
                })
                .await;
        }
        let mut backoff = ExponentialBuilder::new()
            .with_jitter()
            .with_min_delay(self.sending.first_delay)
            .with_max_delay(MAX_DELAY)
            .with_max_times(self.sending.retries as usize)
            .build();
        let mut attempts = QuestionAttempts::with_charged(request.timeouts.charged);
        // Replicas that failed since the last delay, and the last of these failures.
        let (mut avoided, mut failed_over) = (Vec::new(), None::<AskError>);
        let mut retried = None;
        loop {
            let turn = match self.unless_closed(reserve(request.reservation)).await {
                Ok(true) => self.wait_for_turn(request, &avoided).await,
                Ok(false) => Err(over_budget(retried.take())),
                Err(closed) => Err(closed),
            };
            let turn = turn.map_err(|error| attempts.end(failed_over.take().unwrap_or(error)))?;
            attempts.sent += 1;
            if let Some(reservation) = request.reservation {
                reservation.mark_sent();
            }
            let started = Instant::now();
            let outcome = self.send(request, turn).await;
            if let Some(reservation) = request.reservation {
                reservation.settle(match &outcome {
                    Ok(reply) => reply.usage.map_or(Charge::Unknown, Charge::Stated),
                    Err((failed, _)) => failed.charge(),
                });
            }
            let (failed, failover) = match outcome {
                Ok(reply) => {
                    self.connection_reported.store(true, Ordering::Relaxed);
                    self.refusal_reported.store(false, Ordering::Relaxed);
                    self.replies.fetch_add(1, Ordering::Relaxed);
                    return Ok(Reply { attempts: attempts.sent, lost: attempts.lost, ..reply });
                }
                Err(failed) => failed,
            };
            let took = started.elapsed();
            let failed = attempts.add(failed, self.replies.load(Ordering::Relaxed));
            if failed.unfinished.is_timeout() && request.timeouts.asks_otherwise {
                return Err(attempts.end(failed));
            }
            let is_charged_often = attempts.charged() > self.sending.paid_retries;
            if is_charged_often && failed.unfinished.is_probably_charged() {
                return Err(attempts.give_up(failed, request.timeouts.remedy));
            }
            avoided.push(turn.replica);
            if failover == Failover::OtherReplica && self.load_balancer.has_other(request.model, &avoided) {
                failed_over = Some(failed);
                continue;
            }
            if is_charged_often && !failed.lost.is_none() {
                return Err(attempts.give_up(failed, request.timeouts.remedy));
            }
            let failed = self.waiting_for_start(failed, took);
            let (delay, failed) = self.retry_delay(request.model, failed, &mut backoff);
            let Some(delay) = delay else {
                return Err(attempts.end(failed));
            };
            avoided.clear();
            failed_over = None;
            let base = self.replicas[turn.replica].base();
            let problem = &failed.failure.message;
            // Warn before the retries, which take a minute: the address may be mistyped.
            if failed.failure.kind == FailureKind::Connection && !self.connection_reported.swap(true, Ordering::Relaxed)
            {
                let hint = if failed.is_unconnected() {
                    ". Is a server running there? --base-url names the address"
                } else {
                    ""
                };
                warn!("{problem}; trying again{hint}");
            }
            if failed.retry == Retry::WhenAccepted {
                self.warn_about_refusal(request.model, problem);
            }
            debug!(endpoint = %base, ?delay, problem, "trying again");
            self.sleep_unless_closed(delay).await;
            retried = Some(failed);
        }
    }

    /// Lets a request wait, without using a retry, for a server that is starting: it answers 503 at once, and either
    /// says that it loads a model, or has answered no request yet.
    fn waiting_for_start(&self, mut failed: AskError, took: Duration) -> AskError {
        let is_unavailable =
            failed.failure.status == Some(503) && failed.retry == Retry::AfterDelay && took < QUICK_REFUSAL;
        let is_starting = || {
            let message = failed.failure.message.to_lowercase();
            self.replies.load(Ordering::Relaxed) == 0 || STARTING.iter().any(|phrase| message.contains(phrase))
        };
        if is_unavailable && is_starting() {
            failed.retry = Retry::WhenAccepted;
        }
        failed
    }

    /// Delay until the next attempt, and the error; `None` to give up. If the patience is exhausted, the error states
    /// it.
    fn retry_delay(
        &self,
        model: ModelIndex,
        mut failed: AskError,
        backoff: &mut impl Iterator<Item = Duration>,
    ) -> (Option<Duration>, AskError) {
        let delay = match failed.retry {
            Retry::Never => None,
            Retry::AfterDelay => backoff.next().map(|delay| failed.wait.unwrap_or(delay)),
            Retry::WhenAccepted if self.refused_for(model) > self.sending.patience => {
                failed = self.out_of_patience(model, failed);
                None
            }
            // The gate pauses all requests as long as the server asked.
            Retry::WhenAccepted if failed.wait.is_some() => Some(Duration::ZERO),
            Retry::WhenAccepted if failed.failure.status == Some(503) => {
                let longest = MAX_START_DELAY.max(self.sending.first_delay);
                let delay = self.refused_for(model) / 10;
                Some(delay.clamp(self.sending.first_delay, longest))
            }
            Retry::WhenAccepted => Some(self.sending.first_delay),
        };
        (delay, failed)
    }

    /// Waits until a request may be sent: for the user's quota, a replica that accepts it, and the gate of that
    /// replica.
    async fn wait_for_turn(&self, request: &Request<'_>, avoided: &[usize]) -> Result<Turn, AskError> {
        let passed_quota_at = match &self.quota {
            Some(gate) => Some(self.unless_closed(gate.pass()).await?),
            None => None,
        };
        let chosen = self.load_balancer.choose(request.model, request.affinity, avoided, |index| {
            let replica = &self.replicas[index];
            let has_room = self.load_balancer.in_flight(index) < replica.width();
            has_room && replica.gate.ready_at() <= Instant::now() + SOON
        });
        let Some(replica) = chosen else {
            let id = &request.sent.parameters.model;
            let message = format!("no replica of this endpoint can be asked for {id} any more");
            return Err(AskError { reach: Reach::Endpoint, ..AskError::new(FailureKind::Connection, message) });
        };
        match self.unless_closed(self.replicas[replica].gate.pass()).await {
            Ok(sent) => Ok(Turn { replica, sent, passed_quota_at }),
            Err(closed) => {
                self.load_balancer.release(replica);
                Err(closed)
            }
        }
    }

    /// Sends a request to the replica of its turn.
    async fn send(&self, request: &Request<'_>, turn: Turn) -> Result<Reply, (AskError, Failover)> {
        let Turn { replica: index, sent, passed_quota_at } = turn;
        // Released also if the future is dropped.
        let _in_flight = self.load_balancer.guard(index);
        let replica = &self.replicas[index];
        let outcome = replica.send(request, &request.headers[index], sent).await;
        let reply = match outcome {
            Ok(reply) => reply,
            Err(failed) if self.replicas.len() == 1 => return Err((failed, Failover::None)),
            Err(failed) => {
                let failover = self.load_balancer.record_failure(request.model, index, &failed);
                return Err((failed, failover));
            }
        };
        if let (Some(gate), Some(sent)) = (&self.quota, passed_quota_at) {
            let tokens = reply.usage.and_then(|usage| usage.total());
            gate.record_success(sent, tokens, RateLimits::default(), self.sending.max_wait);
        }
        let served = reply.served_model.as_deref();
        if self.replicas.len() > 1 && !self.load_balancer.record_success(request.model, index, served, sent) {
            let served = reply.served_model.unwrap_or_default();
            let message = format!("{} served the model {served}", replica.base());
            let failed = AskError {
                reach: Reach::Endpoint,
                ..AskError::new(FailureKind::Response, message).with_charge(reply.usage)
            };
            return Err((failed, Failover::OtherReplica));
        }
        let endpoint = (self.replicas.len() > 1).then_some(index);
        Ok(Reply { endpoint, ..reply })
    }

    /// Cell that is set after the replicas' descriptions of the model with this id were compared.
    fn compared(&self, id: &str) -> Arc<OnceCell<()>> {
        let mut all = self.compared.lock().unwrap_or_else(PoisonError::into_inner);
        Arc::clone(all.entry(id.to_owned()).or_default())
    }

    /// Warns if the replicas describe the model differently. Replicas without a description are ignored.
    async fn compare_replicas(&self, request: &Request<'_>) {
        let mut descriptions = Vec::new();
        for (replica, headers) in self.replicas.iter().zip(request.headers) {
            let facts = replica.connection.model_facts(headers, request.sent.parameters).await;
            if let Some(facts) = facts {
                descriptions.push((replica.base().to_string(), facts));
            }
        }
        let Some((first, facts)) = descriptions.first() else {
            return;
        };
        for (other, different) in descriptions.iter().filter(|(_, other)| other != facts) {
            warn!(
                "the replicas {first} and {other} serve the model {} differently ({facts} and {different}): their replies may differ",
                request.sent.parameters.model
            );
        }
    }

    /// Waits before a question is asked again whose reply does not count, at most until the endpoint is closed.
    pub async fn wait_to_ask_again(&self) {
        self.sleep_unless_closed(self.sending.first_delay).await;
    }

    /// Sleeps for a time, at most until the endpoint is closed.
    async fn sleep_unless_closed(&self, delay: Duration) {
        tokio::select! {
            () = self.closed() => {}
            () = sleep(delay) => {}
        }
    }

    /// Time for which every replica that accepts this model has refused all requests.
    fn refused_for(&self, model: ModelIndex) -> Duration {
        self.accepting_replicas(model).map(|replica| replica.gate.refused_for()).min().unwrap_or_default()
    }

    /// Warns once if no request has been accepted for [`LONG_REFUSAL`], so that the run does not wait silently.
    fn warn_about_refusal(&self, model: ModelIndex, problem: &str) {
        let patience = self.sending.patience;
        let refused = self.refused_for(model);
        if refused >= LONG_REFUSAL.min(patience / 2) && !self.refusal_reported.swap(true, Ordering::Relaxed) {
            warn!(
                "{problem}; waiting: no request was accepted for {:.0} s, and the run stops after {:.0} s (--retries patience)",
                refused.as_secs_f64(),
                patience.as_secs_f64()
            );
        }
    }

    /// Error of a request that was refused for longer than the patience. Every other request would be refused too.
    fn out_of_patience(&self, model: ModelIndex, mut failed: AskError) -> AskError {
        failed.reach = Reach::Endpoint;
        failed.failure.message = format!(
            "{} (no request was accepted for {:.0} s, longer than --retries patience; continue later with --resume)",
            failed.failure.message,
            self.refused_for(model).as_secs_f64()
        );
        failed
    }
}

/// Reserves the cost of the next request; false if `--max-cost` does not allow it.
async fn reserve(reservation: Option<&Reservation>) -> bool {
    match reservation {
        Some(reservation) => reservation.reserve().await,
        None => true,
    }
}

/// Error of a question that is not asked again because of `--max-cost`.
fn over_budget(last: Option<AskError>) -> AskError {
    let Some(mut failed) = last else {
        let message = "not asked again: --max-cost does not allow it".to_owned();
        return AskError::new(FailureKind::Connection, message);
    };
    failed.failure.message += " (not asked again: --max-cost does not allow it)";
    failed
}

/// Maximum wait for the gate of a replica that counts as ready; chosen: shorter than a reply.
const SOON: Duration = Duration::from_millis(250);

/// Permission to send a request to a replica.
#[derive(Debug, Clone, Copy)]
struct Turn {
    /// Index of the replica.
    replica: usize,
    /// Time at which the request passed the gate of the replica.
    sent: Instant,
    /// Time at which the request passed the quota of all replicas; `None` without a common quota.
    passed_quota_at: Option<Instant>,
}

/// The requests of one question so far, and their charges.
#[derive(Debug, Default)]
pub(super) struct QuestionAttempts {
    /// Number of requests that were sent.
    pub(super) sent: u32,
    /// Requests that were charged and gave no reply.
    pub(super) lost: LostAttempts,
    /// Number of requests that were probably charged, although the server stated no tokens.
    unfinished: u32,
    /// Number of replies of the endpoint at the first quick timeout; `None` before it.
    replies_at_timeout: Option<u64>,
}

impl QuestionAttempts {
    /// The attempts of a question of which this many requests count as charged from the start.
    pub(super) fn with_charged(charged: u32) -> Self {
        Self { unfinished: charged, ..Self::default() }
    }

    /// Adds a failed request; `replies` is the number of replies of the endpoint so far. A second quick timeout after a
    /// reply to another request becomes a [`Unfinished::RepeatedTimeout`].
    pub(super) fn add(&mut self, failed: AskError, replies: u64) -> AskError {
        let is_repeated = self.replies_at_timeout.is_some_and(|before| replies > before);
        let failed = match failed.unfinished {
            Unfinished::QuickTimeout if is_repeated => failed.with_unfinished(Unfinished::RepeatedTimeout),
            Unfinished::QuickTimeout => {
                self.replies_at_timeout.get_or_insert(replies);
                failed
            }
            _ => failed,
        };
        self.lost = self.lost.plus(*failed.lost);
        let is_counted = failed.lost.attempts > 0;
        self.unfinished += u32::from(failed.unfinished.is_probably_charged() && !is_counted);
        failed
    }

    /// Number of requests that were charged and gave no reply, as far as is known.
    pub(super) fn charged(&self) -> u32 {
        self.lost.attempts + self.unfinished
    }

    /// The error of the question, after its last request.
    pub(super) fn end(&self, failed: AskError) -> AskError {
        failed.with_attempts(self.sent, self.lost)
    }

    /// The error of a question with more charged requests than `--retries paid` allows; `remedy` is the one for a
    /// gateway timeout.
    pub(super) fn give_up(&self, mut failed: AskError, remedy: &str) -> AskError {
        let tokens = self.lost.usage.total().unwrap_or_default();
        let reason = if failed.unfinished.is_timeout() {
            format!(
                "given up: a gateway ends the request before the reply is complete, and the server may charge it each time; {remedy}"
            )
        } else if failed.unfinished == Unfinished::BrokeOff && self.lost.attempts == 0 {
            "given up: each request that breaks off may be charged; more --retries paid asks again".to_owned()
        } else {
            format!(
                "{} charged without a reply, {tokens} tokens; remedies: a larger --max-tokens, --thinking off, or more --retries paid",
                counted(self.lost.attempts as usize, "attempt")
            )
        };
        failed.failure.message = format!("{} ({reason})", failed.failure.message);
        self.end(failed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use darkqa_base::types::FailureKind;

    fn timeout() -> AskError {
        AskError::new(FailureKind::Server, "504".to_owned()).with_unfinished(Unfinished::QuickTimeout)
    }

    #[test]
    fn quick_timeouts_count_if_others_are_answered() {
        let mut down = QuestionAttempts::default();
        for _ in 0..5 {
            let failed = down.add(timeout(), 3);
            assert_eq!(failed.unfinished, Unfinished::QuickTimeout);
        }
        assert_eq!(down.charged(), 0);
        let mut slow = QuestionAttempts::default();
        slow.add(timeout(), 3);
        let failed = slow.add(timeout(), 4);
        assert!(failed.unfinished.is_timeout());
        assert_eq!((slow.charged(), failed.failure.kind), (1, FailureKind::Timeout));
    }
}
