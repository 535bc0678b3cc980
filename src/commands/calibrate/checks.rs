//! Plausibility checks of the calibration frames of one camera setting: severe problems are errors, others become
//! notes.

use super::hot_pixels::HotPixels;
use super::mean_frame::MeanFrame;
use super::sums::PairNoise;

/// Maximum share of zeros among the samples of a bias frame (heuristic).
const MAX_ZERO_SHARE: f64 = 1e-3;
/// Maximum share of hot pixels (heuristic).
const MAX_HOT_SHARE: f64 = 5e-3;
/// Maximum correlation of neighbours in the difference of two frames (heuristic: smoothing gives 0.5, independent noise
/// 0.004).
const MAX_CORRELATION: f64 = 0.02;
/// Maximum variance of a fixed pattern, relative to the noise variance (heuristic).
const MAX_PATTERN_SHARE: f64 = 0.2;
/// Minimum number of bias frames whose mean may be subtracted as the fixed pattern (heuristic: the mean of fewer frames
/// is too noisy).
const MIN_PATTERN_FRAMES: usize = 16;
/// Maximum difference between tile means of a bias frame, in standard deviations of the noise (heuristic). A difference
/// beyond both this limit and [`MAX_TILE_ERRORS`] means that light reached the sensor.
const MAX_TILE_DEVIATIONS: f64 = 0.5;
/// Maximum difference between tile means of a bias frame, in standard errors (heuristic).
const MAX_TILE_ERRORS: f64 = 8.0;

/// Checks the raw codes of a single bias frame.
///
/// # Errors
/// If negative noise was clipped to 0, or the codes were scaled by a power of two.
pub(super) fn codes(samples: &[u16]) -> Result<(), String> {
    let zeros = samples.iter().filter(|sample| **sample == 0).count();
    let share = zeros as f64 / samples.len().max(1) as f64;
    if share > MAX_ZERO_SHARE {
        return Err(format!(
            "{:.1} % of a bias frame are 0: bias frames must keep negative noise; export without subtracting the black level",
            100.0 * share
        ));
    }
    // Trailing zero bits that all codes share come from scaling, such as 12-bit codes in a 16-bit range.
    let bits = samples.iter().fold(0, |bits, sample| bits | sample);
    let factor = 1_u32 << bits.trailing_zeros().min(15);
    if factor > 1 {
        return Err(format!(
            "every code is a multiple of {factor}: the codes of the sensor were multiplied, so that rounding and K are in other units; export them as they are, or divide by {factor}"
        ));
    }
    Ok(())
}

/// Checks that neighbouring sites of one colour have independent noise, given their correlation in the difference of
/// two frames.
///
/// # Errors
/// If the correlation exceeds its limit: the frames were smoothed or resized.
pub(super) fn correlation(correlation: f64) -> Result<(), String> {
    if correlation.abs() > MAX_CORRELATION {
        return Err(format!(
            "not raw: the noise of neighbours of one colour correlates by {correlation:.2} in the difference of this frame and its partner (limit {MAX_CORRELATION}): the camera, or the export, has smoothed or resized the frames"
        ));
    }
    Ok(())
}

/// Hot pixels and fixed pattern in the mean of the bias frames.
#[derive(Debug)]
pub(super) struct BiasCheck {
    pub(super) hot: HotPixels,
    /// Variance of the fixed pattern, relative to the noise variance.
    pattern_share: f64,
    /// Number of sites in the mean frame.
    sites: usize,
}

impl BiasCheck {
    /// Checks the mean frame, given the noise variances of a single frame in ADU².
    ///
    /// # Errors
    /// If the frames have no noise, light reached the sensor, or too many pixels are hot.
    pub(super) fn new(mean: &MeanFrame, noise: PairNoise) -> Result<Self, String> {
        if noise.within <= 0.0 {
            return Err("bias frames without any noise: copies of one frame?".to_owned());
        }
        let hot = mean.hot_pixels(noise.within);
        let sites = mean.sums.len();
        let hot_share = hot.count() as f64 / sites as f64;
        let uneven = mean.unevenness(&hot, noise);
        let deviation = noise.within.sqrt();
        if uneven.difference > (MAX_TILE_DEVIATIONS * deviation).max(MAX_TILE_ERRORS * uneven.error) {
            return Err(format!(
                "light on bias frames: the means of parts of one colour differ by {:.2} ADU over the frame, where noise has a deviation of {deviation:.2} ADU; close the lens and the viewfinder, take the shortest exposure",
                uneven.difference
            ));
        }
        if hot_share > MAX_HOT_SHARE {
            return Err(format!(
                "{:.2} % of the pixels are hot (limit {} %): bias frames need the shortest exposure and a cool sensor",
                100.0 * hot_share,
                100.0 * MAX_HOT_SHARE
            ));
        }
        let pattern_share = mean.pattern(&hot, noise) / (noise.within + noise.row.max(0.0));
        Ok(Self { hot, pattern_share, sites })
    }

    /// True if the mean of `frames` bias frames is subtracted: the fixed pattern is strong, and the frames suffice to
    /// measure it.
    pub(super) fn removes_pattern(&self, frames: usize) -> bool {
        self.pattern_share > MAX_PATTERN_SHARE && frames >= MIN_PATTERN_FRAMES
    }

    /// Notes on hot pixels and the fixed pattern, for `frames` bias frames.
    pub(super) fn notes(&self, frames: usize) -> Vec<String> {
        let mut notes = Vec::new();
        if self.hot.count() > 0 {
            notes.push(format!(
                "{} hot pixels ({:.3} %) are left out",
                self.hot.count(),
                100.0 * self.hot.count() as f64 / self.sites as f64
            ));
        }
        if self.pattern_share > MAX_PATTERN_SHARE {
            let finding =
                format!("a fixed pattern has {:.0} % of the variance of the noise", 100.0 * self.pattern_share);
            let treatment = if self.removes_pattern(frames) {
                "the mean of all bias frames is taken off".to_owned()
            } else {
                format!("σ_TL holds it, too; with {MIN_PATTERN_FRAMES} bias frames or more their mean is taken off")
            };
            notes.push(format!("{finding}: {treatment}; the model has no fixed pattern"));
        }
        notes
    }
}
