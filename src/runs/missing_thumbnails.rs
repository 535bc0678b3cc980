//! Thumbnails that a run folder lacks: [`MissingThumbnails`].

use std::collections::{BTreeMap, BTreeSet};

use darkqa_base::types::questions::PixelBox;
use darkqa_base::types::{Condition, Digest, FrameId, RunQuestion, Thumbnail};

/// Maximum number of frames with thumbnails. Chosen to keep the report of a large run small.
const MAX_FRAMES: usize = 48;
/// Maximum number of object crops per frame. Chosen so that the page has room for many frames.
const MAX_OBJECTS: usize = 3;

/// Thumbnails that a run folder does not have yet.
#[derive(Debug, Default)]
pub struct MissingThumbnails {
    frames: BTreeSet<FrameId>,
    objects: BTreeMap<FrameId, Vec<PixelBox>>,
    present: BTreeSet<(FrameId, Condition)>,
}

impl MissingThumbnails {
    /// Thumbnails of `frames`, less those already `present`. Of more than [`MAX_FRAMES`] frames, those with the lowest
    /// digests are kept, so that the choice does not depend on order or shards.
    pub fn new<'a>(frames: impl IntoIterator<Item = &'a FrameId>, present: Vec<Thumbnail>) -> Self {
        let frames: BTreeSet<&FrameId> = frames.into_iter().collect();
        let mut ranked: Vec<&FrameId> = frames.into_iter().collect();
        ranked.sort_by_cached_key(|frame| *Digest::from_bytes(frame.0.as_bytes()).as_bytes());
        Self {
            frames: ranked.into_iter().take(MAX_FRAMES).cloned().collect(),
            objects: BTreeMap::new(),
            present: present.into_iter().map(|thumbnail| (thumbnail.frame, thumbnail.condition)).collect(),
        }
    }

    /// Adds crops of the objects that these questions are about, for the first [`MAX_OBJECTS`] objects of each frame.
    #[must_use]
    pub fn with_objects<'a>(mut self, questions: impl IntoIterator<Item = &'a RunQuestion>) -> Self {
        for question in questions {
            let Some(object) = question.object().filter(|_| self.wants(&question.frame)) else {
                continue;
            };
            let objects = self.objects.entry(question.frame.clone()).or_default();
            if objects.len() < MAX_OBJECTS && !objects.contains(&object) {
                objects.push(object);
            }
        }
        self
    }

    /// Objects to crop from a frame.
    pub fn objects(&self, frame: &FrameId) -> &[PixelBox] {
        self.objects.get(frame).map_or(&[], Vec::as_slice)
    }

    /// True if a frame has thumbnails in the report.
    pub fn wants(&self, frame: &FrameId) -> bool {
        self.frames.contains(frame)
    }

    /// True if the thumbnail of a frame in a condition is wanted and missing.
    pub fn lacks(&self, frame: &FrameId, condition: &Condition) -> bool {
        self.wants(frame) && !self.present.contains(&(frame.clone(), condition.clone()))
    }
}
