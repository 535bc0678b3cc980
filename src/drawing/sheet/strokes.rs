//! Lines, bands and marks with smooth edges on a sheet. Places are `[x, y]` in pixels, from the upper left corner.

use super::SheetCanvas;

impl SheetCanvas {
    /// Mixes a colour into a pixel, by a share from 0 to 1; pixels outside the sheet are ignored.
    fn mix(&mut self, row: usize, column: usize, colour: [u8; 3], share: f64) {
        if row >= self.height || column >= self.width {
            return;
        }
        let below = self.pixel(row, column);
        let mixed = |i: usize| {
            let (above, below) = (f64::from(colour[i]), f64::from(below[i]));
            (below + (above - below) * share).round() as u8
        };
        self.set(row, column, [mixed(0), mixed(1), mixed(2)]);
    }

    /// Draws a straight line. A pixel is covered as far as its centre is inside the width of the line, which makes its edges smooth.
    pub(super) fn line(&mut self, ends: [[f64; 2]; 2], width: f64, colour: [u8; 3]) {
        let [from, to] = ends;
        let reach = width / 2.0 + 1.0;
        let range = |axis: usize| {
            let (low, high) = (from[axis].min(to[axis]), from[axis].max(to[axis]));
            (low - reach).max(0.0) as usize..(high + reach).max(0.0) as usize + 1
        };
        let along = [to[0] - from[0], to[1] - from[1]];
        let length = (along[0] * along[0] + along[1] * along[1]).max(1e-9);
        for row in range(1) {
            for column in range(0) {
                let [x, y] = [column as f64 + 0.5, row as f64 + 0.5];
                let part = ((x - from[0]) * along[0] + (y - from[1]) * along[1]) / length;
                let part = part.clamp(0.0, 1.0);
                let nearest = [from[0] + part * along[0], from[1] + part * along[1]];
                let distance = (x - nearest[0]).hypot(y - nearest[1]);
                self.mix(
                    row,
                    column,
                    colour,
                    (width / 2.0 + 0.5 - distance).clamp(0.0, 1.0),
                );
            }
        }
    }

    /// Draws a line through places, with dashes of a length and a gap if they are given.
    pub(super) fn path(
        &mut self,
        places: &[[f64; 2]],
        dash: Option<[f64; 2]>,
        width: f64,
        colour: [u8; 3],
    ) {
        let Some([drawn, gap]) = dash else {
            for ends in places.windows(2) {
                self.line([ends[0], ends[1]], width, colour);
            }
            return;
        };
        let mut walked = 0.0;
        for ends in places.windows(2) {
            let along = [ends[1][0] - ends[0][0], ends[1][1] - ends[0][1]];
            let length = along[0].hypot(along[1]);
            let at = |distance: f64| {
                let part = (distance / length.max(1e-9)).clamp(0.0, 1.0);
                [ends[0][0] + part * along[0], ends[0][1] + part * along[1]]
            };
            // The dashes go on over the corners of the path.
            let mut start = -(walked % (drawn + gap));
            while start < length {
                if start + drawn > 0.0 {
                    self.line([at(start), at(start + drawn)], width, colour);
                }
                start += drawn + gap;
            }
            walked += length;
        }
    }

    /// Tints the area between two lines, given as `[x, upper y, lower y]` from left to right.
    pub(super) fn band(&mut self, points: &[[f64; 3]], colour: [u8; 3], share: f64) {
        for ends in points.windows(2) {
            let [from, to] = [ends[0], ends[1]];
            for column in from[0].round() as usize..to[0].round() as usize {
                let part = (column as f64 + 0.5 - from[0]) / (to[0] - from[0]).max(1e-9);
                let at = |i: usize| (from[i] + part * (to[i] - from[i])).round() as usize;
                for row in at(1)..at(2) {
                    self.mix(row, column, colour, share);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn inked(canvas: &SheetCanvas) -> usize {
        canvas
            .samples
            .chunks(3)
            .filter(|pixel| **pixel != [255; 3])
            .count()
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
    fn dashes_leave_their_gaps_also_over_corners() {
        let places = [[0.0, 10.0], [50.0, 10.0], [100.0, 10.0]];
        let ink = |dash| {
            let mut canvas = SheetCanvas::new(20, 100);
            canvas.path(&places, dash, 2.0, [0; 3]);
            inked(&canvas)
        };
        let (solid, dashed) = (ink(None), ink(Some([6.0, 6.0])));
        assert!(
            dashed > solid / 3 && dashed < solid * 4 / 5,
            "{dashed} of {solid}"
        );
    }

    #[test]
    fn nothing_is_drawn_outside_the_sheet() {
        let mut canvas = SheetCanvas::new(8, 8);
        canvas.line([[-50.0, -50.0], [50.0, 50.0]], 3.0, [0; 3]);
        canvas.band(&[[0.0, 2.0, 90.0], [90.0, 2.0, 90.0]], [9; 3], 0.5);
        assert!(inked(&canvas) > 0);
    }
}
