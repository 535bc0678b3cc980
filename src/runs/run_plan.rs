//! The plan of a run, which `plan` writes once and every shard reads: [`RunPlan`].
//!
//! The plan contains the questions and the digests of the frames, so that a shard need not measure frames to make
//! questions, and opens only its own frames. The folder of the plan is in the folder of the run.
//!
//! The content of `plan.json`: [`PlanFile`].
//!
//! A frame of a plan ([`PlannedFrame`]) with its cost ([`FrameCost`]).
//!
//! Writes a plan: [`NewPlan`].

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::fs::{self, File};
use std::io::Write as _;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use jiff::Timestamp;
use rayon::prelude::*;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::forecast::Forecast;
use super::shard_records::{WeightedSource, shard_range};
use crate::shard::Shard;
use darkqa_base::error::{Error, Result};
use darkqa_base::files::{self, UNFINISHED};
use darkqa_base::types::flags::setting_spelling;
use darkqa_base::types::manifests::{Identity, differences};
use darkqa_base::types::{Digest, FrameId, Question, RunQuestion, shell_word};
use darkqa_data::Dataset;
use darkqa_store::PLAN;

/// The plan of a run, as read from its folder.
#[derive(Debug)]
pub struct RunPlan {
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
    pub fn read(run: &Path) -> Result<Option<Self>> {
        let folder = run.join(PLAN);
        let path = folder.join(PLAN_FILE);
        if !path.exists() {
            return Ok(None);
        }
        let file: PlanFile = files::json(&path)?;
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
    pub fn check_identity(&self, run: &Identity) -> Result<()> {
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
    pub fn questions(&self, dataset: &Dataset, own: &[Question]) -> Result<Vec<Question>> {
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
    pub fn question_places(&self) -> impl Iterator<Item = usize> {
        self.questions.iter().map(|question| question.place)
    }

    /// Checks that these images, given by frame with their digests, are the planned ones.
    ///
    /// # Errors
    /// If a frame has changed or is not planned; names the frame.
    pub fn check_images<'a>(&self, images: impl IntoIterator<Item = (&'a FrameId, Digest)>) -> Result<()> {
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
    pub fn digest(&self, name: &FrameId) -> Option<Digest> {
        self.frame(name)?.digest
    }

    /// The cost of a frame by which a run is divided into shards, in microseconds; 1 if the frame is not planned.
    pub fn weight(&self, name: &str) -> u64 {
        let frame = self.frame(&FrameId(name.to_owned()));
        frame.map_or(1, |frame| frame.cost.weight())
    }

    /// Number of planned frames.
    pub fn frame_count(&self) -> usize {
        self.frames.len()
    }

    /// Number of requests about the frames with these indices, to all models of the plan.
    pub fn request_count(&self, places: impl Iterator<Item = usize>) -> usize {
        places.filter_map(|place| self.frames.get(place)).map(|frame| frame.cost.requests).sum()
    }

    /// The indices of the frames of a shard.
    pub fn shard_range(&self, shard: Shard) -> Range<usize> {
        let sources: Vec<WeightedSource> = self
            .frames
            .iter()
            .map(|frame| WeightedSource { scene: frame.scene.clone(), cost: frame.cost.weight() })
            .collect();
        shard_range(&sources, shard)
    }

    /// A shard's share of the estimated cost, from 0 to 1: by dollars if all are known, else by tokens, else by
    /// requests.
    pub fn cost_share(&self, shard: Shard) -> f64 {
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
    pub fn command<'a>(&self, asked: impl Iterator<Item = &'a str>) -> Option<String> {
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
    let bytes = files::bytes(path)?;
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

/// Schema of a plan.
const SCHEMA: &str = "darkqa.plan/1";

/// File with the facts about the plan and the digests of its other files. It is written last.
const PLAN_FILE: &str = "plan.json";

/// File with the planned questions, in the format of a run's questions.
const QUESTIONS: &str = "questions.jsonl";

/// File with the frames of the planned questions.
const FRAMES: &str = "frames.jsonl";

/// The content of `plan.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct PlanFile {
    schema: String,
    /// Version of the program that wrote the plan.
    version: String,
    /// Data, questions and light, which must be the same in every run that uses the plan. Models and enhancers are not
    /// included.
    identity: Identity,
    /// Digests of the other files, by name.
    files: BTreeMap<String, Digest>,
    counts: PlanCounts,
    /// Estimate for the whole run with the models and enhancers of the command that wrote the plan.
    estimate: PlanEstimate,
    /// Models of the command that wrote the plan.
    models: Vec<String>,
    /// Words of the command that wrote the plan, without `plan` and `--shard`; `None` if one of them may be a secret.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    command: Option<Vec<String>>,
}

/// Numbers of planned questions, frames, scenes and trials.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct PlanCounts {
    questions: usize,
    frames: usize,
    scenes: usize,
    trials: usize,
}

/// Estimate of a run, as printed by `--dry-run`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PlanEstimate {
    /// Number of images to make.
    pub images: usize,
    /// Time to make the images on the machine that wrote the plan, in seconds, extrapolated from a few.
    pub making_seconds: f64,
    /// CPU time of all frames in `frames.jsonl`, in seconds. Shards are divided by it.
    pub cpu_seconds: f64,
    /// Time waiting for replies, in seconds.
    pub asking_seconds: f64,
    /// Bytes to send.
    pub bytes: f64,
    /// Tokens of requests and replies, assuming short replies; `None` if the image tokens of a model are unknown.
    pub tokens: Option<f64>,
    /// Cost in US dollars, assuming short replies; `None` if a price is unknown.
    pub dollars: Option<f64>,
}

impl PlanEstimate {
    /// The estimate of a plan whose frames take `cpu_seconds` of CPU time.
    pub fn new(forecast: &Forecast, cpu_seconds: f64) -> Self {
        let lines = &forecast.lines;
        let tokens = lines
            .iter()
            .try_fold(0.0, |sum, line| Some(sum + line.text_tokens + line.image_tokens? + line.reply_tokens));
        let dollars = lines.iter().try_fold(0.0, |sum, line| Some(sum + line.dollars?));
        Self {
            images: forecast.images,
            making_seconds: forecast.making_seconds,
            cpu_seconds,
            asking_seconds: forecast.asking_seconds,
            bytes: forecast.bytes,
            tokens,
            dollars,
        }
    }
}

/// Flags whose values may be secret.
const SECRET_FLAGS: [&str; 2] = ["--header", "--extra-body"];

/// Converts the words of a `plan` command to those of an evaluation. `None` if one of them may be secret: a header, a
/// request field, or a URL with a password or a query.
pub fn recorded_command(words: &[String]) -> Option<Vec<String>> {
    if words.iter().any(|word| may_be_secret(word)) {
        return None;
    }
    let mut recorded = Vec::new();
    let mut words = words.iter();
    let mut has_plan = false;
    while let Some(word) = words.next() {
        match &**word {
            "plan" if !has_plan => has_plan = true,
            "--shard" | "--workers" => drop(words.next()),
            "--dry-run" => {}
            flag if flag.starts_with("--shard=") || flag.starts_with("--workers=") => {}
            _ => recorded.push(word.clone()),
        }
    }
    Some(recorded)
}

fn may_be_secret(word: &str) -> bool {
    let flag = word.split('=').next().unwrap_or_default();
    let is_url = word.contains("://");
    SECRET_FLAGS.contains(&flag) || (is_url && word.contains(['@', '?']))
}

/// Estimated cost of all images and requests of a frame. It depends on the plan alone, so that every shard computes the
/// same division.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct FrameCost {
    /// CPU time, in seconds.
    pub seconds: f64,
    /// Number of requests.
    pub requests: usize,
    /// Tokens of all requests and replies, assuming short replies; `None` if the image tokens of a model are unknown.
    pub tokens: Option<f64>,
    /// Cost in US dollars, assuming short replies; `None` if a price or a number of tokens is unknown.
    pub dollars: Option<f64>,
}

impl FrameCost {
    /// The cost by which a run is divided into shards: CPU time in microseconds.
    fn weight(&self) -> u64 {
        (self.seconds * 1e6).round() as u64
    }
}

/// One line of `frames.jsonl`: a frame with questions, or several frames that a question shows together.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PlannedFrame {
    /// Name of the frame, or of several together.
    pub frame: FrameId,
    /// Scene of the frame; empty if the data set has no scenes.
    pub scene: String,
    /// Image file; `None` for rooms, images inside a larger file, and several frames.
    pub path: Option<PathBuf>,
    /// Size of the file in bytes when the plan was written; for information only.
    pub size: Option<u64>,
    /// Modification time of the file in UTC when the plan was written; for information only.
    pub mtime: Option<String>,
    /// Width of the image in pixels (of the middle one if there are several); `None` if no model sees images.
    pub width: Option<u32>,
    /// Height of the image in pixels.
    pub height: Option<u32>,
    /// Digest of the file (or of all files) and of the decoding rule.
    pub digest: Option<Digest>,
    pub cost: FrameCost,
    /// Index among the frames of the run.
    pub place: usize,
}

impl PlannedFrame {
    /// A planned frame with its file. `image` is its size and digest, where models see images.
    pub fn new(
        place: usize,
        frame: &FrameId,
        image: (Option<(u32, u32)>, Option<Digest>),
        dataset: &Dataset,
        cost: FrameCost,
    ) -> Self {
        let path = dataset.image_file(frame);
        let metadata = path.and_then(|path| path.metadata().ok());
        let modified = metadata.as_ref().and_then(|metadata| metadata.modified().ok());
        let (size, digest) = image;
        Self {
            frame: frame.clone(),
            scene: dataset.scene(frame),
            path: path.map(ToOwned::to_owned),
            size: metadata.map(|metadata| metadata.len()),
            mtime: modified.and_then(format_utc),
            width: size.map(|(width, _)| width),
            height: size.map(|(_, height)| height),
            digest,
            cost,
            place,
        }
    }

    /// True if two plans have the same frame with the same content at the same index.
    fn is_same(&self, other: &Self) -> bool {
        self.frame == other.frame
            && self.scene == other.scene
            && self.digest == other.digest
            && self.place == other.place
    }
}

/// Formats a time in UTC, to the second; `None` if it is out of range.
fn format_utc(time: SystemTime) -> Option<String> {
    let time = Timestamp::try_from(time).ok()?;
    Some(time.strftime("%Y-%m-%dT%H:%M:%SZ").to_string())
}

/// The contents of a plan to write.
pub struct NewPlan {
    pub identity: Identity,
    pub questions: Vec<RunQuestion>,
    pub frames: Vec<PlannedFrame>,
    pub models: Vec<String>,
    pub command: Option<Vec<String>>,
    /// Number of trials of the whole run.
    pub trials: usize,
}

impl NewPlan {
    /// Writes the plan into the folder of a run, by renaming a temporary folder. Returns the folder of the plan.
    ///
    /// If an earlier plan of the run has the same questions and frames, the new plan reuses the earlier costs. With new
    /// costs, frames could move to other shards.
    ///
    /// # Errors
    /// If the run has shards of an earlier plan with other questions or frames, or a file cannot be written.
    pub fn write(mut self, run: &Path, forecast: &Forecast) -> Result<PathBuf> {
        let folder = run.join(PLAN);
        let earlier = RunPlan::read(run)?;
        if let Some(earlier) = &earlier {
            if self.has_same_content(earlier) {
                self.frames.clone_from(&earlier.frames);
            } else if let Some(shard) = first_shard(run)? {
                let problem = format!(
                    "the run has parts of another plan, with other questions or frames ({}); use another --out, or delete the parts",
                    shard.display()
                );
                return Err(Error::Run { path: folder, problem });
            }
        }
        let questions = json_lines(&self.questions)?;
        let frames = json_lines(&self.frames)?;
        let file = serde_json::to_vec_pretty(&self.to_plan_file(&questions, &frames, forecast))
            .map_err(|e| Error::data(PLAN_FILE, e))?;
        let unfinished = run.join(format!(".{PLAN}{UNFINISHED}"));
        if unfinished.exists() {
            remove_folder(&unfinished)?;
        }
        fs::create_dir_all(&unfinished).map_err(|e| Error::file(&unfinished, "create", e))?;
        for (name, content) in [(QUESTIONS, &questions), (FRAMES, &frames), (PLAN_FILE, &file)] {
            let path = unfinished.join(name);
            File::create(&path)
                .and_then(|mut file| {
                    file.write_all(content)?;
                    file.sync_all()
                })
                .map_err(|e| Error::file(&path, "write", e))?;
        }
        if folder.exists() {
            remove_folder(&folder)?;
        }
        fs::rename(&unfinished, &folder).map_err(|e| Error::file(&folder, "write", e))?;
        Ok(folder)
    }

    /// True if an earlier plan has the same questions and frames.
    fn has_same_content(&self, earlier: &RunPlan) -> bool {
        self.questions == earlier.questions
            && self.frames.len() == earlier.frames.len()
            && self.frames.iter().zip(&earlier.frames).all(|(now, before)| now.is_same(before))
    }

    fn to_plan_file(&self, questions: &[u8], frames: &[u8], forecast: &Forecast) -> PlanFile {
        let files = [(QUESTIONS, questions), (FRAMES, frames)]
            .map(|(name, content)| (name.to_owned(), Digest::from_bytes(content)));
        let scenes: BTreeSet<&str> = self.frames.iter().map(|frame| &*frame.scene).collect();
        let seconds = self.frames.iter().map(|frame| frame.cost.seconds).sum();
        PlanFile {
            schema: SCHEMA.to_owned(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            identity: self.identity.clone(),
            files: BTreeMap::from(files),
            counts: PlanCounts {
                questions: self.questions.len(),
                frames: self.frames.len(),
                scenes: scenes.into_iter().filter(|scene| !scene.is_empty()).count(),
                trials: self.trials,
            },
            estimate: PlanEstimate::new(forecast, seconds),
            models: self.models.clone(),
            command: self.command.clone(),
        }
    }
}

/// Folder of the first shard of a run, if any.
fn first_shard(run: &Path) -> Result<Option<PathBuf>> {
    for path in files::entries(run)? {
        if path.is_dir() && darkqa_store::schema(&path)?.is_some() {
            return Ok(Some(path));
        }
    }
    Ok(None)
}

fn remove_folder(folder: &Path) -> Result<()> {
    fs::remove_dir_all(folder).map_err(|e| Error::file(folder, "remove", e))
}

fn json_lines<T: Serialize>(values: &[T]) -> Result<Vec<u8>> {
    let mut lines = Vec::new();
    for value in values {
        serde_json::to_writer(&mut lines, value).map_err(|e| Error::data("plan", e))?;
        lines.push(b'\n');
    }
    Ok(lines)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn recorded(line: &str) -> Option<String> {
        let words: Vec<String> = line.split(' ').map(str::to_owned).collect();
        recorded_command(&words).map(|words| words.join(" "))
    }

    #[test]
    fn no_secret_is_recorded() {
        for (line, kept) in [
            ("plan --model a --shard 1/4 --out r", Some("--model a --out r")),
            ("--quiet plan --model plan --workers=3 --out r", Some("--quiet --model plan --out r")),
            ("plan --base-url http://h/v1 --model a", Some("--base-url http://h/v1 --model a")),
            ("plan --base-url http://u:p@h/v1 --model a", None),
            ("plan --base-url=http://h/v1?key=3 --model a", None),
            ("plan --header X-Key:3 --model a", None),
            ("plan --header=X-Key:3 --model a", None),
            ("plan --extra-body {} --model a", None),
        ] {
            assert_eq!(recorded(line).as_deref(), kept, "{line}");
        }
    }
}
