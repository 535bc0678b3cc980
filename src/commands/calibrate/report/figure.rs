//! Figure of a camera calibration, as SVG: [`figure`].

use crate::commands::calibrate::{CameraFit, NoiseLine, SettingFit};
use crate::error::Result;
use crate::report::charts::chart::LineStyle;
use crate::report::charts::chart::points::{PointPanel, PointSeries};
use crate::report::charts::paper::point_figure;

/// Draws three panels: photon transfer, probability plots of the read noise, and the deviations of read and row noise
/// over the gain K.
///
/// # Errors
/// If the figure cannot be drawn.
pub(crate) fn figure(camera: &CameraFit) -> Result<String> {
    point_figure(&[transfer(camera), probability(camera), deviations(camera)])
}

/// One series for each camera setting.
fn setting_series(camera: &CameraFit, series: impl Fn(&SettingFit, LineStyle) -> PointSeries) -> Vec<PointSeries> {
    camera.settings.iter().enumerate().map(|(style, fit)| series(fit, LineStyle(style))).collect()
}

/// Panel of variance over signal for each exposure and colour plane on logarithmic axes, with the fitted line of K.
fn transfer(camera: &CameraFit) -> PointPanel {
    let series = setting_series(camera, |fit, style| {
        let points: Vec<[f64; 2]> = fit
            .figure
            .transfer
            .iter()
            .filter(|[signal, variance]| *signal > 0.0 && *variance > 0.0)
            .map(|point| point.map(libm::log10))
            .collect();
        let signals = points.iter().map(|[signal, _]| *signal);
        let ends = [signals.clone().reduce(f64::min), signals.reduce(f64::max)];
        let line = ends.into_iter().flatten().map(|signal| [signal, signal + libm::log10(fit.gain.value)]).collect();
        PointSeries { name: format!("{}: K {:.4}", fit.name, fit.gain.value), style, lines: vec![line], points }
    });
    PointPanel {
        title: "photon transfer".to_owned(),
        axes: ["log10 of light in ADU", "log10 of variance in ADU²"],
        series,
    }
}

/// Panel of scaled residuals over the quantiles of the fitted distribution; the points are on a straight line if the
/// fit is good.
fn probability(camera: &CameraFit) -> PointPanel {
    let series = setting_series(camera, |fit, style| {
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

/// Panel of ln σ over ln K for read and row noise, with their fitted lines.
fn deviations(camera: &CameraFit) -> PointPanel {
    let read = deviation_series(camera, |fit| fit.read_scale.value, &camera.read_scale);
    let row = deviation_series(camera, |fit| fit.row_deviation.value, &camera.row_deviation);
    PointPanel {
        title: "noise over gain".to_owned(),
        axes: ["ln K", "ln σ"],
        series: vec![
            PointSeries { name: "σ_TL".to_owned(), style: LineStyle(0), ..read },
            PointSeries { name: "σ_row".to_owned(), style: LineStyle(1), ..row },
        ],
    }
}

/// Unnamed series of ln σ over ln K with its fitted line. Settings without noise are left out.
fn deviation_series(camera: &CameraFit, sigma: fn(&SettingFit) -> f64, line: &NoiseLine) -> PointSeries {
    let points: Vec<[f64; 2]> = camera
        .settings
        .iter()
        .map(|fit| [fit.gain.value, sigma(fit)])
        .filter(|[_, sigma]| *sigma > 0.0)
        .map(|point| point.map(libm::log))
        .collect();
    PointSeries {
        name: String::new(),
        style: LineStyle(0),
        lines: vec![points.iter().map(|[x, _]| [*x, libm::log(line.at(libm::exp(*x)))]).collect()],
        points,
    }
}
