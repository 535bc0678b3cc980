//! Measurement of one setting of the camera's gain: [`SettingFit`].

mod doubts;
mod errors;
mod fit;

use super::bias::BiasFit;
use super::flats::{Base, FlatSettings, Flats, Point, Transfer};
use super::frames::FrameReader;
use super::inputs::Inputs;
use super::recording::SettingFiles;
use super::sums::STEPS;
use crate::error::{Error, Result};
use darkqa_light::draws::tukey_lambda;
use errors::Errors;
pub(super) use fit::{FigurePoints, FrameCounts};
pub(crate) use fit::{Measured, SettingFit};

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
    notes.extend(doubts::setting_doubts(&fit, flats.have_dark_frames(), width).map_err(refused)?);
    context.warnings.extend(notes.into_iter().map(|note| format!("{}: {note}", files.name)));
    Ok(fit)
}

/// Fits a setting, and estimates the standard errors.
fn fit(name: &str, bias: &BiasFit, flats: &Flats, base: Base<'_>) -> SettingFit {
    let noise = bias.noise(&vec![1.0; bias.groups()]);
    let points = flats.points(base, &vec![1.0; flats.pairs()]);
    let transfer = Transfer::fit(&points, base.offsets.len());
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
fn means_by_plane(points: &[Point]) -> Vec<[f64; 2]> {
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
