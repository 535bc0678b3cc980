//! Style of a figure: its width, font size and palette ([`Look`]), and the stroke and marker of each line ([`Pen`]).

use super::sheet::{Colour, PAPER, Point, Shape, Sheet, Stroke};
use crate::charts::chart::{COLOURS, INK, LineStyle};

/// The colours of figures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum FigureColours {
    /// Six colours that can be distinguished with any colour vision
    #[value(name = "colour", alias = "color")]
    Colour,
    /// Five greys, told apart by dash and mark
    Grey,
}

/// Five greys; the lightest has a contrast with white of 3.0.
const GREYS: [u8; 5] = [0, 120, 60, 148, 90];

/// Dashes and gaps of lines, in widths of a line of 1 pt.
const DASHES: [&[f64]; 4] = [&[], &[4.0, 2.0], &[1.5, 1.5], &[7.0, 1.8, 1.5, 1.8]];

/// Dashes and gaps of the lines of models without images, used in turn.
const WITHOUT_IMAGES: [&[f64]; 2] = [&[6.0, 2.5], &[6.0, 1.5, 1.5, 1.5]];
/// Dots and gaps of the lines of chance and of the commonest true answer.
const DOTS: &[f64] = &[1.0, 2.2];

/// Width, font size and colours of a figure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Look {
    /// Width of the figure in points.
    pub width: f64,
    /// Font size in points; tick labels are smaller.
    pub font_size: f64,
    pub palette: FigureColours,
}

/// Style of a figure as wide as a column of a paper.
#[cfg(test)]
pub(super) fn column_look() -> Look {
    Look { width: 252.0, font_size: 8.0, palette: FigureColours::Colour }
}

/// Marker at each point of a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum LineMarker {
    Disc,
    Square,
    Triangle,
    Diamond,
    Cross,
    Ring,
}

const MARKERS: [LineMarker; 6] = [
    LineMarker::Disc,
    LineMarker::Square,
    LineMarker::Triangle,
    LineMarker::Diamond,
    LineMarker::Cross,
    LineMarker::Ring,
];

/// Stroke and marker of a line.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Pen {
    pub stroke: Stroke,
    pub marker: LineMarker,
}

impl Look {
    /// Font size of tick labels in points.
    pub(super) fn tick_font_size(&self) -> f64 {
        self.font_size * 0.87
    }

    /// Factor for line widths, which grow with the font size; 1 at 8 points.
    pub(super) fn line_scale(&self) -> f64 {
        self.font_size / 8.0
    }

    pub(super) fn colour(&self, style: LineStyle) -> Colour {
        let LineStyle(number) = style;
        match self.palette {
            FigureColours::Colour => style.rgb(),
            _ if style.is_ink() => style.rgb(),
            FigureColours::Grey => [GREYS[number % GREYS.len()]; 3],
        }
    }

    /// Stroke and marker of a curve. Colours repeat after the last one, with another dash and marker.
    pub(super) fn pen(&self, style: LineStyle) -> Pen {
        let LineStyle(number) = style;
        let colours = match self.palette {
            FigureColours::Colour => COLOURS.len(),
            FigureColours::Grey => GREYS.len(),
        };
        let (dash, marker) = if style == LineStyle::BLACK {
            (DASHES[0], LineMarker::Ring)
        } else {
            let repeat = number / colours;
            (DASHES[(number + repeat) % DASHES.len()], MARKERS[(number + 3 * repeat) % MARKERS.len()])
        };
        let width = 1.1 * self.line_scale();
        Pen { stroke: self.dashed(self.colour(style), width, dash), marker }
    }

    /// Stroke for a model without images; `index` counts these models in the figure.
    pub(super) fn without_images_stroke(&self, index: usize) -> Stroke {
        let dash = WITHOUT_IMAGES[index % WITHOUT_IMAGES.len()];
        self.dashed(INK, 0.8 * self.line_scale(), dash)
    }

    /// Dotted stroke, for chance.
    pub(super) fn dotted_stroke(&self) -> Stroke {
        self.dashed(INK, 0.8 * self.line_scale(), DOTS)
    }

    /// Thin solid stroke.
    pub(super) fn thin_stroke(&self, colour: Colour) -> Stroke {
        Stroke::solid(colour, 0.5 * self.line_scale())
    }

    fn dashed(&self, colour: Colour, width: f64, dash: &[f64]) -> Stroke {
        Stroke { colour, width, dash: dash.iter().map(|length| length * self.line_scale()).collect() }
    }

    /// Name of a pen's marker in pgfplots.
    pub(super) fn pgf_mark(pen: &Pen) -> &'static str {
        match pen.marker {
            LineMarker::Disc => "*",
            LineMarker::Square => "square*",
            LineMarker::Triangle => "triangle*",
            LineMarker::Diamond => "diamond*",
            LineMarker::Cross => "x",
            LineMarker::Ring => "o",
        }
    }

    /// Draws a hollow marker.
    pub(super) fn draw_hollow_marker(&self, sheet: &mut Sheet, style: LineStyle, centre: Point) {
        sheet.shapes.push(Shape::Disc {
            centre,
            radius: 2.2 * self.line_scale(),
            fill: Some(PAPER),
            edge: Some(Stroke::solid(self.colour(style), 0.9 * self.line_scale())),
        });
    }

    /// Draws the marker of a pen at a point.
    pub(super) fn draw_marker(&self, sheet: &mut Sheet, pen: &Pen, [x, y]: Point) {
        let reach = 1.9 * self.line_scale();
        let fill = pen.stroke.colour;
        let edge = Stroke::solid(fill, 0.8 * self.line_scale());
        match pen.marker {
            LineMarker::Disc => {
                sheet.shapes.push(Shape::Disc { centre: [x, y], radius: reach, fill: Some(fill), edge: None });
            }
            LineMarker::Ring => {
                sheet.shapes.push(Shape::Disc { centre: [x, y], radius: reach, fill: Some(PAPER), edge: Some(edge) });
            }
            LineMarker::Square => {
                let side = reach * 0.9;
                let corners = [[x - side, y - side], [x + side, y - side], [x + side, y + side], [x - side, y + side]];
                sheet.area(corners.to_vec(), fill, 1.0);
            }
            LineMarker::Triangle => {
                let high = reach * 1.25;
                let corners = [[x, y - high], [x + high, y + reach * 0.8], [x - high, y + reach * 0.8]];
                sheet.area(corners.to_vec(), fill, 1.0);
            }
            LineMarker::Diamond => {
                let long = reach * 1.3;
                let corners = [[x, y - long], [x + long, y], [x, y + long], [x - long, y]];
                sheet.area(corners.to_vec(), fill, 1.0);
            }
            LineMarker::Cross => {
                sheet.line(&[[x - reach, y - reach], [x + reach, y + reach]], &edge);
                sheet.line(&[[x - reach, y + reach], [x + reach, y - reach]], &edge);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    /// Contrast with white by the Web Content Accessibility Guidelines 2.1: (1 + 0.05) / (L + 0.05).
    fn contrast(colour: Colour) -> f64 {
        let linear = colour.map(|code| {
            let share = f64::from(code) / 255.0;
            if share <= 0.04045 { share / 12.92 } else { ((share + 0.055) / 1.055).powf(2.4) }
        });
        1.05 / (0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2] + 0.05)
    }

    #[test]
    fn lines_contrast_with_white_and_differ() {
        for palette in [FigureColours::Colour, FigureColours::Grey] {
            let look = Look { width: 252.0, font_size: 8.0, palette };
            let mut seen = BTreeSet::new();
            for number in 0..12 {
                let pen = look.pen(LineStyle(number));
                assert!(contrast(pen.stroke.colour) >= 3.0, "{palette:?} {number}");
                seen.insert(format!("{pen:?}"));
            }
            assert_eq!(seen.len(), 12, "{palette:?}");
            assert_eq!(look.colour(LineStyle::BLACK), [0; 3]);
        }
        assert!(contrast([255, 255, 0]) < 3.0);
    }
}
