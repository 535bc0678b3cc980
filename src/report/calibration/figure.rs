//! The figure of a measured camera, as SVG: [`figure`].

use plotters::coord::Shift;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;

use super::super::chart::LineStyle;
use crate::calibrate::{CameraFit, NoiseLine, SettingFit};
use crate::error::{Error, Result};

/// Width and height of a panel in pixels.
const PANEL: (u32, u32) = (470, 430);
/// Share of a range that is added at both of its ends.
const MARGIN: f64 = 0.06;

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Panel<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

/// Photon transfer with its lines, the probability plots of the read noise, and both deviations over K.
///
/// # Errors
/// If the figure cannot be drawn.
pub(crate) fn figure(camera: &CameraFit) -> Result<String> {
    let mut svg = String::new();
    {
        let size = (3 * PANEL.0, PANEL.1);
        let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        draw(&root, camera).map_err(|e| Error::data("figure", e))?;
    }
    Ok(svg)
}

fn draw(root: &Area<'_>, camera: &CameraFit) -> Result<(), String> {
    root.fill(&WHITE).map_err(|e| e.to_string())?;
    let panels = root.split_evenly((1, 3));
    transfer(&panels[0], camera)?;
    probability(&panels[1], camera)?;
    deviations(&panels[2], camera)?;
    root.present().map_err(|e| e.to_string())
}

/// Titles of a panel and of its axes.
struct Titles<'t> {
    panel: &'t str,
    x: &'t str,
    y: &'t str,
}

/// An empty panel that holds all of these points.
fn panel<'a, 'b: 'a>(
    area: &'a Area<'b>,
    points: &[[f64; 2]],
    titles: &Titles<'_>,
) -> Result<Panel<'a, 'b>, String> {
    let range = |axis: usize| {
        let values = points.iter().map(|point| point[axis]);
        let [low, high] = values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| {
            [low.min(value), high.max(value)]
        });
        let [low, high] = if low <= high { [low, high] } else { [0.0, 1.0] };
        let margin = MARGIN * (high - low) + 1e-3;
        low - margin..high + margin
    };
    let mut chart = ChartBuilder::on(area)
        .caption(titles.panel, ("sans-serif", 16))
        .margin(10)
        .x_label_area_size(44)
        .y_label_area_size(56)
        .build_cartesian_2d(range(0), range(1))
        .map_err(|e| e.to_string())?;
    chart
        .configure_mesh()
        .x_desc(titles.x)
        .y_desc(titles.y)
        .label_style(("sans-serif", 13))
        .axis_desc_style(("sans-serif", 14))
        .draw()
        .map_err(|e| e.to_string())?;
    Ok(chart)
}

/// Draws the points of a series, and a line with a name.
fn series<'a, 'b: 'a>(
    chart: &mut Panel<'a, 'b>,
    style: usize,
    name: &str,
    points: &[[f64; 2]],
    line: &[[f64; 2]],
) -> Result<(), String> {
    let [red, green, blue] = LineStyle(style).rgb();
    let colour = RGBColor(red, green, blue);
    let pair = |point: &[f64; 2]| (point[0], point[1]);
    let drawn = chart
        .draw_series(LineSeries::new(
            line.iter().map(pair),
            colour.stroke_width(1),
        ))
        .map_err(|e| e.to_string())?;
    drawn
        .label(name)
        .legend(move |(x, y)| Circle::new((x + 9, y), 3, colour.filled()));
    let dots = points
        .iter()
        .map(|point| Circle::new(pair(point), 3, colour.filled()));
    chart.draw_series(dots).map_err(|e| e.to_string())?;
    Ok(())
}

fn legend<'a, 'b: 'a>(
    chart: &mut Panel<'a, 'b>,
    position: SeriesLabelPosition,
) -> Result<(), String> {
    chart
        .configure_series_labels()
        .position(position)
        .background_style(WHITE.mix(0.8))
        .border_style(BLACK)
        .label_font(("sans-serif", 13))
        .draw()
        .map_err(|e| e.to_string())
}

/// Variance over signal of each exposure and plane on logarithmic axes, with the line of K.
fn transfer(area: &Area<'_>, camera: &CameraFit) -> Result<(), String> {
    let points = |fit: &SettingFit| -> Vec<[f64; 2]> {
        let positive = fit
            .figure
            .transfer
            .iter()
            .filter(|[s, v]| *s > 0.0 && *v > 0.0);
        positive.map(|point| point.map(libm::log10)).collect()
    };
    let all: Vec<[f64; 2]> = camera.settings.iter().flat_map(points).collect();
    let titles = Titles {
        panel: "photon transfer",
        x: "log10 of light in ADU",
        y: "log10 of variance in ADU²",
    };
    let mut chart = panel(area, &all, &titles)?;
    for (style, fit) in camera.settings.iter().enumerate() {
        let points = points(fit);
        let signals = points.iter().map(|[signal, _]| *signal);
        let ends = [
            signals.clone().fold(f64::INFINITY, f64::min),
            signals.fold(f64::NEG_INFINITY, f64::max),
        ];
        let line = ends.map(|signal| [signal, signal + libm::log10(fit.gain.value)]);
        let name = format!("{}: K {:.4}", fit.name, fit.gain.value);
        series(&mut chart, style, &name, &points, &line)?;
    }
    legend(&mut chart, SeriesLabelPosition::UpperLeft)
}

/// Residuals over the fitted scale, over the quantiles of the fitted distribution: a straight line where the fit is right.
fn probability(area: &Area<'_>, camera: &CameraFit) -> Result<(), String> {
    let all: Vec<[f64; 2]> = camera
        .settings
        .iter()
        .flat_map(|fit| fit.figure.plot.clone())
        .collect();
    let titles = Titles {
        panel: "read noise",
        x: "quantile of the Tukey-λ distribution",
        y: "residual / σ_TL",
    };
    let mut chart = panel(area, &all, &titles)?;
    for (style, fit) in camera.settings.iter().enumerate() {
        let points = &fit.figure.plot;
        let ends = points.first().zip(points.last());
        let line = ends.map_or(Vec::new(), |(first, last)| {
            vec![[first[0]; 2], [last[0]; 2]]
        });
        let name = format!("{}: λ {:.4}", fit.name, fit.read_shape.value);
        series(&mut chart, style, &name, points, &line)?;
    }
    legend(&mut chart, SeriesLabelPosition::UpperLeft)
}

/// ln σ over ln K of read and row noise, with their lines.
fn deviations(area: &Area<'_>, camera: &CameraFit) -> Result<(), String> {
    let points = |of: fn(&SettingFit) -> f64| -> Vec<[f64; 2]> {
        let points = camera.settings.iter().map(|fit| [fit.gain.value, of(fit)]);
        let positive = points.filter(|[_, sigma]| *sigma > 0.0);
        positive.map(|point| point.map(libm::log)).collect()
    };
    let read = points(|fit| fit.read_scale.value);
    let row = points(|fit| fit.row_deviation.value);
    let titles = Titles {
        panel: "noise over gain",
        x: "ln K",
        y: "ln σ",
    };
    let mut chart = panel(area, &[&read[..], &row].concat(), &titles)?;
    let line = |points: &[[f64; 2]], line: &NoiseLine| -> Vec<[f64; 2]> {
        let at = |[x, _]: &[f64; 2]| [*x, libm::log(line.at(libm::exp(*x)))];
        points.iter().map(at).collect()
    };
    series(
        &mut chart,
        0,
        "σ_TL",
        &read,
        &line(&read, &camera.read_scale),
    )?;
    series(
        &mut chart,
        1,
        "σ_row",
        &row,
        &line(&row, &camera.row_deviation),
    )?;
    legend(&mut chart, SeriesLabelPosition::LowerRight)
}
