//! Frames that are dark before their light is reduced: [`warn`].

use rayon::prelude::*;

use super::experiment::Experiment;
use super::settings::JobSettings;
use super::source::{Frames, Source, SourceFrame};
use crate::dataset::Picture;
use crate::enhance::brightness;
use crate::types::AxisLevel;

/// Maximum number of frames that are measured; chosen.
const SAMPLED: usize = 24;

/// Mean luma, of 255, below which a frame is dark. Chosen: a well-lit frame has about 100.
const DARK: f64 = 40.0;

/// Warns if the frames of an experiment are dark already, and it does more than to ask about them as they are and enhanced.
pub(super) fn warn<E: Experiment>(experiment: &E) {
    if asks_as_they_are(experiment.settings()) {
        return;
    }
    let median = median_luma(experiment.frames(), experiment.sources());
    if let Some(luma) = median.filter(|luma| *luma < DARK) {
        tracing::warn!(
            "these images are dark already (median brightness {luma:.0} of 255); --levels L0 --llie-on l0 asks about them as they are \
             and enhanced"
        );
    }
}

/// Whether the untouched images are asked about raw and enhanced, and no others.
fn asks_as_they_are(settings: &JobSettings) -> bool {
    let enhancers = &settings.enhancers;
    settings.light.levels == [AxisLevel::L0]
        && !enhancers.llie.is_empty()
        && enhancers.llie_on.includes(None)
}

/// The median of the mean luma of up to [`SAMPLED`] frames, evenly spread; the upper of two. `None` without frames in files. Built-in
/// rooms are lit. A file that cannot be decoded is left out: the trial that needs its image says so.
fn median_luma(frames: &dyn Frames, sources: &[Source]) -> Option<f64> {
    let all: Vec<&SourceFrame> = sources.iter().flat_map(|source| &source.frames).collect();
    let number = all.len().min(SAMPLED);
    let sample = (0..number).into_par_iter().filter_map(|index| {
        let frame = all[index * all.len() / number];
        let picture = frames.picture(&frame.id).ok()?;
        match picture {
            Picture::Encoded(_) => Some(brightness(&picture.decode().ok()?)),
            Picture::Drawn(..) => None,
        }
    });
    let mut sample: Vec<f64> = sample.collect();
    sample.sort_by(f64::total_cmp);
    sample.get(sample.len() / 2).copied()
}
