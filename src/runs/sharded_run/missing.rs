//! Checks which trials the parts of a run lack, by its plan where there is one: [`check`], [`warn_unfinished`].

use super::coverage::Coverage;
use super::part::StoredPart;
use crate::error::{Error, Result};
use crate::runs::run_plan::RunPlan;
use crate::runs::shard::Shard;
use crate::types::manifests::Status;

/// Whether sources of a run may be in no part.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum MissingParts {
    /// It is an error.
    Refused,
    /// It is said, and the sources of the parts are those of the run.
    Accepted,
}

/// The plan beside the parts; `None` if there is none, or if it is not of these parts, which is said.
///
/// # Errors
/// If it cannot be read.
pub(super) fn plan(parts: &[StoredPart], coverage: &Coverage) -> Result<Option<RunPlan>> {
    let Some(run) = parts.first().and_then(|part| part.folder.parent()) else {
        return Ok(None);
    };
    let plan = RunPlan::read(run)?;
    let Some(other) = plan
        .as_ref()
        .filter(|plan| plan.frames() != coverage.sources())
    else {
        return Ok(plan);
    };
    tracing::warn!(
        "{}: the plan is about {} frames, and the parts are of a run about {}: it says nothing about them",
        run.display(),
        other.frames(),
        coverage.sources()
    );
    Ok(None)
}

/// Whether sources are in no part. Says which shards have them, and the command that asks them.
///
/// # Errors
/// If sources are in no part and that is refused.
pub(super) fn check(
    parts: &[StoredPart],
    coverage: &Coverage,
    plan: Option<&RunPlan>,
    missing: MissingParts,
) -> Result<bool> {
    let absent = coverage.absent(|shard| plan.map(|plan| plan.part(shard)));
    let (Some(problem), Some(first)) = (coverage.missing(&absent), parts.first()) else {
        return Ok(false);
    };
    let counts = plan.map_or_else(String::new, |plan| {
        format!(
            " ({} of {} frames, {} trials)",
            coverage.gaps().count(),
            coverage.sources(),
            plan.requests(coverage.gaps())
        )
    });
    let remedy = || remedy(parts, plan, &absent);
    match missing {
        MissingParts::Refused => Err(Error::Run {
            path: first.folder.clone(),
            problem: format!(
                "{problem}{counts}; --partial merges the others; {}",
                remedy()
            ),
        }),
        MissingParts::Accepted => {
            tracing::warn!(
                "{problem}{counts}; the summary covers only the others; {}",
                remedy()
            );
            Ok(true)
        }
    }
}

/// Warns about each part that is not complete, unless complete parts together have all that it was to ask.
pub(super) fn warn_unfinished(parts: &[StoredPart], plan: Option<&RunPlan>) {
    let is_complete = |part: &&StoredPart| part.manifest.status == Status::Complete;
    let complete: Vec<&StoredPart> = parts.iter().filter(is_complete).collect();
    let unfinished = parts.iter().filter(|part| !is_complete(part));
    for part in unfinished.filter(|part| !part.is_covered_by(&complete)) {
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

/// The command that asks what these shards lack. What a part beside them has, it asks not again.
fn remedy(parts: &[StoredPart], plan: Option<&RunPlan>, shards: &[Shard]) -> String {
    let models = parts
        .iter()
        .filter_map(|part| part.manifest.columns.get("model"));
    let models = models.flat_map(|models| models.keys().map(String::as_str));
    let command = plan.and_then(|plan| plan.command(models));
    let command = command.unwrap_or_else(|| "the command of the parts with".to_owned());
    match shards {
        [] => format!(
            "{command} --shard I/N, for all I of one N, asks only what no other part in the same folder has"
        ),
        [only] => format!("{command} --shard {only} asks what is left"),
        [first, ..] => {
            let numbers: Vec<String> = shards
                .iter()
                .map(|shard| (shard.index() + 1).to_string())
                .collect();
            format!(
                "{command} --shard I/{} asks them, with I = {}",
                first.count(),
                numbers.join(", ")
            )
        }
    }
}
