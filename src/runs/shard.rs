//! One of several parts of a run, each for one process: [`Shard`].
//!
//! A shard's share of `--max-cost`: [`ShardBudget`].
//!
//! The divisions of a run into shards, by the shards in its folder: [`Division`].

use std::collections::BTreeMap;
use std::num::NonZeroU32;
use std::path::Path;
use std::str::FromStr;
use std::{fmt, fs};

use serde_json::{Value, json};

use super::batch_system::{ArrayTask, TaskRange};
use darkqa_ask::Quota;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::manifests::RunManifest;
use darkqa_base::types::text::money;

/// One of several parts of a run, with consecutive sources. Each source is in one shard, with all its conditions and
/// questions. See [`shard_questions`](crate::shard_records::shard_questions) for the division.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Shard {
    /// Index of the shard, from 0.
    index: u32,
    count: NonZeroU32,
}

impl Shard {
    /// The only shard of a run that is not divided.
    pub const WHOLE: Self = Self { index: 0, count: NonZeroU32::MIN };

    /// True if there are other shards.
    #[must_use]
    pub fn is_part(self) -> bool {
        self.count.get() > 1
    }

    #[must_use]
    pub fn count(self) -> NonZeroU32 {
        self.count
    }

    /// All shards of a run with `count` of them.
    pub fn all(count: NonZeroU32) -> impl Iterator<Item = Self> {
        (0..count.get()).map(move |index| Self { index, count })
    }

    /// Index of the shard, from 0.
    pub fn index(self) -> u32 {
        self.index
    }

    /// This shard's share of `whole` if `at_once` shards run in parallel. The shares of `at_once` consecutive shards
    /// sum to `whole`, except that each is at least 1.
    fn share(self, whole: NonZeroU32, at_once: NonZeroU32) -> NonZeroU32 {
        let (at_once, whole) = (at_once.get(), whole.get());
        let share = whole / at_once + u32::from(self.index % at_once < whole % at_once);
        NonZeroU32::new(share).unwrap_or(NonZeroU32::MIN)
    }

    /// This shard's equal share of a cost.
    #[must_use]
    pub fn share_of_cost(self, whole: f64) -> f64 {
        whole / f64::from(self.count.get())
    }

    /// Name of the shard's folder within that of the run. [`of_folder`](Self::of_folder) parses it.
    #[must_use]
    pub fn folder(self) -> String {
        let digits = self.count.to_string().len();
        format!("shard-{:0digits$}-of-{}", self.index + 1, self.count)
    }

    /// The shard with this name of a folder; `None` for other folders.
    pub(super) fn of_folder(name: &str) -> Option<Self> {
        let (index, count) = name.strip_prefix("shard-")?.split_once("-of-")?;
        Self::new(index.parse::<u32>().ok()?.checked_sub(1)?, count.parse().ok()?)
    }

    /// This shard's share of the requests and tokens per minute if `workers` shards run in parallel, by default all of
    /// them.
    pub fn quota(self, whole: Quota, workers: Option<NonZeroU32>) -> Quota {
        let at_once = workers.map_or(self.count, |workers| workers.min(self.count));
        Quota {
            requests: whole.requests.map(|whole| self.share(whole, at_once)),
            tokens: whole.tokens.map(|whole| self.share(whole, at_once)),
        }
    }

    /// The shard with an index from 0; `None` if the index is not below `count`.
    pub(super) fn new(index: u32, count: NonZeroU32) -> Option<Self> {
        (index < count.get()).then_some(Self { index, count })
    }
}

impl FromStr for Shard {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let (index, count) = text.split_once('/').ok_or_else(|| not_a_shard(text))?;
        let (index, count) = (number(index, text)?, number(count, text)?);
        Self::new(index.get() - 1, count).ok_or_else(|| not_a_shard(text))
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index + 1, self.count)
    }
}

pub(super) fn usage_error(problem: impl fmt::Display) -> Error {
    Error::usage("--shard", problem)
}

fn not_a_shard(text: &str) -> Error {
    usage_error(format_args!("{text:?}; a part expected, as 2/4, or auto, auto/4, none"))
}

/// The number of shards in the text `whole` of a flag.
///
/// # Errors
/// If it is not a positive number.
pub(super) fn number(text: &str, whole: &str) -> Result<NonZeroU32> {
    text.trim().parse().map_err(|_| not_a_shard(whole))
}

/// Manifest setting with the share of a shard, the amount spent, and the amount left, in US dollars.
const BUDGET_ENTRY: &str = "--max-cost of this part";

/// A shard's share of the cost limit of its run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShardBudget {
    /// In US dollars.
    share: f64,
    /// Cost of the shard's replies, in US dollars.
    spent: f64,
}

impl ShardBudget {
    pub fn new(share: f64, spent: f64) -> Self {
        Self { share, spent }
    }

    /// Amount left, in US dollars; at least 0.
    fn left(self) -> f64 {
        (self.share - self.spent).max(0.0)
    }

    /// Notes the budget in the manifest of the shard.
    pub fn note(self, manifest: &mut RunManifest) {
        let dollars = json!({ "share": self.share, "spent": self.spent, "left": self.left() });
        manifest.settings.insert(BUDGET_ENTRY.to_owned(), dollars);
    }

    /// Removes the note from the manifest of a run joined from shards.
    pub fn remove_note(manifest: &mut RunManifest) {
        manifest.settings.remove(BUDGET_ENTRY);
    }

    /// The sentence about the amount left.
    pub fn words(self) -> String {
        format!(
            "{} of its {} of --max-cost are left; other parts do not get them",
            money(self.left()),
            money(self.share)
        )
    }
}

/// Manifest setting of a shard: the Slurm array whose tasks do the shards, as `0-3`.
const DIVISIONS_ENTRY: &str = "Slurm array of this part";

/// A division of a run into shards, of which some exist.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Division {
    /// Number of shards.
    pub(super) count: NonZeroU32,
    /// The Slurm array whose tasks do the shards; `None` if they were named by hand or by an earlier version.
    tasks: Option<TaskRange>,
}

impl Division {
    /// The shard of a task that repeats one of this division, and the array of the division; `None` if it does not
    /// repeat one.
    pub(super) fn shard_of(&self, task: ArrayTask) -> Option<(Shard, TaskRange)> {
        let tasks = self.tasks.filter(|tasks| task.repeats(*tasks))?;
        let shard = Shard::new(tasks.index(task.number)?, self.count)?;
        Some((shard, tasks))
    }
}

/// The divisions of the run in a folder, by their numbers of shards. Empty if the folder has no shard or cannot be
/// read.
pub(super) fn divisions_in(folder: &Path) -> Vec<Division> {
    let mut shards: Vec<Shard> = fs::read_dir(folder)
        .into_iter()
        .flatten()
        .filter_map(|entry| Shard::of_folder(entry.ok()?.file_name().to_str()?))
        .collect();
    shards.sort_by_key(|shard| (shard.count(), *shard));
    let mut divisions = BTreeMap::<NonZeroU32, Option<TaskRange>>::new();
    for shard in shards {
        let tasks = divisions.entry(shard.count()).or_default();
        // One manifest of a division suffices.
        if tasks.is_none() {
            *tasks = tasks_of(&folder.join(shard.folder()));
        }
    }
    divisions.into_iter().map(|(count, tasks)| Division { count, tasks }).collect()
}

/// The array in the manifest of a shard; `None` if there is none, or if the manifest cannot be read: opening the shard
/// reports that error.
fn tasks_of(shard: &Path) -> Option<TaskRange> {
    let settings = darkqa_store::read_settings(shard).ok()?;
    settings.get(DIVISIONS_ENTRY)?.as_str()?.parse().ok()
}

/// The manifest setting that notes the array of a shard.
pub fn tasks_setting(tasks: TaskRange) -> (String, Value) {
    (DIVISIONS_ENTRY.to_owned(), json!(tasks.to_string()))
}

/// Removes the note from the manifest of a run joined from shards.
pub(super) fn remove_tasks_setting(manifest: &mut RunManifest) {
    manifest.settings.remove(DIVISIONS_ENTRY);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn number(n: u32) -> NonZeroU32 {
        NonZeroU32::new(n).unwrap()
    }

    #[test]
    fn shares_of_the_shards_that_run_at_once_sum_up() {
        let parts: Vec<Shard> = Shard::all(number(3)).collect();
        let whole = Quota { requests: Some(number(500)), tokens: Some(number(1)) };
        let shares = |workers: Option<u32>| -> Vec<u32> {
            parts
                .iter()
                .map(|part| part.quota(whole, workers.map(number)))
                .map(|quota| quota.requests.unwrap().get())
                .collect()
        };
        assert_eq!(shares(None), [167, 167, 166]);
        assert_eq!(shares(Some(2)), [250, 250, 250]);
        // At most as many workers as shards.
        assert_eq!(shares(Some(16)), [167, 167, 166]);
        assert_eq!(parts[2].quota(whole, None).tokens.unwrap().get(), 1);
        assert_eq!(parts[1].folder(), "shard-2-of-3");
        let many = Shard::new(6, number(256)).unwrap();
        assert_eq!(many.folder(), "shard-007-of-256");
        assert_eq!(Shard::of_folder("shard-007-of-256"), Some(many));
        for other in ["plan", "shard-0-of-2", "shard-3-of-2", "shard-1-of-x"] {
            assert_eq!(Shard::of_folder(other), None, "{other}");
        }
    }

    fn half_budget(spent: f64) -> ShardBudget {
        ShardBudget { share: 0.5, spent }
    }

    #[test]
    fn nothing_is_left_of_a_share_that_is_spent() {
        assert!((half_budget(0.2).left() - 0.3).abs() < 1e-12);
        assert_eq!(half_budget(0.6).left().to_bits(), 0.0_f64.to_bits());
        let words = half_budget(0.25).words();
        assert!(words.contains("0.25") && words.contains("0.50"), "{words}");
    }
}
