//! `plan`: writes the questions and frames of a run once, so that no shard makes them again ([`plan`]).

use super::plan_identity::plan_identity;
use super::settings::EvaluateArgs;
use super::setup::ChoiceSetup;
use crate::engine::Job;
use crate::engine::costs::plan_costs::costs;
use crate::engine::experiment::Experiment as _;
use crate::engine::images::progress::Progress;
use crate::engine::images::trials::Plan;
use crate::error::{Error, Result};
use crate::files::folder_access::FolderAccess;
use crate::runs::Outcome;
use crate::runs::run_plan::{NewPlan, PlannedFrame, recorded_command};
use crate::types::manifests::Status;
use crate::types::text::counted;

/// Writes the plan of a run into its folder. Nothing is asked.
///
/// # Errors
/// If no folder is named, the data cannot be read, or the run has parts of another plan.
pub(crate) fn plan(mut args: EvaluateArgs, progress: &Progress) -> Result<Outcome> {
    let Some(run) = args.job.output.out.clone() else {
        let problem =
            "the folder of the run that the plan is for is missing; the evaluation takes the plan from the same --out";
        return Err(Error::usage("--out", problem));
    };
    args.job.scale.shard = Some("none".to_owned());
    args.job.money.dry_run = true;
    let is_shared = args.job.output.shared;
    let command = recorded_command(&args.job.words);
    let mut config = args.resolve()?;
    // A new plan is made from the data, not from an existing plan.
    config.plan = None;
    let (setup, files) = ChoiceSetup::open(&config, progress)?;
    setup.print_column_mapping(progress);
    let trials = setup.plan(0, || Ok(Vec::new()))?;
    let costs = costs(&setup, &trials);
    let frames = setup.sources.iter().zip(costs).zip(0..);
    let new = NewPlan {
        identity: plan_identity(&config, &setup.dataset)?,
        questions: setup.questions(),
        frames: frames
            .map(|((source, cost), place)| {
                let size = source.middle().map(|frame| frame.size);
                let image = (size, source.digest());
                PlannedFrame::new(place, &source.name, image, &setup.dataset, cost)
            })
            .collect(),
        models: setup.columns().remove("model").into_iter().flatten().map(|(name, _)| name).collect(),
        command,
        trials: Plan::new(trials).keys.len(),
    };
    let (questions, count) = (new.questions.len(), new.frames.len());
    let forecast = Job::new(&setup, files, progress)?.forecast()?;
    FolderAccess::new(is_shared).create(&run)?;
    let folder = new.write(&run, &forecast)?;
    let output = format!(
        "{}: {} about {}, {}\n",
        folder.display(),
        counted(questions, "question"),
        counted(count, "frame"),
        counted(forecast.trials, "trial")
    );
    Ok(Outcome::wrote(folder, Status::Complete, output))
}
