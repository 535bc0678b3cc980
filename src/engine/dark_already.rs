//! Warnings about images that are dark before any synthetic darkening: [`warn`] and [`print_note`].

use rayon::prelude::*;

use crate::experiment::Experiment;
use crate::images::frames::{Frames, Source, SourceFrame};
use crate::images::progress::Progress;
use crate::settings::JobSettings;
use darkqa_base::types::{AxisLevel, SetLight};
use darkqa_data::Picture;
use darkqa_enhance::{EnhancerArgs, brightness as brightness_in_codes};
use darkqa_light::{LightSettings, mean_luminance};

/// Maximum number of frames to measure; chosen.
const MAX_SAMPLED: usize = 24;

/// Mean luma, from 0 to 255, below which a frame counts as dark. Chosen: a well-lit frame has about 100.
const DARK: f64 = 40.0;

/// Advice on dark images; `None` if they are not dark. `median` is the median of their mean luma, from 0 to 255.
pub fn advice(median: f64) -> Option<String> {
    (median < DARK).then(|| {
        format!(
            "these images are dark already (median brightness {median:.0} of 255); --levels L0 --llie-on l0 asks about them as they are \
             and enhanced, and --light dark does so by default"
        )
    })
}

/// Prints a note if photographs taken in the dark are asked about unchanged, or a warning if they are darkened further.
pub fn print_note(job: &JobSettings, progress: &Progress) {
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

/// Mean linear luminance of up to [`MAX_SAMPLED`] evenly spaced frames, and their number; `None` if none can be
/// decoded.
pub fn brightness(frames: &dyn Frames, sources: &[Source]) -> Option<(f64, usize)> {
    let sample = sample_frames(frames, sources, |picture| Some(mean_luminance(&picture.decode().ok()?)));
    let mean = sample.iter().sum::<f64>() / sample.len() as f64;
    (!sample.is_empty()).then_some((mean, sample.len()))
}

/// Tells whether dark images in a data set are expected.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DarkImages {
    /// The data set is declared as dark, or only L0 is asked, with and without enhancement.
    Expected,
    /// The user may assume that the images are well lit.
    Unexpected,
}

impl DarkImages {
    /// Decides from the declared light of a data set and from the levels and enhancers of the job.
    pub fn new(set: SetLight, light: &LightSettings, enhancers: &EnhancerArgs) -> Self {
        let asks_raw_and_enhanced_l0 =
            light.levels == [AxisLevel::L0] && !enhancers.is_empty() && enhancers.on().includes_kind(None);
        if set == SetLight::Dark || asks_raw_and_enhanced_l0 { Self::Expected } else { Self::Unexpected }
    }
}

/// Warns if the frames of an experiment are dark, unless that is expected ([`DarkImages`]).
pub fn warn<E: Experiment>(experiment: &E) {
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

/// Median of the mean luma, from 0 to 255, of up to [`MAX_SAMPLED`] evenly spaced frames; the upper middle value if
/// their number is even. Skips built-in rooms, which are lit, and files that cannot be decoded, which are reported in
/// their trials. `None` if no frame is left.
fn median_luma(frames: &dyn Frames, sources: &[Source]) -> Option<f64> {
    let mut sample = sample_frames(frames, sources, |picture| match picture {
        Picture::Encoded(_) => Some(brightness_in_codes(&picture.decode().ok()?)),
        Picture::Drawn(..) => None,
    });
    sample.sort_by(f64::total_cmp);
    sample.get(sample.len() / 2).copied()
}

/// Measures up to [`MAX_SAMPLED`] evenly spaced frames. Frames that cannot be read or for which `measure` returns
/// `None` are left out.
fn sample_frames(
    frames: &dyn Frames,
    sources: &[Source],
    measure: impl Fn(&Picture) -> Option<f64> + Sync,
) -> Vec<f64> {
    let all: Vec<&SourceFrame> = sources.iter().flat_map(|source| &source.frames).collect();
    let count = all.len().min(MAX_SAMPLED);
    (0..count)
        .into_par_iter()
        .filter_map(|index| {
            let frame = all[index * all.len() / count];
            measure(&frames.picture(&frame.id).ok()?)
        })
        .collect()
}
