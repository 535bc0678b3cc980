//! The number of frames in a report, in words: [`frames`].

use std::collections::BTreeMap;

use crate::types::text::counted;
use crate::types::{FrameId, SentImages};
use darkqa_score::grid::Grid;

/// The number of frames that were asked about, as `3 frames (2 of 2 to 4 images)` if some questions show several
/// images.
pub(crate) fn frames(grid: &Grid<'_>) -> String {
    let mut images = BTreeMap::<&FrameId, usize>::new();
    for (place, item) in grid.items.iter().enumerate() {
        let counts = (0..grid.subjects.len())
            .filter_map(|subject| grid.trial(subject, place))
            .map(|trial| trial.images().map_or(0, SentImages::count));
        let most = images.entry(&*item.asked.frame).or_default();
        *most = counts.max().unwrap_or(0).max(*most);
    }
    let frames = counted(images.len(), "frame");
    let several: Vec<usize> = images.into_values().filter(|images| *images > 1).collect();
    match (several.iter().min(), several.iter().max()) {
        (Some(least), Some(most)) if least == most => {
            format!("{frames} ({} of {most} images)", several.len())
        }
        (Some(least), Some(most)) => {
            format!("{frames} ({} of {least} to {most} images)", several.len())
        }
        _ => frames,
    }
}
