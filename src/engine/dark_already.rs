//! Frames that are dark before their light is reduced: [`warn`].

use rayon::prelude::*;

use crate::dataset::Picture;
use crate::engine::experiment::Experiment;
use crate::engine::settings::JobSettings;
use crate::images::frames::{Frames, Source, SourceFrame};
use crate::images::progress::Progress;
use crate::types::{AxisLevel, SetLight};
use darkqa_enhance::{EnhancerArgs, brightness as brightness_in_codes};
use darkqa_light::{LightSettings, mean_luminance};

/// Maximum number of frames that are measured; chosen.
const SAMPLED: usize = 24;

/// Mean luma, of 255, below which a frame is dark. Chosen: a well-lit frame has about 100.
const DARK: f64 = 40.0;

/// Advice for images with this median of the mean luma, of 255; `None` if they are not dark.
pub(crate) fn advice(median: f64) -> Option<String> {
    (median < DARK).then(|| {
        format!(
            "these images are dark already (median brightness {median:.0} of 255); --levels L0 --llie-on l0 asks about them as they are \
             and enhanced, and --light dark does so by default"
        )
    })
}

/// Prints what a set in the dark is asked by default, and why, or what is odd about the levels that are named.
pub(crate) fn tell(job: &JobSettings, progress: &Progress) {
    if job.set_light == SetLight::Lit {
        return;
    }
    if job.light.levels == [AxisLevel::L0] {
        progress.say(
            "photographed in the dark: asked as photographed (L0); synthetic levels would add to noise that is in the photographs already, so --levels must name them",
        );
    } else {
        tracing::warn!(
            "the photographs were taken in the dark, and --levels darkens them further: their own noise is in them already, so a level is \
             darker and noisier than its name says, and L0 is not an image in the light"
        );
    }
}

/// Mean linear luminance of up to [`SAMPLED`] frames, evenly spread, and their number; `None` without frames that can be decoded.
pub(crate) fn brightness(frames: &dyn Frames, sources: &[Source]) -> Option<(f64, usize)> {
    let sample = sampled(frames, sources, |picture| {
        Some(mean_luminance(&picture.decode().ok()?))
    });
    let mean = sample.iter().sum::<f64>() / sample.len() as f64;
    (!sample.is_empty()).then_some((mean, sample.len()))
}

/// Whether dark images are expected of a set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum DarkImages {
    /// They are said to be, or they are asked about as they are, raw and enhanced, and no others are.
    Expected,
    /// They may not be what the user takes them for.
    Odd,
}

impl DarkImages {
    /// For a set in this light, asked with these levels and enhancers.
    pub(crate) fn new(set: SetLight, light: &LightSettings, enhancers: &EnhancerArgs) -> Self {
        let as_they_are = light.levels == [AxisLevel::L0]
            && !enhancers.is_empty()
            && enhancers.on().includes(None);
        if set == SetLight::Dark || as_they_are {
            Self::Expected
        } else {
            Self::Odd
        }
    }
}

/// Warns if the frames of an experiment are dark already, and it does more than to ask about them as they are and enhanced.
pub(crate) fn warn<E: Experiment>(experiment: &E) {
    let settings = experiment.settings();
    let dark = DarkImages::new(settings.set_light, &settings.light, &settings.enhancers);
    if dark == DarkImages::Expected {
        return;
    }
    let median = median_luma(experiment.frames(), experiment.sources());
    if let Some(advice) = median.and_then(advice) {
        tracing::warn!("{advice}");
    }
}

/// The median of the mean luma of up to [`SAMPLED`] frames, evenly spread; the upper of two. `None` without frames in files. Built-in
/// rooms are lit. A file that cannot be decoded is left out: the trial that needs its image states it.
fn median_luma(frames: &dyn Frames, sources: &[Source]) -> Option<f64> {
    let mut sample = sampled(frames, sources, |picture| match picture {
        Picture::Encoded(_) => Some(brightness_in_codes(&picture.decode().ok()?)),
        Picture::Drawn(..) => None,
    });
    sample.sort_by(f64::total_cmp);
    sample.get(sample.len() / 2).copied()
}

/// A number of up to [`SAMPLED`] frames that have one, evenly spread.
fn sampled(
    frames: &dyn Frames,
    sources: &[Source],
    of: impl Fn(&Picture) -> Option<f64> + Sync,
) -> Vec<f64> {
    let all: Vec<&SourceFrame> = sources.iter().flat_map(|source| &source.frames).collect();
    let number = all.len().min(SAMPLED);
    (0..number)
        .into_par_iter()
        .filter_map(|index| {
            let frame = all[index * all.len() / number];
            of(&frames.picture(&frame.id).ok()?)
        })
        .collect()
}
