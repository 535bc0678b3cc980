//! A figure of bars: shares that lie on no axis, as those of photographs in the dark, raw and enhanced ([`BarChart`]).

use plotters::element::DashedPathElement;
use plotters::prelude::*;

use super::{
    BACKGROUND, BELOW, FigureArea, GRID, INK, LEFT, LineStyle, MARGIN, PANEL, RIGHT, ROW,
    draw_path, draw_text,
};
use crate::error::{Error, Result};
use crate::score::estimate::Estimate;

/// Width of a bar with the room beside it, in pixels.
const STEP: i32 = 64;
/// Width of a bar, in pixels.
const BAR: i32 = 36;
/// Most letters of a name below a bar.
const LETTERS: usize = 10;

/// One bar.
#[derive(Debug, Clone)]
pub(crate) struct Bar {
    /// Name in the legend, and shortened below the bar.
    pub name: String,
    pub style: LineStyle,
    pub share: Estimate,
}

/// The bars of one model.
#[derive(Debug, Clone)]
pub(crate) struct BarPanel {
    pub title: String,
    pub bars: Vec<Bar>,
    /// A share that is drawn as a broken line: chance.
    pub line: Option<f64>,
}

/// A figure of panels of bars, side by side.
#[derive(Debug, Clone)]
pub(crate) struct BarChart {
    pub panels: Vec<BarPanel>,
    /// Note below the panels.
    pub note: String,
}

impl BarChart {
    /// The chart as SVG.
    ///
    /// # Errors
    /// If it cannot be drawn.
    pub(crate) fn svg(&self) -> Result<String> {
        let widths = self.panels.iter().map(|panel| {
            let bars = panel.bars.len() as i32 * STEP;
            (MARGIN[0] + bars + MARGIN[2]).max(PANEL.0)
        });
        let widths: Vec<i32> = widths.collect();
        let size = (
            widths.iter().sum::<i32>().max(1) as u32,
            (PANEL.1 + ROW + 8) as u32,
        );
        let mut svg = String::new();
        let drawn = {
            let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
            self.draw(&root, &widths)
        };
        drawn.map_err(|e| Error::data("figure", e))?;
        Ok(svg)
    }

    fn draw(&self, root: &FigureArea<'_>, widths: &[i32]) -> Result<(), String> {
        root.fill(&BACKGROUND).map_err(|e| e.to_string())?;
        let mut left = 0;
        for (panel, width) in self.panels.iter().zip(widths) {
            panel.draw(root, left, *width)?;
            left += width;
        }
        draw_text(root, &self.note, (12, PANEL.1 + ROW / 2), 12, LEFT)?;
        root.present().map_err(|e| e.to_string())
    }
}

impl BarPanel {
    fn draw(&self, root: &FigureArea<'_>, corner: i32, width: i32) -> Result<(), String> {
        let (left, right) = (corner + MARGIN[0], corner + width - MARGIN[2]);
        let (top, bottom) = (MARGIN[1], PANEL.1 - MARGIN[3]);
        let y =
            |share: f64| bottom - (f64::from(bottom - top) * share.clamp(0.0, 1.0)).round() as i32;
        for step in 0..=5 {
            let share = f64::from(step) / 5.0;
            draw_path(
                root,
                &[(left, y(share)), (right, y(share))],
                GRID.stroke_width(1),
            )?;
            draw_text(
                root,
                &(step * 20).to_string(),
                (left - 6, y(share)),
                12,
                RIGHT,
            )?;
        }
        draw_text(root, &self.title, (left - 40, top - 18), 14, LEFT)?;
        for (index, bar) in self.bars.iter().enumerate() {
            let middle = left + STEP / 2 + index as i32 * STEP;
            let corners = [
                (middle - BAR / 2, y(bar.share.value)),
                (middle + BAR / 2, bottom),
            ];
            let colour = bar.style.colour();
            root.draw(&Rectangle::new(corners, colour.mix(0.5).filled()))
                .map_err(|e| e.to_string())?;
            let ends = [(middle, y(bar.share.low)), (middle, y(bar.share.high))];
            draw_path(root, &ends, INK.stroke_width(2))?;
            let short: String = bar.name.chars().take(LETTERS).collect();
            let more = if bar.name.chars().count() > LETTERS {
                "…"
            } else {
                ""
            };
            draw_text(
                root,
                &format!("{short}{more}"),
                (middle, bottom + 7),
                12,
                BELOW,
            )?;
            let share = format!("{:.1}", 100.0 * bar.share.value);
            draw_text(root, &share, (middle, bottom + 22), 11, BELOW)?;
        }
        if let Some(share) = self.line {
            let ends = vec![(left, y(share)), (right, y(share))];
            root.draw(&DashedPathElement::new(ends, 6, 4, INK.stroke_width(1)))
                .map_err(|e| e.to_string())?;
        }
        draw_path(
            root,
            &[(left, bottom), (right, bottom)],
            INK.stroke_width(1),
        )
    }
}
