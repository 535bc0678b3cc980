//! The batch system that started this process: [`BatchSystem`].
//!
//! The task of a Slurm array that this process may belong to: [`ArrayTask`], and the numbers of its array:
//! [`TaskRange`].
//!
//! Asks Slurm whether a job is a task of an array: [`ask_scontrol`].

use std::io::Read as _;
use std::num::NonZeroU32;
use std::process::{Command, Stdio};
use std::str::FromStr;
use std::sync::mpsc;
use std::time::Duration;
use std::{fmt, thread};

use darkqa_base::error::{Error, Result};

/// The batch system that started this process, with the place of the process in it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BatchSystem {
    /// A task of a job array.
    Slurm(ArrayTask),
    /// A pod of an indexed job: its index, from 0. No variable has the number of pods.
    Kubernetes { index: u32 },
}

impl BatchSystem {
    /// Reads the environment variables of the batch systems; `None` outside a batch system.
    ///
    /// # Errors
    /// If a variable is not a number.
    pub fn from_environment(variable: &impl Fn(&str) -> Option<String>) -> Result<Option<Self>> {
        if let Some(task) = ArrayTask::from_environment(variable)? {
            return Ok(Some(Self::Slurm(task)));
        }
        let index = read_number(variable, "JOB_COMPLETION_INDEX")?;
        Ok(index.map(|index| Self::Kubernetes { index }))
    }
}

/// Evenly spaced numbers of the tasks of an array, as in `sbatch --array=0-6:2`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct TaskRange {
    first: u32,
    last: u32,
    step: NonZeroU32,
}

impl TaskRange {
    /// Number of the numbers.
    pub(super) fn count(self) -> u32 {
        (self.last.saturating_sub(self.first) / self.step).saturating_add(1)
    }

    /// Index of a number, from 0; `None` if the range does not have it.
    pub(super) fn index(self, number: u32) -> Option<u32> {
        let distance = number.checked_sub(self.first)?;
        (number <= self.last && distance % self.step == 0).then_some(distance / self.step)
    }
}

impl fmt::Display for TaskRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}-{}", self.first, self.last)?;
        match self.step.get() {
            1 => Ok(()),
            step => write!(f, ":{step}"),
        }
    }
}

impl FromStr for TaskRange {
    type Err = ();

    fn from_str(text: &str) -> Result<Self, ()> {
        let (range, step) = text.split_once(':').unwrap_or((text, "1"));
        let (first, last) = range.split_once('-').ok_or(())?;
        Ok(Self {
            first: first.parse().map_err(|_| ())?,
            last: last.parse().map_err(|_| ())?,
            step: step.parse().map_err(|_| ())?,
        })
    }
}

/// A task of a Slurm array, as the environment describes it. A job that a task submits inherits the variables of the
/// task: see [`membership`](Self::membership).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ArrayTask {
    /// Number of the task.
    pub(super) number: u32,
    /// Lowest and highest number of the submitted array. Slurm states step 1 for a list such as `0,1,3`.
    pub(super) range: TaskRange,
    /// Number of tasks of the submitted array.
    pub(super) count: NonZeroU32,
    /// The job of this process; `None` outside of a job.
    job: Option<u32>,
    /// The job of the array.
    array_job: Option<u32>,
}

impl ArrayTask {
    /// Reads Slurm's environment variables; `None` without `SLURM_ARRAY_TASK_ID`.
    ///
    /// # Errors
    /// If a variable is not a number.
    pub(super) fn from_environment(variable: &impl Fn(&str) -> Option<String>) -> Result<Option<Self>> {
        let Some(number) = read_number(variable, "SLURM_ARRAY_TASK_ID")? else {
            return Ok(None);
        };
        let read = |name| read_number(variable, name);
        let count = read("SLURM_ARRAY_TASK_COUNT")?.and_then(NonZeroU32::new).unwrap_or(NonZeroU32::MIN);
        let step = read("SLURM_ARRAY_TASK_STEP")?.and_then(NonZeroU32::new).unwrap_or(NonZeroU32::MIN);
        let first = read("SLURM_ARRAY_TASK_MIN")?.unwrap_or(number);
        // Old versions of Slurm do not state the highest number.
        let last = read("SLURM_ARRAY_TASK_MAX")?
            .unwrap_or_else(|| first.saturating_add(step.get().saturating_mul(count.get().saturating_sub(1))));
        Ok(Some(Self {
            number,
            range: TaskRange { first, last, step },
            count,
            job: read("SLURM_JOB_ID").ok().flatten(),
            array_job: read("SLURM_ARRAY_JOB_ID").ok().flatten(),
        }))
    }

    /// True if the array has no other task.
    pub(super) fn is_alone(self) -> bool {
        self.count.get() == 1
    }

    /// True if the numbers of the array are a list with gaps, so that no variable has the position of this task.
    pub(super) fn has_gaps(self) -> bool {
        self.range.count() != self.count.get()
    }

    /// True if this array repeats tasks of an earlier one: it has a single task or gaps, or does not begin with the
    /// same number. An array that begins with the same number is a new division of the run.
    pub(super) fn repeats(self, earlier: TaskRange) -> bool {
        let is_within =
            [self.number, self.range.first, self.range.last].into_iter().all(|number| earlier.index(number).is_some());
        let is_new_division =
            !self.is_alone() && (self.range == earlier || !self.has_gaps() && self.range.first == earlier.first);
        is_within && !is_new_division
    }

    /// Whether this process belongs to the task. The job of a task has the number of the array only in its last task,
    /// so that `scontrol` is asked about other jobs.
    pub(super) fn membership(self) -> Membership {
        match self.job {
            Some(job) if self.array_job != Some(job) => ask_scontrol(job),
            _ => Membership::Task,
        }
    }
}

/// The number in an environment variable; `None` if it is not set.
///
/// # Errors
/// If the variable is not a number.
pub(super) fn read_number(variable: &impl Fn(&str) -> Option<String>, name: &str) -> Result<Option<u32>> {
    variable(name)
        .map(|text| text.trim().parse().map_err(|_| Error::usage(name, format_args!("{text:?} is not a number"))))
        .transpose()
}

/// Maximum time for an answer of `scontrol` (chosen). A busy controller may answer late; `scontrol` itself waits 10 s
/// and more.
const TIME_LIMIT: Duration = Duration::from_secs(5);

/// Whether a job is a task of an array.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Membership {
    /// It is a task.
    Task,
    /// It is a plain job of this number: the variables of an array are inherited.
    PlainJob(u32),
    /// Slurm did not say it, for this reason.
    Unknown(String),
}

/// Asks `scontrol` whether a job is a task of an array, for at most [`TIME_LIMIT`].
fn ask_scontrol(job: u32) -> Membership {
    let unknown = |problem: String| Membership::Unknown(format!("scontrol {problem}"));
    let child = Command::new("scontrol")
        .args(["--oneliner", "show", "job", &job.to_string()])
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn();
    let mut child = match child {
        Ok(child) => child,
        Err(e) => return unknown(format!("cannot be started: {e}")),
    };
    let stdout = child.stdout.take();
    let (sender, receiver) = mpsc::channel();
    // The thread ends with the output. It is not joined, because a child of scontrol may keep the output open.
    thread::spawn(move || {
        let mut text = String::new();
        let read = stdout.map(|mut out| out.read_to_string(&mut text));
        let _ = sender.send(read.is_some_and(|read| read.is_ok()).then_some(text));
    });
    let answer = receiver.recv_timeout(TIME_LIMIT);
    // After its output has ended, the program has nothing more to do.
    let _ = child.kill();
    let _ = child.wait();
    match answer {
        Ok(text) => {
            parse(&text.unwrap_or_default(), job).unwrap_or_else(|| unknown(format!("does not know job {job}")))
        }
        Err(_) => unknown(format!("did not answer within {} s", TIME_LIMIT.as_secs())),
    }
}

/// Parses the answer of `scontrol`: `JobId=107 ArrayJobId=100 ArrayTaskId=2 JobName=…` for a task, `JobId=108
/// JobName=…` for a plain job. `None` if it does not describe this job. The fields after the name of the job may have
/// any text.
fn parse(answer: &str, job: u32) -> Option<Membership> {
    let own = format!("JobId={job}");
    let mut fields = answer
        .lines()
        .map(str::split_whitespace)
        .find_map(|mut fields| (fields.next() == Some(&*own)).then_some(fields))?;
    let is_task = fields
        .by_ref()
        .take_while(|field| !field.starts_with("JobName="))
        .any(|field| field.starts_with("ArrayJobId="));
    Some(if is_task { Membership::Task } else { Membership::PlainJob(job) })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn range(text: &str) -> TaskRange {
        text.parse().unwrap()
    }

    /// A task as Slurm 22.05.8 describes it.
    fn task(number: u32, count: u32, numbers: &str) -> ArrayTask {
        ArrayTask { number, range: range(numbers), count: NonZeroU32::new(count).unwrap(), job: None, array_job: None }
    }

    #[test]
    fn ranges_are_written_as_for_sbatch() {
        for text in ["0-3", "0-6:2", "7-7"] {
            assert_eq!(range(text).to_string(), text);
        }
        for wrong in ["", "3", "0-x", "0-4:0"] {
            assert!(wrong.parse::<TaskRange>().is_err(), "{wrong}");
        }
        let even = range("2-8:2");
        assert_eq!(even.count(), 4);
        assert_eq!([1, 2, 3, 8, 10].map(|number| even.index(number)), [None, Some(0), None, Some(3), None]);
    }

    #[test]
    fn lists_with_gaps_are_recognised() {
        // --array=1,3 and --array=0,1,3 state step 1.
        assert!(task(3, 2, "1-3").has_gaps() && task(1, 3, "0-3").has_gaps());
        assert!(!task(1, 4, "0-3").has_gaps() && !task(2, 1, "2-2").has_gaps());
    }

    #[test]
    fn repeated_tasks_differ_from_new_divisions() {
        let earlier = range("0-3");
        for repeated in [task(2, 1, "2-2"), task(0, 1, "0-0"), task(3, 2, "1-3"), task(2, 2, "2-3")] {
            assert!(repeated.repeats(earlier), "{repeated:?}");
        }
        for other in [
            // The whole array again, and other divisions.
            task(2, 4, "0-3"),
            task(1, 2, "0-1"),
            task(1, 8, "0-7"),
            // Not tasks of the earlier array.
            task(4, 1, "4-4"),
            task(3, 4, "1-4"),
        ] {
            assert!(!other.repeats(earlier), "{other:?}");
        }
        assert!(!task(3, 1, "3-3").repeats(range("0-6:2")));
    }

    #[test]
    fn answers_of_scontrol_are_parsed() {
        for (answer, expected) in [
            ("JobId=107 ArrayJobId=100 ArrayTaskId=2 JobName=job.sh UserId=root(0)", Some(Membership::Task)),
            // The throttle of an array, and the form without --oneliner.
            (
                "JobId=107 ArrayJobId=100 ArrayTaskId=2 ArrayTaskThrottle=1 JobName=a\n   Comment=b",
                Some(Membership::Task),
            ),
            ("JobId=107 JobName=job.sh UserId=root(0)", Some(Membership::PlainJob(107))),
            // The name of a job is free text.
            ("JobId=107 JobName=x ArrayJobId=100", Some(Membership::PlainJob(107))),
            // Another job, and no answer.
            ("JobId=1070 ArrayJobId=100 ArrayTaskId=2 JobName=a", None),
            ("", None),
        ] {
            assert_eq!(parse(answer, 107), expected, "{answer}");
        }
    }
}
