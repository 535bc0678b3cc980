//! One of several parts of a run, each for one process: [`Shard`].

use std::fmt;
use std::num::NonZeroU32;
use std::str::FromStr;

use crate::ask::Quota;
use crate::error::{Error, Result};

/// One of several parts of a run, with consecutive sources. Each source is in one shard, with all its conditions and
/// questions. See [`shard_questions`](crate::runs::shard_sources::shard_questions) for the division.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Shard {
    /// Index of the shard, from 0.
    index: u32,
    count: NonZeroU32,
}

impl Shard {
    /// The only shard of a run that is not divided.
    pub(crate) const WHOLE: Self = Self { index: 0, count: NonZeroU32::MIN };

    /// True if there are other shards.
    #[must_use]
    pub(crate) fn is_part(self) -> bool {
        self.count.get() > 1
    }

    #[must_use]
    pub(crate) fn count(self) -> NonZeroU32 {
        self.count
    }

    /// All shards of a run with `count` of them.
    pub(crate) fn all(count: NonZeroU32) -> impl Iterator<Item = Self> {
        (0..count.get()).map(move |index| Self { index, count })
    }

    /// Index of the shard, from 0.
    pub(crate) fn index(self) -> u32 {
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
    pub(crate) fn share_of_cost(self, whole: f64) -> f64 {
        whole / f64::from(self.count.get())
    }

    /// Name of the shard's folder within that of the run. [`of_folder`](Self::of_folder) parses it.
    #[must_use]
    pub(crate) fn folder(self) -> String {
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
    pub(crate) fn quota(self, whole: Quota, workers: Option<NonZeroU32>) -> Quota {
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
}
