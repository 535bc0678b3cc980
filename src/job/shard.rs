//! Which part of a job a process does: [`Shard`], and the questions of it: `part`.

use std::collections::HashMap;
use std::fmt;
use std::num::NonZeroU32;
use std::str::FromStr;

use crate::ask::Quota;
use crate::error::{Error, Result};

/// One of several parts of an evaluation, by frames: those whose place among all, counted from 0, leaves `index` when divided by
/// `of`. A frame is in one part with all its conditions and questions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Shard {
    /// Which, from 0.
    index: u32,
    /// Of how many.
    of: NonZeroU32,
}

impl Shard {
    /// All of it.
    pub(crate) const WHOLE: Self = Self {
        index: 0,
        of: NonZeroU32::MIN,
    };

    /// Whether there are others.
    #[must_use]
    pub(crate) fn is_part(self) -> bool {
        self.of.get() > 1
    }

    /// How many there are.
    #[must_use]
    pub(crate) fn of(self) -> NonZeroU32 {
        self.of
    }

    /// Each of so many.
    pub(crate) fn all(of: NonZeroU32) -> impl Iterator<Item = Self> {
        (0..of.get()).map(move |index| Self { index, of })
    }

    /// Whether the frame at a place is in it.
    #[must_use]
    pub(crate) fn has(self, place: usize) -> bool {
        place as u64 % u64::from(self.of.get()) == u64::from(self.index)
    }

    /// Its share of a number that all parts have together: the shares sum to it, but that none is 0.
    #[must_use]
    pub(crate) fn share(self, whole: NonZeroU32) -> NonZeroU32 {
        let (of, whole) = (self.of.get(), whole.get());
        let share = whole / of + u32::from(self.index < whole % of);
        NonZeroU32::new(share).unwrap_or(NonZeroU32::MIN)
    }

    /// Its share of a sum of money.
    #[must_use]
    pub(crate) fn part_of(self, sum: f64) -> f64 {
        sum / f64::from(self.of.get())
    }

    /// The name of its folder among those of the other parts.
    #[must_use]
    pub(crate) fn folder(self) -> String {
        let digits = self.of.to_string().len();
        format!("shard-{:0digits$}-of-{}", self.index + 1, self.of)
    }

    /// Its share of what may be sent in a minute.
    pub(super) fn quota(self, whole: Quota) -> Quota {
        Quota {
            requests: whole.requests.map(|requests| self.share(requests)),
            tokens: whole.tokens.map(|tokens| self.share(tokens)),
        }
    }

    /// What `--shard` says, or the batch system if nothing is said: `2/4`, `auto/4`, `auto`, `none`.
    ///
    /// # Errors
    /// If it is no such part, or the batch system does not say enough.
    pub(super) fn resolve(
        said: Option<&str>,
        variable: impl Fn(&str) -> Option<String>,
    ) -> Result<Self> {
        let system = BatchSystem::of(&variable)?;
        match (said, system) {
            (Some("none"), _) | (None, None) => Ok(Self::WHOLE),
            (Some("auto"), system) => {
                let system = system.ok_or_else(|| wrong(NO_SYSTEM))?;
                system.shard(None)
            }
            (Some(text), system) => match text.split_once('/') {
                Some(("auto", of)) => {
                    let system = system.ok_or_else(|| wrong(NO_SYSTEM))?;
                    system.shard(Some(number(of, text)?))
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

    fn new(index: u32, of: NonZeroU32) -> Option<Self> {
        (index < of.get()).then_some(Self { index, of })
    }
}

impl FromStr for Shard {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let (index, of) = text.split_once('/').ok_or_else(|| none_of_them(text))?;
        let (index, of) = (number(index, text)?, number(of, text)?);
        Self::new(index.get() - 1, of).ok_or_else(|| none_of_them(text))
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index + 1, self.of)
    }
}

/// The questions about the sources of a shard, which are dealt out one by one in the order in which they are first asked about;
/// `source` names that of a question.
///
/// # Errors
/// If none is left.
pub(crate) fn part<Q>(
    questions: Vec<Q>,
    shard: Shard,
    source: impl Fn(&Q) -> String,
) -> Result<Vec<Q>> {
    if !shard.is_part() {
        return Ok(questions);
    }
    let mut places = HashMap::<String, usize>::new();
    for question in &questions {
        let next = places.len();
        places.entry(source(question)).or_insert(next);
    }
    let own = questions.into_iter();
    let own = own.filter(|question| shard.has(places[&source(question)]));
    let own: Vec<Q> = own.collect();
    if own.is_empty() {
        let problem = format!(
            "{shard} is empty: there are {} frames or walks; as many parts at most expected",
            places.len()
        );
        return Err(Error::usage("--shard", problem));
    }
    Ok(own)
}

const NO_SYSTEM: &str = "auto is for a task of a Slurm array (SLURM_ARRAY_TASK_ID) or a pod of an indexed Kubernetes job \
                         (JOB_COMPLETION_INDEX), and this is neither";

fn wrong(problem: impl fmt::Display) -> Error {
    Error::usage("--shard", problem)
}

fn none_of_them(text: &str) -> Error {
    wrong(format_args!(
        "{text:?}; a part expected, as 2/4, or auto, auto/4, none"
    ))
}

fn number(text: &str, whole: &str) -> Result<NonZeroU32> {
    text.trim().parse().map_err(|_| none_of_them(whole))
}

/// What a batch system says of a process.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum BatchSystem {
    /// A task of a job array.
    Slurm { index: u32, of: NonZeroU32 },
    /// A pod of an indexed job, which is not told how many there are.
    Kubernetes { index: u32 },
}

impl BatchSystem {
    fn of(variable: &impl Fn(&str) -> Option<String>) -> Result<Option<Self>> {
        let value = |name: &str| -> Result<Option<u32>> {
            let parse = |text: String| {
                text.trim()
                    .parse()
                    .map_err(|_| Error::usage(name, format_args!("{text:?} is no number")))
            };
            variable(name).map(parse).transpose()
        };
        if let Some(id) = value("SLURM_ARRAY_TASK_ID")? {
            let first = value("SLURM_ARRAY_TASK_MIN")?.unwrap_or(id);
            let step = value("SLURM_ARRAY_TASK_STEP")?.unwrap_or(1).max(1);
            let of = value("SLURM_ARRAY_TASK_COUNT")?.unwrap_or(1);
            return Ok(Some(Self::Slurm {
                index: id.saturating_sub(first) / step,
                of: NonZeroU32::new(of).unwrap_or(NonZeroU32::MIN),
            }));
        }
        let index = value("JOB_COMPLETION_INDEX")?;
        Ok(index.map(|index| Self::Kubernetes { index }))
    }

    /// Its shard of so many, where that is said.
    fn shard(self, said: Option<NonZeroU32>) -> Result<Shard> {
        let (index, of) = match (self, said) {
            (Self::Slurm { of, .. }, Some(said)) if of != said => {
                return Err(wrong(format_args!(
                    "the Slurm array has {of} tasks, not {said}: name the part itself, as --shard 2/{said}"
                )));
            }
            (Self::Slurm { index, of }, _) | (Self::Kubernetes { index }, Some(of)) => (index, of),
            (Self::Kubernetes { .. }, None) => {
                return Err(wrong(
                    "JOB_COMPLETION_INDEX says that this is a pod of an indexed job, and not of how many: --shard auto/N does, and \
                     --shard none does everything in each",
                ));
            }
        };
        Shard::new(index, of).ok_or_else(|| {
            wrong(format_args!(
                "{self} is beyond the {of} parts: {} from 0 on expected",
                of.get()
            ))
        })
    }
}

impl fmt::Display for BatchSystem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Slurm { index, of } => write!(f, "task {} of a Slurm array of {of}", index + 1),
            Self::Kubernetes { index } => {
                write!(f, "pod {index} of an indexed Kubernetes job")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(text: Option<&str>, variables: &[(&str, &str)]) -> Result<Shard> {
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
    fn parts_are_read_from_the_flag_and_the_batch_system() {
        let pod = [("JOB_COMPLETION_INDEX", "2")];
        for (text, variables, due) in [
            (None, &[][..], "1/1"),
            (Some("2/4"), &[], "2/4"),
            (Some("4/4"), &TASK, "4/4"),
            (Some("none"), &TASK, "1/1"),
            (None, &TASK, "3/4"),
            (Some("auto"), &TASK, "3/4"),
            (Some("auto/4"), &TASK, "3/4"),
            (Some("auto/8"), &pod, "3/8"),
            (Some("none"), &pod, "1/1"),
            // An array of one task does all of it.
            (None, &[("SLURM_ARRAY_TASK_ID", "7")], "1/1"),
        ] {
            assert_eq!(said(text, variables).unwrap().to_string(), due, "{text:?}");
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
            let error = said(text, variables).unwrap_err().to_string();
            assert!(error.contains(says), "{text:?}: {error}");
        }
    }

    #[test]
    fn every_place_is_in_one_part_and_shares_sum_up() {
        let of = NonZeroU32::new(3).unwrap();
        let parts: Vec<Shard> = (0..3).map(|i| Shard::new(i, of).unwrap()).collect();
        for place in 0..20 {
            assert_eq!(parts.iter().filter(|part| part.has(place)).count(), 1);
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
