//! Drawing the marks of photographs in the dark in a panel.

use plotters::element::{Circle, IntoDynElement};
use plotters::prelude::Color;

use super::{AxisFrame, BACKGROUND, DarkMark, FigureArea, LineStyle, draw_path};

/// Radius of a mark, in pixels; chosen, as for the markers of lines.
const RADIUS: i32 = 5;

impl AxisFrame {
    /// Draws a hollow mark at its median drop, with a horizontal bar from quartile to quartile and a vertical one for its interval.
    pub(super) fn mark(
        &self,
        root: &FigureArea<'_>,
        style: LineStyle,
        mark: &DarkMark,
    ) -> Result<(), String> {
        let [low, middle, high] = mark.ev.map(|ev| self.x_of(ev.max(0.0)));
        let y = self.y(mark.share.value);
        let stroke = style.colour().stroke_width(1);
        draw_path(root, &[(low, y), (high, y)], stroke)?;
        let ends = [self.y(mark.share.low), self.y(mark.share.high)];
        draw_path(root, &ends.map(|y| (middle, y)), stroke)?;
        style.hollow(root, (middle, y))
    }
}

impl LineStyle {
    /// Draws a hollow mark.
    pub(super) fn hollow(self, root: &FigureArea<'_>, place: (i32, i32)) -> Result<(), String> {
        let paper = Circle::new(place, RADIUS, BACKGROUND.filled());
        root.draw(&paper.into_dyn()).map_err(|e| e.to_string())?;
        let ring = Circle::new(place, RADIUS, self.colour().stroke_width(2));
        root.draw(&ring.into_dyn()).map_err(|e| e.to_string())
    }
}
