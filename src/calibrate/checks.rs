//! Checks of the frames of a setting. Severe problems are errors, others become notes.

use super::hot_pixels::HotPixels;
use super::mean_frame::MeanFrame;
use super::sums::PairNoise;

/// Maximum share of zeros among the samples of a bias frame (chosen).
const AT_ZERO: f64 = 1e-3;
/// Maximum share of hot pixels (chosen).
const HOT_PIXELS: f64 = 5e-3;
/// Maximum correlation of neighbours in a difference of frames (chosen: smoothing gives 0.5, independent noise 0.004).
const CORRELATION: f64 = 0.02;
/// Maximum variance of a fixed pattern, as a share of the variance of the noise (chosen).
const PATTERN: f64 = 0.2;
/// Minimum number of bias frames to subtract their mean as a fixed pattern (chosen: the mean of fewer frames is too noisy).
const FRAMES_FOR_PATTERN: usize = 16;
/// Limits of the difference between the means of tiles, beyond which bias frames had light: in standard deviations of the noise, and in
/// standard errors (chosen).
const UNEVEN: [f64; 2] = [0.5, 8.0];

/// Checks the codes of a single bias frame.
///
/// # Errors
/// If the negative part of the noise was clipped, or the codes were multiplied.
pub(super) fn codes(samples: &[u16]) -> Result<(), String> {
    let zeros = samples.iter().filter(|sample| **sample == 0).count();
    let share = zeros as f64 / samples.len().max(1) as f64;
    if share > AT_ZERO {
        return Err(format!(
            "{:.1} % of a bias frame are 0: bias frames must keep negative noise; export without subtracting the black level",
            100.0 * share
        ));
    }
    let bits = samples.iter().fold(0, |bits, sample| bits | sample);
    let factor = 1_u32 << bits.trailing_zeros().min(15);
    if factor > 1 {
        return Err(format!(
            "every code is a multiple of {factor}: the codes of the sensor were multiplied, so that rounding and K are in other units; export them as they are, or divide by {factor}"
        ));
    }
    Ok(())
}

/// Checks that the noise of neighbouring sites is independent.
///
/// # Errors
/// If neighbours correlate.
pub(super) fn correlation(correlation: f64) -> Result<(), String> {
    if correlation.abs() > CORRELATION {
        return Err(format!(
            "not raw: the noise of neighbours of one colour correlates by {correlation:.2} in the difference of this frame and its partner (limit {CORRELATION}): the camera, or the export, has smoothed or resized the frames"
        ));
    }
    Ok(())
}

/// Checks on the mean of the bias frames.
#[derive(Debug)]
pub(super) struct BiasCheck {
    pub(super) hot: HotPixels,
    /// Variance of the fixed pattern, as a share of the variance of the noise.
    pattern: f64,
    /// Number of sites.
    sites: usize,
}

impl BiasCheck {
    /// Checks the mean frame; `noise` is the noise of one frame.
    ///
    /// # Errors
    /// If the frames had light or no noise, or too many pixels are hot.
    pub(super) fn new(mean: &MeanFrame, noise: PairNoise) -> Result<Self, String> {
        if noise.within <= 0.0 {
            return Err("bias frames without any noise: copies of one frame?".to_owned());
        }
        let hot = mean.hot_pixels(noise.within);
        let sites = mean.sums.len();
        let share = hot.count() as f64 / sites as f64;
        let uneven = mean.unevenness(&hot, noise);
        let deviation = noise.within.sqrt();
        if uneven.difference > (UNEVEN[0] * deviation).max(UNEVEN[1] * uneven.error) {
            return Err(format!(
                "light on bias frames: the means of parts of one colour differ by {:.2} ADU over the frame, where noise has a deviation of {deviation:.2} ADU; close the lens and the viewfinder, take the shortest exposure",
                uneven.difference
            ));
        }
        if share > HOT_PIXELS {
            return Err(format!(
                "{:.2} % of the pixels are hot (limit {} %): bias frames need the shortest exposure and a cool sensor",
                100.0 * share,
                100.0 * HOT_PIXELS
            ));
        }
        let pattern = mean.pattern(&hot, noise) / (noise.within + noise.row.max(0.0));
        Ok(Self {
            hot,
            pattern,
            sites,
        })
    }

    /// True if the mean of this number of frames is subtracted, because it has a fixed pattern.
    pub(super) fn removes_pattern(&self, frames: usize) -> bool {
        self.pattern > PATTERN && frames >= FRAMES_FOR_PATTERN
    }

    /// Notes on hot pixels and on a fixed pattern, for this number of frames.
    pub(super) fn notes(&self, frames: usize) -> Vec<String> {
        let mut notes = Vec::new();
        if self.hot.count() > 0 {
            notes.push(format!(
                "{} hot pixels ({:.3} %) are left out",
                self.hot.count(),
                100.0 * self.hot.count() as f64 / self.sites as f64
            ));
        }
        if self.pattern > PATTERN {
            let what = format!(
                "a fixed pattern has {:.0} % of the variance of the noise",
                100.0 * self.pattern
            );
            let done = if self.removes_pattern(frames) {
                "the mean of all bias frames is taken off".to_owned()
            } else {
                format!(
                    "σ_TL holds it, too; with {FRAMES_FOR_PATTERN} bias frames or more their mean is taken off"
                )
            };
            notes.push(format!("{what}: {done}; the model has no fixed pattern"));
        }
        notes
    }
}
