//! Colours of objects in all views of a scene: [`Views`].

use std::collections::{BTreeMap, BTreeSet};

use super::colors::{Color, Palette};
use super::rules::RuleBook;
use super::statistics::{FrameStatistics, Segment, WordSource};

/// Colours of each object in all frames that show at least `color.view_px` core pixels, by scene, segment id and word.
/// A colour is `None` if the palette has no name for it.
///
/// Only segments with names are matched across frames: their ids are the same in all frames of a scene. A connected
/// component has a different id in each frame.
#[derive(Debug, Default)]
pub struct Views(BTreeMap<(String, u32, String), BTreeSet<Option<Color>>>);

impl Views {
    /// Collects the colour of the median of each named segment in these frames.
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

    /// True if any view of a named object has a colour other than `color`; `None` counts as another colour. False for
    /// segments without names.
    pub fn has_other_color(&self, frame: &FrameStatistics, segment: &Segment, color: Color) -> bool {
        let colors = self.0.get(&Self::key(frame, segment));
        segment.source == WordSource::Name
            && colors.is_some_and(|colors| colors.iter().any(|other| *other != Some(color)))
    }
}
