//! The rooms that were drawn last, as far as memory is meant for them: [`FrameCache`].
//!
//! A room is drawn where its image is needed and again where its maps are; the second time it is taken from here. The album
//! is bounded in bytes, so that any number of rooms never stands in memory together.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

use crate::error::Result;
use crate::types::Frame;

/// The bytes of the frames that are kept: 24 of 640 × 480 pixels.
const MOST: usize = 104 << 20;

/// The bytes of a pixel: three of colour, four of depth, two of class, four of segment.
const PIXEL: usize = 13;

/// Frames that were drawn last, by their places among all.
#[derive(Debug, Default)]
pub(super) struct FrameCache(Mutex<VecDeque<(usize, Arc<Frame>)>>);

impl FrameCache {
    /// The frame at a place; drawn where it is not kept.
    pub(super) fn frame(
        &self,
        index: usize,
        draw: impl FnOnce() -> Result<Frame>,
    ) -> Result<Arc<Frame>> {
        if let Some(kept) = self.kept(index) {
            return Ok(kept);
        }
        let frame = Arc::new(draw()?);
        let bytes = frame.rgb.height() * frame.rgb.width() * PIXEL;
        let mut frames = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        frames.push_back((index, Arc::clone(&frame)));
        while frames.len() * bytes > MOST && frames.len() > 1 {
            frames.pop_front();
        }
        Ok(frame)
    }

    fn kept(&self, index: usize) -> Option<Arc<Frame>> {
        let frames = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let found = frames.iter().find(|(place, _)| *place == index);
        found.map(|(_, frame)| Arc::clone(frame))
    }
}
