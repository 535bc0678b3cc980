//! Colours of objects in all views of a scene: [`Views`].

use std::collections::{BTreeMap, BTreeSet};

use super::colors::{Color, Palette};
use super::rules::RuleBook;
use super::statistics::{FrameStatistics, Segment, WordSource};

/// Colours of each object, by scene, number and word, over all frames that show it well enough.
///
/// Only segments with names can be matched across frames, because the names of a scene belong to its numbers. A connected component has
/// another number in each frame.
#[derive(Debug, Default)]
pub struct Views(BTreeMap<(String, u32, String), BTreeSet<Option<Color>>>);

impl Views {
    /// Collects the colours in these frames; the colour of a view is that of its median.
    pub fn new(frames: &[FrameStatistics], palette: &Palette, book: &RuleBook) -> Self {
        let mut views = Self::default();
        for frame in frames {
            for segment in frame
                .segments
                .iter()
                .filter(|segment| segment.source == WordSource::Name)
                .filter(|segment| segment.core >= book.color.view_px)
            {
                let colors = views.0.entry(Self::key(frame, segment)).or_default();
                colors.insert(palette.color(segment.median));
            }
        }
        views
    }

    fn key(frame: &FrameStatistics, segment: &Segment) -> (String, u32, String) {
        (frame.scene.clone(), segment.id, segment.word.clone())
    }

    /// True if the object has another colour than this one in some view.
    pub fn has_other_color(
        &self,
        frame: &FrameStatistics,
        segment: &Segment,
        color: Color,
    ) -> bool {
        let colors = self.0.get(&Self::key(frame, segment));
        segment.source == WordSource::Name
            && colors.is_some_and(|colors| colors.iter().any(|other| *other != Some(color)))
    }
}
