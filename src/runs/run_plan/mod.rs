//! The plan of a run, which `plan` writes once and every shard reads: [`RunPlan`].
//!
//! The plan contains the questions and the digests of the frames, so that a shard need not measure frames to make
//! questions, and opens only its own frames. The folder of the plan is in the folder of the run.

mod file;
mod frame;
mod write;

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::ops::Range;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use serde::de::DeserializeOwned;

use crate::data::Dataset;
use crate::error::{Error, Result};
use crate::files::reading;
use crate::runs::shard::Shard;
use crate::runs::shard_sources::{WeightedSource, shard_range};
use crate::store::PLAN;
use crate::types::flags::setting_spelling;
use crate::types::manifests::{Identity, differences};
use crate::types::{Digest, FrameId, Question, RunQuestion, shell_word};

pub(crate) use file::recorded_command;
use file::{FRAMES, PLAN_FILE, PlanFile, QUESTIONS, SCHEMA};
pub(crate) use frame::{FrameCost, PlannedFrame};
pub(crate) use write::NewPlan;

/// The plan of a run, as read from its folder.
#[derive(Debug)]
pub(crate) struct RunPlan {
    folder: PathBuf,
    identity: Identity,
    /// The planned questions, in order.
    questions: Vec<RunQuestion>,
    /// The frames of the questions, in the order of their first question.
    frames: Vec<PlannedFrame>,
    /// Index of each frame in `frames`.
    places: HashMap<FrameId, usize>,
    command: Option<Vec<String>>,
    models: Vec<String>,
}

impl RunPlan {
    /// Reads the plan in the folder of a run; `None` if there is none.
    ///
    /// # Errors
    /// If the plan cannot be read, has another schema, or one of its files has changed.
    pub(crate) fn read(run: &Path) -> Result<Option<Self>> {
        let folder = run.join(PLAN);
        let path = folder.join(PLAN_FILE);
        if !path.exists() {
            return Ok(None);
        }
        let file: PlanFile = reading::json(&path)?;
        if file.schema != SCHEMA {
            let problem = format!(
                "the plan has the schema {:?}, this version reads {SCHEMA:?}; write it again with `darkqa-eval plan`",
                file.schema
            );
            return Err(Error::Run { path, problem });
        }
        let questions: Vec<RunQuestion> = read_lines(&folder.join(QUESTIONS), &file.files)?;
        let frames: Vec<PlannedFrame> = read_lines(&folder.join(FRAMES), &file.files)?;
        let names = frames.iter().map(|frame| frame.frame.clone());
        Ok(Some(Self {
            places: names.zip(0..).collect(),
            folder,
            identity: file.identity,
            questions,
            frames,
            command: file.command,
            models: file.models,
        }))
    }

    /// Checks that a run has the data, questions and light of the plan.
    ///
    /// # Errors
    /// Names the setting that differs.
    pub(crate) fn check_identity(&self, run: &Identity) -> Result<()> {
        // Name a whole setting rather than a part of it: the variant rather than one of its noise profiles.
        let differences = differences(&self.identity, run);
        match differences.min_by_key(|(field, ..)| field.contains(" of the ")) {
            None => Ok(()),
            Some((field, planned, now)) => Err(self.error(format!(
                "the plan is of another run: its {setting} is {planned}, now it is {now}; use the same {setting}, or another --out, or write the \
                 plan again with the new flags (`darkqa-eval plan`)",
                setting = setting_spelling(field)
            ))),
        }
    }

    /// The planned questions. `own` are the questions of the data set; if there are any, they must be the planned ones.
    ///
    /// # Errors
    /// If a question of the data is not the planned one, or its frame is missing.
    pub(crate) fn questions(&self, dataset: &Dataset, own: &[Question]) -> Result<Vec<Question>> {
        if !own.is_empty() {
            self.check_questions(dataset, own)?;
        }
        if let Some(lost) = self.frames.iter().find(|frame| !dataset.has_frames(&frame.frame)) {
            return Err(self.error(format!(
                "the frame {:?} of the plan is not among the data any more; restore it, or write the plan again into another --out",
                lost.frame.0
            )));
        }
        self.questions.par_iter().map(RunQuestion::to_question).collect()
    }

    /// Checks that the questions of the data set are the planned ones.
    fn check_questions(&self, dataset: &Dataset, own: &[Question]) -> Result<()> {
        let remedy = "use the questions of the plan, or write the plan again into another --out";
        if own.len() != self.questions.len() {
            return Err(self.error(format!(
                "{} questions are planned, and the data have {}; {remedy}",
                self.questions.len(),
                own.len()
            )));
        }
        let other = own.iter().zip(&self.questions).find(|(own, planned)| {
            !planned.is_same(&RunQuestion {
                images: dataset.image_series(&own.frame).to_vec(),
                ..RunQuestion::new(own, 0, &dataset.scene(&own.frame))
            })
        });
        match other {
            None => Ok(()),
            Some((own, planned)) => Err(self.error(format!(
                "the question {:?} of the data is not the planned one ({:?}); {remedy}",
                own.id.0, planned.id.0
            ))),
        }
    }

    /// The index of each planned question among all questions of the data set.
    pub(crate) fn question_places(&self) -> impl Iterator<Item = usize> {
        self.questions.iter().map(|question| question.place)
    }

    /// Checks that these images, given by frame with their digests, are the planned ones.
    ///
    /// # Errors
    /// If a frame has changed or is not planned; names the frame.
    pub(crate) fn check_images<'a>(&self, images: impl IntoIterator<Item = (&'a FrameId, Digest)>) -> Result<()> {
        for (name, digest) in images {
            let planned = self.frame(name).map(|frame| frame.digest);
            let problem = match planned {
                Some(Some(planned)) if planned == digest => continue,
                Some(Some(_)) => "its image is not the one that was planned",
                Some(None) => "the plan was written for models that see no image, and has no digest of it",
                None => "no question about it is planned",
            };
            return Err(Error::data(
                format_args!("frame {:?}", name.0),
                format_args!(
                    "{problem} ({}); restore it, or write the plan again into another --out",
                    self.folder.display()
                ),
            ));
        }
        Ok(())
    }

    fn frame(&self, name: &FrameId) -> Option<&PlannedFrame> {
        Some(&self.frames[*self.places.get(name)?])
    }

    /// The digest of a frame; `None` if it is not planned, or no model of the plan sees images.
    pub(crate) fn digest(&self, name: &FrameId) -> Option<Digest> {
        self.frame(name)?.digest
    }

    /// The cost of a frame by which a run is divided into shards, in microseconds; 1 if the frame is not planned.
    pub(crate) fn weight(&self, name: &str) -> u64 {
        let frame = self.frame(&FrameId(name.to_owned()));
        frame.map_or(1, |frame| frame.cost.weight())
    }

    /// Number of planned frames.
    pub(crate) fn frame_count(&self) -> usize {
        self.frames.len()
    }

    /// Number of requests about the frames with these indices, to all models of the plan.
    pub(crate) fn request_count(&self, places: impl Iterator<Item = usize>) -> usize {
        places.filter_map(|place| self.frames.get(place)).map(|frame| frame.cost.requests).sum()
    }

    /// The indices of the frames of a shard.
    pub(crate) fn shard_range(&self, shard: Shard) -> Range<usize> {
        let sources: Vec<WeightedSource> = self
            .frames
            .iter()
            .map(|frame| WeightedSource { scene: frame.scene.clone(), cost: frame.cost.weight() })
            .collect();
        shard_range(&sources, shard)
    }

    /// A shard's share of the estimated cost, from 0 to 1: by dollars if all are known, else by tokens, else by
    /// requests.
    pub(crate) fn cost_share(&self, shard: Shard) -> f64 {
        let own = self.shard_range(shard);
        let share_by = |cost: &dyn Fn(&FrameCost) -> Option<f64>| {
            let sum =
                |frames: &[PlannedFrame]| frames.iter().try_fold(0.0, |sum, frame| Some(sum + cost(&frame.cost)?));
            let whole = sum(&self.frames)?;
            Some(sum(&self.frames[own.clone()])? / whole).filter(|_| whole > 0.0)
        };
        share_by(&|cost| cost.dollars)
            .or_else(|| share_by(&|cost| cost.tokens))
            .or_else(|| share_by(&|cost| Some(cost.requests as f64)))
            .unwrap_or(0.0)
    }

    /// The command of the run without `--shard`; `None` if the plan does not have it, or if models other than its own
    /// were asked.
    pub(crate) fn command<'a>(&self, asked: impl Iterator<Item = &'a str>) -> Option<String> {
        let planned: BTreeSet<&str> = self.models.iter().map(|name| &**name).collect();
        let words = self.command.as_ref()?;
        let command = words.iter().map(|word| shell_word(word)).collect::<Vec<_>>().join(" ");
        (planned == asked.collect()).then(|| format!("darkqa-eval {command}"))
    }

    fn error(&self, problem: String) -> Error {
        let path = self.folder.clone();
        Error::Run { path, problem }
    }
}

/// Reads the lines of a file of a plan.
///
/// # Errors
/// If the file does not have the digest in `digests`, or a line cannot be parsed.
fn read_lines<T: DeserializeOwned + Send>(path: &Path, digests: &BTreeMap<String, Digest>) -> Result<Vec<T>> {
    let bytes = reading::bytes(path)?;
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    if digests.get(&*name) != Some(&Digest::from_bytes(&bytes)) {
        let problem = format!(
            "the file is not the one that {PLAN_FILE} was written with; write the plan again with `darkqa-eval plan`"
        );
        let path = path.to_owned();
        return Err(Error::Run { path, problem });
    }
    let lines: Vec<&[u8]> = bytes.split(|byte| *byte == b'\n').collect();
    lines
        .par_iter()
        .enumerate()
        .filter(|(_, line)| !line.is_empty())
        .map(|(index, line)| serde_json::from_slice(line).map_err(|e| Error::json_line(path, index + 1, &e)))
        .collect()
}
