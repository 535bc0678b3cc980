//! The trials that wait for their turn, one queue for each endpoint: [`Lanes`].

use std::collections::VecDeque;
use std::sync::{Arc, Weak};

use crate::engine::models::ModelUnderTest;
use crate::engine::open_files::ConnectionRoom;
use crate::images::trial::{Stimulus, Trial};
use crate::images::workers::ThreadArgs;
use crate::text::words::counted;

/// The most bytes of images that may wait ahead of the slowest endpoint; chosen: some fifty images of 1280×720 as PNG.
const BYTES_AHEAD: usize = 64 << 20;

/// One trial, with the stimulus that its group shares.
pub(crate) struct PreparedTrial<I> {
    pub(crate) trial: Trial<I>,
    pub(crate) stimulus: Arc<Stimulus>,
}

/// The trials of the models that share an endpoint. The built-in models are one lane, too.
struct Lane<I> {
    /// Indexes of the models.
    models: Vec<usize>,
    waiting: VecDeque<PreparedTrial<I>>,
    /// Trials that are asked last.
    aside: VecDeque<PreparedTrial<I>>,
    in_flight: usize,
    /// Number of addresses, each with its own connections.
    addresses: usize,
    /// The maximum number of requests in flight for which there is room.
    room: usize,
    /// The budget does not allow its next trial now.
    is_held: bool,
}

/// The trials that wait, and the number in flight, by endpoint: a slow endpoint does not hold up the others. The images of a group
/// are made once for all of them.
pub(crate) struct Lanes<'a, I> {
    models: &'a [ModelUnderTest],
    all: Vec<Lane<I>>,
    /// Index of the lane of each model.
    of_model: Vec<usize>,
    /// Width of a lane of models that have none.
    default_width: usize,
    /// The images that were accepted, with their bytes, until all their trials have ended.
    held: VecDeque<(Weak<Stimulus>, usize)>,
}

impl<'a, I> Lanes<'a, I> {
    pub(crate) fn new(models: &'a [ModelUnderTest], default_width: usize) -> Self {
        let mut lanes: Vec<Lane<I>> = Vec::new();
        let mut of_model = Vec::new();
        for (index, model) in models.iter().enumerate() {
            let shares =
                |lane: &Lane<I>| models[lane.models[0]].model.shares_endpoint(&model.model);
            let lane = lanes.iter().position(shares).unwrap_or_else(|| {
                let server = model.server.as_ref();
                lanes.push(Lane {
                    models: Vec::new(),
                    addresses: server.map_or(0, |server| server.replicas.len()),
                    room: usize::MAX,
                    waiting: VecDeque::new(),
                    aside: VecDeque::new(),
                    in_flight: 0,
                    is_held: false,
                });
                lanes.len() - 1
            });
            lanes[lane].models.push(index);
            of_model.push(lane);
        }
        Self {
            models,
            all: lanes,
            of_model,
            default_width,
            held: VecDeque::new(),
        }
    }

    /// Limits the requests in flight to the connections that this process may open beside the files of these threads. Says so if they are
    /// fewer than the settings allow.
    pub(crate) fn keep_within_open_files(&mut self, threads: ThreadArgs) {
        let Some(ConnectionRoom { limit, requests }) = ConnectionRoom::now(threads.number()) else {
            return;
        };
        let addresses: usize = self.all.iter().map(|lane| lane.addresses).sum();
        let mut most = 0;
        for lane in self.all.iter_mut().filter(|lane| lane.addresses > 0) {
            lane.room = (requests / addresses * lane.addresses).max(1);
            let server = self.models[lane.models[0]].server.as_ref();
            most += server.map_or(0, |server| server.most_in_flight());
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
        let width = lane
            .models
            .iter()
            .filter_map(|model| self.models[*model].model.width())
            .max()
            .unwrap_or(self.default_width);
        width.min(lane.room)
    }

    /// Adds the trials of a group.
    pub(crate) fn extend(&mut self, ready: Vec<PreparedTrial<I>>) {
        if let Some(first) = ready.first() {
            let bytes = first
                .stimulus
                .images
                .iter()
                .map(|image| image.facts().bytes)
                .sum();
            self.held
                .push_back((Arc::downgrade(&first.stimulus), bytes));
        }
        for ready in ready {
            let lane = self.of_model[ready.trial.model];
            self.all[lane].waiting.push_back(ready);
        }
    }

    /// Takes the next trial of a lane that has room and is not held; trials that `is_dropped` names are dropped, those that `is_aside`
    /// names wait until [`Self::ask_aside`].
    pub(crate) fn next(
        &mut self,
        is_dropped: impl Fn(&Trial<I>) -> bool,
        is_aside: impl Fn(&Trial<I>) -> bool,
    ) -> Option<PreparedTrial<I>> {
        for index in 0..self.all.len() {
            let lane = &self.all[index];
            if lane.is_held || lane.in_flight >= self.width(lane) {
                continue;
            }
            let lane = &mut self.all[index];
            while let Some(ready) = lane.waiting.pop_front() {
                if is_dropped(&ready.trial) {
                    continue;
                }
                if is_aside(&ready.trial) {
                    lane.aside.push_back(ready);
                    continue;
                }
                lane.in_flight += 1;
                return Some(ready);
            }
        }
        None
    }

    /// Whether trials were set aside.
    pub(crate) fn has_aside(&self) -> bool {
        self.all.iter().any(|lane| !lane.aside.is_empty())
    }

    /// Has the trials that were set aside wait as the others.
    pub(crate) fn ask_aside(&mut self) {
        for lane in &mut self.all {
            lane.waiting.append(&mut lane.aside);
        }
    }

    /// Puts back a trial that the budget does not allow now; its lane is held until something ends.
    pub(crate) fn put_back(&mut self, ready: PreparedTrial<I>) {
        let lane = &mut self.all[self.of_model[ready.trial.model]];
        lane.in_flight -= 1;
        lane.is_held = true;
        lane.waiting.push_front(ready);
    }

    /// Notes that a trial of a model has ended.
    pub(crate) fn ended(&mut self, model: usize) {
        let lane = &mut self.all[self.of_model[model]];
        lane.in_flight = lane.in_flight.saturating_sub(1);
        self.release();
    }

    /// Whether the budget keeps back a trial that its endpoint would take now.
    pub(crate) fn is_held_back(&self) -> bool {
        self.all
            .iter()
            .any(|lane| lane.is_held && lane.in_flight < self.width(lane))
    }

    /// Tries again the trials that the budget did not allow.
    pub(crate) fn release(&mut self) {
        self.all.iter_mut().for_each(|lane| lane.is_held = false);
    }

    /// Whether no trial waits.
    pub(crate) fn is_empty(&self) -> bool {
        self.all.iter().all(|lane| lane.waiting.is_empty())
    }

    /// Whether more trials wait than may be sent.
    pub(crate) fn is_full(&self) -> bool {
        !self.is_empty()
    }

    /// Whether a lane has nothing to do, and the images that wait for the others are few enough for one group more.
    pub(crate) fn wants_more(&mut self, is_stopped: impl Fn(usize) -> bool) -> bool {
        if self.is_empty() {
            return true;
        }
        let mut idle = self.all.iter().filter(|lane| lane.waiting.is_empty());
        if !idle.any(|lane| lane.models.iter().any(|model| !is_stopped(*model))) {
            return false;
        }
        self.held
            .retain(|(stimulus, _)| stimulus.strong_count() > 0);
        self.held.iter().map(|(_, bytes)| bytes).sum::<usize>() < BYTES_AHEAD
    }
}
