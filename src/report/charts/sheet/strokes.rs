//! Anti-aliased lines and bands on a sheet. Points are `[x, y]` in pixels, from the upper left corner.

use std::ops::Range;

use super::SheetCanvas;

impl SheetCanvas {
    /// Blends a colour into a pixel with an opacity from 0 to 1; pixels outside the sheet are ignored.
    fn blend(&mut self, row: usize, column: usize, colour: [u8; 3], opacity: f64) {
        if row >= self.height || column >= self.width {
            return;
        }
        let below = self.pixel(row, column);
        let blended = [0, 1, 2].map(|channel| {
            let (above, below) = (f64::from(colour[channel]), f64::from(below[channel]));
            (below + (above - below) * opacity).round() as u8
        });
        self.set(row, column, blended);
    }

    /// Draws a straight line. The opacity of a pixel falls with the distance of its centre from the line, which smooths
    /// the edges.
    pub(super) fn line(&mut self, ends: [[f64; 2]; 2], width: f64, colour: [u8; 3]) {
        let [from, to] = ends;
        let reach = width / 2.0 + 1.0;
        let along = [to[0] - from[0], to[1] - from[1]];
        let squared_length = (along[0] * along[0] + along[1] * along[1]).max(1e-9);
        for row in pixel_range(from[1], to[1], reach) {
            for column in pixel_range(from[0], to[0], reach) {
                let [x, y] = [column as f64 + 0.5, row as f64 + 0.5];
                let part = ((x - from[0]) * along[0] + (y - from[1]) * along[1]) / squared_length;
                let part = part.clamp(0.0, 1.0);
                let nearest = [from[0] + part * along[0], from[1] + part * along[1]];
                let distance = (x - nearest[0]).hypot(y - nearest[1]);
                self.blend(row, column, colour, (width / 2.0 + 0.5 - distance).clamp(0.0, 1.0));
            }
        }
    }

    /// Draws a line through points. `dash` is the length of dashes and gaps in pixels; `None` draws a solid line.
    pub(super) fn path(&mut self, points: &[[f64; 2]], dash: Option<[f64; 2]>, width: f64, colour: [u8; 3]) {
        let Some([drawn, gap]) = dash else {
            for ends in points.windows(2) {
                self.line([ends[0], ends[1]], width, colour);
            }
            return;
        };
        let mut path_length = 0.0;
        for ends in points.windows(2) {
            let along = [ends[1][0] - ends[0][0], ends[1][1] - ends[0][1]];
            let length = along[0].hypot(along[1]);
            let at = |distance: f64| {
                let part = (distance / length.max(1e-9)).clamp(0.0, 1.0);
                [ends[0][0] + part * along[0], ends[0][1] + part * along[1]]
            };
            // Dashes continue around the corners of the path.
            let mut start = -(path_length % (drawn + gap));
            while start < length {
                if start + drawn > 0.0 {
                    self.line([at(start), at(start + drawn)], width, colour);
                }
                start += drawn + gap;
            }
            path_length += length;
        }
    }

    /// Tints the area between two lines. Points are `[x, upper y, lower y]` from left to right.
    pub(super) fn band(&mut self, points: &[[f64; 3]], colour: [u8; 3], opacity: f64) {
        for ends in points.windows(2) {
            let [from, to] = [ends[0], ends[1]];
            for column in from[0].round() as usize..to[0].round() as usize {
                let part = (column as f64 + 0.5 - from[0]) / (to[0] - from[0]).max(1e-9);
                let [upper, lower] = [1, 2].map(|i| (from[i] + part * (to[i] - from[i])).round() as usize);
                for row in upper..lower {
                    self.blend(row, column, colour, opacity);
                }
            }
        }
    }
}

/// Rows or columns that are at most `reach` pixels from the range between two coordinates.
fn pixel_range(a: f64, b: f64, reach: f64) -> Range<usize> {
    let (low, high) = (a.min(b), a.max(b));
    (low - reach).max(0.0) as usize..(high + reach).max(0.0) as usize + 1
}

#[cfg(test)]
mod tests {
    use super::*;

    fn count_drawn_pixels(canvas: &SheetCanvas) -> usize {
        canvas.samples.chunks(3).filter(|pixel| **pixel != [255; 3]).count()
    }

    #[test]
    fn a_line_covers_its_length_and_width() {
        let mut canvas = SheetCanvas::new(20, 100);
        canvas.line([[10.0, 10.0], [90.0, 10.0]], 2.0, [0; 3]);
        assert_eq!(canvas.pixel(9, 50), [0; 3]);
        assert_eq!(canvas.pixel(10, 50), [0; 3]);
        assert_eq!(canvas.pixel(7, 50), [255; 3]);
        assert_eq!(canvas.pixel(10, 95), [255; 3]);
    }

    #[test]
    fn dashes_leave_gaps() {
        let points = [[0.0, 10.0], [50.0, 10.0], [100.0, 10.0]];
        let [solid, dashed] = [None, Some([6.0, 6.0])].map(|dash| {
            let mut canvas = SheetCanvas::new(20, 100);
            canvas.path(&points, dash, 2.0, [0; 3]);
            count_drawn_pixels(&canvas)
        });
        assert!(dashed > solid / 3 && dashed < solid * 4 / 5, "{dashed} of {solid}");
    }

    #[test]
    fn nothing_is_drawn_outside_the_sheet() {
        let mut canvas = SheetCanvas::new(8, 8);
        canvas.line([[-50.0, -50.0], [50.0, 50.0]], 3.0, [0; 3]);
        canvas.band(&[[0.0, 2.0, 90.0], [90.0, 2.0, 90.0]], [9; 3], 0.5);
        assert!(count_drawn_pixels(&canvas) > 0);
    }
}
