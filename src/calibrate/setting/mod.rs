//! One setting of the camera's gain, measured: [`SettingFit`].

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

/// Points of the probability plot of a setting (chosen).
const PLOT_POINTS: usize = 61;

/// The inputs of every setting's measurement.
pub(super) struct Measuring<'a> {
    pub(super) reader: &'a FrameReader,
    /// The code of white.
    pub(super) white: u16,
    pub(super) inputs: &'a mut Inputs,
    /// Doubts about the recording.
    pub(super) warnings: &'a mut Vec<String>,
}

/// Measures a setting.
///
/// # Errors
/// If a frame cannot be read, or a check refuses the recording.
pub(super) fn measure(files: &SettingFiles, with: &mut Measuring<'_>) -> Result<SettingFit> {
    let refused = |problem: String| Error::data(&files.name, problem);
    let mut notes = Vec::new();
    let bias = BiasFit::measure(with.reader, files, with.inputs, &mut notes)?;
    let ones = vec![1.0; bias.groups()];
    let (offsets, noise) = (bias.offsets(&ones), bias.noise(&ones));
    let highest = offsets.iter().copied().fold(0.0, f64::max);
    if highest >= f64::from(with.white) {
        return Err(refused(format!(
            "bias frames of {highest:.0} ADU are not below white, {}; see --white and the folders white/",
            with.white
        )));
    }
    let base = Base {
        offsets: &offsets,
        within: noise.within,
    };
    let settings = FlatSettings {
        white: with.white,
        hot: &bias.hot,
    };
    let flats = Flats::measure(with.reader, files, settings, base, with.inputs, &mut notes)?;
    let fit = fit(&files.name, &bias, &flats, base);
    let width = with.reader.layout.width;
    notes.extend(doubts::setting_doubts(&fit, flats.have_dark(), width).map_err(refused)?);
    let named = notes
        .into_iter()
        .map(|note| format!("{}: {note}", files.name));
    with.warnings.extend(named);
    Ok(fit)
}

/// The numbers of a setting with their errors.
fn fit(name: &str, bias: &BiasFit, flats: &Flats, base: Base<'_>) -> SettingFit {
    let noise = bias.noise(&vec![1.0; bias.groups()]);
    let points = flats.points(base, &vec![1.0; flats.pairs()]);
    let transfer = Transfer::fit(&points, base.offsets.len());
    let errors = Errors::draw(bias, flats);
    let measured = |value: f64, error: Option<f64>| Measured { value, error };
    let scale = bias.widened * libm::exp(bias.read.log_scale);
    let offsets = base.offsets.iter().zip(&errors.offsets);
    SettingFit {
        name: name.to_owned(),
        frames: FrameCounts {
            bias: bias.frames,
            exposures: flats.exposures(),
            flat_pairs: flats.pairs(),
        },
        gain: measured(transfer.gain, errors.gain),
        read_scale: measured(scale, errors.log_scale.map(|error| scale * error)),
        read_shape: measured(bias.read.shape, errors.shape),
        plot: bias.plot,
        row_deviation: measured(noise.row_deviation(), errors.row),
        offsets: offsets
            .map(|(offset, error)| measured(*offset, *error))
            .collect(),
        read_deviation: noise.within.sqrt(),
        hot_pixels: bias.hot.count(),
        gain_by_plane: transfer.by_plane,
        bend: transfer.bend,
        intercept: measured(transfer.intercept, Some(transfer.intercept_error)),
        figure: FigurePoints {
            transfer: means_by_plane(&points),
            plot: plot_points(bias),
        },
    }
}

/// Mean signal and variance of each exposure and plane.
fn means_by_plane(points: &[Point]) -> Vec<[f64; 2]> {
    let groups = points.chunk_by(|a, b| (a.exposure, a.plane) == (b.exposure, b.plane));
    let mean = |group: &[Point]| {
        let [sum, signal, variance] = group.iter().fold([0.0; 3], |[sum, signal, variance], p| {
            [
                sum + p.weight,
                signal + p.weight * p.signal,
                variance + p.weight * p.variance,
            ]
        });
        [signal / sum, variance / sum]
    };
    groups.map(mean).collect()
}

/// Points of the probability plot at even steps of the logit of probability, from a sample in a million to as many less.
fn plot_points(bias: &BiasFit) -> Vec<[f64; 2]> {
    let counts = bias.residuals.counts();
    let total: f64 = counts.iter().map(|(_, count)| *count as f64).sum();
    let reach = libm::log(total.clamp(100.0, 1e6));
    let scale = libm::exp(bias.read.log_scale);
    let mut counts = counts.into_iter();
    let (mut below, mut current) = (0.0, 0);
    let point = |index: usize| {
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
    };
    (0..PLOT_POINTS).map(point).collect()
}
