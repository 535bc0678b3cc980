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
const MAX_SAMPLED: usize = 24;

/// Mean luma, from 0 to 255, below which a frame is dark. Chosen: a well-lit frame has about 100.
const DARK: f64 = 40.0;

/// Advice for images whose mean luma, from 0 to 255, has this median; `None` if they are not dark.
pub(crate) fn advice(median: f64) -> Option<String> {
    (median < DARK).then(|| {
        format!(
            "these images are dark already (median brightness {median:.0} of 255); --levels L0 --llie-on l0 asks about them as they are \
             and enhanced, and --light dark does so by default"
        )
    })
}

/// Prints a note about photographs taken in the dark if they are asked as they are, or a warning if they are darkened further.
pub(crate) fn print_note(job: &JobSettings, progress: &Progress) {
    if job.set_light == SetLight::Lit {
        return;
    }
    if job.light.levels == [AxisLevel::L0] {
        progress.print_on_terminal(
            "photographed in the dark: asked as photographed (L0); synthetic levels would add to noise that is in the photographs already, so --levels must name them",
        );
    } else {
        tracing::warn!(
            "the photographs were taken in the dark, and --levels darkens them further: their own noise is in them already, so a level is \
             darker and noisier than its name says, and L0 is not an image in the light"
        );
    }
}

/// Mean linear luminance of up to [`MAX_SAMPLED`] evenly spaced frames, and their number; `None` if none can be decoded.
pub(crate) fn brightness(frames: &dyn Frames, sources: &[Source]) -> Option<(f64, usize)> {
    let sample = sample_frames(frames, sources, |picture| {
        Some(mean_luminance(&picture.decode().ok()?))
    });
    let mean = sample.iter().sum::<f64>() / sample.len() as f64;
    (!sample.is_empty()).then_some((mean, sample.len()))
}

/// Tells whether dark images in a data set are expected.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum DarkImages {
    /// The data set is declared as dark, or its images are asked undarkened only, both raw and enhanced.
    Expected,
    /// The user may take the images for well-lit ones.
    Unexpected,
}

impl DarkImages {
    /// Judges a data set by its declared light, and by the levels and enhancers that it is asked with.
    pub(crate) fn new(set: SetLight, light: &LightSettings, enhancers: &EnhancerArgs) -> Self {
        let is_undarkened_only = light.levels == [AxisLevel::L0]
            && !enhancers.is_empty()
            && enhancers.on().includes_kind(None);
        if set == SetLight::Dark || is_undarkened_only {
            Self::Expected
        } else {
            Self::Unexpected
        }
    }
}

/// Warns if the frames of an experiment are dark, unless that is expected ([`DarkImages`]).
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

/// Median over up to [`MAX_SAMPLED`] evenly spaced frames of their mean luma, from 0 to 255; of an even number the upper middle value.
/// Built-in rooms are skipped, because they are lit, and so are files that cannot be decoded, which their trials report. `None` if no
/// frame is left.
fn median_luma(frames: &dyn Frames, sources: &[Source]) -> Option<f64> {
    let mut sample = sample_frames(frames, sources, |picture| match picture {
        Picture::Encoded(_) => Some(brightness_in_codes(&picture.decode().ok()?)),
        Picture::Drawn(..) => None,
    });
    sample.sort_by(f64::total_cmp);
    sample.get(sample.len() / 2).copied()
}

/// Measures up to [`MAX_SAMPLED`] evenly spaced frames. Frames that cannot be read or for which `measure` returns `None` are left out.
fn sample_frames(
    frames: &dyn Frames,
    sources: &[Source],
    measure: impl Fn(&Picture) -> Option<f64> + Sync,
) -> Vec<f64> {
    let all: Vec<&SourceFrame> = sources.iter().flat_map(|source| &source.frames).collect();
    let number = all.len().min(MAX_SAMPLED);
    (0..number)
        .into_par_iter()
        .filter_map(|index| {
            let frame = all[index * all.len() / number];
            measure(&frames.picture(&frame.id).ok()?)
        })
        .collect()
}
