//! `study pack`: writes a page on which people answer the questions of a run.

use std::collections::{BTreeMap, BTreeSet};
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use clap::Args;

use crate::engine::image_rebuilder::{ImageRebuilder, RebuildArgs};
use crate::engine::images::progress::Progress;
use crate::error::{Error, Result};
use crate::files::write;
use crate::pictures::Payload;
use crate::report::study::{StudyImage, StudyQuestion, page};
use crate::runs::Outcome;
use crate::runs::stored::StoredRun;
use crate::types::manifests::Status;
use crate::types::text::{counted, plural};
use crate::types::{ChoiceDetail, Condition, Decides, Digest, FrameId, QuestionId, RunQuestion, Trials};

/// The flags of `study pack`.
#[derive(Debug, Args)]
pub(crate) struct PackArgs {
    /// The folder of a run
    #[arg(value_name = "RUN", add = Decides::Nothing)]
    pub run: PathBuf,
    /// Where the page and its images go
    #[arg(long, value_name = "DIR", add = Decides::Nothing)]
    pub out: PathBuf,
    /// Ask only N questions, chosen by a hash of their ids; default: all
    #[arg(long, value_name = "N", add = Decides::Trials)]
    pub items: Option<NonZeroUsize>,
    /// Only these conditions, as L3-noise+zerodce; repeatable; default: all of the run
    #[arg(long, value_name = "CONDITION", add = Decides::Nothing)]
    pub condition: Vec<Condition>,
    /// Where the data and enhancers are now.
    #[command(flatten)]
    pub rebuild: RebuildArgs,
}

/// Writes the page and its images. Each image has the same bytes as the one sent to the models.
///
/// # Errors
/// If the run has no questions about images, its data or enhancers are missing, or an image differs from the one sent.
pub(crate) fn pack(args: PackArgs, progress: &Progress) -> Result<Outcome> {
    let StoredRun { manifest, trials, questions, .. } =
        StoredRun::open_choices(&args.run, "openeqa --study DIR makes their page")?
            .with_truths("what people answer is scored by them")?;
    let conditions = conditions(&trials, &args.condition)?;
    if questions.is_empty() || conditions.is_empty() {
        return Err(run_error(&args.run, "this run has no questions about images".to_owned()));
    }
    let first_orders = first_orders(&trials);
    let mut frames = BTreeMap::<FrameId, Vec<RunQuestion>>::new();
    for question in choose_questions(questions, args.items.map_or(usize::MAX, usize::from)) {
        frames.entry(question.frame.clone()).or_default().push(question);
    }
    let sent = sent_digests(&trials);
    let mut rebuilder = ImageRebuilder::open(args.rebuild, &manifest, &args.run, &conditions)?;
    let bar = progress.bar("images", frames.len() * conditions.len());
    let (mut asked, mut images) = (Vec::new(), 0);
    for (number, (frame, questions)) in frames.into_iter().enumerate() {
        let mut shots = Vec::new();
        let rebuilt = rebuilder.images(&frame, &conditions)?;
        for (condition, payloads) in conditions.iter().zip(&rebuilt) {
            let now = Payload::joint_digest(payloads);
            if let Some(sent) = sent.get(&(frame.clone(), condition.clone()))
                && now.is_some_and(|now| now != *sent)
            {
                let problem = format!(
                    "{frame} at {condition} is not the image that was sent: the data, an enhancement model or this program has changed"
                );
                return Err(run_error(&args.run, problem));
            }
            // The name does not reveal the level.
            let name = Digest::from_parts([frame.0.as_bytes(), condition.to_string().as_bytes()]);
            let stem = format!("images/{}", &name.to_string()[..16]);
            let names = payloads.iter().enumerate().map(|(place, image)| {
                let place = match payloads.len() {
                    1 => String::new(),
                    _ => format!("-{}", place + 1),
                };
                let name = format!("{stem}{place}.{}", image.extension());
                write(&args.out.join(&name), image.file())?;
                Ok(name)
            });
            shots.push(StudyImage { condition: condition.to_string(), images: names.collect::<Result<_>>()? });
            images += payloads.len();
            bar.inc();
        }
        asked.extend(questions.into_iter().map(|question| StudyQuestion {
            frame: number,
            choices: first_orders.get(&question.id).cloned().unwrap_or(question.choices),
            id: question.id.0,
            text: question.text,
            shots: shots.clone(),
        }));
    }
    drop(bar);
    let path = args.out.join("study.html");
    write(&path, page(&asked)?.as_bytes())?;
    Ok(Outcome::wrote(
        &path,
        Status::Complete,
        format!(
            "{}: {}, {}, {}; with {} each image is seen by one of them\n",
            path.display(),
            counted(asked.len(), "question"),
            counted(images, "image"),
            counted(conditions.len(), "condition"),
            plural(conditions.len(), "person", "people")
        ),
    ))
}

fn run_error(run: &Path, problem: String) -> Error {
    let path = run.to_owned();
    Error::Run { path, problem }
}

/// The conditions of the run with images, limited to the `wanted` ones if there are any.
fn conditions(trials: &Trials<ChoiceDetail>, wanted: &[Condition]) -> Result<Vec<Condition>> {
    let asked: BTreeSet<Condition> =
        trials.asked().into_iter().flatten().filter_map(|(_, condition)| condition.cloned()).collect();
    if let Some(missing) = wanted.iter().find(|condition| !asked.contains(condition)) {
        let problem = format_args!("nothing was asked at {missing} in this run");
        return Err(Error::usage("--condition", problem));
    }
    if wanted.is_empty() {
        return Ok(asked.into_iter().collect());
    }
    Ok(wanted.to_vec())
}

/// The choices of each question, in the first order in which they were shown.
fn first_orders(trials: &Trials<ChoiceDetail>) -> BTreeMap<QuestionId, Vec<String>> {
    let mut orders = BTreeMap::new();
    for trial in trials.iter() {
        orders.entry(trial.question().clone()).or_insert_with(|| trial.choices().to_vec());
    }
    orders
}

/// Chooses the `count` questions whose ids have the lowest digests.
fn choose_questions(mut questions: Vec<RunQuestion>, count: usize) -> Vec<RunQuestion> {
    questions.sort_by_cached_key(|question| *Digest::from_bytes(question.id.0.as_bytes()).as_bytes());
    questions.truncate(count);
    questions
}

/// The digest of the images sent, by frame and condition.
fn sent_digests(trials: &Trials<ChoiceDetail>) -> BTreeMap<(FrameId, Condition), Digest> {
    trials
        .iter()
        .filter_map(|trial| {
            let place = (trial.sent_frame().clone(), trial.condition()?.clone());
            Some((place, trial.sent_digest()?))
        })
        .collect()
}
