//! Queues of trials waiting to be sent, one per endpoint: [`Lanes`].
//!
//! Sends one trial to its model: [`send`].

use std::collections::VecDeque;
use std::sync::{Arc, Weak};

use tokio::sync::watch;

use super::costs::Permit;
use crate::images::trials::{Item, Stimulus, Trial};
use crate::images::workers::ThreadArgs;
use crate::models::ModelUnderTest;
use crate::open_files::RequestLimit;
use darkqa_ask::{AskError, Call, Reservation};
use darkqa_base::types::text::counted;
use darkqa_base::types::{LostAttempts, Reply};

/// Maximum bytes of images held so that idle endpoints can work ahead of the slowest; chosen: about fifty images of
/// 1280×720 as PNG.
const BYTES_AHEAD: usize = 64 << 20;

/// A trial with its stimulus, which it shares with the other trials of its group.
pub struct PreparedTrial<I> {
    pub trial: Trial<I>,
    pub stimulus: Arc<Stimulus>,
}

/// The queue of the models that share an endpoint. The built-in models share one lane.
struct Lane<I> {
    /// Indexes of its models.
    models: Vec<usize>,
    waiting: VecDeque<PreparedTrial<I>>,
    /// Trials set aside, to be asked after all others.
    deferred: VecDeque<PreparedTrial<I>>,
    in_flight: usize,
    /// Number of server addresses, each with its own connections.
    addresses: usize,
    /// Maximum number of requests in flight within the limit on open files.
    max_in_flight: usize,
    /// True while the lane waits because the budget refused its next trial.
    is_held: bool,
}

/// Waiting trials and the number in flight, per endpoint, so that a slow endpoint does not hold up the others. All
/// endpoints share the images of a group, which are made once.
pub struct Lanes<'a, I> {
    models: &'a [ModelUnderTest],
    by_endpoint: Vec<Lane<I>>,
    /// Index into `by_endpoint`, by index of the model.
    lane_of_model: Vec<usize>,
    /// Maximum number of requests in flight in a lane whose models set no limit.
    default_width: usize,
    /// The stimulus of each accepted group and the bytes of its images, until all its trials have ended.
    live_images: VecDeque<(Weak<Stimulus>, usize)>,
}

impl<'a, I> Lanes<'a, I> {
    pub fn new(models: &'a [ModelUnderTest], default_width: usize) -> Self {
        let mut lanes: Vec<Lane<I>> = Vec::new();
        let mut lane_of_model = Vec::new();
        for (index, model) in models.iter().enumerate() {
            let shared = lanes.iter().position(|lane| models[lane.models[0]].model.shares_endpoint(&model.model));
            let lane = shared.unwrap_or_else(|| {
                let server = model.server.as_ref();
                lanes.push(Lane {
                    models: Vec::new(),
                    addresses: server.map_or(0, |server| server.replicas.len()),
                    max_in_flight: usize::MAX,
                    waiting: VecDeque::new(),
                    deferred: VecDeque::new(),
                    in_flight: 0,
                    is_held: false,
                });
                lanes.len() - 1
            });
            lanes[lane].models.push(index);
            lane_of_model.push(lane);
        }
        Self { models, by_endpoint: lanes, lane_of_model, default_width, live_images: VecDeque::new() }
    }

    /// Limits the requests in flight to the connections that this process may open in addition to the files of these
    /// threads. Prints a warning if that is fewer than the settings allow.
    pub fn keep_within_open_files(&mut self, threads: ThreadArgs) {
        let Some(RequestLimit { limit, requests }) = RequestLimit::now(threads.count()) else {
            return;
        };
        let addresses: usize = self.by_endpoint.iter().map(|lane| lane.addresses).sum();
        let mut most = 0;
        for lane in self.by_endpoint.iter_mut().filter(|lane| lane.addresses > 0) {
            lane.max_in_flight = (requests / addresses * lane.addresses).max(1);
            let server = self.models[lane.models[0]].server.as_ref();
            most += server.map_or(0, |server| server.max_in_flight());
        }
        if most > requests {
            tracing::warn!(
                "at most {} in flight at once instead of {most} (--concurrency), as this process may open only {limit} files (ulimit -n)",
                counted(requests, "request")
            );
        }
    }

    /// The maximum number of requests in flight in a lane now.
    fn width(&self, lane: &Lane<I>) -> usize {
        lane.models
            .iter()
            .filter_map(|model| self.models[*model].model.width())
            .max()
            .unwrap_or(self.default_width)
            .min(lane.max_in_flight)
    }

    /// Adds the trials of a group.
    pub fn extend(&mut self, ready: Vec<PreparedTrial<I>>) {
        if let Some(first) = ready.first() {
            let bytes = first.stimulus.images.iter().map(|image| image.facts().bytes).sum();
            self.live_images.push_back((Arc::downgrade(&first.stimulus), bytes));
        }
        for ready in ready {
            let lane = self.lane_of_model[ready.trial.model];
            self.by_endpoint[lane].waiting.push_back(ready);
        }
    }

    /// Appends trials that are asked again to the waiting ones; true if there are any.
    pub fn requeue(&mut self, again: Vec<PreparedTrial<I>>) -> bool {
        let has_any = !again.is_empty();
        for ready in again {
            let lane = self.lane_of_model[ready.trial.model];
            self.by_endpoint[lane].waiting.push_back(ready);
        }
        has_any
    }

    /// Takes the next trial from a lane that has room and is not held by the budget. Trials for which `is_dropped` is
    /// true are dropped; those for which `is_deferred` is true are set aside until [`Self::requeue_deferred`].
    pub fn next(
        &mut self,
        is_dropped: impl Fn(&Trial<I>) -> bool,
        is_deferred: impl Fn(&Trial<I>) -> bool,
    ) -> Option<PreparedTrial<I>> {
        for index in 0..self.by_endpoint.len() {
            let lane = &self.by_endpoint[index];
            if lane.is_held || lane.in_flight >= self.width(lane) {
                continue;
            }
            let lane = &mut self.by_endpoint[index];
            while let Some(ready) = lane.waiting.pop_front() {
                if is_dropped(&ready.trial) {
                    continue;
                }
                if is_deferred(&ready.trial) {
                    lane.deferred.push_back(ready);
                    continue;
                }
                lane.in_flight += 1;
                return Some(ready);
            }
        }
        None
    }

    /// True if any trial is set aside.
    pub fn has_deferred(&self) -> bool {
        self.by_endpoint.iter().any(|lane| !lane.deferred.is_empty())
    }

    /// Appends the trials that were set aside to the waiting ones.
    pub fn requeue_deferred(&mut self) {
        for lane in &mut self.by_endpoint {
            lane.waiting.append(&mut lane.deferred);
        }
    }

    /// Returns a trial that the budget does not allow now to its queue, and holds its lane until a trial ends or
    /// [`Self::release`] is called.
    pub fn put_back(&mut self, ready: PreparedTrial<I>) {
        let lane = &mut self.by_endpoint[self.lane_of_model[ready.trial.model]];
        lane.in_flight -= 1;
        lane.is_held = true;
        lane.waiting.push_front(ready);
    }

    /// Records that a trial of a model has ended, and releases all lanes held by the budget.
    pub fn ended(&mut self, model: usize) {
        let lane = &mut self.by_endpoint[self.lane_of_model[model]];
        lane.in_flight = lane.in_flight.saturating_sub(1);
        self.release();
    }

    /// True if the budget holds a lane whose endpoint has room for another request.
    pub fn is_held_back(&self) -> bool {
        self.by_endpoint.iter().any(|lane| lane.is_held && lane.in_flight < self.width(lane))
    }

    /// Releases all lanes held by the budget, so that their next trials are tried again.
    pub fn release(&mut self) {
        for lane in &mut self.by_endpoint {
            lane.is_held = false;
        }
    }

    /// True if no trial is waiting; trials set aside do not count.
    pub fn is_empty(&self) -> bool {
        self.by_endpoint.iter().all(|lane| lane.waiting.is_empty())
    }

    /// True if trials are waiting. Once [`Self::next`] has returned `None`, none of them may be sent now.
    pub fn has_waiting(&self) -> bool {
        !self.is_empty()
    }

    /// True if another group should be prepared: no trial is waiting, or a lane of a model that is not stopped has none
    /// waiting and the images held are smaller than [`BYTES_AHEAD`].
    pub fn wants_more(&mut self, is_stopped: impl Fn(usize) -> bool) -> bool {
        if self.is_empty() {
            return true;
        }
        let has_idle_lane = self
            .by_endpoint
            .iter()
            .any(|lane| lane.waiting.is_empty() && lane.models.iter().any(|model| !is_stopped(*model)));
        if !has_idle_lane {
            return false;
        }
        self.live_images.retain(|(stimulus, _)| stimulus.strong_count() > 0);
        let held_bytes: usize = self.live_images.iter().map(|(_, bytes)| bytes).sum();
        held_bytes < BYTES_AHEAD
    }
}

/// One trial, with its reply or error.
pub(super) type Finished<I> = (PreparedTrial<I>, Result<Reply, AskError>);

/// Sends one trial to its model, unless it is given up first. Returns the trial with its reply or error, including the
/// cost of lost attempts. `has_timed_out` is true if a gateway gave up on it in an earlier call.
pub(super) async fn send<I: Item>(
    model: ModelUnderTest,
    ready: PreparedTrial<I>,
    permit: Permit,
    has_timed_out: bool,
    mut given_up: watch::Receiver<bool>,
) -> Finished<I> {
    let PreparedTrial { trial, stimulus } = &ready;
    let call = Call {
        query: trial.item.query(),
        condition: stimulus.condition.as_ref(),
        message: trial.prompt.message(&stimulus.images),
        turn: trial.item.turn(),
    };
    let reservation = match &permit {
        Permit::Reserved(reservation) => Some(&**reservation),
        Permit::Free | Permit::Refused => None,
    };
    let asked = tokio::select! {
        biased;
        result = model.model.ask_within(call, reservation, has_timed_out) => Some(result),
        _ = given_up.wait_for(|given_up| *given_up) => None,
    };
    let charged = reservation.map_or_else(LostAttempts::default, Reservation::charged);
    let result = match asked {
        Some(Ok(mut reply)) => {
            reply.lost.unstated = charged.unstated;
            Ok(reply)
        }
        Some(Err(mut error)) => {
            error.lost.unstated = charged.unstated;
            Err(error)
        }
        None => Err(AskError { lost: Box::new(charged), ..AskError::given_up() }),
    };
    (ready, result)
}
