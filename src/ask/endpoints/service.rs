//! Which replica of an endpoint takes a request: [`Services`].

use std::collections::BTreeSet;
use std::sync::{Mutex, MutexGuard, PoisonError};

use tokio::time::{Duration, Instant};
use tracing::warn;

use crate::ask::failures::{Again, AskError, Reach};
use crate::types::FailureKind;

/// The replica that a request prefers takes it while it has at most this many more in flight than the one with the fewest; chosen.
/// Questions about one image then meet one cache of prefixes.
const LEANING: usize = 3;

/// Failures to connect, or of the server, in a row after which a replica is out for a time; chosen.
const FAILURES_IN_A_ROW: u32 = 3;

/// The first time for which a replica is out; each further one is longer by as much, up to [`LONGEST_OUT`]. Chosen.
const FIRST_OUT: Duration = Duration::from_secs(5);

/// The longest time for which a replica is out; chosen.
const LONGEST_OUT: Duration = Duration::from_mins(1);

/// The state of each replica of an endpoint: what holds for all models that are asked there, and what holds for one of them.
#[derive(Debug)]
pub(super) struct Services(Mutex<State>);

/// The number of a model among those that were opened at an endpoint. Two of them may have one id: what a server refuses may be due to
/// the other settings of a model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::ask) struct ModelNumber(usize);

#[derive(Debug)]
struct State {
    replicas: Vec<Service>,
    /// By [`ModelNumber`].
    models: Vec<Served>,
}

impl State {
    /// Whether a replica takes requests to a model.
    fn takes(&self, model: ModelNumber, index: usize) -> bool {
        self.replicas[index].health == Health::Working && !self.is_gone(model, index)
    }

    /// Whether a replica is asked nothing more for a model in this run.
    fn is_gone(&self, model: ModelNumber, index: usize) -> bool {
        self.models[model.0].gone.contains(&index)
    }

    /// Whether one of the replicas that `is_wanted` names takes requests to a model.
    fn any_takes(&self, model: ModelNumber, is_wanted: impl Fn(usize) -> bool) -> bool {
        (0..self.replicas.len()).any(|index| is_wanted(index) && self.takes(model, index))
    }
}

/// The state of one model at the replicas.
#[derive(Debug)]
struct Served {
    /// The id by which it is asked, for messages.
    id: String,
    /// The model that its replies name; the first reply decides.
    replies_as: Option<String>,
    /// The replicas that are asked nothing more for it in this run.
    gone: BTreeSet<usize>,
}

#[derive(Debug)]
struct Service {
    address: String,
    in_flight: usize,
    /// Failures to connect or of the server since the last reply.
    failures: u32,
    /// The time of the last of them: replies to requests that were sent before it reveal nothing about the replica now.
    failed_at: Option<Instant>,
    /// How often it was out since the last reply.
    outs: u32,
    health: Health,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Health {
    Working,
    /// It takes nothing before this time; then one request tries it.
    OutUntil(Instant),
    /// One request tries it.
    OnTrial,
}

/// The replica for a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Choice {
    /// This one; the request counts as in flight there.
    Replica(usize),
    /// None can be asked any more.
    None,
}

/// The consequence of a request's failure at one replica.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Effect {
    /// The failure is the request's own.
    Own,
    /// The request goes to another replica without spending a retry.
    Elsewhere,
}

/// A request in flight at a replica, until it is dropped.
pub(super) struct InFlight<'a>(&'a Services, usize);

impl Drop for InFlight<'_> {
    fn drop(&mut self) {
        self.0.released(self.1);
    }
}

impl Services {
    /// Replicas at these addresses, which are named in messages.
    pub(super) fn new(addresses: impl Iterator<Item = String>) -> Self {
        let replicas = addresses.map(|address| Service {
            address,
            in_flight: 0,
            failures: 0,
            failed_at: None,
            outs: 0,
            health: Health::Working,
        });
        Self(Mutex::new(State {
            replicas: replicas.collect(),
            models: Vec::new(),
        }))
    }

    /// Adds a model that is asked by this id.
    pub(super) fn add_model(&self, id: String) -> ModelNumber {
        let mut state = self.state();
        state.models.push(Served {
            id,
            replies_as: None,
            gone: BTreeSet::new(),
        });
        ModelNumber(state.models.len() - 1)
    }

    /// Whether a replica takes requests to a model, so that its window counts.
    pub(super) fn takes(&self, model: ModelNumber, index: usize) -> bool {
        self.state().takes(model, index)
    }

    /// The number of requests in flight at a replica.
    pub(super) fn in_flight(&self, index: usize) -> usize {
        self.state().replicas[index].in_flight
    }

    /// The replica for a request to a model: the one that prefers it by rendezvous hashing (Thaler and Ravishankar 1998, IEEE/ACM Trans. Netw. 6:1)
    /// while it has at most [`LEANING`] more in flight than the one with the fewest; else the one with the fewest. Those that `is_ready`
    /// names come first, as the others wait for their pace.
    pub(super) fn choose(
        &self,
        model: ModelNumber,
        affinity: u64,
        avoided: &[usize],
        is_ready: impl Fn(usize) -> bool,
    ) -> Choice {
        // Not under the lock: it asks for the number in flight.
        let count = self.state().replicas.len();
        let ready: Vec<bool> = (0..count).map(is_ready).collect();
        let (now, mut state) = (Instant::now(), self.state());
        let working = |index: &usize| match state.replicas[*index].health {
            Health::Working => true,
            Health::OutUntil(time) => time <= now,
            Health::OnTrial => false,
        };
        let left: Vec<usize> = (0..count)
            .filter(|index| !state.is_gone(model, *index))
            .collect();
        let mut open: Vec<usize> = left.iter().copied().filter(working).collect();
        if open.is_empty() {
            // None works: those that are out are tried as a single endpoint would be, with its retries and their waits.
            open = left;
        }
        if open.iter().any(|index| !avoided.contains(index)) {
            open.retain(|index| !avoided.contains(index));
        }
        if open.iter().any(|index| ready[*index]) {
            open.retain(|index| ready[*index]);
        }
        let in_flight = |index: usize| state.replicas[index].in_flight;
        let least = open
            .iter()
            .map(|index| in_flight(*index))
            .min()
            .unwrap_or(0);
        let chosen = open
            .iter()
            .filter(|index| in_flight(**index) <= least + LEANING)
            .max_by_key(|index| weight(affinity, **index));
        let Some(&chosen) = chosen else {
            return Choice::None;
        };
        let replica = &mut state.replicas[chosen];
        replica.in_flight += 1;
        if replica.health != Health::Working {
            replica.health = Health::OnTrial;
        }
        Choice::Replica(chosen)
    }

    /// The request in flight at a replica that [`Services::choose`] counted; it is released when this is dropped.
    pub(super) fn guard(&self, index: usize) -> InFlight<'_> {
        InFlight(self, index)
    }

    /// Notes that a request at a replica has ended, or was not sent.
    pub(super) fn released(&self, index: usize) {
        let mut state = self.state();
        let replica = &mut state.replicas[index];
        replica.in_flight = replica.in_flight.saturating_sub(1);
        // The trial was given up: the next request is one.
        if replica.health == Health::OnTrial && replica.in_flight == 0 {
            replica.health = Health::OutUntil(Instant::now());
        }
    }

    /// Notes a reply of a replica to a request to a model that was sent at a time; the reply names the model `replies_as`.
    ///
    /// # Errors
    /// If it is another model than that of the other replicas: the reply does not count, and the replica is asked nothing more for this
    /// model.
    pub(super) fn succeeded(
        &self,
        model: ModelNumber,
        index: usize,
        replies_as: Option<&str>,
        sent: Instant,
    ) -> Result<(), Effect> {
        let mut state = self.state();
        let State { replicas, models } = &mut *state;
        let (replica, served) = (&mut replicas[index], &mut models[model.0]);
        replica.answered(sent);
        let Some(name) = replies_as else {
            return Ok(());
        };
        let known = served.replies_as.get_or_insert_with(|| name.to_owned());
        if known == name {
            return Ok(());
        }
        if served.gone.insert(index) {
            warn!(
                "{}: it replies as the model {name}, and the others as {known}: it gets no more requests for {}",
                replica.address, served.id
            );
        }
        Err(Effect::Elsewhere)
    }

    /// Notes a failure of a request to a model at a replica, and tells whether the request goes elsewhere.
    pub(super) fn failed(&self, model: ModelNumber, index: usize, failed: &AskError) -> Effect {
        let (now, mut state) = (Instant::now(), self.state());
        let effect = |is_left: bool| {
            if is_left {
                Effect::Elsewhere
            } else {
                Effect::Own
            }
        };
        let status = failed.failure.status;
        let refused = matches!(status, Some(401 | 403 | 404 | 405 | 410));
        // After a refusal of one field the replica is asked without it.
        if failed.reach == Reach::Endpoint && refused && failed.refused_field.is_none() {
            let State { replicas, models } = &mut *state;
            let served = &mut models[model.0];
            if served.gone.insert(index) {
                warn!(
                    "{}: it gets no more requests for {}: {}",
                    replicas[index].address, served.id, failed.failure.message
                );
            }
            // If no other is left, the failure stands.
            return effect(served.gone.len() < replicas.len());
        }
        let replica = &mut state.replicas[index];
        // A limit of a day or an hour: the others may have none.
        if let (Reach::Endpoint, Some(429), Some(wait)) = (failed.reach, status, failed.wait) {
            replica.health = Health::OutUntil(now + wait);
            return effect(state.any_takes(model, |_| true));
        }
        let kind = failed.failure.kind;
        let broken = matches!(kind, FailureKind::Connection | FailureKind::Server);
        if !broken || failed.again != Again::Later || failed.reach == Reach::Interrupted {
            return Effect::Own;
        }
        replica.broke(now, &failed.failure.message);
        // What the server itself could not do may be due to the request, which then spends a retry.
        let elsewhere = kind == FailureKind::Connection || replica.health != Health::Working;
        effect(elsewhere && state.any_takes(model, |other| other != index))
    }

    /// Whether a replica takes requests to a model that a request has not tried.
    pub(super) fn has_other(&self, model: ModelNumber, avoided: &[usize]) -> bool {
        self.state()
            .any_takes(model, |index| !avoided.contains(&index))
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Service {
    /// Notes a reply to a request that was sent at a time.
    fn answered(&mut self, sent: Instant) {
        if self.failed_at.is_some_and(|failed| sent < failed) {
            return;
        }
        if self.health != Health::Working {
            warn!("{}: it answers again", self.address);
            self.health = Health::Working;
        }
        (self.failures, self.outs) = (0, 0);
    }

    /// Notes a failure to connect, or of the server.
    fn broke(&mut self, now: Instant, message: &str) {
        self.failures += 1;
        self.failed_at = Some(now);
        let was_trial = self.health == Health::OnTrial;
        if was_trial || (self.failures >= FAILURES_IN_A_ROW && self.health == Health::Working) {
            self.outs += 1;
            let time = (FIRST_OUT * self.outs).min(LONGEST_OUT);
            self.health = Health::OutUntil(now + time);
            if self.outs == 1 {
                warn!(
                    "{}: {} failures in a row; the other replicas take its requests: {message}",
                    self.address, self.failures
                );
            }
        }
    }
}

/// The weight of a replica for requests of this affinity: the highest one is preferred. A replica that goes or comes moves only the
/// requests that prefer it.
fn weight(affinity: u64, index: usize) -> u64 {
    let mut bytes = [0; 16];
    bytes[..8].copy_from_slice(&affinity.to_le_bytes());
    bytes[8..].copy_from_slice(&(index as u64).to_le_bytes());
    let hash = blake3::hash(&bytes);
    let mut weight = [0; 8];
    weight.copy_from_slice(&hash.as_bytes()[..8]);
    u64::from_le_bytes(weight)
}

#[cfg(test)]
mod tests;
