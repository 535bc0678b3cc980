//! A cache of the frames that were drawn last: [`FrameCache`].
//!
//! A frame is needed once for its image and again for its maps. The second time it comes from this cache. The size of the
//! cache is limited, so that a large number of rooms does not fill the memory.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

use crate::error::Result;
use crate::types::Frame;

/// The maximum size of the cache in bytes: 24 frames of 640 × 480 pixels (chosen).
const MAX_BYTES: usize = 104 << 20;

/// The bytes per pixel: three for colour, four for depth, two for the class, four for the segment.
const BYTES_PER_PIXEL: usize = 13;

/// The frames that were drawn last, by their indices.
#[derive(Debug, Default)]
pub(super) struct FrameCache(Mutex<VecDeque<(usize, Arc<Frame>)>>);

impl FrameCache {
    /// The frame with an index; `draw` makes it if it is not in the cache.
    pub(super) fn frame(
        &self,
        index: usize,
        draw: impl FnOnce() -> Result<Frame>,
    ) -> Result<Arc<Frame>> {
        if let Some(cached) = self.cached(index) {
            return Ok(cached);
        }
        let frame = Arc::new(draw()?);
        let bytes = frame.rgb.height() * frame.rgb.width() * BYTES_PER_PIXEL;
        let mut frames = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        frames.push_back((index, Arc::clone(&frame)));
        while frames.len() * bytes > MAX_BYTES && frames.len() > 1 {
            frames.pop_front();
        }
        Ok(frame)
    }

    fn cached(&self, index: usize) -> Option<Arc<Frame>> {
        let frames = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let found = frames.iter().find(|(place, _)| *place == index);
        found.map(|(_, frame)| Arc::clone(frame))
    }
}
