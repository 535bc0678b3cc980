//! One of several parts of a run, each for one process: [`Shard`].

use std::fmt;
use std::num::NonZeroU32;
use std::str::FromStr;

use crate::ask::Quota;
use crate::error::{Error, Result};
use crate::runs::batch_system::BatchSystem;

/// One of several parts of a run, with consecutive sources. Each source is in one shard, with all its conditions and questions. See
/// [`shard_questions`](crate::runs::shard_sources::shard_questions) for the division.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Shard {
    /// Index of the shard, from 0.
    index: u32,
    count: NonZeroU32,
}

impl Shard {
    /// The only shard of a run that is not divided.
    pub(crate) const WHOLE: Self = Self {
        index: 0,
        count: NonZeroU32::MIN,
    };

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

    /// This shard's share of `whole` if `at_once` shards run in parallel. The shares of `at_once` consecutive shards sum to `whole`, except
    /// that each is at least 1.
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

    /// Name of the shard's folder within that of the run.
    #[must_use]
    pub(crate) fn folder(self) -> String {
        let digits = self.count.to_string().len();
        format!("shard-{:0digits$}-of-{}", self.index + 1, self.count)
    }

    /// This shard's share of the requests and tokens per minute if `workers` shards run in parallel, by default all of them.
    pub(crate) fn quota(self, whole: Quota, workers: Option<NonZeroU32>) -> Quota {
        let at_once = workers.map_or(self.count, |workers| workers.min(self.count));
        Quota {
            requests: whole.requests.map(|whole| self.share(whole, at_once)),
            tokens: whole.tokens.map(|whole| self.share(whole, at_once)),
        }
    }

    /// The shard given by `--shard` (`2/4`, `auto/4`, `auto`, `none`), or, without the flag, by the batch system.
    ///
    /// # Errors
    /// If there is no such shard, or the batch system does not set all required variables.
    pub(crate) fn resolve(
        flag: Option<&str>,
        variable: impl Fn(&str) -> Option<String>,
    ) -> Result<Self> {
        let system = BatchSystem::from_environment(&variable)?;
        match (flag, system) {
            (Some("none"), _) | (None, None) => Ok(Self::WHOLE),
            (Some("auto"), system) => {
                let system = system.ok_or_else(|| usage_error(NO_SYSTEM))?;
                Self::from_batch_system(system, None)
            }
            (Some(text), system) => match text.split_once('/') {
                Some(("auto", count)) => {
                    let system = system.ok_or_else(|| usage_error(NO_SYSTEM))?;
                    Self::from_batch_system(system, Some(number(count, text)?))
                }
                _ => text.parse(),
            },
            (None, Some(system)) => {
                let shard = Self::from_batch_system(system, None)?;
                if shard.is_part() {
                    tracing::warn!(
                        "{system}: this process does shard {shard}; --shard none does everything"
                    );
                }
                Ok(shard)
            }
        }
    }

    /// The shard of this process in a batch system.
    fn from_batch_system(system: BatchSystem, count: Option<NonZeroU32>) -> Result<Self> {
        let (index, count) = system.index_and_count(count)?;
        Ok(Self { index, count })
    }

    fn new(index: u32, count: NonZeroU32) -> Option<Self> {
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

const NO_SYSTEM: &str = "auto is for a task of a Slurm array (SLURM_ARRAY_TASK_ID) or a pod of an indexed Kubernetes job \
                         (JOB_COMPLETION_INDEX), and this is neither";

fn usage_error(problem: impl fmt::Display) -> Error {
    Error::usage("--shard", problem)
}

fn not_a_shard(text: &str) -> Error {
    usage_error(format_args!(
        "{text:?}; a part expected, as 2/4, or auto, auto/4, none"
    ))
}

fn number(text: &str, whole: &str) -> Result<NonZeroU32> {
    text.trim().parse().map_err(|_| not_a_shard(whole))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn resolved(text: Option<&str>, variables: &[(&str, &str)]) -> Result<Shard> {
        Shard::resolve(text, |name| {
            variables
                .iter()
                .find(|(known, _)| *known == name)
                .map(|(_, value)| (*value).to_owned())
        })
    }

    const TASK: [(&str, &str); 4] = [
        ("SLURM_ARRAY_TASK_ID", "5"),
        ("SLURM_ARRAY_TASK_MIN", "1"),
        ("SLURM_ARRAY_TASK_STEP", "2"),
        ("SLURM_ARRAY_TASK_COUNT", "4"),
    ];

    #[test]
    fn shards_are_read_from_the_flag_and_the_batch_system() {
        let pod = [("JOB_COMPLETION_INDEX", "2")];
        for (text, variables, expected) in [
            (None, &[][..], "1/1"),
            (Some("2/4"), &[], "2/4"),
            (Some("4/4"), &TASK, "4/4"),
            (Some("none"), &TASK, "1/1"),
            (None, &TASK, "3/4"),
            (Some("auto"), &TASK, "3/4"),
            (Some("auto/4"), &TASK, "3/4"),
            (Some("auto/8"), &pod, "3/8"),
            (Some("none"), &pod, "1/1"),
            // An array of one task does everything.
            (None, &[("SLURM_ARRAY_TASK_ID", "7")], "1/1"),
        ] {
            let shard = resolved(text, variables).unwrap();
            assert_eq!(shard.to_string(), expected, "{text:?}");
        }
        for (text, variables, message) in [
            (Some("0/4"), &[][..], "a part expected, as 2/4"),
            (Some("5/4"), &[], "a part expected"),
            (Some("1"), &[], "a part expected"),
            (Some("auto"), &[], "auto is for a task"),
            (Some("auto/2"), &pod, "beyond the 2 parts"),
            (Some("auto/3"), &TASK, "has 4 tasks, not 3"),
            (None, &pod, "--shard auto/N"),
        ] {
            let error = resolved(text, variables).unwrap_err().to_string();
            assert!(error.contains(message), "{text:?}: {error}");
        }
    }

    fn number(n: u32) -> NonZeroU32 {
        NonZeroU32::new(n).unwrap()
    }

    #[test]
    fn shares_of_the_shards_that_run_at_once_sum_up() {
        let parts: Vec<Shard> = Shard::all(number(3)).collect();
        let whole = Quota {
            requests: Some(number(500)),
            tokens: Some(number(1)),
        };
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
    }
}
