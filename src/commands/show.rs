//! `show`: rebuilds the images of one question and compares their digests with those of the images sent.
//!
//! A question of a run with the replies to it, as text: [`ShownItem`].
//!
//! The flags of `show`: [`ShowArgs`].
//!
//! `show --sheet`: draws the images of one item at all levels, and the curves of its run, as one picture: [`sheet`].

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::Args;

use darkqa_base::error::{Error, Result};
use darkqa_base::files::write;
use darkqa_base::types::degradations::Kind;
use darkqa_base::types::manifests::{RunManifest, Status};
use darkqa_base::types::questions::letter;
use darkqa_base::types::{
    AxisLevel, Condition, Decides, Digest, FrameId, OpenDetail, Record, Rgb, RunQuestion, TrialOutcome, Variant,
};
use darkqa_data::inputs::stem;
use darkqa_data::ready_made::is_zip_file;
use darkqa_engine::image_rebuilder::{ImageRebuilder, RebuildArgs};
use darkqa_engine::images::notes::montage;
use darkqa_pictures::{Payload, PayloadFormat};
use darkqa_report::charts::figures::StoryCurves;
use darkqa_report::charts::sheet::{Story, StoryCell, StoryMark, StoryRow, story};
use darkqa_report::joined::story_curves;
use darkqa_report::text::words;
use darkqa_runs::Outcome;
use darkqa_runs::sharded_run::{open_any_run, open_choice_run};
use darkqa_runs::stored::AnyRun;
use darkqa_score::model_in_condition::is_control;

/// Rebuilds and writes the images of a question, and reports for each whether it equals the image sent. With `--sheet`,
/// draws them in one picture instead.
///
/// # Errors
/// If the run, the question, its data or an enhancer is missing, or an image cannot be written.
pub(crate) fn show(args: ShowArgs) -> Result<Outcome> {
    if let Some(path) = &args.sheet {
        return sheet(&args, path);
    }
    let folder = args.run.clone();
    let name = args.question_id();
    let (manifest, item) = read(open_any_run(&folder)?, name)?;
    let Some(item) = item else {
        let problem = format!("no question {name:?} in this run; report.html and questions.jsonl have their ids");
        return Err(Error::Run { path: folder, problem });
    };
    let conditions = conditions(&item.answers, &args)?;
    let target = match &args.out {
        Some(out) => ImageFolder { trusted: out.clone(), out: out.clone() },
        None if is_zip_file(&folder) => {
            return Err(Error::usage("--out", "missing: the run is a ZIP file, so name a folder for the images"));
        }
        None => ImageFolder { trusted: folder.clone(), out: folder.join("shown") },
    };
    let mut rebuilder = ImageRebuilder::open(args.rebuild, &manifest, &folder, &conditions)?;
    let mut text = item.text.clone();
    let mut all_equal = true;
    for source in shown_frames(&item) {
        let answers: Vec<&ShownAnswer> = item.answers.iter().filter(|answer| answer.shown == source).collect();
        let conditions: Vec<Condition> = conditions
            .iter()
            .filter(|condition| answers.iter().any(|answer| answer.condition.as_ref() == Some(*condition)))
            .cloned()
            .collect();
        if source != item.source && !conditions.is_empty() {
            let _ = writeln!(text, "with the image of {source}:");
        }
        let images = rebuilder.images(&source, &conditions)?;
        for (condition, images) in conditions.iter().zip(images) {
            text += &write_images(&target, &source, condition, &images)?;
            let Some(digest) = Payload::joint_digest(&images) else {
                continue;
            };
            let sent = sent_digests(&answers, condition);
            let comparison = if sent.is_empty() {
                format!("the digest of what was sent is not stored; {digest} now")
            } else if sent.iter().all(|sent| *sent == digest) {
                format!("the same bytes as were sent ({digest})")
            } else {
                all_equal = false;
                format!("NOT the bytes that were sent: {digest} now")
            };
            let _ = writeln!(text, "{condition}: {comparison}");
            text += &reply_lines(&answers, Some(condition));
        }
    }
    let answers: Vec<&ShownAnswer> = item.answers.iter().collect();
    text += &reply_lines(&answers, None);
    if !all_equal {
        text += "the data, an enhancement model or this program has changed since the run\n";
    }
    Ok(Outcome::text(Outcome::complete_if(all_equal), text))
}

/// Output folder of the images.
struct ImageFolder {
    /// Folder named by the user: the run or `--out`. It may be a symbolic link.
    trusted: PathBuf,
    /// Folder of the images: `trusted` or a folder in it.
    out: PathBuf,
}

impl ImageFolder {
    /// Path of an image. Frame names can contain folders, and a run may come from a stranger.
    ///
    /// # Errors
    /// If a folder below the trusted one is a symbolic link, because a link may lead anywhere.
    fn path(&self, name: &str) -> Result<PathBuf> {
        let path = self.out.join(name);
        let link =
            path.ancestors().skip(1).take_while(|folder| *folder != self.trusted).find(|folder| folder.is_symlink());
        if let Some(link) = link {
            let problem =
                "a link; the images would be written to where it leads. Delete the link, or name another --out";
            return Err(Error::data(link.display(), problem));
        }
        Ok(path)
    }
}

/// Frames shown with the question: its own first, then those shown in controls of the observer.
fn shown_frames(item: &ShownItem) -> Vec<FrameId> {
    let others: BTreeSet<&FrameId> =
        item.answers.iter().filter(|answer| answer.condition.is_some()).map(|answer| &answer.shown).collect();
    let others = others.into_iter().filter(|shown| **shown != item.source);
    std::iter::once(&item.source).chain(others).cloned().collect()
}

/// Writes the images of a frame in a condition. Returns their paths, one per line.
fn write_images(
    target: &ImageFolder,
    source: &FrameId,
    condition: &Condition,
    images: &[Arc<Payload>],
) -> Result<String> {
    let mut text = String::new();
    for (index, image) in images.iter().enumerate() {
        let suffix = if images.len() > 1 { format!("_{index:03}") } else { String::new() };
        let name = format!("{}_{condition}{suffix}.{}", stem(source)?, image.extension());
        let path = target.path(&name)?;
        write(&path, image.file())?;
        let _ = writeln!(text, "{condition}: {}", path.display());
    }
    Ok(text)
}

/// Conditions of the question, limited to those of `--condition`.
///
/// # Errors
/// If the question was only asked without images, or not in a condition of `--condition`.
fn conditions(answers: &[ShownAnswer], args: &ShowArgs) -> Result<Vec<Condition>> {
    let wanted = &args.condition;
    let asked: BTreeSet<Condition> = answers.iter().filter_map(|answer| answer.condition.clone()).collect();
    if asked.is_empty() {
        let problem = "the item was only asked without images, so there is nothing to show".to_owned();
        let path = args.run.clone();
        return Err(Error::Run { path, problem });
    }
    if wanted.is_empty() {
        return Ok(asked.into_iter().collect());
    }
    if let Some(missing) = wanted.iter().find(|condition| !asked.contains(condition)) {
        let asked: Vec<String> = asked.iter().map(ToString::to_string).collect();
        let problem = format!("the item was not asked at {missing}; it was at {}", asked.join(", "));
        return Err(Error::usage("--condition", problem));
    }
    Ok(wanted.clone())
}

/// Digests of the images sent in a condition.
fn sent_digests(answers: &[&ShownAnswer], condition: &Condition) -> BTreeSet<Digest> {
    answers
        .iter()
        .filter(|answer| answer.condition.as_ref() == Some(condition))
        .filter_map(|answer| answer.sent)
        .collect()
}

/// Replies in a condition, one line per answer; `None` selects the answers without an image. Replies are escaped, so
/// that they cannot send control characters to the terminal.
fn reply_lines(answers: &[&ShownAnswer], condition: Option<&Condition>) -> String {
    let mut text = String::new();
    let note = if condition.is_none() { " without an image" } else { "" };
    for answer in answers.iter().filter(|answer| answer.condition.as_ref() == condition) {
        let ShownAnswer { model, outcome, reply, .. } = answer;
        let _ = writeln!(text, "  {model}{note}: {outcome}: {reply:?}");
    }
    text
}

/// The reply of a model to the item in a condition.
pub(super) struct ShownAnswer {
    model: String,
    condition: Option<Condition>,
    /// Outcome of the trial, in the words of the report.
    outcome: String,
    reply: String,
    /// The frame or walk shown.
    shown: FrameId,
    /// Digest of the image sent, or of all images of a walk.
    sent: Option<Digest>,
}

/// A question and the replies to it.
pub(super) struct ShownItem {
    source: FrameId,
    text: String,
    answers: Vec<ShownAnswer>,
}

/// The manifest of a run, and one item of it; `None` if the run did not ask the item.
///
/// # Errors
/// If a record cannot be read.
fn read(run: AnyRun, name: &str) -> Result<(RunManifest, Option<ShownItem>)> {
    Ok(match run {
        AnyRun::Choice(run) => {
            let records = run.records_of(name)?;
            let item = records.first().map(|first| ShownItem {
                source: first.detail.frame.clone(),
                text: choice_text(first, stored_question(&run.questions, name)),
                answers: records.iter().map(choice_answer).collect(),
            });
            (run.manifest, item)
        }
        AnyRun::Open(run) => {
            let records = run.records_of(name)?;
            let item = records.first().map(|first| ShownItem {
                source: FrameId(first.detail.episode.clone()),
                text: open_text(first, stored_question(&run.questions, name)),
                answers: records.iter().map(open_answer).collect(),
            });
            (run.manifest, item)
        }
    })
}

fn stored_question<'a>(questions: &'a [RunQuestion], name: &str) -> Option<&'a RunQuestion> {
    questions.iter().find(|question| question.id.0 == name)
}

fn choice_text(record: &Record, stored_question: Option<&RunQuestion>) -> String {
    let images = stored_question.map_or(&[][..], |question| &question.images);
    let images: Vec<&str> = images.iter().map(|frame| &*frame.0).collect();
    let about = match &*images {
        [] => record.detail.frame.to_string(),
        several => format!("{} images: {}", several.len(), several.join(", ")),
    };
    let mut text = format!("{}, about {about}\n", record.question);
    if let Some(stored_question) = stored_question {
        let _ = writeln!(text, "{}", stored_question.text);
    }
    for (index, choice) in record.detail.choices.iter().enumerate() {
        let truth = if Some(index) == record.detail.truth { "  (true)" } else { "" };
        let _ = writeln!(text, "  {}. {choice}{truth}", letter(index));
    }
    text
}

fn choice_answer(record: &Record) -> ShownAnswer {
    ShownAnswer {
        model: record.model.clone(),
        condition: record.condition.clone(),
        outcome: words::outcome(record),
        reply: reply_excerpt(record),
        shown: record.detail.sent_frame().clone(),
        sent: record.detail.file_digest(),
    }
}

fn open_text(record: &Record<OpenDetail>, stored_question: Option<&RunQuestion>) -> String {
    let mut text = format!("{}, about {}\n", record.question, record.detail.episode);
    if let Some(stored_question) = stored_question {
        let answer = stored_question.answer.as_deref().unwrap_or_default();
        let _ = writeln!(text, "{}\n  {answer}  (true)", stored_question.text);
    }
    text
}

fn open_answer(record: &Record<OpenDetail>) -> ShownAnswer {
    ShownAnswer {
        model: record.model.clone(),
        condition: record.condition.clone(),
        outcome: match (&record.failure, &record.detail.judged) {
            (Some(failure), _) => format!("failed ({})", words::failure_reason(failure.kind, failure.status)),
            (None, Some(_)) => "marked".to_owned(),
            (None, None) => "answered".to_owned(),
        },
        reply: reply_excerpt(record),
        shown: FrameId(record.detail.episode.clone()),
        sent: record.detail.images.as_ref().map(|images| images.digest),
    }
}

/// The first 200 characters of the reply, of the refusal, or of the error.
fn reply_excerpt<D>(record: &Record<D>) -> String {
    let text = record.text_or_error().unwrap_or_default();
    text.chars().take(200).collect()
}

/// The flags of `show`.
#[derive(Debug, Args)]
pub(crate) struct ShowArgs {
    /// The folder of a run, or the ZIP file of a bundle
    #[arg(value_name = "RUN", add = Decides::Nothing)]
    pub run: PathBuf,
    /// The id of a question
    #[arg(value_name = "ITEM", add = Decides::Nothing)]
    pub item: String,
    /// Only these conditions, as L3-noise+zerodce; repeatable; default: all that it was asked in
    #[arg(long, value_name = "CONDITION", add = Decides::Nothing)]
    pub condition: Vec<Condition>,
    /// Where the images go; default: shown in the folder of the run
    #[arg(long, value_name = "DIR", add = Decides::Nothing)]
    pub out: Option<PathBuf>,
    /// Draw one picture instead, .png or .jpg: the image over the levels, raw above each enhancer, whether each model's
    /// reply was right, and the curves of the run below; default: none
    #[arg(long, value_name = "FILE", conflicts_with_all = ["condition", "out"], add = Decides::Nothing)]
    pub sheet: Option<PathBuf>,
    /// Where the data and enhancers are now.
    #[command(flatten)]
    pub rebuild: RebuildArgs,
}

impl ShowArgs {
    /// The id of the question, without the order of its choices, which the report adds to it.
    fn question_id(&self) -> &str {
        self.item.split('#').next().unwrap_or_default()
    }
}

/// Draws and writes the picture. The outcome lists the conditions left out, and the images that differ from those sent.
///
/// # Errors
/// If the folder has no run of questions with choices, the run has no degraded images, it did not ask the item with
/// images, or an image cannot be rebuilt.
fn sheet(args: &ShowArgs, path: &Path) -> Result<Outcome> {
    let format = format(path)?;
    let item = SheetItem::read(args)?;
    let rows = item.rows();
    let images = item.images(args, &rows)?;
    let drawn = rows.iter().map(|(name, conditions)| {
        let cells = conditions.iter().map(|condition| {
            condition
                .as_ref()
                .and_then(|condition| -> Option<Result<StoryCell>> {
                    let image = images.get(condition)?;
                    let marks = item.marks(condition);
                    Some(cell_image(image).map(|image| StoryCell { image, marks }))
                })
                .transpose()
        });
        let name = name.clone();
        cells.collect::<Result<_>>().map(|cells| StoryRow { name, cells })
    });
    let picture = story(&Story {
        rows: drawn.collect::<Result<_>>()?,
        question: item.question.clone(),
        levels: item.levels.iter().copied().collect(),
        lines: item.curves.lines.clone(),
        note: item.curves.note.clone(),
    });
    write(path, Payload::encode(&picture, format)?.file())?;
    let left_out = item.asked_conditions().filter(|condition| !images.contains_key(condition));
    let changed = images.iter().filter(|(condition, image)| item.is_changed(condition, image));
    let changed = condition_names(changed.map(|(condition, _)| condition));
    let drawn = format!("{}: the item over the levels\n", path.display());
    let left_out = condition_names(left_out).map(|names| format!("not drawn: {names}\n"));
    let note = changed.as_ref().map(|names| {
        format!(
            "NOT the bytes that were sent: {names}; the data, an enhancer or this program has changed since the run\n"
        )
    });
    Ok(Outcome::wrote(
        path,
        changed.map_or(Status::Complete, |_| Status::Incomplete),
        [Some(drawn), left_out, note].into_iter().flatten().collect(),
    ))
}

/// The image of a cell; several images are placed side by side.
fn cell_image(images: &[Arc<Payload>]) -> Result<Rgb> {
    let mut images: Vec<Rgb> = images.iter().map(|image| image.decode()).collect::<Result<_>>()?;
    match images.pop() {
        Some(only) if images.is_empty() => Ok(only),
        last => montage(&images.into_iter().chain(last).collect::<Vec<Rgb>>()),
    }
}

/// The names of conditions, joined by commas; `None` if there are none.
fn condition_names<'a>(conditions: impl Iterator<Item = &'a Condition>) -> Option<String> {
    let names: BTreeSet<String> = conditions.map(ToString::to_string).collect();
    let names: Vec<String> = names.into_iter().collect();
    (!names.is_empty()).then(|| names.join(", "))
}

/// The name of each row of images, and the condition of each column; `None` if the item was not asked in it.
type SheetRows = Vec<(String, Vec<Option<Condition>>)>;

/// An item, with the data of its run that the picture needs.
struct SheetItem {
    manifest: RunManifest,
    /// The records of the item with images; not empty.
    records: Vec<Record>,
    /// The question, and its choices in one line.
    question: Vec<String>,
    levels: BTreeSet<AxisLevel>,
    curves: StoryCurves,
}

impl SheetItem {
    fn read(args: &ShowArgs) -> Result<Self> {
        let run = open_choice_run(&args.run, "--sheet draws questions with choices")?;
        let run = run.with_truths("--sheet draws accuracy; leave it out to see the images and replies")?;
        let name = args.question_id();
        let mut records = run.records_of(name)?;
        records.retain(|record| record.condition.is_some() && !is_control(&record.model));
        let Some(first) = records.first() else {
            let example = run.trials.first().map_or("", |trial| &trial.question().0);
            return Err(run_error(
                args,
                format!(
                    "the run did not ask {name:?} with images; an item is named by the id of its question, as {example}"
                ),
            ));
        };
        let stored = run.questions.iter().find(|question| question.id.0 == name);
        let text = choice_text(first, stored);
        let mut lines = text.lines().skip(1);
        let question = lines.next().unwrap_or_default().to_owned();
        let choices: Vec<&str> = lines.map(str::trim).collect();
        let manifest = run.manifest.clone();
        let curves =
            story_curves(run)?.ok_or_else(|| run_error(args, "no model was shown a degraded image".to_owned()))?;
        let conditions = records.iter().filter_map(|record| record.condition.as_ref());
        // The picture shows only the axis of the curves.
        let axis = curves.variant.kind.map(Kind::axis);
        let levels = conditions.map(Condition::level).filter(|level| *level == AxisLevel::L0 || level.axis() == axis);
        Ok(Self {
            levels: levels.collect(),
            question: vec![question, choices.join("   ").replace("  (true)", " (true)")],
            manifest,
            curves,
            records,
        })
    }

    /// The conditions in which the item was asked.
    fn asked_conditions(&self) -> impl Iterator<Item = &Condition> {
        self.records.iter().filter_map(|record| record.condition.as_ref())
    }

    /// The rows of the picture: raw images, and images by each enhancer with which the item was asked.
    fn rows(&self) -> SheetRows {
        let row = |name: String, enhancer: Option<_>| {
            let conditions = self.levels.iter().map(|level| {
                self.asked_conditions()
                    .find(|condition| {
                        let variant = condition.variant();
                        condition.level() == *level
                            && condition.enhancer.as_ref() == enhancer
                            && (variant == self.curves.variant || variant == Variant::NONE)
                    })
                    .cloned()
            });
            (name, conditions.collect())
        };
        let raw = row(self.curves.light.clone(), None);
        let enhanced = self.curves.enhancers.iter().map(|name| row(format!("+ {name}"), Some(name)));
        std::iter::once(raw)
            .chain(enhanced.filter(|(_, conditions): &(String, Vec<Option<_>>)| conditions.iter().any(Option::is_some)))
            .collect()
    }

    /// Rebuilds the images of all conditions in the rows.
    fn images(&self, args: &ShowArgs, rows: &SheetRows) -> Result<BTreeMap<Condition, Vec<Arc<Payload>>>> {
        let conditions: Vec<Condition> =
            rows.iter().flat_map(|(_, conditions)| conditions.iter().flatten()).cloned().collect();
        let rebuild = args.rebuild.clone();
        let mut rebuilder = ImageRebuilder::open(rebuild, &self.manifest, &args.run, &conditions)?;
        let images = rebuilder.images(&self.records[0].detail.frame, &conditions)?;
        Ok(conditions.into_iter().zip(images).collect())
    }

    /// True if the rebuilt images differ from those sent.
    fn is_changed(&self, condition: &Condition, images: &[Arc<Payload>]) -> bool {
        let now = Payload::joint_digest(images);
        self.records.iter().filter(|record| record.condition.as_ref() == Some(condition)).any(|record| {
            let sent = record.detail.file_digest();
            sent.is_some() && sent != now
        })
    }

    /// The mark of each model in a condition, from its first reply.
    fn marks(&self, condition: &Condition) -> Vec<(String, StoryMark)> {
        let mut marks: Vec<(String, StoryMark)> = Vec::new();
        for record in &self.records {
            let known = marks.iter().any(|(model, _)| *model == record.model);
            if known || record.condition.as_ref() != Some(condition) {
                continue;
            }
            let mark = match record.detail.outcome {
                TrialOutcome::Right => StoryMark::Right,
                TrialOutcome::Wrong => StoryMark::Wrong,
                TrialOutcome::Answered | TrialOutcome::Unparsed | TrialOutcome::Failed => StoryMark::None,
            };
            marks.push((record.model.clone(), mark));
        }
        marks
    }
}

fn run_error(args: &ShowArgs, problem: String) -> Error {
    Error::Run { path: args.run.clone(), problem }
}

/// The format for a file extension: PNG, or JPEG at a quality that keeps text sharp (chosen).
fn format(path: &Path) -> Result<PayloadFormat> {
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    let format = match &*extension.to_ascii_lowercase() {
        "png" => "png".parse(),
        "jpg" | "jpeg" => "jpeg:90".parse(),
        _ => {
            let problem = format_args!("{}: a name that ends in .png or .jpg expected", path.display());
            return Err(Error::usage("--sheet", problem));
        }
    };
    format.map_err(|e| Error::usage("--sheet", e))
}
