//! Frames that are shown together: [`Source`], read once before anything is asked.
//!
//! Thread-safe counts of changes made to images when they were read: [`InputTally`].
//!
//! A photograph of a frame's scene in the dark, and how dark it is: [`SourcePhotograph`].

use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;

use crate::images::progress::Progress;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::degradations::Kind;
use darkqa_base::types::text::excerpt;
use darkqa_base::types::{
    Condition, Degradation, Digest, FrameId, InputNote, InputSummary, PairDark, PairFacts, PhotoName, ProfileName,
    Question, Rgb, Severity,
};
use darkqa_data::{Dataset, Picture};
use darkqa_light::PairEv;

/// Access to the files of frames.
pub trait Frames: Sync {
    /// The file of a frame, not decoded.
    fn picture(&self, frame: &FrameId) -> Result<Picture>;

    /// The horizontal focal length of a frame, in pixels; `None` if unknown.
    fn focal(&self, frame: &FrameId) -> Option<f64>;

    /// The photographs of a frame's scene in the dark: their names and stated exposure drops in EV. By default none.
    fn photographs(&self, _frame: &FrameId) -> Vec<(PhotoName, Option<f64>)> {
        Vec::new()
    }

    /// The file of a photograph of a frame's scene in the dark, not decoded.
    fn photograph(&self, frame: &FrameId, name: &PhotoName) -> Result<Picture> {
        Err(Error::data(frame, format_args!("no photograph {name} of it")))
    }
}

impl Frames for Dataset {
    fn picture(&self, frame: &FrameId) -> Result<Picture> {
        self.picture(frame)
    }

    fn focal(&self, frame: &FrameId) -> Option<f64> {
        self.focal(frame)
    }

    fn photographs(&self, frame: &FrameId) -> Vec<(PhotoName, Option<f64>)> {
        self.photographs(frame).iter().map(|photo| (photo.name.clone(), photo.ev)).collect()
    }

    fn photograph(&self, frame: &FrameId, name: &PhotoName) -> Result<Picture> {
        self.photograph(frame, name)
    }
}

/// One frame of a source.
#[derive(Debug, Clone)]
pub struct SourceFrame {
    /// Name of the frame, which also seeds its noise.
    pub id: FrameId,
    /// Digest of the file and of its reading rule.
    pub digest: Digest,
    /// Changes that reading the file makes besides decoding its codes.
    pub note: InputNote,
    /// Width and height, in pixels.
    pub size: (u32, u32),
    /// Exposure value at ISO 100 of the camera's settings; `None` if the file does not state them.
    pub exposure_value: Option<f64>,
    /// Horizontal focal length, in pixels; `None` if unknown.
    pub focal: Option<f64>,
    /// Photographs of the same scene in the dark.
    pub photographs: Vec<SourcePhotograph>,
}

impl SourceFrame {
    /// Reads the file of a frame, which must be an image.
    pub fn inspect(frames: &dyn Frames, id: &FrameId) -> Result<Self> {
        let picture = frames.picture(id)?;
        Ok(Self {
            id: id.clone(),
            size: picture.check()?,
            digest: picture.digest(),
            note: picture.note(),
            exposure_value: picture.exposure_value(),
            focal: frames.focal(id),
            photographs: inspect_photographs(frames, id)?,
        })
    }

    /// The photograph of this name.
    pub fn photograph(&self, name: &PhotoName) -> Option<&SourcePhotograph> {
        self.photographs.iter().find(|photo| photo.name == *name)
    }

    /// The digest of the file that is shown in a condition.
    ///
    /// # Errors
    /// If the frame has no such photograph.
    pub fn picture_digest(&self, condition: &Condition) -> Result<Digest> {
        let Some(name) = condition.photograph() else {
            return Ok(self.digest);
        };
        self.photograph(name)
            .map(|photo| photo.digest)
            .ok_or_else(|| Error::data(&self.id, format_args!("no photograph {name} of it")))
    }

    /// The degradation of this frame in a condition; `None` for untouched frames and photographs.
    ///
    /// # Errors
    /// If the exposure drop of the frame's photograph is unknown or cannot be synthesised.
    pub fn degradation(&self, condition: &Condition) -> Result<Option<Degradation>> {
        match condition.pair() {
            Some(PairDark::Match(kind, reading)) => {
                let (how, _) = matching_degradation(&self.photographs, *kind, reading.as_ref()).ok_or_else(|| {
                    let problem = "no photograph of it in the dark with a known exposure drop";
                    Error::data(&self.id, problem)
                })?;
                Ok(Some(how))
            }
            _ => Ok(condition.degradation().cloned()),
        }
    }

    /// True if the frame can be shown in a condition: it has the photograph, or one whose exposure drop can be
    /// synthesised.
    pub fn can_show(&self, condition: &Condition) -> bool {
        match condition.pair() {
            None => true,
            Some(PairDark::Photograph(name)) => self.photograph(name).is_some(),
            Some(PairDark::Match(kind, reading)) => {
                matching_degradation(&self.photographs, *kind, reading.as_ref()).is_some()
            }
        }
    }
}

/// Reads the photographs of a frame, which must be images.
fn inspect_photographs(frames: &dyn Frames, id: &FrameId) -> Result<Vec<SourcePhotograph>> {
    frames
        .photographs(id)
        .into_iter()
        .map(|(name, stated)| {
            let picture = frames.photograph(id, &name)?;
            picture.check()?;
            Ok(SourcePhotograph { digest: picture.digest(), note: picture.note(), name, stated, facts: None })
        })
        .collect()
}

/// Frames that are shown together: a single frame, the frames of one question, or the frames of a walk.
#[derive(Debug)]
pub struct Source {
    /// Name of the frame, of the group of frames, or of the walk.
    pub name: FrameId,
    /// The distinct frames; empty if only blind models are asked, or if the source cannot be shown.
    pub frames: Vec<SourceFrame>,
    /// Indices into `frames`, in the order shown. Repeats a frame if a question shows it twice, or if a walk has fewer
    /// frames than are shown.
    pub order: Vec<usize>,
    /// Reason why the source cannot be shown; `None` if it can.
    pub problem: Option<String>,
}

impl Source {
    /// The source for questions about this name: a single frame, or the group of frames with this name. Each file is
    /// read once.
    pub fn from_questions(dataset: &Dataset, name: &FrameId) -> Result<Self> {
        let mut frames: Vec<SourceFrame> = Vec::new();
        let mut order = Vec::new();
        for id in dataset.shown_frames(name) {
            let known = frames.iter().position(|frame| frame.id == *id);
            if known.is_none() {
                frames.push(SourceFrame::inspect(dataset, id)?);
            }
            order.push(known.unwrap_or(frames.len() - 1));
        }
        Ok(Self { name: name.clone(), frames, order, problem: None })
    }

    /// A source without frames, for blind models.
    pub fn without_frames(name: FrameId) -> Self {
        Self { name, frames: Vec::new(), order: Vec::new(), problem: None }
    }

    /// True if all frames can be shown in a condition.
    pub fn can_show(&self, condition: &Condition) -> bool {
        self.frames.iter().all(|frame| frame.can_show(condition))
    }

    /// The middle frame; `None` without frames.
    pub fn middle(&self) -> Option<&SourceFrame> {
        self.frames.get(self.frames.len() / 2)
    }

    /// The digest of all frames in the order shown (for a single frame, the digest of its file); `None` without frames.
    pub fn digest(&self) -> Option<Digest> {
        Digest::from_file_digests(self.order.iter().map(|index| self.frames[*index].digest))
    }
}

/// Changes made to the frames of these sources when they were read.
pub fn input_summary(sources: &[Source]) -> InputSummary {
    let mut summary = InputSummary::default();
    for frame in sources.iter().flat_map(|source| &source.frames) {
        summary.add(&frame.id, &frame.note);
        for photo in &frame.photographs {
            summary.add(&FrameId(format!("{} ({})", frame.id, photo.name)), &photo.note);
        }
    }
    summary
}

/// Logs one warning per kind of change made to images when they were read.
pub fn warn_of_inputs(summary: &InputSummary) {
    for line in summary.lines() {
        tracing::warn!("{line}");
    }
}

/// The first question about each frame, in the order of the questions.
pub fn first_question_per_frame(questions: &[Question]) -> Vec<&Question> {
    let mut first = BTreeMap::new();
    for (position, question) in questions.iter().enumerate() {
        first.entry(&question.frame).or_insert((position, question));
    }
    let mut first: Vec<(usize, &Question)> = first.into_values().collect();
    first.sort_by_key(|(position, _)| *position);
    first.into_iter().map(|(_, question)| question).collect()
}

/// Reads the sources of all questions. Missing or broken files are found here, before anything is paid for, and the
/// trial keys include the content of the files.
pub fn inspect_all(dataset: &Dataset, questions: &[Question], progress: &Progress) -> Result<Vec<Source>> {
    let first = first_question_per_frame(questions);
    let bar = progress.bar("reading images", first.len());
    first
        .into_par_iter()
        .map(|question| {
            let source = Source::from_questions(dataset, &question.frame).map_err(|e| {
                let problem = format_args!("{e}; --skip bad leaves such questions out");
                Error::data(format_args!("question {:?}", excerpt(&question.id.0, 60)), problem)
            })?;
            bar.inc();
            Ok(source)
        })
        .collect()
}

/// Changes to the images of a command so far.
#[derive(Debug, Default)]
pub struct InputTally(Mutex<InputSummary>);

impl InputTally {
    /// Counts one image.
    pub fn add(&self, frame: &FrameId, note: &InputNote) {
        let mut summary = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        summary.add(frame, note);
    }

    /// Logs one warning per kind of change.
    pub fn warn(self) {
        let summary = self.0.into_inner();
        warn_of_inputs(&summary.unwrap_or_else(PoisonError::into_inner));
    }
}

/// A photograph of a frame's scene in the dark.
#[derive(Debug, Clone)]
pub struct SourcePhotograph {
    /// Name of the condition in which it is shown.
    pub name: PhotoName,
    /// Digest of the file and of its reading rule.
    pub digest: Digest,
    /// Changes that reading the file makes besides decoding its codes.
    pub note: InputNote,
    /// Exposure drop stated in the data set, in EV; `None` if unknown.
    pub stated: Option<f64>,
    /// How dark the photograph is; `None` before it is measured. No store key depends on it.
    pub facts: Option<PairFacts>,
}

impl SourcePhotograph {
    /// Measures how dark the photograph (`low`) is compared with its frame (`normal`).
    pub fn measure(&self, normal: &Rgb, low: &Rgb) -> PairFacts {
        let measured = PairEv::measure(normal, low);
        PairFacts {
            stated: self.stated,
            mean: measured.map(|ev| ev.mean),
            median: measured.and_then(|ev| ev.median),
            synthesis: measured.map(|ev| ev.synthesis),
        }
    }
}

/// The degradation of this kind that is as dark as the first of these photographs, rounded to a hundredth of an EV;
/// `None` if the exposure drop is unknown or cannot be synthesised.
pub(crate) fn matching_degradation(
    photos: &[SourcePhotograph],
    kind: Kind,
    reading: Option<&ProfileName>,
) -> Option<(Degradation, PairFacts)> {
    let facts = photos.first()?.facts?;
    let hundredths = (100.0 * facts.matching()?).round();
    if !(1.0..=f64::from(kind.max_severity().hundredths())).contains(&hundredths) {
        return None;
    }
    let severity = Severity::from_hundredths(hundredths as u16);
    let how = Degradation::new(kind, severity, reading.cloned()).ok()?;
    Some((how, facts))
}
