//! Moves the parts of a run on, step by step, until nothing is left: [`Driver`].
//!
//! A step calls the server at most once, and the journal holds what is about to happen before each call that changes something. So
//! the driver may be stopped anywhere.

use std::cell::Cell;
use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use tokio::time::{Instant, sleep};

use super::journal::Journal;
use super::part::{Part, Stage};
use super::servers::Servers;
use super::settings::BatchRunArgs;
use super::stopped::Stopped;
use crate::ask::batch_api::BatchServer;
use crate::ask::{AskError, BaseUrl};
use crate::engine::models::ModelUnderTest;
use crate::engine::money::MoneySettings;
use crate::error::{Error, Result};
use crate::images::progress::Progress;
use crate::store::Store;
use crate::types::TrialKey;
use crate::types::manifest::RunManifest;
use darkqa_score::record::Detail;

/// How many times as long as at first the wait between two looks may become; chosen: 5 minutes with the default of 10 s.
const LONGEST_WAIT: u32 = 30;

/// How many looks long a file or batch is looked for at least that may exist; chosen.
pub(super) const SEARCH: u32 = 6;

/// How long a file or batch is looked for at least that may exist; chosen: lists of servers may be late.
const SHORTEST_SEARCH: Duration = Duration::from_mins(1);

/// The shortest `--poll` with which a server on this machine is searched for that long; chosen.
const SHORT_POLL: Duration = Duration::from_millis(200);

/// How many refused looks in a row end the command; chosen.
const MOST_REFUSED: u32 = 10;

/// The outcome of a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Step {
    /// The part has gone on, and may go on at once.
    Moved,
    /// The part has to wait.
    Waiting,
}

/// How far parts are brought.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Until {
    /// All replies are taken over.
    TakenOver,
    /// The batches are made, as far as the server takes them.
    Submitted,
    /// One look at each batch; nothing is submitted.
    LookedAt,
    /// All batches are cancelled or have ended, and their replies are taken over.
    Cancelled,
}

/// Why the driver stopped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Driven {
    /// The goal is reached.
    Reached,
    /// The next part would have gone beyond `--max-cost`.
    OverBudget,
}

/// The parts of a run, with all that moving them on needs.
pub(super) struct Driver<'a, D> {
    pub(super) store: &'a mut Store<D>,
    pub(super) manifest: &'a RunManifest,
    pub(super) journal: &'a mut Journal,
    pub(super) servers: &'a Servers,
    /// The models of all phases of the run, to adapt their requests and to price their replies; empty if none is asked again.
    pub(super) models: &'a [&'a ModelUnderTest],
    pub(super) args: &'a BatchRunArgs,
    /// Limits of the cost; `None` if nothing is submitted.
    pub(super) money: Option<&'a MoneySettings>,
    pub(super) progress: &'a Progress,
    pub(super) until: Until,
    /// Trials that were refused in a way in which they would be again.
    pub(super) refused: &'a mut BTreeSet<TrialKey>,
    /// The models whose parts stay as they are.
    pub(super) stopped: &'a mut Stopped,
    pub(super) notes: Notes,
}

/// State that a driver keeps only while it runs.
#[derive(Debug, Default)]
pub(super) struct Notes {
    /// Files at servers that batches may be made of.
    pub(super) ready: BTreeSet<String>,
    /// Since when a part's file or batch was not found.
    pub(super) missing_since: BTreeMap<usize, Instant>,
    /// Until when nothing is submitted, by address and model; with the number of refusals.
    pub(super) holds: BTreeMap<(String, String), (Instant, u32)>,
    /// How often the batch of a part was refused because too many tokens wait.
    pub(super) refused_parts: BTreeMap<usize, u32>,
    /// Uploads and creations in a row at which the server failed, by part.
    pub(super) failed_calls: BTreeMap<usize, u32>,
    /// Refused looks in a row, by part.
    pub(super) refused_looks: BTreeMap<usize, u32>,
    /// Looks in a row at a batch that has ended and whose files are not complete, by part.
    pub(super) incomplete_looks: BTreeMap<usize, u32>,
    /// Parts that have been looked at since the last wait.
    pub(super) looked_at: BTreeSet<usize>,
    /// US dollars that the stored replies were charged; `None` if it is to be summed again.
    pub(super) charged: Cell<Option<f64>>,
    /// The last state of each part that was printed.
    pub(super) printed: BTreeMap<usize, String>,
    /// Messages that have been printed.
    pub(super) said: BTreeSet<String>,
}

impl<D: Detail> Driver<'_, D> {
    /// Moves all parts on. If a server refuses what every further call would ask, the parts of that model stay as they are.
    ///
    /// # Errors
    /// If a file cannot be written, the server of a part is not known, or one refuses and the first model that is stopped ends the run.
    pub(super) async fn drive(&mut self) -> Result<Driven> {
        let first = self.args.collect.poll;
        let mut wait = first;
        loop {
            let mut moved = false;
            self.notes.looked_at.clear();
            let mut part = 0;
            // Parts that are divided add parts at the end.
            while part < self.journal.parts.len() {
                while self.step_or_stop(part).await? == Step::Moved {
                    moved = true;
                }
                part += 1;
            }
            if self.is_reached()? {
                return Ok(Driven::Reached);
            }
            if self.is_over_budget()? {
                return Ok(Driven::OverBudget);
            }
            wait = if moved {
                first
            } else {
                (wait * 3 / 2).min(first * LONGEST_WAIT)
            };
            sleep(wait).await;
        }
    }

    /// A step of a part, unless its model is stopped; stops it if its server refuses what every further call would ask.
    async fn step_or_stop(&mut self, part: usize) -> Result<Step> {
        if self.is_stopped(part) {
            return Ok(Step::Waiting);
        }
        match self.step(part).await {
            Err(error @ Error::Endpoint { .. })
                if !self.money.is_some_and(|money| money.fail_fast) =>
            {
                self.progress.say(&format!("stopped: {error}"));
                let facts = &self.journal.parts[part].facts;
                self.stopped.add_part(facts, error);
                Ok(Step::Waiting)
            }
            step => step,
        }
    }

    async fn step(&mut self, part: usize) -> Result<Step> {
        if self.is_elsewhere(part) {
            let base = &self.part(part).facts.base;
            let line = format!("batches at {base} are left alone; name that address, with its key");
            self.warn_once(line);
            return Ok(Step::Waiting);
        }
        match &self.part(part).stage {
            Stage::Written | Stage::Uploading | Stage::Uploaded
                if self.until == Until::Cancelled =>
            {
                self.withdraw(part).await
            }
            Stage::Written => self.upload(part).await,
            Stage::Uploading => self.find_file(part).await,
            Stage::Uploaded => self.create(part).await,
            Stage::Creating => self.find_batch(part).await,
            Stage::Created => self.look_at(part).await,
            Stage::Fetched { .. } => self.take_over(part),
            Stage::TakenOver => self.delete_files(part).await,
            Stage::Ended => Ok(Step::Waiting),
        }
    }

    fn is_reached(&self) -> Result<bool> {
        let has_ended = |part: &Part| part.stage == Stage::Ended;
        let stays = |part: usize| self.is_elsewhere(part) || self.is_stopped(part);
        let mut parts = 0..self.journal.parts.len();
        if parts.all(|part| has_ended(self.part(part)) || stays(part)) {
            return Ok(true);
        }
        Ok(match self.until {
            Until::TakenOver | Until::Cancelled => false,
            Until::LookedAt => true,
            Until::Submitted => {
                let mut waiting = true;
                for (index, part) in self.journal.parts.iter().enumerate() {
                    let is_out = part.stage == Stage::Created;
                    let is_left = has_ended(part) || is_out || self.is_stopped(index);
                    waiting &= is_left || self.is_held(index)?;
                }
                waiting
            }
        })
    }

    /// Whether a part is at a server that the flags do not name, in a command that does not ask anything.
    fn is_elsewhere(&self, part: usize) -> bool {
        let only_looks = matches!(self.until, Until::LookedAt | Until::Cancelled);
        let part = self.part(part);
        only_looks && part.stage != Stage::Ended && !self.servers.has(&part.facts.base)
    }

    fn is_stopped(&self, part: usize) -> bool {
        self.stopped.has_part(&self.part(part).facts)
    }

    pub(super) fn part(&self, part: usize) -> &Part {
        &self.journal.parts[part]
    }

    /// The server of a part.
    pub(super) fn server(&self, part: usize) -> Result<&BatchServer> {
        self.servers.server(&self.part(part).facts)
    }

    /// Prints a line once.
    pub(super) fn warn_once(&mut self, line: String) {
        if !self.notes.said.contains(&line) {
            tracing::warn!("{line}");
            self.notes.said.insert(line);
        }
    }

    /// Prints how a part goes on, if that is new.
    pub(super) fn say(&mut self, part: usize, what: &str) {
        let before = self.notes.printed.insert(part, what.to_owned());
        if before.as_deref() != Some(what) {
            let line = format!("{}: {what}", self.part(part).name);
            self.progress.say(&line);
        }
    }

    /// The error for a call that would fail again.
    pub(super) fn fatal(&self, part: usize, failure: &AskError) -> Error {
        let part = self.part(part);
        Error::Endpoint {
            endpoint: part.facts.base.clone(),
            problem: format!(
                "{}: {failure}; the batches of this run stay as they are, and the same command continues",
                part.name
            ),
        }
    }

    /// Counts a look that the server refused.
    ///
    /// # Errors
    /// If the last looks were refused, too: the key or the address is wrong.
    pub(super) fn look_failed(&mut self, part: usize, failure: &AskError) -> Result<Step> {
        tracing::debug!("{}: {failure}", self.part(part).name);
        if failure.is_permanent() {
            let looks = self.notes.refused_looks.entry(part).or_default();
            *looks += 1;
            if *looks >= MOST_REFUSED || self.until == Until::LookedAt {
                return Err(self.fatal(part, failure));
            }
        }
        let name = self.part(part).name.clone();
        self.warn_once(format!("{name}: {failure}; tried again"));
        Ok(Step::Waiting)
    }

    /// Whether a part's file or batch has been missing for long enough to be sure that it does not exist; states it if it has not.
    pub(super) fn is_missing(&mut self, part: usize, what: &str) -> bool {
        let now = Instant::now();
        let since = *self.notes.missing_since.entry(part).or_insert(now);
        let search = self.search_time(part);
        let is_missing = now - since >= search;
        if is_missing {
            self.notes.missing_since.remove(&part);
        } else {
            self.warn_once(format!(
                "{}: the server does not list its {what}; looked for again for {} s, as a list may be late",
                self.part(part).name,
                search.as_secs_f64()
            ));
        }
        is_missing
    }

    /// Ends the search for a part's file or batch: the next one has its whole time again.
    pub(super) fn was_found(&mut self, part: usize) {
        self.notes.missing_since.remove(&part);
    }

    /// How long a part's file or batch is looked for. A server on this machine that is looked at all the time has lists that are not late.
    fn search_time(&self, part: usize) -> Duration {
        let poll = self.args.collect.poll;
        let base = self.part(part).facts.base.parse::<BaseUrl>();
        let is_here = base.is_ok_and(|base| base.is_loopback());
        if is_here && poll < SHORT_POLL {
            return poll * SEARCH;
        }
        SHORTEST_SEARCH.max(poll * SEARCH)
    }
}
