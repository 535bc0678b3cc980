//! Notes about images that a run stores for the report ([`ImageNotes`]), and those still missing ([`MissingNotes`]).

use std::collections::BTreeSet;

use crate::error::Result;
use crate::images::notes::thumbnail::MissingThumbnails;
use crate::images::stored::Similarity;
use crate::picture::Payload;
use crate::store::Store;
use crate::types::questions::PixelBox;
use crate::types::{Condition, FrameId, ImageFidelity, Rgb, Shared, Thumbnail};
use darkqa_score::answers::record::Detail;
use darkqa_score::photographs::realism::psnr;
use darkqa_score::photographs::realism::ssim::ssim;

/// The notes about one image; `None` for what is not wanted or exists already.
#[derive(Debug, Default)]
pub(crate) struct ImageNotes {
    pub(crate) thumbnail: Option<Thumbnail>,
    pub(crate) fidelity: Option<ImageFidelity>,
}

impl ImageNotes {
    /// Appends the notes to the files of a run.
    pub(crate) fn store<D: Detail>(&self, store: &mut Store<D>) -> Result<()> {
        if let Some(thumbnail) = &self.thumbnail {
            store.append_thumbnail(thumbnail)?;
        }
        if let Some(fidelity) = &self.fidelity {
            store.append_fidelity(fidelity)?;
        }
        Ok(())
    }
}

/// The notes that a run folder does not have yet; by default none are wanted.
#[derive(Debug, Default)]
pub(crate) struct MissingNotes {
    thumbnails: MissingThumbnails,
    measured: BTreeSet<(Shared<FrameId>, Shared<Condition>)>,
}

/// Which notes about an image are wanted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct WantedNotes {
    pub(crate) thumbnail: bool,
    pub(crate) fidelity: bool,
}

impl MissingNotes {
    /// The notes that are missing beside those `measured` already.
    pub(crate) fn new(thumbnails: MissingThumbnails, measured: Vec<ImageFidelity>) -> Self {
        let measured = measured.into_iter();
        Self {
            thumbnails,
            measured: measured
                .map(|image| (image.frame, image.condition))
                .collect(),
        }
    }

    /// The things of a frame that have crops.
    pub(crate) fn objects(&self, frame: &FrameId) -> &[PixelBox] {
        self.thumbnails.objects(frame)
    }

    /// The notes that are wanted about a frame in a condition. The clean frame is not compared with itself.
    pub(crate) fn wanted(&self, frame: &FrameId, condition: &Condition) -> WantedNotes {
        let is_measured = || {
            let image = (Shared::from(frame.clone()), Shared::from(condition.clone()));
            self.measured.contains(&image)
        };
        // An untouched frame may be dark itself, so that it is no reference for its enhanced image; a photograph in the dark need not
        // be aligned with its frame.
        let has_reference = condition.degradation().is_some();
        WantedNotes {
            thumbnail: self.thumbnails.lacks(frame, condition),
            fidelity: has_reference && !is_measured(),
        }
    }
}

/// The similarity of an image to its clean frame, both in the size sent.
///
/// # Errors
/// If the sizes differ.
pub(crate) fn similarity([image, clean]: [&Rgb; 2]) -> Result<Similarity> {
    let psnr = psnr(image, clean)?;
    Ok(Similarity {
        psnr: psnr.is_finite().then_some(psnr),
        // An error means that the image is smaller than the window.
        ssim: ssim(image, clean).ok(),
    })
}

/// The similarity of an image as a run stores it.
pub(crate) fn fidelity(
    frame: &FrameId,
    condition: &Condition,
    sent: &Payload,
    similarity: Similarity,
) -> ImageFidelity {
    ImageFidelity {
        frame: Shared::from(frame.clone()),
        condition: Shared::from(condition.clone()),
        image: sent.facts().digest,
        psnr: similarity.psnr,
        ssim: similarity.ssim,
    }
}
