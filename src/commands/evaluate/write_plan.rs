//! `plan`: writes the questions and frames of a run once, so that no shard makes them again ([`plan`]).
//!
//! The effect that a planned evaluation can detect: [`power_forecast`].

use std::collections::BTreeSet;

use super::settings::{EvaluateArgs, plan_identity};
use super::setup::ChoiceSetup;
use darkqa_base::error::{Error, Result};
use darkqa_base::files::FolderAccess;
use darkqa_base::types::degradations::Kind;
use darkqa_base::types::manifests::Status;
use darkqa_base::types::text::counted;
use darkqa_base::types::{Condition, Digest, Question, Variant};
use darkqa_data::Dataset;
use darkqa_engine::Job;
use darkqa_engine::costs::estimate::costs;
use darkqa_engine::experiment::Experiment as _;
use darkqa_engine::images::progress::Progress;
use darkqa_engine::images::trials::Plan;
use darkqa_runs::Outcome;
use darkqa_runs::forecast::PowerForecast;
use darkqa_runs::run_plan::{NewPlan, PlannedFrame, recorded_command};
use darkqa_score::cluster::{Clusters, FrameTies};
use darkqa_score::tested_sentences::RunContents;

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

/// The effect that these questions can detect, each with the digest of its frame if it is known; `None` without
/// questions, or if a true answer is unknown.
pub(super) fn power_forecast<'a>(
    dataset: &Dataset,
    questions: impl Iterator<Item = (&'a Question, Option<Digest>)> + Clone,
    contents: RunContents,
) -> Option<PowerForecast> {
    let mut ties = FrameTies::default();
    for (question, digest) in questions.clone() {
        question.choices.truth()?;
        let frame = &question.frame;
        ties.digests.extend(digest.map(|digest| (frame.clone(), digest)));
        let (scene, several) = (dataset.scene(frame), dataset.image_series(frame));
        if !scene.is_empty() {
            ties.scenes.insert(frame.clone(), scene);
        }
        if !several.is_empty() {
            ties.images.insert(frame.clone(), several.to_vec());
        }
    }
    let questions = questions.map(|(question, _)| question);
    let clusters = Clusters::new(questions.clone().map(|question| (&question.id, &question.frame)), &ties);
    let question_clusters: Vec<u32> =
        questions.filter_map(|question| clusters.get(&question.frame, &question.id)).collect();
    PowerForecast::new(&clusters, &question_clusters, contents)
}

/// The numbers of models, enhancers and lights of a run with these conditions.
pub(super) fn run_contents(conditions: &[Condition], models: usize) -> RunContents {
    let variants: BTreeSet<Variant> = conditions.iter().map(Condition::variant).collect();
    let last = variants.iter().filter_map(|variant| variant.kind).max();
    let lights = variants.iter().filter(|variant| variant.kind == last);
    let base = last.and_then(Kind::base);
    let enhancers: BTreeSet<_> = conditions.iter().filter_map(|condition| condition.enhancer.as_ref()).collect();
    RunContents {
        models: models.max(1),
        enhancers: enhancers.len(),
        lights: lights.count(),
        has_noise: base.is_some() && variants.iter().any(|variant| variant.kind == base),
    }
}
