//! [`SentImages`]: the images sent with a question.

use std::hash::{Hash, Hasher};

use crate::types::degradations::PairFacts;
use crate::types::{ChoiceDetail, Digest, FrameId};

/// Facts about the images sent in one request.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SentImages {
    /// The digest of the first image file.
    pub first: Digest,
    /// The number of files and the digest of all, if there are several.
    several: Option<Box<(usize, Digest)>>,
    /// The size of all files in bytes.
    pub bytes: u64,
    /// The width and the height of the first image, in pixels.
    pub size: [u32; 2],
    /// How dark the photograph of the frame is; only for images of a pair, which are as dark as the photograph.
    pub pair: Option<Box<PairFacts>>,
    /// The frame that was shown, if it differs from that of the question.
    pub(super) shown_frame: Option<FrameId>,
}

impl SentImages {
    /// The images of a record; `None` without images.
    pub(super) fn from_detail(detail: &ChoiceDetail) -> Option<Self> {
        let first = detail.image.as_ref()?;
        let count = detail.images().count();
        let all = detail.file_digest().filter(|_| count > 1);
        Some(Self {
            first: first.digest,
            several: all.map(|all| Box::new((count, all))),
            bytes: detail.images().map(|image| image.bytes as u64).sum(),
            size: [first.width, first.height].map(|side| side as u32),
            pair: first.pair.map(Box::new),
            shown_frame: detail.shown_frame.clone(),
        })
    }

    /// The number of files.
    #[must_use]
    pub fn count(&self) -> usize {
        self.several.as_ref().map_or(1, |several| several.0)
    }

    /// The digest of the file, or of all files in order.
    #[must_use]
    pub fn digest(&self) -> Digest {
        self.several.as_ref().map_or(self.first, |several| several.1)
    }
}

/// Hashes the first file only: equal images have equal first files.
impl Hash for SentImages {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.first.hash(state);
    }
}
