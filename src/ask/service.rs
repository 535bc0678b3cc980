//! Which replica of an endpoint takes a request: [`Services`].

use std::sync::{Mutex, MutexGuard, PoisonError};

use tokio::time::{Duration, Instant};
use tracing::warn;

use super::failure::{Again, FailedTry, Reach};
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

/// The state of each replica of an endpoint.
#[derive(Debug)]
pub(super) struct Services(Mutex<State>);

#[derive(Debug)]
struct State {
    replicas: Vec<Service>,
    /// The model that replies name; the first reply decides.
    served: Option<String>,
}

#[derive(Debug)]
struct Service {
    address: String,
    in_flight: usize,
    /// Failures to connect or of the server since the last reply.
    failures: u32,
    /// The time of the last of them: replies to requests that were sent before it say nothing of the replica now.
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
    /// It takes nothing more in this run.
    Gone,
}

/// The replica for a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Choice {
    /// This one; the request counts as in flight there.
    Replica(usize),
    /// None can be asked any more.
    None,
}

/// What follows from a failure of a request at one replica.
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
            served: None,
        }))
    }

    /// Whether a replica takes requests, so that its window counts.
    pub(super) fn is_working(&self, index: usize) -> bool {
        self.state().replicas[index].health == Health::Working
    }

    /// The number of requests in flight at a replica.
    pub(super) fn in_flight(&self, index: usize) -> usize {
        self.state().replicas[index].in_flight
    }

    /// The replica for a request: the one that prefers it by rendezvous hashing (Thaler and Ravishankar 1998, IEEE/ACM Trans. Netw. 6:1)
    /// while it has at most [`LEANING`] more in flight than the one with the fewest; else the one with the fewest. Those that `is_ready`
    /// names come first, as the others wait for their pace.
    pub(super) fn choose(
        &self,
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
            Health::OnTrial | Health::Gone => false,
        };
        let mut open: Vec<usize> = (0..count).filter(working).collect();
        if open.is_empty() {
            // None works: those that are out are tried as a single endpoint would be, with its retries and their waits.
            let left = |index: &usize| state.replicas[*index].health != Health::Gone;
            open = (0..count).filter(left).collect();
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
        let near = open
            .iter()
            .filter(|index| in_flight(**index) <= least + LEANING);
        let chosen = near.max_by_key(|index| weight(affinity, **index));
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

    /// Notes a reply of a replica to a request that was sent at a time; the reply names this model.
    ///
    /// # Errors
    /// If it is another model than that of the other replicas: the reply does not count, and the replica is asked nothing more.
    pub(super) fn succeeded(
        &self,
        index: usize,
        served: Option<&str>,
        sent: Instant,
    ) -> Result<(), Effect> {
        let mut state = self.state();
        let known = state.served.clone();
        if let (Some(known), Some(served)) = (&known, served)
            && known != served
        {
            let replica = &mut state.replicas[index];
            if replica.health != Health::Gone {
                replica.health = Health::Gone;
                warn!(
                    "{}: it serves the model {served}, and the others serve {known}: it is asked nothing more",
                    replica.address
                );
            }
            return Err(Effect::Elsewhere);
        }
        if known.is_none() {
            state.served = served.map(str::to_owned);
        }
        let replica = &mut state.replicas[index];
        if replica.failed_at.is_some_and(|failed| sent < failed) {
            return Ok(());
        }
        if matches!(replica.health, Health::OnTrial | Health::OutUntil(_)) {
            warn!("{}: it answers again", replica.address);
            replica.health = Health::Working;
        }
        (replica.failures, replica.outs) = (0, 0);
        Ok(())
    }

    /// Notes a failure at a replica, and tells whether the request goes elsewhere.
    pub(super) fn failed(&self, index: usize, failed: &FailedTry) -> Effect {
        let (now, mut state) = (Instant::now(), self.state());
        let replica = &mut state.replicas[index];
        let status = failed.failure.status;
        let refused = matches!(status, Some(401 | 403 | 404 | 405 | 410));
        if failed.reach == Reach::Endpoint && refused {
            if replica.health != Health::Gone {
                replica.health = Health::Gone;
                warn!(
                    "{}: it is asked nothing more: {}",
                    replica.address, failed.failure.message
                );
            }
            // If no other is left, the failure stands.
            let left = state
                .replicas
                .iter()
                .any(|replica| replica.health != Health::Gone);
            return if left { Effect::Elsewhere } else { Effect::Own };
        }
        // A limit of a day or an hour: the others may have none.
        if let (Reach::Endpoint, Some(429), Some(wait)) = (failed.reach, status, failed.wait) {
            replica.health = Health::OutUntil(now + wait);
            let left = state
                .replicas
                .iter()
                .any(|replica| replica.health == Health::Working);
            return if left { Effect::Elsewhere } else { Effect::Own };
        }
        let kind = failed.failure.kind;
        let broken = matches!(kind, FailureKind::Connection | FailureKind::Server);
        if !broken || failed.again != Again::Later || failed.reach == Reach::Interrupted {
            return Effect::Own;
        }
        replica.failures += 1;
        replica.failed_at = Some(now);
        let was_trial = replica.health == Health::OnTrial;
        if was_trial || (replica.failures >= FAILURES_IN_A_ROW && replica.health == Health::Working)
        {
            replica.outs += 1;
            let time = (FIRST_OUT * replica.outs).min(LONGEST_OUT);
            replica.health = Health::OutUntil(now + time);
            if replica.outs == 1 {
                warn!(
                    "{}: {} failures in a row; the other replicas take its requests: {}",
                    replica.address, replica.failures, failed.failure.message
                );
            }
        }
        // What the server itself could not do may be due to the request, which then spends a retry.
        let elsewhere = kind == FailureKind::Connection || replica.health != Health::Working;
        let left = state.replicas.iter().enumerate();
        let mut left = left.filter(|(_, replica)| replica.health == Health::Working);
        if elsewhere && left.any(|(other, _)| other != index) {
            Effect::Elsewhere
        } else {
            Effect::Own
        }
    }

    /// Whether a replica works that a request has not tried.
    pub(super) fn has_other(&self, avoided: &[usize]) -> bool {
        let state = self.state();
        let mut replicas = state.replicas.iter().enumerate();
        replicas
            .any(|(index, replica)| replica.health == Health::Working && !avoided.contains(&index))
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
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
