//! What is shown together: [`Source`], read once before anything is asked.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::progress::Progress;
use crate::dataset::{Dataset, Picture};
use crate::error::{Error, Result};
use crate::types::{Digest, FrameId, Question};

/// Where the files of frames come from.
pub(crate) trait Frames: Sync {
    /// The file of a frame, not yet decoded.
    fn picture(&self, frame: &FrameId) -> Result<Picture>;
}

impl Frames for Dataset {
    fn picture(&self, frame: &FrameId) -> Result<Picture> {
        self.picture(frame)
    }
}

/// One frame of a source.
#[derive(Debug, Clone)]
pub(crate) struct SourceFrame {
    /// Its name, which its noise is drawn from.
    pub(crate) id: FrameId,
    /// The digest of its file.
    pub(crate) digest: Digest,
    /// Its width and height, in pixels.
    pub(crate) size: (u32, u32),
}

impl SourceFrame {
    /// Reads a frame's file and checks that it is an image.
    pub(crate) fn inspect(frames: &dyn Frames, id: &FrameId) -> Result<Self> {
        let picture = frames.picture(id)?;
        Ok(Self {
            id: id.clone(),
            size: picture.check()?,
            digest: picture.digest(),
        })
    }
}

/// What is shown together: one frame, or the frames of a walk.
#[derive(Debug)]
pub(crate) struct Source {
    /// The name of the frame or of the walk.
    pub(crate) name: FrameId,
    /// Each of its frames once; none if nobody sees it or it cannot be shown.
    pub(crate) frames: Vec<SourceFrame>,
    /// Which of them is shown at each place: one more than once if a walk has fewer frames than are shown.
    pub(crate) order: Vec<usize>,
    /// Why it cannot be shown; `None` if it can.
    pub(crate) problem: Option<String>,
}

impl Source {
    /// A frame alone.
    pub(crate) fn of_frame(frame: SourceFrame) -> Self {
        Self {
            name: frame.id.clone(),
            frames: vec![frame],
            order: vec![0],
            problem: None,
        }
    }

    /// A source that nobody sees.
    pub(crate) fn unseen(name: FrameId) -> Self {
        Self {
            name,
            frames: Vec::new(),
            order: Vec::new(),
            problem: None,
        }
    }

    /// The frame in the middle of a walk; the only one of a frame.
    pub(crate) fn middle(&self) -> Option<&SourceFrame> {
        self.frames.get(self.frames.len() / 2)
    }

    /// The digest of each frame shown, in the order shown.
    pub(crate) fn digest(&self) -> Digest {
        let shown = self.order.iter().map(|place| &self.frames[*place].digest);
        let digests: Vec<&Digest> = shown.collect();
        match digests[..] {
            [only] => *only,
            _ => Digest::of_parts(digests.iter().map(|digest| &digest.as_bytes()[..])),
        }
    }
}

/// The frames that questions are about, in the order in which they are first asked about.
pub(crate) fn first_asked(questions: &[Question]) -> Vec<&Question> {
    let mut seen = BTreeMap::new();
    for (place, question) in questions.iter().enumerate() {
        seen.entry(&question.frame).or_insert((place, question));
    }
    let mut first: Vec<(usize, &Question)> = seen.into_values().collect();
    first.sort_by_key(|(place, _)| *place);
    first.into_iter().map(|(_, question)| question).collect()
}

/// Reads every image that is asked about once: a missing or broken one is found before anything is paid for, and its content
/// enters the keys of its trials.
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
