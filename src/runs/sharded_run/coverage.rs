//! Coverage of a run's sources by shards: [`Coverage`].
//!
//! Checks whether the shards of a run are complete, using its plan if it has one: [`check`], [`warn_unfinished`].
//!
//! One shard of a run: [`StoredShard`].

use std::collections::BTreeSet;
use std::fmt::Write;
use std::num::NonZeroU32;
use std::ops::Range;
use std::path::{Path, PathBuf};

use crate::run_plan::RunPlan;
use crate::shard::Shard;
use crate::stored::read_run_manifest;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::manifests::{RunManifest, RunPart, Status};
use darkqa_base::types::text::counted;

/// The sources (frames or walks) of a run that are in some shard. The shards may come from several divisions.
pub(super) struct Coverage {
    /// Number of trials about each source; `None` if the source is in no shard.
    trials: Vec<Option<usize>>,
    /// Number of trials that an earlier command asked, and that the last command of their shard did not plan.
    unplanned: usize,
    shards: Vec<Shard>,
    /// True if a source is in several shards.
    overlaps: bool,
}

impl Coverage {
    /// The coverage by these shards, each with its folder and manifest.
    ///
    /// # Errors
    /// If the manifest of a shard has no sources, or the runs have different numbers of sources.
    pub(super) fn from_shards<'a>(shards: impl Iterator<Item = (Shard, &'a Path, &'a RunManifest)>) -> Result<Self> {
        let mut coverage = Self { trials: Vec::new(), unplanned: 0, shards: Vec::new(), overlaps: false };
        for (shard, folder, manifest) in shards {
            let Some(part) = &manifest.part else {
                let problem = "the part does not say which frames it has: an earlier version made it; run it again";
                return Err(Error::Run { path: folder.to_owned(), problem: problem.to_owned() });
            };
            let place = part.place;
            if coverage.shards.is_empty() {
                coverage.trials.resize(place.of, None);
            } else if coverage.trials.len() != place.of {
                return Err(Error::Run {
                    path: folder.to_owned(),
                    problem: format!(
                        "shard {shard} is of a run about {} frames or walks, the others of one about {}",
                        place.of,
                        coverage.trials.len()
                    ),
                });
            }
            let own = coverage.trials.iter_mut().skip(place.first);
            for (known, trials) in own.zip(&part.trials) {
                coverage.overlaps |= known.is_some();
                *known = (*known).max(Some(*trials));
            }
            let planned: usize = part.trials.iter().sum();
            coverage.unplanned += manifest.counts.trials.saturating_sub(planned);
            coverage.shards.push(shard);
        }
        Ok(coverage)
    }

    /// Number of trials about all sources in the shards.
    pub(super) fn trials(&self) -> usize {
        self.unplanned + self.trials.iter().flatten().sum::<usize>()
    }

    /// Number of sources of the run.
    pub(super) fn sources(&self) -> usize {
        self.trials.len()
    }

    /// Indices of the sources that are in no shard.
    pub(super) fn gaps(&self) -> impl Iterator<Item = usize> {
        self.trials.iter().enumerate().filter_map(|(place, trials)| trials.is_none().then_some(place))
    }

    /// The shards that have the missing sources; if there are several divisions, those of the division with the fewest
    /// such shards. `range` returns the indices of the sources of a shard, or `None` if they are unknown. Without them,
    /// the missing shards are known only if all shards are from one division.
    pub(super) fn absent(&self, range: impl Fn(Shard) -> Option<Range<usize>>) -> Vec<Shard> {
        let counts: BTreeSet<NonZeroU32> = self.shards.iter().map(|shard| shard.count()).collect();
        counts
            .iter()
            .map(|count| {
                Shard::all(*count)
                    .filter(|shard| match range(*shard) {
                        None => counts.len() == 1 && !self.shards.contains(shard),
                        Some(mut places) => places.any(|place| self.trials.get(place) == Some(&None)),
                    })
                    .collect::<Vec<Shard>>()
            })
            .filter(|absent| !absent.is_empty())
            .min_by_key(Vec::len)
            .unwrap_or_default()
    }

    /// The sentence about the missing sources; `None` if none is missing. `absent` are the shards that have them, if
    /// known.
    pub(super) fn missing(&self, absent: &[Shard]) -> Option<String> {
        if self.trials.iter().all(Option::is_some) {
            return None;
        }
        if !absent.is_empty() {
            let verb = if absent.len() == 1 { " is" } else { "s are" };
            let names: Vec<String> = absent.iter().map(Shard::to_string).collect();
            return Some(format!("{} shard{verb} missing: {}", absent.len(), names.join(", ")));
        }
        let mut gaps = String::new();
        let mut start = 0;
        for run in self.trials.chunk_by(|one, next| one.is_some() == next.is_some()) {
            if run[0].is_none() {
                let comma = if gaps.is_empty() { "" } else { ", " };
                let _ = match run.len() {
                    1 => write!(gaps, "{comma}{}", start + 1),
                    length => write!(gaps, "{comma}{} to {}", start + 1, start + length),
                };
            }
            start += run.len();
        }
        Some(format!("frames or walks {gaps} of {} are in no part", self.trials.len()))
    }

    /// For each shard, true if notes about its sources are counted. If all shards of one division exist, only these are
    /// counted, each once; otherwise all shards are.
    pub(super) fn counted_once(&self) -> impl Iterator<Item = bool> {
        let counts: BTreeSet<NonZeroU32> = self.shards.iter().map(|shard| shard.count()).collect();
        let is_whole = |count: &NonZeroU32| Shard::all(*count).all(|shard| self.shards.contains(&shard));
        let whole = counts.into_iter().rev().find(is_whole);
        if whole.is_none() && self.overlaps {
            tracing::warn!(
                "the parts overlap: what was done to images when they were read is counted once for each part"
            );
        }
        let mut seen = BTreeSet::new();
        self.shards.iter().map(move |shard| match whole {
            Some(count) => shard.count() == count && seen.insert(*shard),
            None => true,
        })
    }
}

/// Treatment of sources of a run that are in no shard.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MissingShards {
    /// Return an error.
    Refuse,
    /// Print a warning, and leave these sources out.
    Accept,
}

/// Reads the plan in the parent folder of the shards. Returns `None` if there is none, or, with a warning, if its
/// number of sources differs from that of the run.
///
/// # Errors
/// If the plan cannot be read.
pub(super) fn plan(parts: &[StoredShard], coverage: &Coverage) -> Result<Option<RunPlan>> {
    let Some(run) = parts.first().and_then(|part| part.folder.parent()) else {
        return Ok(None);
    };
    let plan = RunPlan::read(run)?;
    let Some(other) = plan.as_ref().filter(|plan| plan.frame_count() != coverage.sources()) else {
        return Ok(plan);
    };
    tracing::warn!(
        "{}: the plan is about {} frames, and the parts are of a run about {}: it says nothing about them",
        run.display(),
        other.frame_count(),
        coverage.sources()
    );
    Ok(None)
}

/// Returns true if sources are in no shard, with a warning that names the missing shards and the command to run.
///
/// # Errors
/// If sources are in no shard and `missing` is [`MissingShards::Refuse`].
pub(super) fn check(
    parts: &[StoredShard],
    coverage: &Coverage,
    plan: Option<&RunPlan>,
    missing: MissingShards,
) -> Result<bool> {
    let absent = coverage.absent(|shard| plan.map(|plan| plan.shard_range(shard)));
    let (Some(problem), Some(first)) = (coverage.missing(&absent), parts.first()) else {
        return Ok(false);
    };
    let counts = plan.map_or_else(String::new, |plan| {
        format!(
            " ({} of {} frames, {})",
            coverage.gaps().count(),
            coverage.sources(),
            counted(plan.request_count(coverage.gaps()), "trial")
        )
    });
    match missing {
        MissingShards::Refuse => Err(Error::Run {
            path: first.folder.clone(),
            problem: format!("{problem}{counts}; --partial merges the others; {}", remedy(parts, plan, &absent)),
        }),
        MissingShards::Accept => {
            tracing::warn!("{problem}{counts}; the summary covers only the others; {}", remedy(parts, plan, &absent));
            Ok(true)
        }
    }
}

/// Warns about each shard that is not complete, unless complete shards together have all its trials.
pub(super) fn warn_unfinished(parts: &[StoredShard], plan: Option<&RunPlan>) {
    let (complete, unfinished) =
        parts.iter().partition::<Vec<&StoredShard>, _>(|part| part.manifest.status == Status::Complete);
    for part in unfinished.into_iter().filter(|part| !part.is_covered_by(&complete)) {
        let counts = part.manifest.counts;
        tracing::warn!(
            "{}: shard {} is {}: {} of {} trials answered; {}",
            part.folder.display(),
            part.shard,
            part.manifest.status,
            counts.answered,
            counts.trials,
            remedy(parts, plan, &[part.shard])
        );
    }
}

/// The advice to run the command that asks the missing trials of these shards.
fn remedy(parts: &[StoredShard], plan: Option<&RunPlan>, shards: &[Shard]) -> String {
    let models = parts
        .iter()
        .filter_map(|part| part.manifest.columns.get("model"))
        .flat_map(|models| models.keys().map(String::as_str));
    let command =
        plan.and_then(|plan| plan.command(models)).unwrap_or_else(|| "the command of the parts with".to_owned());
    match shards {
        [] => format!("{command} --shard I/N, for all I of one N, asks only what no other part in the same folder has"),
        [only] => format!("{command} --shard {only} asks what is left"),
        [first, ..] => {
            let numbers: Vec<String> = shards.iter().map(|shard| (shard.index() + 1).to_string()).collect();
            format!("{command} --shard I/{} asks them, with I = {}", first.count(), numbers.join(", "))
        }
    }
}

/// A shard as read from its folder.
pub(super) struct StoredShard {
    pub(super) shard: Shard,
    pub(super) folder: PathBuf,
    pub(super) manifest: RunManifest,
}

impl StoredShard {
    /// Reads the shard in a folder.
    ///
    /// # Errors
    /// If the folder has no shard, or a file in it cannot be read.
    pub(super) fn open(folder: &Path) -> Result<Self> {
        let manifest = read_run_manifest(folder)?;
        let Some(shard) = manifest.shard.as_deref() else {
            return Err(Error::Run {
                path: folder.to_owned(),
                problem: "the run is not a shard: it was made without --shard".to_owned(),
            });
        };
        Ok(Self { shard: shard.parse()?, folder: folder.to_owned(), manifest })
    }

    /// True if every source of this shard is in another one with at least as many trials, and the other has all models,
    /// enhancers and other column values of this one.
    pub(super) fn is_covered_by(&self, others: &[&Self]) -> bool {
        let Some(own) = &self.manifest.part else {
            return false;
        };
        let candidates: Vec<&RunPart> = others
            .iter()
            .filter(|other| self.has_columns_in(other))
            .filter_map(|other| other.manifest.part.as_ref())
            .collect();
        own.trials.iter().zip(own.place.first..).all(|(trials, source)| {
            candidates.iter().any(|part| {
                source
                    .checked_sub(part.place.first)
                    .and_then(|place| part.trials.get(place))
                    .is_some_and(|other| other >= trials)
            })
        })
    }

    /// True if another shard has every column value of this one.
    fn has_columns_in(&self, other: &Self) -> bool {
        self.manifest.columns.iter().all(|(column, values)| {
            let known = other.manifest.columns.get(column);
            values.keys().all(|value| known.is_some_and(|known| known.contains_key(value)))
        })
    }
}

/// The error for a command without a shard.
pub(super) fn no_shard_error() -> Error {
    Error::usage("RUN", "no shard is named")
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    /// Coverage by shards, each with the index of its first source and the number of trials about each source.
    fn coverage(parts: &[(&str, usize, &[usize])]) -> Coverage {
        let parts: Vec<(Shard, RunManifest)> = parts.iter().map(|(shard, first, trials)| {
            let total: usize = trials.iter().sum();
            let manifest = json!({
                "schema": "", "status": "complete", "version": "", "created": "", "updated": "", "platform": {}, "identity": {},
                "settings": {}, "counts": {"trials": total, "answered": total, "failed": 0},
                "part": {"first": first, "count": trials.len(), "of": 6, "trials": trials},
            });
            let manifest: RunManifest = serde_json::from_value(manifest).unwrap();
            (shard.parse().unwrap(), manifest)
        }).collect();
        let parts = parts.iter();
        Coverage::from_shards(parts.map(|(shard, manifest)| (*shard, Path::new("run"), manifest))).unwrap()
    }

    #[test]
    fn missing_sources_are_named() {
        let whole = coverage(&[("1/2", 0, &[4, 4, 4]), ("2/2", 3, &[4, 4, 2])]);
        assert_eq!((whole.missing(&[]), whole.trials()), (None, 22));
        let one = coverage(&[("1/3", 0, &[4, 4])]);
        let sentence = one.missing(&one.absent(|_| None)).unwrap();
        assert_eq!(sentence, "2 shards are missing: 2/3, 3/3");
        // The end of one division and the beginning of another.
        let mixed = coverage(&[("1/3", 0, &[4, 4]), ("5/6", 4, &[4])]);
        assert_eq!(mixed.absent(|_| None), []);
        let sentence = mixed.missing(&[]).unwrap();
        assert!(sentence.starts_with("frames or walks 3 to 4, 6 of 6 are in no part"), "{sentence}");
        assert_eq!(mixed.trials(), 12);
        assert_eq!(mixed.gaps().collect::<Vec<_>>(), [2, 3, 5]);
        // If the sources of each shard are known, the division with the fewest missing shards is chosen.
        let absent: Vec<String> = mixed
            .absent(|shard| {
                let each = 6 / shard.count().get() as usize;
                let first = shard.index() as usize * each;
                Some(first..first + each)
            })
            .iter()
            .map(Shard::to_string)
            .collect();
        assert_eq!(absent, ["2/3", "3/3"]);
    }

    #[test]
    fn sources_in_several_shards_count_once() {
        let parts = [
            ("1/2", 0, &[4, 4, 4][..]),
            ("2/2", 3, &[4, 4, 2]),
            // A shard that was stopped before all its marks were planned.
            ("1/3", 0, &[3, 4]),
        ];
        let overlapping = coverage(&parts);
        assert_eq!((overlapping.missing(&[]), overlapping.trials()), (None, 22));
        let counted: Vec<bool> = overlapping.counted_once().collect();
        assert_eq!(counted, [true, true, false]);
        let together = coverage(&[("1/2", 0, &[4, 4, 4]), ("2/3", 2, &[5, 4]), ("3/3", 4, &[4, 2])]);
        assert_eq!((together.missing(&[]), together.trials()), (None, 23));
        assert!(together.counted_once().all(|is_counted| is_counted));
    }
}
