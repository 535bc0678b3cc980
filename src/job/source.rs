//! The frames that are shown together: [`Source`], read once before anything is asked.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::progress::Progress;
use crate::dataset::{Dataset, Picture};
use crate::error::{Error, Result};
use crate::types::{Digest, FrameId, InputNote, InputSummary, Question};

/// A reader of frames' files.
pub(crate) trait Frames: Sync {
    /// The file of a frame, which is not decoded.
    fn picture(&self, frame: &FrameId) -> Result<Picture>;

    /// The focal length of a frame along a row, in pixels of its image; `None` if it is not known.
    fn focal(&self, frame: &FrameId) -> Option<f64>;
}

impl Frames for Dataset {
    fn picture(&self, frame: &FrameId) -> Result<Picture> {
        self.picture(frame)
    }

    fn focal(&self, frame: &FrameId) -> Option<f64> {
        self.focal(frame)
    }
}

/// One frame of a source.
#[derive(Debug, Clone)]
pub(crate) struct SourceFrame {
    /// Name of the frame. Its noise is drawn from it.
    pub(crate) id: FrameId,
    /// Digest of the file and of the rule by which it is read.
    pub(crate) digest: Digest,
    /// What reading the file does besides taking its codes.
    pub(crate) note: InputNote,
    /// Width and height, in pixels.
    pub(crate) size: (u32, u32),
    /// Focal length along a row, in pixels; `None` if it is not known.
    pub(crate) focal: Option<f64>,
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
        })
    }
}

/// The frames that are shown together: one frame, or those of a walk.
#[derive(Debug)]
pub(crate) struct Source {
    /// Name of the frame or of the walk.
    pub(crate) name: FrameId,
    /// Each of its frames once; none if only blind models are asked, or it cannot be shown.
    pub(crate) frames: Vec<SourceFrame>,
    /// Indices into `frames`, in the order shown. A frame is repeated if a walk has fewer frames than are shown.
    pub(crate) order: Vec<usize>,
    /// Reason why it cannot be shown; `None` if it can.
    pub(crate) problem: Option<String>,
}

impl Source {
    /// A source of a single frame.
    pub(crate) fn of_frame(frame: SourceFrame) -> Self {
        Self {
            name: frame.id.clone(),
            frames: vec![frame],
            order: vec![0],
            problem: None,
        }
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

    /// The frame in the middle, or the only one; `None` without frames.
    pub(crate) fn middle(&self) -> Option<&SourceFrame> {
        self.frames.get(self.frames.len() / 2)
    }

    /// The digest of all frames in the order shown; for a single frame, that of its file.
    pub(crate) fn digest(&self) -> Digest {
        let shown = self.order.iter().map(|index| &self.frames[*index].digest);
        let digests: Vec<&Digest> = shown.collect();
        match digests[..] {
            [only] => *only,
            _ => Digest::of_parts(digests.iter().map(|digest| &digest.as_bytes()[..])),
        }
    }
}

/// What was done to the frames of these sources when they were read.
pub(crate) fn input_summary(sources: &[Source]) -> InputSummary {
    let mut summary = InputSummary::default();
    for frame in sources.iter().flat_map(|source| &source.frames) {
        summary.add(&frame.id, &frame.note);
    }
    summary
}

/// Says what was done to images when they were read, in one line for each thing.
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
    let sources = first.into_par_iter().map(|question| {
        let frame = SourceFrame::inspect(dataset, &question.frame)
            .map_err(|e| Error::data(format_args!("question {:?}", question.id.0), e))?;
        bar.inc();
        Ok(Source::of_frame(frame))
    });
    sources.collect()
}
