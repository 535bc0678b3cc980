//! `show`: the images that one item was asked with, made again and proved by their digests.

use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::Path;

use super::darkroom::{Darkroom, Desk};
use super::gallery::{Gallery, look_at};
use super::inputs::stem;
use super::recipe::Recipe;
use super::report::kept;
use super::written::write;
use super::{Verdict, identity, open_enhancers};
use crate::config::{Pictures, ShowItem};
use crate::dataset::{Dataset, Place};
use crate::error::{Error, Result};
use crate::store;
use crate::types::manifest::{RunManifest, Status};
use crate::types::question::letter;
use crate::types::{Condition, Digest, FrameId, Listed, Outcome, Record};

/// Makes the images again, writes them, and says of each whether it is the one that was sent.
///
/// # Errors
/// Where the run or the item is not there, or its data or enhancers are not where they were.
pub fn show(config: ShowItem) -> Result<Verdict> {
    let folder = config.run.clone();
    let manifest = kept(&folder)?;
    let item = config.item.split('#').next().unwrap_or_default().to_owned();
    let records: Vec<Record> = store::read_records(&folder)?
        .into_iter()
        .filter(|record| record.question.0 == item)
        .collect();
    let Some(first) = records.first() else {
        let problem = format!(
            "no question {item:?} in this run; report.html and questions.jsonl have their ids"
        );
        return Err(Error::Run {
            path: folder,
            problem,
        });
    };
    let frame = first.frame.clone();
    let listed = store::read_questions(&folder)?;
    let listed = listed
        .into_iter()
        .find(|listed| listed.id == first.question);
    let conditions = conditions(&records, &config.conditions, &folder)?;
    let out = config.out.clone().unwrap_or_else(|| folder.join("shown"));
    let pictures = pictures(config, &manifest, &folder)?;
    let mut again = Again::open(&pictures, &frame, &conditions)?;
    let mut text = question(first, listed.as_ref());
    let mut all_same = true;
    for condition in &conditions {
        let (file, digest, ending) = again.image(condition)?;
        let path = out.join(format!("{}_{condition}.{ending}", stem(&frame)?));
        write(&path, &file)?;
        let sent = sent(&records, condition);
        let proof = if sent.is_empty() {
            format!("nothing is known of what was sent; {digest} now")
        } else if sent.iter().all(|sent| *sent == digest) {
            format!("the very bytes that were sent ({digest})")
        } else {
            all_same = false;
            format!("NOT the bytes that were sent: {digest} now")
        };
        let _ = writeln!(text, "{condition}: {}: {proof}", path.display());
        text += &replies(&records, Some(condition));
    }
    text += &replies(&records, None);
    if !all_same {
        text += "what decides the images is not as it was: the data, an enhancement model, or this program\n";
    }
    Ok(Verdict {
        status: if all_same {
            Status::Complete
        } else {
            Status::Incomplete
        },
        output: text,
    })
}

fn pictures(config: ShowItem, manifest: &RunManifest, folder: &Path) -> Result<Pictures> {
    if manifest.images.is_empty() {
        let problem =
            "the run does not say how its images were made: an earlier version made it".to_owned();
        let path = folder.to_owned();
        return Err(Error::Run { path, problem });
    }
    config.pictures(&manifest.images)
}

/// The conditions that the item was shown in, or those of them that are wanted.
fn conditions(records: &[Record], wanted: &[Condition], folder: &Path) -> Result<Vec<Condition>> {
    let there: BTreeSet<Condition> = records
        .iter()
        .filter_map(|record| record.condition.clone())
        .collect();
    if there.is_empty() {
        let problem =
            "the item was asked without images alone: there is nothing to show".to_owned();
        let path = folder.to_owned();
        return Err(Error::Run { path, problem });
    }
    if wanted.is_empty() {
        return Ok(there.into_iter().collect());
    }
    if let Some(missing) = wanted.iter().find(|condition| !there.contains(condition)) {
        let there: Vec<String> = there.iter().map(ToString::to_string).collect();
        let problem = format!(
            "the item was not asked at {missing}; it was at {}",
            there.join(", ")
        );
        return Err(Error::usage("--condition", problem));
    }
    Ok(wanted.to_vec())
}

/// What makes the images of one frame again.
struct Again {
    dataset: Dataset,
    gallery: Gallery,
    recipe: Recipe,
    enhancers: Vec<crate::enhance::Enhancer>,
    desk: Desk,
}

impl Again {
    fn open(pictures: &Pictures, frame: &FrameId, conditions: &[Condition]) -> Result<Self> {
        let dataset = frames(&pictures.data.place)?.with_most_pixels(pictures.data.most_pixels);
        let elsewhere = |e: Error| {
            let problem =
                format_args!("{e}; where the data lie elsewhere by now, --data says where");
            Error::data(frame, problem)
        };
        let found = look_at(&dataset, frame).map_err(elsewhere)?;
        let mended = conditions
            .iter()
            .any(|condition| condition.enhancer.is_some());
        let models = if mended {
            &*pictures.enhancement.models
        } else {
            &[]
        };
        let files = identity::enhancers(models)?;
        let recipe = Recipe {
            seed: pictures.sensor.seed,
            synthesis: pictures.sensor.synthesis.clone(),
            format: pictures.images.format,
            max_side: pictures.images.max_side,
            enhancers: files
                .iter()
                .map(|file| (file.name().clone(), file.digest()))
                .collect(),
        };
        let (_, enhancers) = open_enhancers(files, &pictures.enhancement)?;
        Ok(Self {
            dataset,
            gallery: Gallery::from([(frame.clone(), found)]),
            recipe,
            enhancers,
            desk: Desk::new(frame.clone()),
        })
    }

    /// The file of the frame in a condition, its digest, and its ending.
    fn image(&mut self, condition: &Condition) -> Result<(Vec<u8>, Digest, &'static str)> {
        let mut darkroom = Darkroom {
            dataset: &self.dataset,
            pictures: &self.gallery,
            recipe: &self.recipe,
            enhancers: std::mem::take(&mut self.enhancers),
            limit: None,
        };
        let image = darkroom.image(&mut self.desk, condition);
        self.enhancers = darkroom.enhancers;
        let image = image?;
        let ending = if image.facts().format == "png" {
            "png"
        } else {
            "jpg"
        };
        Ok((image.file()?, image.facts().digest, ending))
    }
}

/// The frames at a place; questions that come with them are of no interest.
fn frames(place: &Place) -> Result<Dataset> {
    match place {
        Place::Path(path) if path.join("frames.jsonl").is_file() => Dataset::of_frames(path),
        Place::Path(_) => Dataset::open(place, None),
        Place::Rooms(_) => Dataset::open_unasked(place),
    }
}

fn question(record: &Record, listed: Option<&Listed>) -> String {
    let mut text = format!("{}, about {}\n", record.question, record.frame);
    if let Some(listed) = listed {
        let _ = writeln!(text, "{}", listed.text);
    }
    for (index, choice) in record.choices.iter().enumerate() {
        let truth = if index == record.truth {
            "  (true)"
        } else {
            ""
        };
        let _ = writeln!(text, "  {}. {choice}{truth}", letter(index));
    }
    text
}

/// The digests of what was sent in a condition.
fn sent(records: &[Record], condition: &Condition) -> BTreeSet<Digest> {
    let there = records
        .iter()
        .filter(|record| record.condition.as_ref() == Some(condition));
    there
        .filter_map(|record| Some(record.image.as_ref()?.digest))
        .collect()
}

/// What each model made of the item in a condition, or without an image; replies in the form of a JSON text, so that nothing
/// in them reaches the terminal as a control.
fn replies(records: &[Record], condition: Option<&Condition>) -> String {
    let mut text = String::new();
    for record in records
        .iter()
        .filter(|record| record.condition.as_ref() == condition)
    {
        let without = if condition.is_none() {
            " without an image"
        } else {
            ""
        };
        let outcome = match record.outcome {
            Outcome::Right => "right",
            Outcome::Wrong => "wrong",
            Outcome::Unparsed => "not readable",
            Outcome::Failed => "failed",
        };
        let failure = || {
            record
                .failure
                .as_ref()
                .map(|failure| failure.message.as_str())
        };
        let said = record.reply.as_deref().or_else(failure).unwrap_or_default();
        let said: String = said.chars().take(200).collect();
        let _ = writeln!(text, "  {}{without}: {outcome}: {said:?}", record.model);
    }
    text
}
