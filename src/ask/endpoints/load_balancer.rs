//! Choice of the replica for a request, by load and health: [`LoadBalancer`].
//!
//! The settings for sending and retrying requests: [`Sending`].

#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use clap::Args;
use tokio::time::Instant;
use tracing::warn;

use crate::failures::{AskError, Reach, Retry};
use crate::pace::{ConcurrencyBounds, Quota};
use darkqa_base::types::flags::{positive, seconds};
use darkqa_base::types::{Decides, FailureKind};

/// A request goes to its preferred replica if that has at most this many more requests in flight than the least loaded
/// one; chosen. Questions about one image then share a prefix cache.
const AFFINITY_SLACK: usize = 3;

/// Number of consecutive connection or server failures after which a replica is not used for a time; chosen.
const MAX_FAILURES: u32 = 3;

/// Number of consecutive refusals by a status that concerns all requests after which a replica gets no more requests;
/// chosen.
const MAX_REFUSALS: usize = 3;

/// First time for which a replica is not used. Each further time is longer by this much, up to [`MAX_BACKOFF`]. Chosen.
const FIRST_BACKOFF: Duration = Duration::from_secs(5);

/// Maximum time for which a replica is not used; chosen.
const MAX_BACKOFF: Duration = Duration::from_mins(1);

/// Longest wait stated by a replica that is kept; any longer one outlasts a run, and the clock cannot add all of them.
const MAX_STATED_WAIT: Duration = Duration::from_hours(365 * 24);

/// Load balancer over the replicas of an endpoint. Health and load are common to all models; a replica can be excluded
/// for one model.
#[derive(Debug)]
pub(super) struct LoadBalancer(Mutex<State>);

/// Index of a model among the models opened at an endpoint. Two models may have the same id and different settings, and
/// so different refusals.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ModelIndex(usize);

#[derive(Debug)]
struct State {
    replicas: Vec<ReplicaState>,
    /// By [`ModelIndex`].
    models: Vec<ModelState>,
}

impl State {
    /// True if a replica accepts requests to a model.
    fn accepts(&self, model: ModelIndex, index: usize) -> bool {
        self.replicas[index].health == Health::Working && !self.is_excluded(model, index)
    }

    /// True if a replica gets no more requests to a model in this run.
    fn is_excluded(&self, model: ModelIndex, index: usize) -> bool {
        self.models[model.0].excluded.contains(&index)
    }

    /// True if a replica for which `is_candidate` is true accepts requests to a model.
    fn any_accepts(&self, model: ModelIndex, is_candidate: impl Fn(usize) -> bool) -> bool {
        (0..self.replicas.len()).any(|index| is_candidate(index) && self.accepts(model, index))
    }
}

/// State of one model at all replicas.
#[derive(Debug)]
struct ModelState {
    /// Id in requests, for messages.
    id: String,
    /// Model name in the first reply that has one.
    served_model: Option<String>,
    /// Replicas that get no more requests to this model in this run.
    excluded: BTreeSet<usize>,
    /// Number of refusals in a row, by replica, with a status that concerns all requests.
    refusals: BTreeMap<usize, usize>,
}

/// State of one replica.
#[derive(Debug)]
struct ReplicaState {
    /// Base URL, for messages.
    address: String,
    /// Number of requests in flight.
    in_flight: usize,
    /// Number of connection or server failures since the last reply.
    failures: u32,
    /// Time of the last failure. Replies to requests sent before it reveal nothing about the replica now.
    failed_at: Option<Instant>,
    /// Number of times for which the replica was not used since the last reply.
    backoffs: u32,
    health: Health,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Health {
    Working,
    /// The replica gets no requests before this time, and then a single one to probe it.
    BackoffUntil(Instant),
    /// A single request probes the replica.
    Probing,
}

/// Whether a failed request moves to another replica.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Failover {
    /// It does not: the failure counts as an attempt.
    None,
    /// It does, without using a retry.
    OtherReplica,
}

impl Failover {
    fn to_other_replica_if(condition: bool) -> Self {
        if condition { Self::OtherReplica } else { Self::None }
    }
}

/// A request in flight at a replica; releases it when dropped.
pub(super) struct InFlight<'a> {
    balancer: &'a LoadBalancer,
    replica: usize,
}

impl Drop for InFlight<'_> {
    fn drop(&mut self) {
        self.balancer.release(self.replica);
    }
}

impl LoadBalancer {
    /// Creates a load balancer over replicas at these addresses.
    pub(super) fn new(addresses: impl Iterator<Item = String>) -> Self {
        let replicas = addresses
            .map(|address| ReplicaState {
                address,
                in_flight: 0,
                failures: 0,
                failed_at: None,
                backoffs: 0,
                health: Health::Working,
            })
            .collect();
        Self(Mutex::new(State { replicas, models: Vec::new() }))
    }

    /// Adds a model with this id.
    pub(super) fn add_model(&self, id: String) -> ModelIndex {
        let mut state = self.state();
        state.models.push(ModelState { id, served_model: None, excluded: BTreeSet::new(), refusals: BTreeMap::new() });
        ModelIndex(state.models.len() - 1)
    }

    /// True if a replica accepts requests to a model.
    pub(super) fn accepts(&self, model: ModelIndex, index: usize) -> bool {
        self.state().accepts(model, index)
    }

    /// Number of requests in flight at a replica.
    pub(super) fn in_flight(&self, index: usize) -> usize {
        self.state().replicas[index].in_flight
    }

    /// Chooses the replica for a request to a model, and counts the request as in flight there. `None` if every replica
    /// is excluded.
    ///
    /// Rendezvous hashing of `affinity` (Thaler and Ravishankar 1998, IEEE/ACM Trans. Netw. 6:1) selects among the
    /// replicas with at most [`AFFINITY_SLACK`] more requests in flight than the least loaded one. Replicas in
    /// `avoided`, and those for which `is_ready` is false, are chosen only if no other is left.
    pub(super) fn choose(
        &self,
        model: ModelIndex,
        affinity: u64,
        avoided: &[usize],
        is_ready: impl Fn(usize) -> bool,
    ) -> Option<usize> {
        // `is_ready` locks the state, so call it before the lock.
        let count = self.state().replicas.len();
        let ready: Vec<bool> = (0..count).map(is_ready).collect();
        let (now, mut state) = (Instant::now(), self.state());
        let mut candidates: Vec<usize> = (0..count).filter(|index| !state.is_excluded(model, *index)).collect();
        // If no replica is available, all are tried as a single endpoint would be, with the delays of its retries.
        prefer(&mut candidates, |index| match state.replicas[index].health {
            Health::Working => true,
            Health::BackoffUntil(end) => end <= now,
            Health::Probing => false,
        });
        prefer(&mut candidates, |index| !avoided.contains(&index));
        prefer(&mut candidates, |index| ready[index]);
        let in_flight = |index: &usize| state.replicas[*index].in_flight;
        let least_loaded = candidates.iter().map(in_flight).min()?;
        let chosen = candidates
            .into_iter()
            .filter(|index| in_flight(index) <= least_loaded + AFFINITY_SLACK)
            .max_by_key(|index| rendezvous_weight(affinity, *index))?;
        let replica = &mut state.replicas[chosen];
        replica.in_flight += 1;
        if replica.health != Health::Working {
            replica.health = Health::Probing;
        }
        Some(chosen)
    }

    /// Guard of a request that [`LoadBalancer::choose`] counted as in flight.
    pub(super) fn guard(&self, index: usize) -> InFlight<'_> {
        InFlight { balancer: self, replica: index }
    }

    /// Records that a request at a replica has ended, or was not sent.
    pub(super) fn release(&self, index: usize) {
        let mut state = self.state();
        let replica = &mut state.replicas[index];
        replica.in_flight = replica.in_flight.saturating_sub(1);
        // The probe was given up: the next request is the probe.
        if replica.health == Health::Probing && replica.in_flight == 0 {
            replica.health = Health::BackoffUntil(Instant::now());
        }
    }

    /// Records a reply from a replica to the request sent at `sent`. `served_model` is the model name in the reply.
    ///
    /// Returns false if the other replicas served another model: the reply must not be used, and the replica is
    /// excluded for this model.
    pub(super) fn record_success(
        &self,
        model: ModelIndex,
        index: usize,
        served_model: Option<&str>,
        sent: Instant,
    ) -> bool {
        let mut state = self.state();
        let State { replicas, models } = &mut *state;
        let (replica, model) = (&mut replicas[index], &mut models[model.0]);
        replica.record_success(sent);
        model.refusals.remove(&index);
        let Some(name) = served_model else {
            return true;
        };
        let known = model.served_model.get_or_insert_with(|| name.to_owned());
        if known == name {
            return true;
        }
        if model.excluded.insert(index) {
            warn!(
                "{}: it replies as the model {name}, and the others as {known}: it gets no more requests for {}",
                replica.address, model.id
            );
        }
        false
    }

    /// Records the failure of a request to a model at a replica. Returns whether the request moves to another replica.
    pub(super) fn record_failure(&self, model: ModelIndex, index: usize, failed: &AskError) -> Failover {
        let (now, mut state) = (Instant::now(), self.state());
        let status = failed.failure.status;
        let is_refused = matches!(status, Some(401 | 403 | 404 | 405 | 410));
        // If only a field was refused, the replica is asked again without it.
        let concerns_all = matches!(failed.reach, Reach::Endpoint | Reach::ByStatus);
        if concerns_all && is_refused && failed.refused_field.is_none() {
            let State { replicas, models } = &mut *state;
            let model = &mut models[model.0];
            let refusals = model.refusals.entry(index).or_default();
            *refusals += 1;
            if failed.reach == Reach::ByStatus && *refusals < MAX_REFUSALS {
                // The request may be the cause: another replica shows it.
                return Failover::to_other_replica_if(model.excluded.len() + 1 < replicas.len());
            }
            if model.excluded.insert(index) {
                warn!(
                    "{}: it gets no more requests for {}: {}",
                    replicas[index].address, model.id, failed.failure.message
                );
            }
            return Failover::to_other_replica_if(model.excluded.len() < replicas.len());
        }
        let replica = &mut state.replicas[index];
        // A limit per day or hour: other replicas may not have reached theirs.
        if let (Reach::Endpoint, Some(429), Some(wait)) = (failed.reach, status, failed.wait) {
            replica.health = Health::BackoffUntil(now + wait.min(MAX_STATED_WAIT));
            return Failover::to_other_replica_if(state.any_accepts(model, |_| true));
        }
        let kind = failed.failure.kind;
        let is_replica_failure = matches!(kind, FailureKind::Connection | FailureKind::Server);
        if !is_replica_failure || failed.retry != Retry::AfterDelay || failed.reach == Reach::Interrupted {
            return Failover::None;
        }
        replica.record_failure(now, &failed.failure.message);
        // The request itself may have caused a server failure, so it uses a retry.
        let moves = kind == FailureKind::Connection || replica.health != Health::Working;
        Failover::to_other_replica_if(moves && state.any_accepts(model, |other| other != index))
    }

    /// True if a replica outside `avoided` accepts requests to a model.
    pub(super) fn has_other(&self, model: ModelIndex, avoided: &[usize]) -> bool {
        self.state().any_accepts(model, |index| !avoided.contains(&index))
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl ReplicaState {
    /// Records a reply to the request sent at `sent`.
    fn record_success(&mut self, sent: Instant) {
        if self.failed_at.is_some_and(|failed| sent < failed) {
            return;
        }
        if self.health != Health::Working {
            warn!("{}: it answers again", self.address);
            self.health = Health::Working;
        }
        (self.failures, self.backoffs) = (0, 0);
    }

    /// Records a connection or server failure.
    fn record_failure(&mut self, now: Instant, message: &str) {
        self.failures += 1;
        self.failed_at = Some(now);
        let was_probe = self.health == Health::Probing;
        if was_probe || (self.failures >= MAX_FAILURES && self.health == Health::Working) {
            self.backoffs += 1;
            let backoff = (FIRST_BACKOFF * self.backoffs).min(MAX_BACKOFF);
            self.health = Health::BackoffUntil(now + backoff);
            if self.backoffs == 1 {
                warn!(
                    "{}: {} failures in a row; the other replicas take its requests: {message}",
                    self.address, self.failures
                );
            }
        }
    }
}

/// Keeps the replicas for which `is_preferred` is true, or all if there is none.
fn prefer(replicas: &mut Vec<usize>, is_preferred: impl Fn(usize) -> bool) {
    if replicas.iter().any(|index| is_preferred(*index)) {
        replicas.retain(|index| is_preferred(*index));
    }
}

/// Weight of a replica for requests of this affinity; the replica with the highest weight is preferred. If a replica is
/// added or removed, only the requests that prefer it move.
fn rendezvous_weight(affinity: u64, index: usize) -> u64 {
    let mut bytes = [0; 16];
    bytes[..8].copy_from_slice(&affinity.to_le_bytes());
    bytes[8..].copy_from_slice(&(index as u64).to_le_bytes());
    let hash = blake3::hash(&bytes);
    let mut weight = [0; 8];
    weight.copy_from_slice(&hash.as_bytes()[..8]);
    u64::from_le_bytes(weight)
}

/// The settings for sending and retrying requests.
#[derive(Debug, Clone, Copy, PartialEq, Args)]
#[command(next_help_heading = "Sending")]
pub struct Sending {
    /// Requests in flight: N, fewer if the server is overloaded; MIN-MAX, from MIN up while replies do not slow down;
    /// auto is 8-32, down to 1
    #[arg(long, value_name = "N|MIN-MAX|auto", default_value = "auto", add = Decides::Nothing)]
    pub concurrency: ConcurrencyBounds,
    /// The user's limits per minute.
    #[command(flatten)]
    pub quota: Quota,
    /// Seconds for one attempt, reply included
    #[arg(long, value_name = "SECONDS", value_parser = seconds, default_value = "120", add = Decides::Nothing)]
    pub timeout: Duration,
    /// Retries after a temporary failure
    #[arg(long, value_name = "N", default_value_t = 5, add = Decides::Nothing)]
    pub retries: u32,
    /// Retries of a trial after an attempt that was charged and gave no reply, in all calls together
    #[arg(long, value_name = "N", default_value_t = 1, add = Decides::Nothing)]
    pub paid_retries: u32,
    /// Wait before the first retry if the server does not ask for one. It doubles with each further retry; each wait is
    /// extended at random by up to its own length.
    #[arg(skip = FIRST_DELAY)]
    pub first_delay: Duration,
    /// Seconds for which an endpoint may turn all requests away (rate limit, overload, loading a model) before the run
    /// stops; these refusals do not count as retries
    #[arg(long, value_name = "SECONDS", value_parser = seconds, default_value = "1800", add = Decides::Nothing)]
    pub patience: Duration,
    /// Longest wait in seconds that a server may ask for; a longer one fails the request
    #[arg(long, value_name = "SECONDS", value_parser = seconds, default_value = "120", add = Decides::Nothing)]
    pub max_wait: Duration,
    /// Largest image file to send, in MB; default: the vendor's limit, else 20
    #[arg(long, value_name = "MB", value_parser = positive, add = Decides::Nothing)]
    pub max_image: Option<f64>,
}

/// Default of [`Sending::first_delay`]; chosen.
const FIRST_DELAY: Duration = Duration::from_millis(500);

impl Default for Sending {
    fn default() -> Self {
        Self {
            concurrency: ConcurrencyBounds::DEFAULT,
            quota: Quota::default(),
            timeout: Duration::from_mins(2),
            retries: 5,
            paid_retries: 1,
            first_delay: FIRST_DELAY,
            patience: Duration::from_mins(30),
            max_wait: Duration::from_mins(2),
            max_image: None,
        }
    }
}
