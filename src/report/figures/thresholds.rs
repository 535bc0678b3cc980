//! The figures of the thresholds, one for each axis.

use plotters::prelude::*;

use super::super::chart::{
    BACKGROUND, BELOW, Figure, FigureArea, GRID, LEFT, LineStyle, RIGHT, draw_path, draw_text,
};
use super::super::words::{light, shortened, stops};
use crate::error::{Error, Result};
use crate::score::curve::Curve;
use crate::score::findings::Findings;
use crate::score::threshold::Threshold;
use crate::types::degradation::Axis;

/// Widths of the names, of the axis and of the numbers, in pixels.
const NAMES: i32 = 330;
/// Most letters of a name.
const NAME_LETTERS: usize = 46;
const AXIS: i32 = 400;
const NUMBERS: i32 = 150;
const ROW: i32 = 24;

/// The scale of an axis: the exposure drops to L5, the darkest named level, or the exposure times of the ladder.
struct Scale {
    end: f64,
    /// Distance of two ticks.
    step: i32,
    /// Name of the threshold.
    title: &'static str,
    unit: &'static str,
}

impl Scale {
    fn of(axis: Axis) -> Self {
        let (end, step, title) = if axis == Axis::MOTION {
            (140.0, 20, "threshold of motion blur")
        } else {
            (9.0, 1, "darkness threshold")
        };
        Self {
            end,
            step,
            title,
            unit: axis.unit,
        }
    }

    fn x(&self, value: f64) -> i32 {
        NAMES + (value.clamp(0.0, self.end) / self.end * f64::from(AXIS)).round() as i32
    }
}

/// The figure of each axis on which a curve has a threshold.
pub(super) fn figures(findings: &Findings<'_>) -> Result<Vec<Figure>> {
    let figures = Axis::ALL.map(|axis| figure(findings, axis));
    let figures = figures.into_iter().filter_map(Result::transpose);
    figures.collect()
}

/// A row for each curve, with its threshold and interval on an axis. `None` if no curve has a threshold.
fn figure(findings: &Findings<'_>, axis: Axis) -> Result<Option<Figure>> {
    let rows = findings
        .curves
        .iter()
        .filter(|curve| curve.family.is_none() && curve.axis() == axis);
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
        draw(&root, &rows, &Scale::of(axis), &findings.unit.to_string())
    };
    drawn.map_err(|e| Error::data("figure", e))?;
    let (name, caption) = if axis == Axis::MOTION {
        (
            "blur_thresholds",
            "Threshold of motion blur: the exposure time at which accuracy is half-way between that at L0 and chance. Arrows: \
             beyond the longest time asked.",
        )
    } else {
        (
            "thresholds",
            "Darkness threshold: the exposure drop at which accuracy is half-way between that at L0 and chance. Arrows: \
             beyond the darkest level asked.",
        )
    };
    let caption = caption.to_owned();
    Ok(Some(Figure {
        name,
        caption,
        svg,
        data: None,
    }))
}

fn draw(
    root: &FigureArea<'_>,
    rows: &[(&Curve, Threshold)],
    scale: &Scale,
    unit: &str,
) -> Result<(), String> {
    let failed = |e: DrawingAreaErrorKind<_>| e.to_string();
    let x = |value: f64| scale.x(value);
    let colour = LineStyle(0).colour();
    root.fill(&BACKGROUND).map_err(failed)?;
    let bottom = 12 + rows.len() as i32 * ROW;
    for tick in (0..=scale.end as i32).step_by(scale.step as usize) {
        let at = x(f64::from(tick));
        draw_path(root, &[(at, 8), (at, bottom)], GRID.stroke_width(1))?;
        draw_text(root, &tick.to_string(), (at, bottom + 6), 13, BELOW)?;
    }
    for (row, (curve, threshold)) in (0..).zip(rows) {
        let y = 12 + row * ROW + ROW / 2;
        let light = light(&curve.variant, curve.enhancer.as_ref());
        let name = shortened(&format!("{}, {light}", curve.model), NAME_LETTERS);
        draw_text(root, &name, (NAMES - 14, y), 13, RIGHT)?;
        let ends = [(x(threshold.low), y), (x(threshold.high), y)];
        draw_path(root, &ends, colour.stroke_width(2))?;
        if threshold.high.is_infinite() {
            let end = x(scale.end);
            let tip = vec![(end + 8, y), (end, y - 5), (end, y + 5)];
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
    let Scale {
        title, unit: of, ..
    } = scale;
    let axis_title = format!("{title} in {of}, with 95 % interval by {unit}");
    let place = (NAMES + AXIS / 2, bottom + 30);
    draw_text(root, &axis_title, place, 13, BELOW)?;
    root.present().map_err(failed)
}
