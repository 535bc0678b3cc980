//! The shard that a process does, by `--shard` and by the batch system: [`ResolvedShard`].
//!
//! The `--shard` flag of commands that work on files: [`ShardArgs`], [`shard_from_flag`], [`keep_shard`].

use std::num::NonZeroU32;
use std::path::Path;

use clap::Args;

use super::batch_system::{ArrayTask, Membership, TaskRange};
use super::shard::{Division, divisions_in};
use super::shard_records::{WeightedSource, shard_range};
use crate::batch_system::BatchSystem;
use crate::shard::{Shard, number, usage_error};
use darkqa_base::error::{Error, Result};
use darkqa_base::types::Decides;
use darkqa_base::types::text::counted;

/// The shard that a process does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ResolvedShard {
    pub shard: Shard,
    /// The array whose tasks do the shards; `None` for shards that the user names.
    pub tasks: Option<TaskRange>,
}

/// The number of shards that `--shard` states.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Wanted {
    /// There is no flag.
    Nothing,
    /// `auto`.
    Auto,
    /// `auto/N`.
    AutoOf(NonZeroU32),
}

impl Wanted {
    fn count(self) -> Option<NonZeroU32> {
        match self {
            Self::AutoOf(count) => Some(count),
            Self::Nothing | Self::Auto => None,
        }
    }
}

impl From<Shard> for ResolvedShard {
    fn from(shard: Shard) -> Self {
        Self { shard, tasks: None }
    }
}

impl ResolvedShard {
    /// The shard given by `--shard` (`2/4`, `auto/4`, `auto`, `none`), or, without the flag, by the batch system.
    /// `folder` has the parts of the run: tasks of a Slurm array that are repeated do the same parts again.
    ///
    /// # Errors
    /// If there is no such shard, or the batch system does not determine it.
    pub fn resolve(
        flag: Option<&str>,
        variable: impl Fn(&str) -> Option<String>,
        folder: Option<&Path>,
    ) -> Result<Self> {
        let wanted = match (flag, flag.and_then(|text| text.split_once('/'))) {
            (None, _) => Wanted::Nothing,
            (Some("none"), _) => return Ok(Self::from(Shard::WHOLE)),
            (Some("auto"), _) => Wanted::Auto,
            (Some(text), Some(("auto", count))) => Wanted::AutoOf(number(count, text)?),
            (Some(text), _) => return Ok(Self::from(text.parse::<Shard>()?)),
        };
        match BatchSystem::from_environment(&variable)? {
            Some(BatchSystem::Slurm(task)) => Self::of_task(task, wanted, folder),
            Some(BatchSystem::Kubernetes { index }) => of_pod(index, wanted).map(Self::from),
            None if wanted == Wanted::Nothing => Ok(Self::from(Shard::WHOLE)),
            None => Err(usage_error(NO_SYSTEM)),
        }
    }

    /// The shard of a task of a Slurm array.
    fn of_task(task: ArrayTask, wanted: Wanted, folder: Option<&Path>) -> Result<Self> {
        let divisions = folder.map(divisions_in).unwrap_or_default();
        if task.is_alone() && divisions.is_empty() && wanted.count().is_none() {
            tracing::warn!(
                "SLURM_ARRAY_TASK_COUNT is 1: the only task of a Slurm array does everything; --shard I/N does one part"
            );
            return Ok(Self::from(Shard::WHOLE));
        }
        let doubt = match task.membership() {
            Membership::Task => None,
            Membership::Unknown(reason) => Some(reason),
            Membership::PlainJob(job) if wanted == Wanted::Nothing => {
                tracing::warn!(
                    "scontrol: job {job} is no task of a Slurm array, only submitted by one (SLURM_ARRAY_TASK_ID is inherited): this process \
                     does everything; --shard I/N does one part"
                );
                return Ok(Self::from(Shard::WHOLE));
            }
            Membership::PlainJob(job) => {
                return Err(usage_error(format_args!(
                    "auto is for a task of a Slurm array, and scontrol says that job {job} is none (SLURM_ARRAY_TASK_ID is inherited from the \
                     task that submitted it): name the part, as --shard 2/4, or do everything with --shard none"
                )));
            }
        };
        let found = task_shard(task, wanted.count(), folder, &divisions)?;
        let (shard, tasks) = found;
        let is_repeated = tasks != task.range;
        let what = if is_repeated {
            format!("task {} of the Slurm array {tasks} again", task.number)
        } else {
            format!("task {} of a Slurm array of {}", shard.index() + 1, shard.count())
        };
        let doubt = doubt.map_or_else(String::new, |reason| {
            format!(
                ". {reason}, so that it is not known whether this job is the task or was submitted by it (then --shard none is right)"
            )
        });
        if wanted == Wanted::Nothing || is_repeated || !doubt.is_empty() {
            tracing::warn!("{what}: this process does shard {shard}; --shard none does everything{doubt}");
        }
        Ok(Self { shard, tasks: Some(tasks) })
    }
}

/// The shard of a task, and the array whose tasks do the shards.
///
/// # Errors
/// If the array does not determine the shard.
fn task_shard(
    task: ArrayTask,
    count: Option<NonZeroU32>,
    folder: Option<&Path>,
    divisions: &[Division],
) -> Result<(Shard, TaskRange)> {
    let repeated: Vec<(Shard, TaskRange)> = divisions
        .iter()
        .filter(|division| count.is_none_or(|count| count == division.count))
        .filter_map(|division| division.shard_of(task))
        .collect();
    if let [found] = repeated[..] {
        return Ok(found);
    }
    let is_division = !task.is_alone() && !task.has_gaps() && repeated.is_empty();
    if !is_division {
        return Err(unknown_part(task, count, folder, divisions));
    }
    if let Some(count) = count.filter(|count| *count != task.count) {
        return Err(usage_error(format_args!(
            "the Slurm array has {} tasks, not {count}: name the shard itself, as --shard 2/{count}",
            task.count
        )));
    }
    let index = task.range.index(task.number);
    index.and_then(|index| Shard::new(index, task.count)).map(|shard| (shard, task.range)).ok_or_else(|| {
        usage_error(format_args!(
            "SLURM_ARRAY_TASK_ID={} is none of the tasks {} of the array",
            task.number, task.range
        ))
    })
}

/// The error for a task of an array that does not determine its shard. It names the shards that the task may mean.
fn unknown_part(task: ArrayTask, count: Option<NonZeroU32>, folder: Option<&Path>, divisions: &[Division]) -> Error {
    let number = task.number;
    let why = if task.is_alone() {
        format!("task {number} is the only one of its Slurm array (SLURM_ARRAY_TASK_COUNT=1)")
    } else {
        format!("the Slurm array has only {} tasks of {}", task.count, task.range)
    };
    let counts: Vec<NonZeroU32> = match count {
        Some(count) => vec![count],
        None => divisions.iter().map(|division| division.count).collect(),
    };
    let parts: Vec<String> = counts
        .iter()
        .flat_map(|count| {
            // Arrays are usually numbered from 0 or from 1.
            [0, 1].into_iter().filter_map(move |first| {
                let shard = Shard::new(number.checked_sub(first)?, *count)?;
                let last = count.get() - 1 + first;
                Some(format!("--shard {shard} for task {number} of {first}-{last}"))
            })
        })
        .collect();
    if parts.is_empty() {
        return usage_error(format_args!(
            "{why}, and no variable has the place of a task in such an array: number the tasks without gaps, as --array=0-{}, or name the \
             part of each with --shard I/N, or do everything in each with --shard none",
            task.count.get() - 1
        ));
    }
    let where_parts = match folder.filter(|_| count.is_none()) {
        Some(folder) => format!(", and {} has the parts of a run", folder.display()),
        None => String::new(),
    };
    usage_error(format_args!(
        "{why}{where_parts}: name the part, {}, or do everything in another --out with --shard none",
        parts.join(", ")
    ))
}

/// The shard of a pod of an indexed job.
///
/// # Errors
/// If the number of pods is unknown, or not above the index.
fn of_pod(index: u32, wanted: Wanted) -> Result<Shard> {
    let Some(count) = wanted.count() else {
        return Err(usage_error(
            "JOB_COMPLETION_INDEX is the index of this pod, but the number of pods is unknown: set it with --shard auto/N, or do \
             everything in each pod with --shard none",
        ));
    };
    Shard::new(index, count).ok_or_else(|| {
        usage_error(format_args!(
            "pod {index} of an indexed Kubernetes job is beyond the {count} parts: an index from 0 to {} expected",
            count.get() - 1
        ))
    })
}

const NO_SYSTEM: &str = "auto is for a task of a Slurm array (SLURM_ARRAY_TASK_ID) or a pod of an indexed Kubernetes job \
                         (JOB_COMPLETION_INDEX), and this is neither";

/// The `--shard` flag.
#[derive(Debug, Clone, Default, Args)]
pub struct ShardArgs {
    /// Process only this shard of the frames, as 2/4, or auto/4 for the task of a Slurm array or the pod of an indexed
    /// Kubernetes job. All shards together write what one call does; default: all frames
    #[arg(long, value_name = "I/N|auto/N|auto", help_heading = "Scale", add = Decides::Trials)]
    pub shard: Option<String>,
}

impl ShardArgs {
    /// The shard in the flag.
    ///
    /// # Errors
    /// As for [`shard_from_flag`].
    pub fn resolve(&self) -> Result<Shard> {
        shard_from_flag(self.shard.as_deref())
    }
}

/// The shard in a flag; everything without the flag. A batch system alone does not select a shard, because each task of
/// its array may run another model.
///
/// # Errors
/// If there is no such shard, or the variables of the batch system do not determine it.
pub fn shard_from_flag(flag: Option<&str>) -> Result<Shard> {
    let flag = flag.unwrap_or("none");
    ResolvedShard::resolve(Some(flag), |name| std::env::var(name).ok(), None).map(|resolved| resolved.shard)
}

/// Keeps the frames of a shard. All frames cost the same.
///
/// # Errors
/// If the shard is empty.
pub fn keep_shard<T>(frames: &mut Vec<T>, shard: Shard) -> Result<()> {
    if !shard.is_part() {
        return Ok(());
    }
    let own = shard_range(&vec![WeightedSource::equal(); frames.len()], shard);
    if own.is_empty() {
        let problem = format!("{shard} is empty: only {}; use at most as many parts", counted(frames.len(), "frame"));
        return Err(Error::usage("--shard", problem));
    }
    frames.truncate(own.end);
    frames.drain(..own.start);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn resolved(text: Option<&str>, variables: &[(&str, &str)]) -> Result<Shard> {
        let variable =
            |name: &str| variables.iter().find(|(known, _)| *known == name).map(|(_, value)| (*value).to_owned());
        ResolvedShard::resolve(text, variable, None).map(|resolved| resolved.shard)
    }

    const TASK: [(&str, &str); 4] = [
        ("SLURM_ARRAY_TASK_ID", "5"),
        ("SLURM_ARRAY_TASK_MIN", "1"),
        ("SLURM_ARRAY_TASK_STEP", "2"),
        ("SLURM_ARRAY_TASK_COUNT", "4"),
    ];

    /// Task 1 of `--array=0,1,3`.
    const WITH_GAPS: [(&str, &str); 4] = [
        ("SLURM_ARRAY_TASK_ID", "1"),
        ("SLURM_ARRAY_TASK_MIN", "0"),
        ("SLURM_ARRAY_TASK_MAX", "3"),
        ("SLURM_ARRAY_TASK_COUNT", "3"),
    ];

    const ALONE: [(&str, &str); 1] = [("SLURM_ARRAY_TASK_ID", "2")];

    const POD: [(&str, &str); 1] = [("JOB_COMPLETION_INDEX", "2")];

    #[test]
    fn shards_are_read_from_the_flag_and_the_batch_system() {
        for (text, variables, expected) in [
            (None, &[][..], "1/1"),
            (Some("2/4"), &[], "2/4"),
            (Some("4/4"), &TASK, "4/4"),
            (Some("none"), &TASK, "1/1"),
            (None, &TASK, "3/4"),
            (Some("auto"), &TASK, "3/4"),
            (Some("auto/4"), &TASK, "3/4"),
            (Some("auto/8"), &POD, "3/8"),
            (Some("none"), &POD, "1/1"),
            // An array of one task does everything.
            (None, &ALONE, "1/1"),
            (Some("auto"), &ALONE, "1/1"),
            (Some("2/3"), &WITH_GAPS, "2/3"),
        ] {
            let shard = resolved(text, variables).unwrap();
            assert_eq!(shard.to_string(), expected, "{text:?}");
        }
    }

    #[test]
    fn unknown_shards_are_refused() {
        for (text, variables, message) in [
            (Some("0/4"), &[][..], "a part expected, as 2/4"),
            (Some("5/4"), &[], "a part expected"),
            (Some("1"), &[], "a part expected"),
            (Some("auto"), &[], "auto is for a task"),
            (Some("auto/2"), &POD, "beyond the 2 parts"),
            (Some("auto/3"), &TASK, "has 4 tasks, not 3"),
            (None, &POD, "--shard auto/N"),
            (None, &WITH_GAPS, "without gaps, as --array=0-2"),
            (Some("auto/4"), &ALONE, "--shard 3/4 for task 2 of 0-3, --shard 2/4 for task 2 of 1-4"),
        ] {
            let error = resolved(text, variables).unwrap_err().to_string();
            assert!(error.contains(message), "{text:?}: {error}");
        }
    }

    fn part(text: &str) -> Result<String> {
        let mut letters: Vec<char> = "abcdefg".chars().collect();
        let kept = keep_shard(&mut letters, text.parse().unwrap());
        kept.map(|()| letters.into_iter().collect::<String>())
    }

    #[test]
    fn parts_are_together_everything_in_order() {
        let parts = ["1/3", "2/3", "3/3"].map(|text| part(text).unwrap());
        assert_eq!(parts.concat(), "abcdefg");
        assert!(parts.iter().all(|part| (2..=3).contains(&part.len())));
        assert_eq!(part("1/1").unwrap(), "abcdefg");
        let error = part("8/8").unwrap_err().to_string();
        assert!(error.contains("8/8 is empty: only 7 frames"), "{error}");
    }
}
