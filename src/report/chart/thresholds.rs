//! A figure of thresholds, a row for each curve: [`ThresholdChart`].

use plotters::prelude::*;

use super::{BACKGROUND, BELOW, FigureArea, GRID, LEFT, LineStyle, RIGHT, draw_path, draw_text};
use crate::error::{Error, Result};
use crate::report::words::shortened;
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
#[derive(Debug, Clone)]
pub(crate) struct Scale {
    pub end: f64,
    /// Distance of two ticks.
    pub step: i32,
    /// Name of the threshold.
    pub title: &'static str,
    pub unit: &'static str,
}

impl Scale {
    pub(crate) fn of(axis: Axis) -> Self {
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

/// The threshold of one curve.
#[derive(Debug, Clone)]
pub(crate) struct ThresholdRow {
    /// The model and its light.
    pub name: String,
    pub threshold: Threshold,
    /// The threshold with its interval, in words.
    pub words: String,
}

/// A figure of the thresholds on one axis.
#[derive(Debug, Clone)]
pub(crate) struct ThresholdChart {
    pub rows: Vec<ThresholdRow>,
    pub scale: Scale,
    /// The unit of the intervals: scenes or frames.
    pub unit: String,
}

impl ThresholdChart {
    /// The chart as SVG.
    ///
    /// # Errors
    /// If it cannot be drawn.
    pub(crate) fn svg(&self) -> Result<String> {
        let size = (
            (NAMES + AXIS + NUMBERS) as u32,
            (self.rows.len() as i32 * ROW + 76) as u32,
        );
        let mut svg = String::new();
        let drawn = {
            let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
            self.draw(&root)
        };
        drawn.map_err(|e| Error::data("figure", e))?;
        Ok(svg)
    }

    fn draw(&self, root: &FigureArea<'_>) -> Result<(), String> {
        let failed = |e: DrawingAreaErrorKind<_>| e.to_string();
        let scale = &self.scale;
        let x = |value: f64| scale.x(value);
        let colour = LineStyle(0).colour();
        root.fill(&BACKGROUND).map_err(failed)?;
        let bottom = 12 + self.rows.len() as i32 * ROW;
        for tick in (0..=scale.end as i32).step_by(scale.step as usize) {
            let at = x(f64::from(tick));
            draw_path(root, &[(at, 8), (at, bottom)], GRID.stroke_width(1))?;
            draw_text(root, &tick.to_string(), (at, bottom + 6), 13, BELOW)?;
        }
        for (index, row) in (0..).zip(&self.rows) {
            let threshold = row.threshold;
            let y = 12 + index * ROW + ROW / 2;
            let name = shortened(&row.name, NAME_LETTERS);
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
            let place = (NAMES + AXIS + 16, y);
            draw_text(root, &row.words, place, 13, LEFT)?;
        }
        let place = (NAMES + AXIS / 2, bottom + 30);
        draw_text(root, &self.axis_title(), place, 13, BELOW)?;
        root.present().map_err(failed)
    }

    /// Title of the axis.
    pub(crate) fn axis_title(&self) -> String {
        let Scale { title, unit, .. } = self.scale;
        format!("{title} in {unit}, with 95 % interval by {}", self.unit)
    }
}
