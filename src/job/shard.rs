//! Parts of a job for several processes: [`Shard`], and its questions: `part`.

use std::collections::HashMap;
use std::fmt;
use std::num::NonZeroU32;
use std::str::FromStr;

use crate::ask::Quota;
use crate::error::{Error, Result};

/// One of several parts of a run. It contains the sources whose position, counted from 0, has the remainder `index` when divided by
/// `count`. A source is in one shard, with all its conditions and questions.
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

    /// Whether there are other shards.
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

    /// Whether the shard contains the source at a position.
    #[must_use]
    pub(crate) fn has(self, position: usize) -> bool {
        position as u64 % u64::from(self.count.get()) == u64::from(self.index)
    }

    /// The shard's share of a whole number. The shares sum to it, except that each is at least 1.
    #[must_use]
    pub(crate) fn share(self, whole: NonZeroU32) -> NonZeroU32 {
        let (count, whole) = (self.count.get(), whole.get());
        let share = whole / count + u32::from(self.index < whole % count);
        NonZeroU32::new(share).unwrap_or(NonZeroU32::MIN)
    }

    /// The shard's share of a cost.
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

    /// The shard's share of the requests and tokens per minute.
    pub(super) fn quota(self, whole: Quota) -> Quota {
        Quota {
            requests: whole.requests.map(|requests| self.share(requests)),
            tokens: whole.tokens.map(|tokens| self.share(tokens)),
        }
    }

    /// The shard that `--shard` names (`2/4`, `auto/4`, `auto`, `none`). Without the flag, that of the batch system.
    ///
    /// # Errors
    /// If there is no such shard, or the batch system does not set all variables that are needed.
    pub(super) fn resolve(
        flag: Option<&str>,
        variable: impl Fn(&str) -> Option<String>,
    ) -> Result<Self> {
        let system = BatchSystem::of(&variable)?;
        match (flag, system) {
            (Some("none"), _) | (None, None) => Ok(Self::WHOLE),
            (Some("auto"), system) => {
                let system = system.ok_or_else(|| usage_error(NO_SYSTEM))?;
                system.shard(None)
            }
            (Some(text), system) => match text.split_once('/') {
                Some(("auto", count)) => {
                    let system = system.ok_or_else(|| usage_error(NO_SYSTEM))?;
                    system.shard(Some(number(count, text)?))
                }
                _ => text.parse(),
            },
            (None, Some(system)) => {
                let shard = system.shard(None)?;
                if shard.is_part() {
                    tracing::warn!(
                        "{system}: this process does shard {shard}; --shard none does everything"
                    );
                }
                Ok(shard)
            }
        }
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

/// The questions about the sources of a shard. Sources are assigned to the shards in turn, in the order of their first question.
/// `source` returns the source of a question.
///
/// # Errors
/// If the shard has no question.
pub(crate) fn part<Q>(
    questions: Vec<Q>,
    shard: Shard,
    source: impl Fn(&Q) -> String,
) -> Result<Vec<Q>> {
    if !shard.is_part() {
        return Ok(questions);
    }
    let mut positions = HashMap::<String, usize>::new();
    for question in &questions {
        let next = positions.len();
        positions.entry(source(question)).or_insert(next);
    }
    let own = questions.into_iter();
    let own = own.filter(|question| shard.has(positions[&source(question)]));
    let own: Vec<Q> = own.collect();
    if own.is_empty() {
        let problem = format!(
            "{shard} is empty: there are {} frames or walks; use at most as many shards",
            positions.len()
        );
        return Err(Error::usage("--shard", problem));
    }
    Ok(own)
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

/// The batch system that started this process, with its variables.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum BatchSystem {
    /// A task of a job array: its index from 0, and the number of tasks.
    Slurm { index: u32, count: NonZeroU32 },
    /// A pod of an indexed job: its index from 0. The number of pods is in no variable.
    Kubernetes { index: u32 },
}

impl BatchSystem {
    fn of(variable: &impl Fn(&str) -> Option<String>) -> Result<Option<Self>> {
        let value = |name: &str| -> Result<Option<u32>> {
            let parse = |text: String| {
                text.trim()
                    .parse()
                    .map_err(|_| Error::usage(name, format_args!("{text:?} is not a number")))
            };
            variable(name).map(parse).transpose()
        };
        if let Some(id) = value("SLURM_ARRAY_TASK_ID")? {
            let first = value("SLURM_ARRAY_TASK_MIN")?.unwrap_or(id);
            let step = value("SLURM_ARRAY_TASK_STEP")?.unwrap_or(1).max(1);
            let count = value("SLURM_ARRAY_TASK_COUNT")?.unwrap_or(1);
            return Ok(Some(Self::Slurm {
                index: id.saturating_sub(first) / step,
                count: NonZeroU32::new(count).unwrap_or(NonZeroU32::MIN),
            }));
        }
        let index = value("JOB_COMPLETION_INDEX")?;
        Ok(index.map(|index| Self::Kubernetes { index }))
    }

    /// The shard of this process. `parts` is the number of shards, if `--shard auto/N` sets it.
    fn shard(self, parts: Option<NonZeroU32>) -> Result<Shard> {
        let (index, count) = match (self, parts) {
            (Self::Slurm { count, .. }, Some(parts)) if count != parts => {
                return Err(usage_error(format_args!(
                    "the Slurm array has {count} tasks, not {parts}: name the shard itself, as --shard 2/{parts}"
                )));
            }
            (Self::Slurm { index, count }, _) | (Self::Kubernetes { index }, Some(count)) => {
                (index, count)
            }
            (Self::Kubernetes { .. }, None) => {
                return Err(usage_error(
                    "JOB_COMPLETION_INDEX is the index of this pod, but the number of pods is unknown: set it with --shard auto/N, or \
                     do everything in each pod with --shard none",
                ));
            }
        };
        Shard::new(index, count).ok_or_else(|| {
            usage_error(format_args!(
                "{self} is beyond the {count} parts: an index from 0 to {} expected",
                count.get() - 1
            ))
        })
    }
}

impl fmt::Display for BatchSystem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Slurm { index, count } => {
                write!(f, "task {} of a Slurm array of {count}", index + 1)
            }
            Self::Kubernetes { index } => {
                write!(f, "pod {index} of an indexed Kubernetes job")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn resolved(text: Option<&str>, variables: &[(&str, &str)]) -> Result<Shard> {
        Shard::resolve(text, |name| {
            let mut variables = variables.iter();
            let found = variables.find(|(known, _)| *known == name);
            found.map(|(_, value)| (*value).to_owned())
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
        for (text, variables, says) in [
            (Some("0/4"), &[][..], "a part expected, as 2/4"),
            (Some("5/4"), &[], "a part expected"),
            (Some("1"), &[], "a part expected"),
            (Some("auto"), &[], "auto is for a task"),
            (Some("auto/2"), &pod, "beyond the 2 parts"),
            (Some("auto/3"), &TASK, "has 4 tasks, not 3"),
            (None, &pod, "--shard auto/N"),
        ] {
            let error = resolved(text, variables).unwrap_err().to_string();
            assert!(error.contains(says), "{text:?}: {error}");
        }
    }

    #[test]
    fn every_position_is_in_one_shard_and_shares_sum_up() {
        let count = NonZeroU32::new(3).unwrap();
        let parts: Vec<Shard> = (0..3).map(|i| Shard::new(i, count).unwrap()).collect();
        for position in 0..20 {
            let shards = parts.iter().filter(|part| part.has(position));
            assert_eq!(shards.count(), 1);
        }
        let whole = NonZeroU32::new(500).unwrap();
        let shares = parts.iter().map(|part| part.share(whole).get());
        assert_eq!(shares.collect::<Vec<_>>(), [167, 167, 166]);
        assert_eq!(parts[2].share(NonZeroU32::MIN).get(), 1);
        assert_eq!(parts[1].folder(), "shard-2-of-3");
        let many = Shard::new(6, NonZeroU32::new(256).unwrap()).unwrap();
        assert_eq!(many.folder(), "shard-007-of-256");
    }
}
