//! The darkness thresholds side by side.

use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::super::subject::{light, stops};
use super::Figure;
use crate::error::{Error, Result};
use crate::score::curve::{Curve, Threshold};
use crate::score::findings::Findings;

/// Axes and words; as in the other figures.
const INK: RGBColor = RGBColor(34, 34, 34);
const GRID: RGBColor = RGBColor(221, 221, 221);
const DOT: RGBColor = RGBColor(0, 114, 178);
/// The width of the names, of the axis, and of the numbers, in pixels.
const NAMES: i32 = 330;
const AXIS: i32 = 400;
const NUMBERS: i32 = 150;
const ROW: i32 = 24;
/// The darkest level of all, in EV.
const MOST: f64 = 9.0;

/// A row a curve: its threshold and interval over exposure drops; `None` where no curve has one.
pub(super) fn figure(findings: &Findings<'_>) -> Result<Option<Figure>> {
    let rows = findings
        .curves
        .iter()
        .filter(|curve| curve.family.is_none());
    let rows: Vec<(&Curve, Threshold)> = rows
        .filter_map(|curve| Some((curve, curve.threshold?)))
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
        draw(&root, &rows, &findings.unit.to_string()).map_err(|e| e.to_string())
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

type Area<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;
type Drawn<'a> =
    std::result::Result<(), DrawingAreaErrorKind<<SVGBackend<'a> as DrawingBackend>::ErrorType>>;

fn draw<'a>(root: &Area<'a>, rows: &[(&Curve, Threshold)], unit: &str) -> Drawn<'a> {
    let style = |across, down| {
        let font = ("sans-serif", 13).into_font();
        TextStyle::from(font)
            .color(&INK)
            .pos(Pos::new(across, down))
    };
    let x = |ev: f64| NAMES + (ev.clamp(0.0, MOST) / MOST * f64::from(AXIS)).round() as i32;
    root.fill(&RGBColor(255, 255, 255))?;
    let bottom = 12 + rows.len() as i32 * ROW;
    for tick in 0..=9 {
        let at = x(f64::from(tick));
        let line = vec![(at, 8), (at, bottom)];
        root.draw(&PathElement::new(line, GRID.stroke_width(1)))?;
        let label = style(HPos::Center, VPos::Top);
        root.draw(&Text::new(tick.to_string(), (at, bottom + 6), label))?;
    }
    for (row, (curve, threshold)) in (0..).zip(rows) {
        let y = 12 + row * ROW + ROW / 2;
        let name = format!(
            "{}, {}",
            curve.model,
            light(curve.variant, curve.enhancer.as_ref())
        );
        root.draw(&Text::new(
            name,
            (NAMES - 14, y),
            style(HPos::Right, VPos::Center),
        ))?;
        let ends = vec![(x(threshold.low), y), (x(threshold.high), y)];
        root.draw(&PathElement::new(ends, DOT.stroke_width(2)))?;
        if threshold.high.is_infinite() {
            let tip = vec![(x(MOST) + 8, y), (x(MOST), y - 5), (x(MOST), y + 5)];
            root.draw(&Polygon::new(tip, DOT))?;
        }
        if threshold.value.is_finite() {
            root.draw(&Circle::new((x(threshold.value), y), 5, DOT.filled()))?;
        }
        let darkest = curve.darkest.exposure_drop().0;
        let number = format!(
            "{} [{}, {}]",
            stops(threshold.value, darkest),
            stops(threshold.low, darkest),
            stops(threshold.high, darkest)
        );
        let place = (NAMES + AXIS + 16, y);
        root.draw(&Text::new(number, place, style(HPos::Left, VPos::Center)))?;
    }
    let below = format!("darkness threshold in EV, with 95 % interval by {unit}");
    let place = (NAMES + AXIS / 2, bottom + 30);
    root.draw(&Text::new(below, place, style(HPos::Center, VPos::Top)))?;
    root.present()
}
