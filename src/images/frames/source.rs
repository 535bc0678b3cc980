//! The frames that are shown together: [`Source`], read once before anything is asked.

use std::collections::BTreeMap;

use rayon::prelude::*;

use crate::dataset::{Dataset, Picture};
use crate::error::{Error, Result};
use crate::images::frames::photograph::{SourcePhotograph, matched};
use crate::images::progress::Progress;
use crate::types::text::excerpt;
use crate::types::{
    Condition, Degradation, Digest, FrameId, InputNote, InputSummary, PairDark, PhotoName, Question,
};

/// A reader of frames' files.
pub(crate) trait Frames: Sync {
    /// The file of a frame, which is not decoded.
    fn picture(&self, frame: &FrameId) -> Result<Picture>;

    /// The focal length of a frame along a row, in pixels of its image; `None` if it is not known.
    fn focal(&self, frame: &FrameId) -> Option<f64>;

    /// The names of the photographs of a frame's scene in the dark, with the exposure drop that the data state; by default none.
    fn photographs(&self, _frame: &FrameId) -> Vec<(PhotoName, Option<f64>)> {
        Vec::new()
    }

    /// The file of a photograph of a frame's scene in the dark, which is not decoded.
    fn photograph(&self, frame: &FrameId, name: &PhotoName) -> Result<Picture> {
        Err(Error::data(
            frame,
            format_args!("no photograph {name} of it"),
        ))
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
        self.photographs(frame)
            .iter()
            .map(|photo| (photo.name.clone(), photo.ev))
            .collect()
    }

    fn photograph(&self, frame: &FrameId, name: &PhotoName) -> Result<Picture> {
        self.photograph(frame, name)
    }
}

/// One frame of a source.
#[derive(Debug, Clone)]
pub(crate) struct SourceFrame {
    /// Name of the frame. Its noise is drawn from it.
    pub(crate) id: FrameId,
    /// Digest of the file and of the rule by which it is read.
    pub(crate) digest: Digest,
    /// Changes that reading the file makes besides decoding its codes.
    pub(crate) note: InputNote,
    /// Width and height, in pixels.
    pub(crate) size: (u32, u32),
    /// Focal length along a row, in pixels; `None` if it is not known.
    pub(crate) focal: Option<f64>,
    /// Photographs of the same scene in the dark.
    pub(crate) photographs: Vec<SourcePhotograph>,
}

impl SourceFrame {
    /// The frame of this name. Its file is read, and must be an image.
    pub(crate) fn inspect(frames: &dyn Frames, id: &FrameId) -> Result<Self> {
        let picture = frames.picture(id)?;
        Ok(Self {
            id: id.clone(),
            size: picture.check()?,
            digest: picture.digest(),
            note: picture.note(),
            focal: frames.focal(id),
            photographs: inspect_photographs(frames, id)?,
        })
    }

    /// The photograph of this name.
    pub(crate) fn photograph(&self, name: &PhotoName) -> Option<&SourcePhotograph> {
        self.photographs.iter().find(|photo| photo.name == *name)
    }

    /// The digest of the file that is shown in a condition.
    ///
    /// # Errors
    /// If the frame has no such photograph.
    pub(crate) fn picture(&self, condition: &Condition) -> Result<Digest> {
        let Some(name) = condition.photograph() else {
            return Ok(self.digest);
        };
        let photo = self.photograph(name).map(|photo| photo.digest);
        photo.ok_or_else(|| Error::data(&self.id, format_args!("no photograph {name} of it")))
    }

    /// The degradation of this frame in a condition; `None` for untouched frames and photographs.
    ///
    /// # Errors
    /// If the darkness of the frame's photograph is not known, or cannot be synthesised.
    pub(crate) fn degradation(&self, condition: &Condition) -> Result<Option<Degradation>> {
        match condition.pair() {
            Some(PairDark::Match(kind, reading)) => {
                let how = matched(&self.photographs, *kind, reading.as_ref());
                let problem = "no photograph of it in the dark with a known exposure drop";
                let how = how.ok_or_else(|| Error::data(&self.id, problem))?;
                Ok(Some(how.0))
            }
            _ => Ok(condition.degradation().cloned()),
        }
    }

    /// Whether the frame can be shown in a condition: it has the photograph, or one whose darkness is known and can be synthesised.
    pub(crate) fn can_show(&self, condition: &Condition) -> bool {
        match condition.pair() {
            None => true,
            Some(PairDark::Photograph(name)) => self.photograph(name).is_some(),
            Some(PairDark::Match(kind, reading)) => {
                matched(&self.photographs, *kind, reading.as_ref()).is_some()
            }
        }
    }
}

/// The photographs of a frame. Their files are read, and must be images.
fn inspect_photographs(frames: &dyn Frames, id: &FrameId) -> Result<Vec<SourcePhotograph>> {
    frames
        .photographs(id)
        .into_iter()
        .map(|(name, stated)| {
            let picture = frames.photograph(id, &name)?;
            picture.check()?;
            Ok(SourcePhotograph {
                digest: picture.digest(),
                note: picture.note(),
                name,
                stated,
                facts: None,
            })
        })
        .collect()
}

/// The frames that are shown together: one frame, those of a question that shows several, or those of a walk.
#[derive(Debug)]
pub(crate) struct Source {
    /// Name of the frame, of several frames together, or of the walk.
    pub(crate) name: FrameId,
    /// Each of its frames once; none if only blind models are asked, or it cannot be shown.
    pub(crate) frames: Vec<SourceFrame>,
    /// Indices into `frames`, in the order shown. A frame is repeated if a question shows it twice, or a walk has fewer frames than
    /// are shown.
    pub(crate) order: Vec<usize>,
    /// Reason why it cannot be shown; `None` if it can.
    pub(crate) problem: Option<String>,
}

impl Source {
    /// The source of questions about a frame of this name: this frame alone, or the several that it stands for. Each file is read once.
    pub(crate) fn from_questions(dataset: &Dataset, name: &FrameId) -> Result<Self> {
        let mut frames: Vec<SourceFrame> = Vec::new();
        let mut order = Vec::new();
        for id in dataset.shown_frames(name) {
            let known = frames.iter().position(|frame| frame.id == *id);
            if known.is_none() {
                frames.push(SourceFrame::inspect(dataset, id)?);
            }
            order.push(known.unwrap_or(frames.len() - 1));
        }
        Ok(Self {
            name: name.clone(),
            frames,
            order,
            problem: None,
        })
    }

    /// A source without frames, for blind models.
    pub(crate) fn unseen(name: FrameId) -> Self {
        Self {
            name,
            frames: Vec::new(),
            order: Vec::new(),
            problem: None,
        }
    }

    /// Whether all its frames can be shown in a condition.
    pub(crate) fn can_show(&self, condition: &Condition) -> bool {
        self.frames.iter().all(|frame| frame.can_show(condition))
    }

    /// The frame in the middle, or the only one; `None` without frames.
    pub(crate) fn middle(&self) -> Option<&SourceFrame> {
        self.frames.get(self.frames.len() / 2)
    }

    /// The digest of all frames in the order shown; for a single frame, that of its file; `None` without frames.
    pub(crate) fn digest(&self) -> Option<Digest> {
        Digest::from_file_digests(self.order.iter().map(|index| self.frames[*index].digest))
    }
}

/// Changes made to the frames of these sources when they were read.
pub(crate) fn input_summary(sources: &[Source]) -> InputSummary {
    let mut summary = InputSummary::default();
    for frame in sources.iter().flat_map(|source| &source.frames) {
        summary.add(&frame.id, &frame.note);
        for photo in &frame.photographs {
            summary.add(
                &FrameId(format!("{} ({})", frame.id, photo.name)),
                &photo.note,
            );
        }
    }
    summary
}

/// Prints what was done to images when they were read, in one line for each thing.
pub(crate) fn warn_of_inputs(summary: &InputSummary) {
    for line in summary.lines() {
        tracing::warn!("{line}");
    }
}

/// The first question about each frame, in the order of the questions.
pub(crate) fn first_asked(questions: &[Question]) -> Vec<&Question> {
    let mut first = BTreeMap::new();
    for (place, question) in questions.iter().enumerate() {
        first.entry(&question.frame).or_insert((place, question));
    }
    let mut first: Vec<(usize, &Question)> = first.into_values().collect();
    first.sort_by_key(|(place, _)| *place);
    first.into_iter().map(|(_, question)| question).collect()
}

/// The sources of all frames with a question. Each file is read once. So a missing or broken one is found before anything is paid
/// for, and its content enters the keys of its trials.
pub(crate) fn inspect_all(
    dataset: &Dataset,
    questions: &[Question],
    progress: &Progress,
) -> Result<Vec<Source>> {
    let first = first_asked(questions);
    let bar = progress.bar("reading images", first.len());
    first
        .into_par_iter()
        .map(|question| {
            let source = Source::from_questions(dataset, &question.frame).map_err(|e| {
                let problem = format_args!("{e}; --skip bad leaves such questions out");
                Error::data(
                    format_args!("question {:?}", excerpt(&question.id.0, 60)),
                    problem,
                )
            })?;
            bar.inc();
            Ok(source)
        })
        .collect()
}
