//! Checks whether the shards of a run are complete, using its plan if it has one: [`check`], [`warn_unfinished`].

use super::coverage::Coverage;
use super::stored_shard::StoredShard;
use crate::error::{Error, Result};
use crate::runs::run_plan::RunPlan;
use crate::runs::shard::Shard;
use crate::types::manifests::Status;
use crate::types::text::counted;

/// Treatment of sources of a run that are in no shard.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum MissingShards {
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
