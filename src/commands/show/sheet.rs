//! `show --sheet`: draws the images of one item at all levels, and the curves of its run, as one picture: [`sheet`].

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Arc;

use super::item::choice_text;
use super::settings::ShowArgs;
use crate::engine::image_rebuilder::ImageRebuilder;
use crate::engine::images::notes::montage;
use crate::error::{Error, Result};
use crate::files::write;
use crate::pictures::{Payload, PayloadFormat};
use crate::report::charts::figures::StoryCurves;
use crate::report::charts::sheet::{Story, StoryCell, StoryMark, StoryRow, story};
use crate::report::joined::story_curves;
use crate::runs::Outcome;
use crate::runs::sharded_run::open_choice_run;
use crate::types::degradations::Kind;
use crate::types::manifests::{RunManifest, Status};
use crate::types::{AxisLevel, Condition, Record, Rgb, TrialOutcome, Variant};
use darkqa_score::model_in_condition::is_control;

/// Draws and writes the picture. The outcome lists the conditions left out, and the images that differ from those sent.
///
/// # Errors
/// If the folder has no run of questions with choices, the run has no degraded images, it did not ask the item with
/// images, or an image cannot be rebuilt.
pub(super) fn sheet(args: &ShowArgs, path: &Path) -> Result<Outcome> {
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
