//! The pictures of a run: [`Gallery`].

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::progress::Progress;
use crate::dataset::Dataset;
use crate::error::{Error, Result};
use crate::types::{Digest, FrameId, Question};

/// What is known of one picture before it is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Pictured {
    /// Its content.
    pub(super) digest: Digest,
    /// Its width and height, in pixels.
    pub(super) size: (u32, u32),
}

/// The pictures that are asked about, by frame.
pub(super) type Gallery = BTreeMap<FrameId, Pictured>;

/// Reads one image.
pub(super) fn look_at(dataset: &Dataset, frame: &FrameId) -> Result<Pictured> {
    let picture = dataset.picture(frame)?;
    Ok(Pictured {
        size: picture.check()?,
        digest: picture.digest(),
    })
}

/// Reads every image that is asked about once: a missing or broken one is found before anything is paid for, and its
/// content enters the keys of its trials.
pub(super) fn look_through(
    dataset: &Dataset,
    questions: &[Question],
    progress: &Progress,
) -> Result<Gallery> {
    let frames: BTreeMap<&FrameId, &Question> = questions
        .iter()
        .map(|question| (&question.frame, question))
        .collect();
    let bar = progress.bar("reading images", frames.len());
    let pictured = frames.into_par_iter().map(|(frame, question)| {
        let picture = dataset.picture(frame)?;
        let size = picture
            .check()
            .map_err(|e| Error::data(format_args!("question {:?}", question.id.0), e))?;
        bar.inc();
        let digest = picture.digest();
        Ok((frame.clone(), Pictured { digest, size }))
    });
    pictured.collect()
}
