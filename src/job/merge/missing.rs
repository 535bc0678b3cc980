//! What the parts of a run lack, by its plan where there is one: [`check`], [`warn_unfinished`].

use super::coverage::Coverage;
use super::part::MergePart;
use crate::error::{Error, Result};
use crate::job::run_plan::RunPlan;
use crate::job::shard::Shard;
use crate::types::manifest::Status;

/// The plan beside the parts; `None` if there is none, or if it is not of these parts, which is said.
///
/// # Errors
/// If it cannot be read.
pub(super) fn plan(parts: &[MergePart], coverage: &Coverage) -> Result<Option<RunPlan>> {
    let Some(run) = parts.first().and_then(|part| part.folder.parent()) else {
        return Ok(None);
    };
    let plan = RunPlan::of(run)?;
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

/// Whether sources are missing; an error that names them if a partial merge is not allowed.
///
/// # Errors
/// If sources are missing and `partial` is not set; says which shards have them, and the command that asks them.
pub(super) fn check(
    parts: &[MergePart],
    coverage: &Coverage,
    plan: Option<&RunPlan>,
    partial: bool,
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
    if !partial {
        let remedy = remedy(parts, plan, &absent);
        return Err(Error::Run {
            path: first.folder.clone(),
            problem: format!("{problem}{counts}; --partial merges the others; {remedy}"),
        });
    }
    tracing::warn!("{problem}{counts}; the summary covers only the others");
    Ok(true)
}

/// Warns about each shard that is not complete.
pub(super) fn warn_unfinished(parts: &[MergePart], plan: Option<&RunPlan>) {
    for part in parts {
        let (status, counts) = (part.manifest.status, part.manifest.counts);
        if status != Status::Complete {
            tracing::warn!(
                "{}: shard {} is {status}: {} of {} trials answered; {}",
                part.folder.display(),
                part.shard,
                counts.answered,
                counts.trials,
                remedy(parts, plan, &[part.shard])
            );
        }
    }
}

/// The command that asks what these shards lack. What a part beside them has, it asks not again.
fn remedy(parts: &[MergePart], plan: Option<&RunPlan>, shards: &[Shard]) -> String {
    let models = parts
        .iter()
        .filter_map(|part| part.manifest.columns.get("model"));
    let models = models.flat_map(|models| models.keys().map(String::as_str));
    let command = plan.and_then(|plan| plan.command(models));
    let command = command.unwrap_or_else(|| "the command of the parts with".to_owned());
    match shards {
        [] => format!(
            "{command} --shard I/N, for all I of one N, asks only what no part beside it has"
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
