//! The figure of a measured camera, as SVG: [`figure`].

use crate::calibrate::{CameraFit, NoiseLine, SettingFit};
use crate::drawing::chart::LineStyle;
use crate::drawing::chart::points::{PointPanel, PointSeries};
use crate::drawing::paper::point_figure;
use crate::error::Result;

/// Photon transfer with its lines, the probability plots of the read noise, and both deviations over K.
///
/// # Errors
/// If the figure cannot be written.
pub(crate) fn figure(camera: &CameraFit) -> Result<String> {
    point_figure(&[transfer(camera), probability(camera), deviations(camera)])
}

/// A series for each setting.
fn by_setting(
    camera: &CameraFit,
    series: impl Fn(&SettingFit, LineStyle) -> PointSeries,
) -> Vec<PointSeries> {
    camera
        .settings
        .iter()
        .enumerate()
        .map(|(style, fit)| series(fit, LineStyle(style)))
        .collect()
}

/// Variance over signal of each exposure and plane on logarithmic axes, with the line of K.
fn transfer(camera: &CameraFit) -> PointPanel {
    let series = by_setting(camera, |fit, style| {
        let positive = |[signal, variance]: &&[f64; 2]| *signal > 0.0 && *variance > 0.0;
        let points: Vec<[f64; 2]> = fit
            .figure
            .transfer
            .iter()
            .filter(positive)
            .map(|point| point.map(libm::log10))
            .collect();
        let signals = points.iter().map(|[signal, _]| *signal);
        let ends = [signals.clone().reduce(f64::min), signals.reduce(f64::max)];
        let line = ends
            .into_iter()
            .flatten()
            .map(|signal| [signal, signal + libm::log10(fit.gain.value)]);
        PointSeries {
            name: format!("{}: K {:.4}", fit.name, fit.gain.value),
            style,
            lines: vec![line.collect()],
            points,
        }
    });
    PointPanel {
        title: "photon transfer".to_owned(),
        axes: ["log10 of light in ADU", "log10 of variance in ADU²"],
        series,
    }
}

/// Residuals over the fitted scale, over the quantiles of the fitted distribution: a straight line where the fit is right.
fn probability(camera: &CameraFit) -> PointPanel {
    let series = by_setting(camera, |fit, style| {
        let points = &fit.figure.plot;
        let ends = [points.first(), points.last()].into_iter().flatten();
        PointSeries {
            name: format!("{}: λ {:.4}", fit.name, fit.read_shape.value),
            style,
            lines: vec![ends.map(|end| [end[0]; 2]).collect()],
            points: points.clone(),
        }
    });
    PointPanel {
        title: "read noise".to_owned(),
        axes: ["quantile of the Tukey-λ distribution", "residual / σ_TL"],
        series,
    }
}

/// ln σ over ln K of read and row noise, with their lines.
fn deviations(camera: &CameraFit) -> PointPanel {
    let series = |style, name: &str, sigma: fn(&SettingFit) -> f64, line: &NoiseLine| {
        let points: Vec<[f64; 2]> = camera
            .settings
            .iter()
            .map(|fit| [fit.gain.value, sigma(fit)])
            .filter(|[_, sigma]| *sigma > 0.0)
            .map(|point| point.map(libm::log))
            .collect();
        let at = |[x, _]: &[f64; 2]| [*x, libm::log(line.at(libm::exp(*x)))];
        PointSeries {
            name: name.to_owned(),
            style: LineStyle(style),
            lines: vec![points.iter().map(at).collect()],
            points,
        }
    };
    PointPanel {
        title: "noise over gain".to_owned(),
        axes: ["ln K", "ln σ"],
        series: vec![
            series(0, "σ_TL", |fit| fit.read_scale.value, &camera.read_scale),
            series(
                1,
                "σ_row",
                |fit| fit.row_deviation.value,
                &camera.row_deviation,
            ),
        ],
    }
}
