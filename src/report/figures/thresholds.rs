//! The figure of the darkness thresholds.

use plotters::prelude::*;

use super::super::chart::{
    BACKGROUND, BELOW, Figure, FigureArea, GRID, LEFT, LineStyle, RIGHT, draw_path, draw_text,
};
use super::super::words::{light, stops};
use crate::error::{Error, Result};
use crate::score::curve::Curve;
use crate::score::findings::Findings;
use crate::score::threshold::Threshold;

/// Widths of the names, of the axis and of the numbers, in pixels.
const NAMES: i32 = 330;
const AXIS: i32 = 400;
const NUMBERS: i32 = 150;
const ROW: i32 = 24;
/// End of the axis in EV: the exposure drop of L5, the darkest named level.
const MAX_EV: f64 = 9.0;

/// A row for each curve, with its threshold and interval on an axis of exposure drops. `None` if no curve has a threshold.
pub(super) fn figure(findings: &Findings<'_>) -> Result<Option<Figure>> {
    let rows = findings
        .curves
        .iter()
        .filter(|curve| curve.family.is_none());
    let rows: Vec<(&Curve, Threshold)> = rows
        .filter_map(|curve| Some((curve, *curve.summary.threshold.as_ref().ok()?)))
        .collect();
    if rows.is_empty() {
        return Ok(None);
    }
    let size = (
        (NAMES + AXIS + NUMBERS) as u32,
        (rows.len() as i32 * ROW + 76) as u32,
    );
    let mut svg = String::new();
    let drawn = {
        let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        draw(&root, &rows, &findings.unit.to_string())
    };
    drawn.map_err(|e| Error::data("figure", e))?;
    let caption =
        "Darkness threshold: the exposure drop at which accuracy is half-way between that at L0 and chance. Arrows: \
         beyond the darkest level asked."
            .to_owned();
    Ok(Some(Figure {
        name: "thresholds",
        caption,
        svg,
    }))
}

fn draw(root: &FigureArea<'_>, rows: &[(&Curve, Threshold)], unit: &str) -> Result<(), String> {
    let failed = |e: DrawingAreaErrorKind<_>| e.to_string();
    let x = |ev: f64| NAMES + (ev.clamp(0.0, MAX_EV) / MAX_EV * f64::from(AXIS)).round() as i32;
    let colour = LineStyle(0).colour();
    root.fill(&BACKGROUND).map_err(failed)?;
    let bottom = 12 + rows.len() as i32 * ROW;
    for tick in 0..=9 {
        let at = x(f64::from(tick));
        draw_path(root, &[(at, 8), (at, bottom)], GRID.stroke_width(1))?;
        draw_text(root, &tick.to_string(), (at, bottom + 6), 13, BELOW)?;
    }
    for (row, (curve, threshold)) in (0..).zip(rows) {
        let y = 12 + row * ROW + ROW / 2;
        let light = light(&curve.variant, curve.enhancer.as_ref());
        let name = format!("{}, {light}", curve.model);
        draw_text(root, &name, (NAMES - 14, y), 13, RIGHT)?;
        let ends = [(x(threshold.low), y), (x(threshold.high), y)];
        draw_path(root, &ends, colour.stroke_width(2))?;
        if threshold.high.is_infinite() {
            let tip = vec![(x(MAX_EV) + 8, y), (x(MAX_EV), y - 5), (x(MAX_EV), y + 5)];
            root.draw(&Polygon::new(tip, colour)).map_err(failed)?;
        }
        if threshold.value.is_finite() {
            let place = (x(threshold.value), y);
            let point = Circle::new(place, 5, colour.filled());
            root.draw(&point).map_err(failed)?;
        }
        let darkest = curve.summary.darkest.value();
        let number = format!(
            "{} [{}, {}]",
            stops(threshold.value, darkest),
            stops(threshold.low, darkest),
            stops(threshold.high, darkest)
        );
        let place = (NAMES + AXIS + 16, y);
        draw_text(root, &number, place, 13, LEFT)?;
    }
    let axis_title = format!("darkness threshold in EV, with 95 % interval by {unit}");
    let place = (NAMES + AXIS / 2, bottom + 30);
    draw_text(root, &axis_title, place, 13, BELOW)?;
    root.present().map_err(failed)
}
