//! Notes about images that a run stores for the report ([`ImageNotes`]), and which of them are missing
//! ([`MissingNotes`]).

use std::collections::BTreeSet;

use crate::images::stored::Similarity;
use darkqa_base::error::Result;
use darkqa_base::types::questions::PixelBox;
use darkqa_base::types::{Condition, FrameId, ImageFidelity, Rgb, Shared, Thumbnail};
use darkqa_pictures::Payload;
use darkqa_runs::missing_thumbnails::MissingThumbnails;
use darkqa_score::answers::record::Detail;
use darkqa_score::photographs::realism::psnr;
use darkqa_score::photographs::realism::ssim::sampled_ssim;
use darkqa_store::Store;

/// The notes about one image; `None` for a note that is not wanted or exists already.
#[derive(Debug, Default)]
pub struct ImageNotes {
    pub thumbnail: Option<Thumbnail>,
    pub fidelity: Option<ImageFidelity>,
}

impl ImageNotes {
    /// Appends the notes to the files of a run.
    pub fn store<D: Detail>(&self, store: &mut Store<D>) -> Result<()> {
        if let Some(thumbnail) = &self.thumbnail {
            store.append_thumbnail(thumbnail)?;
        }
        if let Some(fidelity) = &self.fidelity {
            store.append_fidelity(fidelity)?;
        }
        Ok(())
    }
}

/// The notes that a run folder does not have yet; by default none.
#[derive(Debug, Default)]
pub struct MissingNotes {
    thumbnails: MissingThumbnails,
    /// Images whose fidelity is stored already.
    measured: BTreeSet<(Shared<FrameId>, Shared<Condition>)>,
}

/// Which notes about an image are wanted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct WantedNotes {
    pub thumbnail: bool,
    pub fidelity: bool,
}

impl MissingNotes {
    /// The missing thumbnails, and the fidelity of all images except those `measured` already.
    pub fn new(thumbnails: MissingThumbnails, measured: Vec<ImageFidelity>) -> Self {
        Self { thumbnails, measured: measured.into_iter().map(|image| (image.frame, image.condition)).collect() }
    }

    /// The objects of a frame that the thumbnail crops.
    pub fn objects(&self, frame: &FrameId) -> &[PixelBox] {
        self.thumbnails.objects(frame)
    }

    /// The notes to make about a frame in a condition. The clean frame is not compared with itself.
    pub fn wanted(&self, frame: &FrameId, condition: &Condition) -> WantedNotes {
        // An untouched frame may be dark, so it is no reference for its enhanced image. A photograph in the dark may
        // not be aligned with its frame.
        let has_reference = condition.degradation().is_some();
        let image = (Shared::from(frame.clone()), Shared::from(condition.clone()));
        WantedNotes {
            thumbnail: self.thumbnails.lacks(frame, condition),
            fidelity: has_reference && !self.measured.contains(&image),
        }
    }
}

/// The similarity of an image to its clean frame, both in the size sent.
///
/// # Errors
/// If the sizes differ.
pub(crate) fn similarity(image: &Rgb, clean: &Rgb) -> Result<Similarity> {
    let psnr = psnr(image, clean)?;
    Ok(Similarity {
        psnr: psnr.is_finite().then_some(psnr),
        // An error means that the image is smaller than the SSIM window.
        ssim: sampled_ssim(image, clean).ok(),
    })
}

/// The similarity of an image in the form that a run stores.
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
