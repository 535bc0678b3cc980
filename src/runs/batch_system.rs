//! The batch system that started this process: [`BatchSystem`].

use std::fmt;
use std::num::NonZeroU32;

use crate::error::{Error, Result};

/// The batch system that started this process, with the place of the process in it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum BatchSystem {
    /// A task of a job array: its index, from 0, and the number of tasks.
    Slurm { index: u32, count: NonZeroU32 },
    /// A pod of an indexed job: its index, from 0. No variable has the number of pods.
    Kubernetes { index: u32 },
}

impl BatchSystem {
    /// Reads the environment variables of the batch systems; `None` outside a batch system.
    ///
    /// # Errors
    /// If a variable is not a number.
    pub(crate) fn from_environment(
        variable: &impl Fn(&str) -> Option<String>,
    ) -> Result<Option<Self>> {
        if let Some(id) = number(variable, "SLURM_ARRAY_TASK_ID")? {
            let first = number(variable, "SLURM_ARRAY_TASK_MIN")?.unwrap_or(id);
            let step = number(variable, "SLURM_ARRAY_TASK_STEP")?
                .unwrap_or(1)
                .max(1);
            let count = number(variable, "SLURM_ARRAY_TASK_COUNT")?.unwrap_or(1);
            return Ok(Some(Self::Slurm {
                index: id.saturating_sub(first) / step,
                count: NonZeroU32::new(count).unwrap_or(NonZeroU32::MIN),
            }));
        }
        let index = number(variable, "JOB_COMPLETION_INDEX")?;
        Ok(index.map(|index| Self::Kubernetes { index }))
    }

    /// The index of this process, from 0, and the number of processes. `shard_count` is the number in `--shard auto/N`.
    ///
    /// # Errors
    /// If the numbers contradict each other, or the number of processes is unknown.
    pub(crate) fn index_and_count(
        self,
        shard_count: Option<NonZeroU32>,
    ) -> Result<(u32, NonZeroU32)> {
        let (index, count) = match (self, shard_count) {
            (Self::Slurm { count, .. }, Some(shard_count)) if count != shard_count => {
                return Err(Error::usage(
                    "--shard",
                    format_args!(
                        "the Slurm array has {count} tasks, not {shard_count}: name the shard itself, as --shard 2/{shard_count}"
                    ),
                ));
            }
            (Self::Slurm { index, count }, _) | (Self::Kubernetes { index }, Some(count)) => {
                (index, count)
            }
            (Self::Kubernetes { .. }, None) => {
                return Err(Error::usage(
                    "--shard",
                    "JOB_COMPLETION_INDEX is the index of this pod, but the number of pods is unknown: set it with --shard auto/N, or do \
                     everything in each pod with --shard none",
                ));
            }
        };
        if index >= count.get() {
            return Err(Error::usage(
                "--shard",
                format_args!(
                    "{self} is beyond the {count} parts: an index from 0 to {} expected",
                    count.get() - 1
                ),
            ));
        }
        Ok((index, count))
    }
}

fn number(variable: &impl Fn(&str) -> Option<String>, name: &str) -> Result<Option<u32>> {
    variable(name)
        .map(|text| {
            text.trim()
                .parse()
                .map_err(|_| Error::usage(name, format_args!("{text:?} is not a number")))
        })
        .transpose()
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
