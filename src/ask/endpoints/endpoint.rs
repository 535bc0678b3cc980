//! A server, at one or several addresses, and the way questions are put to it: [`Endpoint`].

use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use backon::{BackoffBuilder as _, ExponentialBuilder};
use reqwest::header::HeaderMap;
use tokio::sync::{OnceCell, watch};
use tokio::time::{Instant, sleep, timeout};
use tracing::{debug, warn};

use super::access::Access;
use super::replica::Replica;
use super::sending::Sending;
use super::service::{Choice, Effect, ModelNumber, Services};
use super::url::BaseUrl;
use crate::ask::batch_api::BatchServer;
use crate::ask::costs::{Charge, Reservation};
use crate::ask::failures::{Again, AskError, Reach};
use crate::ask::pace::{Gate, Quota, RateLimits};
use crate::ask::requests::Request;
use crate::ask::vendors::Vendor;
use crate::ask::wire_kind::Wire;
use crate::error::{Error, Result};
use crate::types::{FailureKind, LostAttempts, Reply};

/// The maximum wait between retries if the server asks for none; chosen. A server may ask for longer waits.
const MAX_DELAY: Duration = Duration::from_secs(30);

/// The longest time for the comparison of replicas before the first request; chosen.
const COMPARING: Duration = Duration::from_secs(3);

/// The time without an accepted request after which the user is told that the run waits; at most half of the patience. Chosen: pauses
/// of vendors' limits per minute are mostly shorter.
const LONG_REFUSAL: Duration = Duration::from_secs(20);

/// A server: one replica, or several that serve the same models.
///
/// With several, each request goes to the one that has the fewest in flight, and among nearly equal ones to the same for the same
/// images, so that their cache of prefixes is used. What one replica cannot take goes to another without spending a retry.
#[derive(Debug)]
pub struct Endpoint {
    replicas: Vec<Replica>,
    sending: Sending,
    /// The user's limits per minute, which hold for all replicas together; `None` if the only replica keeps them.
    quota: Option<Gate>,
    services: Services,
    /// Whether what the replicas report of a model was compared, by its id.
    compared: Mutex<HashMap<String, Arc<OnceCell<()>>>>,
    closing: watch::Sender<bool>,
    /// Whether a request had a reply, or it was said that there is no connection.
    is_known: AtomicBool,
    /// Whether the user was told that the endpoint has turned all requests away since its last reply.
    is_refusal_told: AtomicBool,
}

impl Endpoint {
    /// An endpoint at one address that is ready for requests; nothing is sent yet.
    ///
    /// # Errors
    /// If a key would be sent unencrypted to another machine, or if two keys are set.
    pub fn open(access: Access, sending: Sending) -> Result<Self> {
        Self::from_addresses(vec![access], sending)
    }

    /// An endpoint of replicas at these addresses; nothing is sent yet. The user's limits hold for all of them together.
    ///
    /// # Errors
    /// As [`Endpoint::open`], or if there is no address.
    pub fn from_addresses(addresses: Vec<Access>, sending: Sending) -> Result<Self> {
        let count = addresses.len();
        let each = if count > 1 {
            Sending {
                quota: Quota::default(),
                concurrency: sending.concurrency.share(count),
                ..sending
            }
        } else {
            sending
        };
        let replicas = addresses
            .into_iter()
            .map(|access| Replica::open(access, each))
            .collect::<Result<Vec<_>>>()?;
        if replicas.is_empty() {
            return Err(Error::usage("--base-url", "an address expected"));
        }
        Ok(Self {
            services: Services::new(replicas.iter().map(|replica| replica.base().to_string())),
            quota: (count > 1).then(|| Gate::new(sending.quota)),
            replicas,
            sending,
            compared: Mutex::default(),
            closing: watch::Sender::new(false),
            is_known: AtomicBool::new(false),
            is_refusal_told: AtomicBool::new(false),
        })
    }

    /// Adds a model that is asked by this id. What the replicas are for it is known apart from the other models.
    pub(in crate::ask) fn add_model(&self, id: &str) -> ModelNumber {
        self.services.add_model(id.to_owned())
    }

    /// The number of requests that may be in flight now at the replicas that take this model, within [`Sending::concurrency`].
    pub(in crate::ask) fn width(&self, model: ModelNumber) -> usize {
        let width: usize = self.taking(model).map(Replica::width).sum();
        width.max(1)
    }

    /// The replicas that take requests to a model.
    fn taking(&self, model: ModelNumber) -> impl Iterator<Item = &Replica> {
        self.replicas
            .iter()
            .enumerate()
            .filter(move |(index, _)| self.services.takes(model, *index))
            .map(|(_, replica)| replica)
    }

    /// The base URL of the first replica; its text has no user, password and query string.
    #[must_use]
    pub fn base(&self) -> &BaseUrl {
        self.replicas[0].base()
    }

    /// Facts about the vendor of the first replica; `None` if no table lists its host.
    pub(in crate::ask) fn vendor(&self) -> Option<&'static Vendor> {
        self.replicas[0].vendor()
    }

    pub(in crate::ask) fn has_key(&self) -> bool {
        self.replicas[0].has_key()
    }

    /// The headers of every request to an API, for each replica.
    pub(in crate::ask) fn headers(&self, wire: Wire) -> Result<Vec<HeaderMap>> {
        self.replicas
            .iter()
            .map(|replica| replica.headers(wire))
            .collect()
    }

    /// The files and batches of the server, at its first replica.
    ///
    /// # Errors
    /// If a header value has characters that HTTP does not allow.
    pub(crate) fn batch_server(&self) -> Result<BatchServer> {
        let first = &self.replicas[0];
        let headers = first.headers(Wire::Chat)?;
        let connection = first.connection.clone();
        Ok(BatchServer::new(connection, headers, self.sending.timeout))
    }

    /// Whether the files and batches of another endpoint are those of the same account: its address, key and headers are the same.
    ///
    /// # Errors
    /// If a header value has characters that HTTP does not allow.
    pub(crate) fn has_account_of(&self, other: &Self) -> Result<bool> {
        let (own, other) = (&self.replicas[0], &other.replicas[0]);
        let is_same_base = own.base() == other.base();
        Ok(is_same_base && own.headers(Wire::Chat)? == other.headers(Wire::Chat)?)
    }

    /// Stops further requests: those in flight are finished, those that wait fail at once.
    pub fn close(&self) {
        self.closing.send_replace(true);
    }

    /// Waits until the endpoint is closed.
    async fn closed(&self) {
        // The sender lives as long as the endpoint, so only a change can end this wait.
        let _ = self.closing.subscribe().wait_for(|closing| *closing).await;
    }

    /// Waits for something, or fails as soon as the endpoint is closed.
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

    /// Sends a request, with retries after failures that may pass. While the endpoint takes no more, the request waits without spending
    /// a retry, for at most [`Sending::patience`]. The future may be dropped at any time.
    pub(in crate::ask) async fn ask(&self, request: &Request<'_>) -> Result<Reply, AskError> {
        if self.replicas.len() > 1 {
            let compare = || async {
                // What takes longer is not waited for.
                let _ = timeout(COMPARING, self.compare(request)).await;
            };
            let compared = self.compared(&request.sent.parameters.model);
            compared.get_or_init(compare).await;
        }
        let mut tries = ExponentialBuilder::new()
            .with_jitter()
            .with_min_delay(self.sending.first_delay)
            .with_max_delay(MAX_DELAY)
            .with_max_times(self.sending.retries as usize)
            .build();
        let (mut attempts, mut avoided, mut last) = (0, Vec::new(), None::<AskError>);
        let (mut retried, mut lost) = (None, LostAttempts::default());
        loop {
            let turn = match self.unless_closed(hold(request.reservation)).await {
                Ok(true) => self.turn(request, &avoided).await,
                Ok(false) => Err(over_budget(retried.take())),
                Err(closed) => Err(closed),
            };
            let turn = turn.map_err(|e| last.take().unwrap_or(e).after(attempts, lost))?;
            attempts += 1;
            request
                .reservation
                .inspect(|reservation| reservation.sent());
            let sent = self.send(request, turn).await;
            if let Some(reservation) = request.reservation {
                reservation.ended(match &sent {
                    Ok(reply) => reply.usage.map_or(Charge::Unknown, Charge::Stated),
                    Err((failed, _)) => failed.charge(),
                });
            }
            let (failed, effect) = match sent {
                Ok(reply) => {
                    self.is_known.store(true, Ordering::Relaxed);
                    self.is_refusal_told.store(false, Ordering::Relaxed);
                    return Ok(Reply {
                        attempts,
                        lost,
                        ..reply
                    });
                }
                Err(failed) => failed,
            };
            lost = lost.plus(*failed.lost);
            avoided.push(turn.replica);
            if effect == Effect::Elsewhere && self.services.has_other(request.model, &avoided) {
                last = Some(failed);
                continue;
            }
            if lost.attempts > self.sending.paid_retries {
                return Err(out_of_paid_retries(failed, lost).after(attempts, lost));
            }
            let (delay, failed) = self.delay(request.model, failed, &mut tries);
            let Some(delay) = delay else {
                return Err(failed.after(attempts, lost));
            };
            avoided.clear();
            let base = self.replicas[turn.replica].base();
            let problem = &failed.failure.message;
            // Retries take a minute: who mistyped an address knows it at once.
            if failed.failure.kind == FailureKind::Connection
                && !self.is_known.swap(true, Ordering::Relaxed)
            {
                warn!(
                    "{problem}; trying again. Is a server running there? --base-url names the address"
                );
            }
            if matches!(failed.again, Again::WhenTaken) {
                self.tell_refusal(request.model, problem);
            }
            debug!(endpoint = %base, ?delay, problem, "trying again");
            self.rest(delay).await;
            retried = Some(failed);
        }
    }

    /// The time until a request is sent again; `None` if it is not. A failure after which no request is taken states it.
    fn delay(
        &self,
        model: ModelNumber,
        mut failed: AskError,
        tries: &mut impl Iterator<Item = Duration>,
    ) -> (Option<Duration>, AskError) {
        let delay = match failed.again {
            Again::Never => None,
            Again::Later => tries.next().map(|delay| failed.wait.unwrap_or(delay)),
            Again::WhenTaken if self.refused_for(model) > self.sending.patience => {
                failed = self.out_of_patience(model, failed);
                None
            }
            // The gate holds all requests for as long as the server asked.
            Again::WhenTaken if failed.wait.is_some() => Some(Duration::ZERO),
            Again::WhenTaken => Some(self.sending.first_delay),
        };
        (delay, failed)
    }

    /// Waits for the turn of a request: the user's limits, a replica that takes it, and the pace of that replica.
    async fn turn(&self, request: &Request<'_>, avoided: &[usize]) -> Result<Turn, AskError> {
        let limited = match &self.quota {
            Some(gate) => Some(self.unless_closed(gate.pass()).await?),
            None => None,
        };
        let ready = |index: usize| {
            let replica = &self.replicas[index];
            let room = self.services.in_flight(index) < replica.width();
            room && replica.gate.ready_at() <= Instant::now() + SOON
        };
        let chosen = self
            .services
            .choose(request.model, request.affinity, avoided, ready);
        let Choice::Replica(replica) = chosen else {
            let id = &request.sent.parameters.model;
            let message = format!("no replica of this endpoint can be asked for {id} any more");
            return Err(AskError {
                reach: Reach::Endpoint,
                ..AskError::new(FailureKind::Connection, message)
            });
        };
        let passed = self.unless_closed(self.replicas[replica].gate.pass()).await;
        match passed {
            Ok(sent) => Ok(Turn {
                replica,
                sent,
                limited,
            }),
            Err(closed) => {
                self.services.released(replica);
                Err(closed)
            }
        }
    }

    /// Sends a request to the replica of its turn; a failure with what follows from it.
    async fn send(&self, request: &Request<'_>, turn: Turn) -> Result<Reply, (AskError, Effect)> {
        let Turn {
            replica: index,
            sent,
            limited,
        } = turn;
        // Released also if the future is dropped.
        let _in_flight = self.services.guard(index);
        let replica = &self.replicas[index];
        let outcome = replica.send(request, &request.headers[index], sent).await;
        let reply = match outcome {
            Ok(reply) => reply,
            Err(failed) if self.replicas.len() == 1 => return Err((failed, Effect::Own)),
            Err(failed) => {
                let effect = self.services.failed(request.model, index, &failed);
                return Err((failed, effect));
            }
        };
        if let (Some(gate), Some(sent)) = (&self.quota, limited) {
            let tokens = reply.usage.and_then(|usage| usage.total());
            gate.succeeded(sent, tokens, RateLimits::default(), self.sending.max_wait);
        }
        let served = reply.served_model.as_deref();
        if self.replicas.len() > 1
            && let Err(effect) = self.services.succeeded(request.model, index, served, sent)
        {
            let served = reply.served_model.unwrap_or_default();
            let message = format!("{} served the model {served}", replica.base());
            let failed = AskError {
                reach: Reach::Endpoint,
                ..AskError::new(FailureKind::Response, message).charged(reply.usage)
            };
            return Err((failed, effect));
        }
        let endpoint = (self.replicas.len() > 1).then_some(index);
        Ok(Reply { endpoint, ..reply })
    }

    /// Whether what the replicas report of the model with this id was compared.
    fn compared(&self, id: &str) -> Arc<OnceCell<()>> {
        let mut all = self.compared.lock().unwrap_or_else(PoisonError::into_inner);
        Arc::clone(all.entry(id.to_owned()).or_default())
    }

    /// Warns if the replicas describe the model differently. What cannot be asked for is ignored.
    async fn compare(&self, request: &Request<'_>) {
        let mut said = Vec::new();
        for (replica, headers) in self.replicas.iter().zip(request.headers) {
            let facts = replica
                .connection
                .model_facts(headers, request.sent.parameters);
            if let Some(facts) = facts.await {
                said.push((replica.base().to_string(), facts));
            }
        }
        let Some((first, facts)) = said.first() else {
            return;
        };
        for (other, different) in said.iter().filter(|(_, other)| other != facts) {
            warn!(
                "the replicas {first} and {other} serve the model {} differently ({facts} and {different}): their replies may differ",
                request.sent.parameters.model
            );
        }
    }

    /// Sleeps, or until the endpoint is closed.
    async fn rest(&self, delay: Duration) {
        tokio::select! {
            () = self.closed() => {}
            () = sleep(delay) => {}
        }
    }

    /// The time for which no replica that takes this model has taken a request.
    fn refused_for(&self, model: ModelNumber) -> Duration {
        self.taking(model)
            .map(|replica| replica.gate.refused_for())
            .min()
            .unwrap_or_default()
    }

    /// Warns once if no request has been accepted for a while: the run goes on, and would otherwise wait without a word.
    fn tell_refusal(&self, model: ModelNumber, problem: &str) {
        let patience = self.sending.patience;
        let refused = self.refused_for(model);
        if refused >= LONG_REFUSAL.min(patience / 2)
            && !self.is_refusal_told.swap(true, Ordering::Relaxed)
        {
            warn!(
                "{problem}; waiting: no request was accepted for {:.0} s, and the run stops after {:.0} s (--retries patience)",
                refused.as_secs_f64(),
                patience.as_secs_f64()
            );
        }
    }

    /// The failure of a request that was turned away for too long: every other one is, too.
    fn out_of_patience(&self, model: ModelNumber, mut failed: AskError) -> AskError {
        failed.reach = Reach::Endpoint;
        failed.failure.message = format!(
            "{} (no request was accepted for {:.0} s, longer than --retries patience; continue later with --resume)",
            failed.failure.message,
            self.refused_for(model).as_secs_f64()
        );
        failed
    }
}

/// Holds the dollars of the next request; false if `--max-cost` does not allow it.
async fn hold(reservation: Option<&Reservation>) -> bool {
    match reservation {
        Some(reservation) => reservation.hold().await,
        None => true,
    }
}

/// The failure of a question that is not asked again because of `--max-cost`.
fn over_budget(last: Option<AskError>) -> AskError {
    let Some(mut failed) = last else {
        let message = "not asked again: --max-cost does not allow it".to_owned();
        return AskError::new(FailureKind::Connection, message);
    };
    failed.failure.message += " (not asked again: --max-cost does not allow it)";
    failed
}

/// The failure of a request that was charged for as many attempts as `--retries paid` allows.
fn out_of_paid_retries(mut failed: AskError, lost: LostAttempts) -> AskError {
    failed.failure.message = format!(
        "{} ({} charged without a reply, {} tokens; remedies: a larger --max-tokens, --thinking off, or more --retries paid)",
        failed.failure.message,
        if lost.attempts == 1 {
            "1 attempt".to_owned()
        } else {
            format!("{} attempts", lost.attempts)
        },
        lost.usage.total().unwrap_or_default()
    );
    failed
}

/// A replica whose next turn is within this time takes a request now; chosen: shorter than a reply.
const SOON: Duration = Duration::from_millis(250);

/// The turn of a request: the replica that takes it and the time at which it is sent.
#[derive(Debug, Clone, Copy)]
struct Turn {
    replica: usize,
    sent: Instant,
    /// The time at which it passed the user's limits for all replicas.
    limited: Option<Instant>,
}
