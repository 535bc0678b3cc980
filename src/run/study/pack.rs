//! `study pack`: a page on which people answer what the models were asked.

use std::collections::{BTreeMap, BTreeSet};
use std::num::NonZeroUsize;
use std::path::PathBuf;

use clap::Args;

use crate::error::{Error, Result};
use crate::files::write;
use crate::job::Outcome;
use crate::job::progress::Progress;
use crate::job::rebuild::{ImageRebuilder, RebuildArgs};
use crate::job::stored::StoredRun;
use crate::report::study::{StudyImage, StudyQuestion, page};
use crate::types::Decides;
use crate::types::manifest::Status;
use crate::types::{Condition, Digest, FrameId, QuestionId, Record, RunQuestion};

/// The flags of `study pack`.
#[derive(Debug, Args)]
pub(crate) struct PackArgs {
    /// The folder of a run
    #[arg(value_name = "RUN", add = Decides::Nothing)]
    pub run: PathBuf,
    /// Where the page and its images go
    #[arg(long, value_name = "DIR", add = Decides::Nothing)]
    pub out: PathBuf,
    /// Ask about N questions, drawn by their names; default: all
    #[arg(long, value_name = "N", add = Decides::Trials)]
    pub items: Option<NonZeroUsize>,
    /// Only these conditions, as L3-noise+zerodce; repeatable; default: all of the run
    #[arg(long, value_name = "CONDITION", add = Decides::Nothing)]
    pub condition: Vec<Condition>,
    /// Where everything lies by now.
    #[command(flatten)]
    pub rebuild: RebuildArgs,
}

/// Makes the page and its images, each the very file that the models were sent.
///
/// # Errors
/// Where the run kept no questions, or its data or enhancers are not where they were.
pub(crate) fn pack(args: PackArgs, progress: &Progress) -> Result<Outcome> {
    let StoredRun {
        manifest,
        records,
        questions: listed,
        ..
    } = StoredRun::of_choices(&args.run, "openeqa --study DIR makes their page")?;
    let wrong = |problem: String| {
        let path = args.run.clone();
        Error::Run { path, problem }
    };
    let conditions = conditions(&records, &args.condition)?;
    if listed.is_empty() || conditions.is_empty() {
        return Err(wrong(
            "no questions about images are kept in this run".to_owned(),
        ));
    }
    let shown = first_order(&records);
    let chosen = chosen(listed, args.items.map_or(usize::MAX, usize::from));
    let mut frames = BTreeMap::<FrameId, Vec<RunQuestion>>::new();
    for question in chosen {
        frames
            .entry(question.frame.clone())
            .or_default()
            .push(question);
    }
    let sent = sent(&records);
    let mut rebuilder = ImageRebuilder::open(args.rebuild, &manifest, &args.run, &conditions)?;
    let bar = progress.bar("images", frames.len() * conditions.len());
    let (mut asked, mut images) = (Vec::new(), 0);
    for (number, (frame, questions)) in frames.into_iter().enumerate() {
        let mut shots = Vec::new();
        let rebuilt = rebuilder.images(&frame, &conditions)?;
        for (condition, made) in conditions.iter().zip(rebuilt.iter().flatten()) {
            if let Some(sent) = sent.get(&(frame.clone(), condition.clone()))
                && *sent != made.digest
            {
                let problem = format!(
                    "{frame} at {condition} is not the image that was sent: the data, an enhancement model or this program is another"
                );
                return Err(wrong(problem));
            }
            // The name says nothing of the level.
            let name = Digest::of_parts([frame.0.as_bytes(), condition.to_string().as_bytes()]);
            let name = format!("images/{}.{}", &name.to_string()[..16], made.ending);
            write(&args.out.join(&name), &made.file)?;
            shots.push(StudyImage {
                condition: condition.to_string(),
                images: vec![name],
            });
            images += 1;
            bar.inc();
        }
        asked.extend(questions.into_iter().map(|question| StudyQuestion {
            frame: number,
            choices: shown.get(&question.id).cloned().unwrap_or(question.choices),
            id: question.id.0,
            text: question.text,
            shots: shots.clone(),
        }));
    }
    drop(bar);
    let path = args.out.join("study.html");
    write(&path, page(&asked)?.as_bytes())?;
    Ok(Outcome {
        status: Status::Complete,
        output: format!(
            "{}: {} questions, {images} images, {} conditions; with {} people each image is seen by one of them\n",
            path.display(),
            asked.len(),
            conditions.len(),
            conditions.len()
        ),
    })
}

fn conditions(records: &[Record], wanted: &[Condition]) -> Result<Vec<Condition>> {
    let there: BTreeSet<Condition> = records
        .iter()
        .filter_map(|record| record.condition.clone())
        .collect();
    if let Some(missing) = wanted.iter().find(|condition| !there.contains(condition)) {
        let problem = format_args!("nothing was asked at {missing} in this run");
        return Err(Error::usage("--condition", problem));
    }
    if wanted.is_empty() {
        return Ok(there.into_iter().collect());
    }
    Ok(wanted.to_vec())
}

/// The choices of each question in the order that they were first shown in.
fn first_order(records: &[Record]) -> BTreeMap<QuestionId, Vec<String>> {
    let mut orders = BTreeMap::new();
    for record in records {
        orders
            .entry(record.question.clone())
            .or_insert_with(|| record.detail.choices.clone());
    }
    orders
}

/// So many questions, those with the lowest digests of their names.
fn chosen(mut listed: Vec<RunQuestion>, most: usize) -> Vec<RunQuestion> {
    listed.sort_by_cached_key(|question| *Digest::of(question.id.0.as_bytes()).as_bytes());
    listed.truncate(most);
    listed
}

/// The digests of the images that were sent.
fn sent(records: &[Record]) -> BTreeMap<(FrameId, Condition), Digest> {
    let sent = records.iter().filter_map(|record| {
        let place = (record.detail.frame.clone(), record.condition.clone()?);
        Some((place, record.detail.image.as_ref()?.digest))
    });
    sent.collect()
}
