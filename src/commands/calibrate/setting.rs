//! Measurement of one setting of the camera's gain: [`SettingFit`].
//!
//! Plausibility checks of a fitted camera setting.
//!
//! Standard errors of a setting by bootstrap over frame pairs: [`Errors`].
//!
//! Results of one setting: [`SettingFit`].
//!
//! Standard errors by the bootstrap over frame pairs: [`BootstrapDraws`].

use serde::Serialize;

use super::bias::BiasFit;
use super::flats::{Base, FlatSettings, Flats, TransferLine, TransferPoint, fitted_gain};
use super::frames::{FrameReader, Inputs};
use super::read_noise::PlotFit;
use super::recording::SettingFiles;
use super::sums::STEPS;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::FrameId;
use darkqa_light::draws::tukey_lambda;
use darkqa_light::{Component, NoiseKey, Site};

/// Number of points in the probability plot of a setting (chosen).
const PLOT_POINTS: usize = 61;

/// Inputs of the measurement that all settings share.
pub(super) struct MeasureContext<'a> {
    pub(super) reader: &'a FrameReader,
    /// Code of white.
    pub(super) white: u16,
    pub(super) inputs: &'a mut Inputs,
    /// Warnings so far.
    pub(super) warnings: &'a mut Vec<String>,
}

/// Measures a setting.
///
/// # Errors
/// If a frame cannot be read, or a check fails.
pub(super) fn measure(files: &SettingFiles, context: &mut MeasureContext<'_>) -> Result<SettingFit> {
    let refused = |problem: String| Error::data(&files.name, problem);
    let mut notes = Vec::new();
    let bias = BiasFit::measure(context.reader, files, context.inputs, &mut notes)?;
    let ones = vec![1.0; bias.groups()];
    let (offsets, noise) = (bias.offsets(&ones), bias.noise(&ones));
    let highest = offsets.iter().copied().fold(0.0, f64::max);
    if highest >= f64::from(context.white) {
        return Err(refused(format!(
            "bias frames of {highest:.0} ADU are not below white, {}; see --white and the folders white/",
            context.white
        )));
    }
    let base = Base { offsets: &offsets, within: noise.within };
    let settings = FlatSettings { white: context.white, hot: &bias.hot };
    let flats = Flats::measure(context.reader, files, settings, base, context.inputs, &mut notes)?;
    let fit = fit(&files.name, &bias, &flats, base);
    let width = context.reader.layout.width;
    notes.extend(setting_doubts(&fit, flats.have_dark_frames(), width).map_err(refused)?);
    context.warnings.extend(notes.into_iter().map(|note| format!("{}: {note}", files.name)));
    Ok(fit)
}

/// Fits a setting, and estimates the standard errors.
fn fit(name: &str, bias: &BiasFit, flats: &Flats, base: Base<'_>) -> SettingFit {
    let noise = bias.noise(&vec![1.0; bias.groups()]);
    let points = flats.points(base, &vec![1.0; flats.pairs()]);
    let transfer = TransferLine::fit(&points, base.offsets.len());
    let errors = Errors::estimate(bias, flats);
    let scale = bias.widened * libm::exp(bias.read.log_scale);
    SettingFit {
        name: name.to_owned(),
        frames: FrameCounts { bias: bias.frames, exposures: flats.exposures(), flat_pairs: flats.pairs() },
        gain: Measured::new(transfer.gain, errors.gain),
        read_scale: Measured::new(scale, errors.log_scale.map(|error| scale * error)),
        read_shape: Measured::new(bias.read.shape, errors.shape),
        plot: bias.plot,
        row_deviation: Measured::new(noise.row_deviation(), errors.row),
        offsets: base
            .offsets
            .iter()
            .zip(&errors.offsets)
            .map(|(offset, error)| Measured::new(*offset, *error))
            .collect(),
        read_deviation: noise.within.sqrt(),
        hot_pixels: bias.hot.count(),
        gain_by_plane: transfer.by_plane,
        bend: transfer.bend,
        intercept: Measured::new(transfer.intercept, Some(transfer.intercept_error)),
        figure: FigurePoints { transfer: means_by_plane(&points), plot: plot_points(bias) },
    }
}

/// Mean signal and variance of each exposure and plane.
fn means_by_plane(points: &[TransferPoint]) -> Vec<[f64; 2]> {
    points
        .chunk_by(|a, b| (a.exposure, a.plane) == (b.exposure, b.plane))
        .map(|group| {
            let [sum, signal, variance] = group.iter().fold([0.0; 3], |[sum, signal, variance], p| {
                [sum + p.weight, signal + p.weight * p.signal, variance + p.weight * p.variance]
            });
            [signal / sum, variance / sum]
        })
        .collect()
}

/// Points of the probability plot at equally spaced logits of the probability, up to one sample in a million at either
/// end.
fn plot_points(bias: &BiasFit) -> Vec<[f64; 2]> {
    let counts = bias.residuals.counts();
    let total: f64 = counts.iter().map(|(_, count)| *count as f64).sum();
    let reach = libm::log(total.clamp(100.0, 1e6));
    let scale = libm::exp(bias.read.log_scale);
    let mut counts = counts.into_iter();
    let (mut below, mut current) = (0.0, 0);
    (0..PLOT_POINTS)
        .map(|index| {
            let logit = reach * (2.0 * index as f64 / (PLOT_POINTS - 1) as f64 - 1.0);
            let u = 1.0 / (1.0 + libm::exp(-logit));
            while below <= u * total
                && let Some((steps, count)) = counts.next()
            {
                below += count as f64;
                current = steps;
            }
            let residual = current as f64 / STEPS as f64;
            [tukey_lambda(u, bias.read.shape), residual / scale]
        })
        .collect()
}

/// Range of the gain K in a camera file, in ADU per electron.
const GAIN_RANGE: [f64; 2] = [0.01, 100.0];

/// Relative bend of the photon transfer line: warn above the first, reject above the second (chosen).
const BEND_LIMITS: [f64; 2] = [0.05, 0.15];

/// Largest distance of the intercept of photon transfer from 0, in standard errors.
const MAX_INTERCEPT: f64 = 3.0;

/// Largest difference of K between colour planes, relative to K (chosen).
const MAX_PLANE_DIFFERENCE: f64 = 0.03;

/// Smallest standard deviation of the noise of bias frames, in ADU. Chosen: below it, the rounding error depends on the
/// noise and on the fractional part of the offset.
const MIN_READ_DEVIATION: f64 = 0.35;

/// Checks a fitted setting and returns warnings. `width` is the number of sites in a row.
///
/// # Errors
/// If K is out of range, or if the photon transfer line bends too much.
fn setting_doubts(fit: &SettingFit, has_dark: bool, width: usize) -> Result<Vec<String>, String> {
    let gain = fit.gain.value;
    if !(GAIN_RANGE[0]..=GAIN_RANGE[1]).contains(&gain) {
        return Err(format!(
            "K is {gain:.4} ADU per electron, and {} to {} are possible: do flats and bias frames belong together?",
            GAIN_RANGE[0], GAIN_RANGE[1]
        ));
    }
    let bend = 100.0 * fit.bend;
    if fit.bend.abs() > BEND_LIMITS[1] {
        return Err(format!(
            "photon transfer bends by {bend:+.0} % over the range of light (limit {:.0} %): the codes are not linear in light, the frames were processed, or the light of pairs changed in parts of the frame alone",
            100.0 * BEND_LIMITS[1]
        ));
    }
    let mut doubts = Vec::new();
    if fit.bend.abs() > BEND_LIMITS[0] {
        doubts.push(format!(
            "photon transfer bends by {bend:+.1} % over the range of light: the codes are not quite linear; K is off by some percent"
        ));
    }
    doubts.extend(intercept_doubt(fit, has_dark));
    doubts.extend(plane_doubt(fit));
    if fit.row_deviation.value <= 0.0 {
        doubts.push(format!(
            "row noise cannot be seen below about {:.3} ADU: this setting does not count in the line of σ_row, which --noise camera takes for it, too",
            fit.read_deviation / (width as f64).sqrt()
        ));
    }
    if fit.read_deviation < MIN_READ_DEVIATION {
        doubts.push(format!(
            "the noise of bias frames has a deviation of {:.2} ADU, less than the codes can show: σ_TL and λ are uncertain",
            fit.read_deviation
        ));
    }
    Ok(doubts)
}

/// Warning if the photon transfer line misses 0 by more than [`MAX_INTERCEPT`] standard errors.
fn intercept_doubt(fit: &SettingFit, has_dark: bool) -> Option<String> {
    let error = fit.intercept.error.unwrap_or(f64::INFINITY);
    if fit.intercept.value.abs() > MAX_INTERCEPT * error {
        let advice = if has_dark { "" } else { "; record dark frames of the exposures of the flats (dark-NAME/)" };
        return Some(format!(
            "photon transfer does not pass through 0: {:+.1} ± {error:.1} ADU² at no light, as if the offset of the flats were {:+.1} ADU from that of the bias frames (dark current, or a black level that moves){advice}",
            fit.intercept.value,
            -fit.intercept.value / fit.gain.value,
        ));
    }
    None
}

/// Warning if K differs between planes by more than [`MAX_PLANE_DIFFERENCE`].
fn plane_doubt(fit: &SettingFit) -> Option<String> {
    let gains = fit.gain_by_plane.iter().flatten().copied();
    let low = gains.clone().fold(f64::INFINITY, f64::min);
    let high = gains.fold(0.0, f64::max);
    if (high - low) / fit.gain.value > MAX_PLANE_DIFFERENCE {
        let list: Vec<String> =
            fit.gain_by_plane.iter().map(|k| k.map_or("–".to_owned(), |k| format!("{k:.4}"))).collect();
        return Some(format!(
            "the planes differ in K by more than {:.0} % ({}), and the model has one K for all",
            100.0 * MAX_PLANE_DIFFERENCE,
            list.join(", ")
        ));
    }
    None
}

/// Standard errors; `None` with a single pair.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Errors {
    gain: Option<f64>,
    /// Of λ.
    shape: Option<f64>,
    /// Of ln σ_TL.
    log_scale: Option<f64>,
    row: Option<f64>,
    /// Of the offset of each plane.
    offsets: Vec<Option<f64>>,
}

/// The fit of one draw.
struct FitDraw {
    offsets: Vec<f64>,
    row: f64,
    read: [f64; 2],
    gain: f64,
}

impl Errors {
    /// Estimates the errors by independent draws of bias pairs and flat pairs.
    fn estimate(bias: &BiasFit, flats: &Flats) -> Self {
        let bias_draws = BootstrapDraws::new(DrawnGroups::Bias, bias.pairs());
        let flat_draws = BootstrapDraws::new(DrawnGroups::Flats, flats.pairs());
        let draws: Vec<FitDraw> = bias_draws
            .weights()
            .zip(flat_draws.weights())
            .map(|(bias_weights, flat_weights)| {
                // A last frame without a partner has weight 1 in every draw.
                let mut weights = bias_weights.to_vec();
                weights.resize(bias.groups(), 1.0);
                fit_draw(bias, flats, &weights, flat_weights)
            })
            .collect();
        let bias_error = |value: &dyn Fn(&FitDraw) -> f64| deviation(draws.iter().map(value), bias.pairs());
        let planes = draws.first().map_or(0, |draw| draw.offsets.len());
        Self {
            gain: deviation(draws.iter().map(|draw| draw.gain), flats.pairs()),
            shape: bias_error(&|draw| draw.read[0]),
            log_scale: bias_error(&|draw| draw.read[1]),
            row: bias_error(&|draw| draw.row),
            offsets: (0..planes).map(|plane| bias_error(&|draw| draw.offsets[plane])).collect(),
        }
    }
}

/// Fits a draw of the bias groups and the flat pairs, given by their weights.
fn fit_draw(bias: &BiasFit, flats: &Flats, bias_weights: &[f64], flat_weights: &[f64]) -> FitDraw {
    let (offsets, noise) = (bias.offsets(bias_weights), bias.noise(bias_weights));
    let base = Base { offsets: &offsets, within: noise.within };
    FitDraw {
        gain: fitted_gain(&flats.points(base, flat_weights)),
        row: noise.row_deviation(),
        read: bias.read.resampled(bias_weights),
        offsets,
    }
}

/// A number with its standard error.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct Measured {
    pub value: f64,
    /// Standard error by bootstrap over frame pairs; `None` with a single pair.
    pub error: Option<f64>,
}

impl Measured {
    fn new(value: f64, error: Option<f64>) -> Self {
        Self { value, error }
    }
}

/// Noise of a sensor at one setting.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct SettingFit {
    pub name: String,
    pub frames: FrameCounts,
    /// System gain K, in ADU per electron.
    pub gain: Measured,
    /// Scale σ_TL of the read noise, in ADU.
    pub read_scale: Measured,
    /// Shape λ of the read noise.
    pub read_shape: Measured,
    /// Read noise by the probability plot, which counts rounding as noise.
    pub plot: PlotFit,
    /// Standard deviation σ_r of the row noise, in ADU.
    pub row_deviation: Measured,
    /// Mean codes of the planes of bias frames, including the black level, in the order R, G1, G2, B.
    pub offsets: Vec<Measured>,
    /// Standard deviation of the noise within rows, in ADU.
    pub read_deviation: f64,
    pub hot_pixels: usize,
    /// K of each plane alone; `None` if all its light is out of range.
    pub gain_by_plane: Vec<Option<f64>>,
    /// Change of variance / signal over the range of light, relative to K.
    pub bend: f64,
    /// Intercept of the photon transfer line: its variance without light, in ADU². Its error comes from the noise of
    /// the sites, because a few pairs of flats are too few for a bootstrap.
    pub intercept: Measured,
    /// Points for the figures.
    #[serde(skip)]
    pub figure: FigurePoints,
}

/// Numbers of used frames of a setting.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub(crate) struct FrameCounts {
    pub bias: usize,
    pub exposures: usize,
    pub flat_pairs: usize,
}

/// Points of a setting for the figures.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct FigurePoints {
    /// Signal in ADU and variance in ADU² of each exposure and plane.
    pub transfer: Vec<[f64; 2]>,
    /// Quantiles of the fitted distribution with scale 1, and the residuals there relative to the fitted scale.
    pub plot: Vec<[f64; 2]>,
}

/// Number of draws (chosen: the relative error of a standard error is then 3 %).
const DRAWS: usize = 1000;

/// Bootstrap draws of groups of frames.
///
/// A draw has n − 1 of n groups, with replacement, so that the variance of a mean over the draws is unbiased for few
/// groups too (Rao and Wu 1988, Journal of the American Statistical Association 83:231).
#[derive(Debug)]
pub(super) struct BootstrapDraws {
    /// Weights of the groups in each draw, with mean 1.
    weights: Vec<Vec<f64>>,
}

/// Kind of groups; each kind is drawn independently.
#[derive(Debug, Clone, Copy)]
pub(super) enum DrawnGroups {
    Bias,
    Flats,
}

impl BootstrapDraws {
    /// Draws from this number of groups. A single group has weight 1 in every draw.
    pub(super) fn new(kind: DrawnGroups, groups: usize) -> Self {
        let key = NoiseKey::new(0, &FrameId("calibrate".to_owned()));
        let stream = key.stream(Component::Resamples);
        let weights = (0..DRAWS)
            .map(|draw| {
                if groups < 2 {
                    return vec![1.0; groups];
                }
                let mut weights = vec![0.0; groups];
                let share = groups as f64 / (groups - 1) as f64;
                for pick in 0..groups - 1 {
                    let site = Site::new(2 * draw + kind as usize, pick);
                    // The upper half of the 64-bit product is uniform from 0 to n − 1, except for a bias of n / 2³².
                    let word = u64::from(stream.words(site, 0)[0]);
                    weights[((word * groups as u64) >> 32) as usize] += share;
                }
                weights
            })
            .collect();
        Self { weights }
    }

    /// Weights of each draw.
    pub(super) fn weights(&self) -> impl Iterator<Item = &[f64]> {
        self.weights.iter().map(Vec::as_slice)
    }
}

/// Standard deviation of values, one for each draw; `None` for fewer than two groups.
pub(super) fn deviation(values: impl Iterator<Item = f64>, groups: usize) -> Option<f64> {
    if groups < 2 {
        return None;
    }
    let values: Vec<f64> = values.collect();
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    Some((squares / (n - 1.0)).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Five groups with known values: the error of their mean is known.
    #[test]
    fn the_error_of_a_mean_is_unbiased_for_few_values() {
        let values = [1.0, 4.0, 2.0, 8.0, 5.0];
        let mean = values.iter().sum::<f64>() / 5.0;
        let squares: f64 = values.iter().map(|v| (v - mean) * (v - mean)).sum();
        let expected = (squares / 4.0 / 5.0_f64).sqrt();
        let draws = BootstrapDraws::new(DrawnGroups::Bias, 5);
        let means = draws.weights().map(|weights| {
            assert!((weights.iter().sum::<f64>() - 5.0).abs() < 1e-12);
            values.iter().zip(weights).map(|(v, w)| v * w).sum::<f64>() / 5.0
        });
        let error = deviation(means, 5).unwrap();
        assert!((error / expected - 1.0).abs() < 0.08, "{error}, {expected}");
        assert_eq!(deviation([1.0, 2.0].into_iter(), 1), None);
        let other = BootstrapDraws::new(DrawnGroups::Flats, 5);
        assert!(draws.weights().zip(other.weights()).any(|(a, b)| a != b));
    }
}
