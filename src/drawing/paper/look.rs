//! How a figure for a paper looks: its width, letters and palette ([`Look`]), and the pens of its lines ([`Pen`]).

use super::sheet::{Colour, Sheet, Stroke};
use crate::drawing::chart::{COLOURS, INK, LineStyle};

/// The colours of figures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Palette {
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

/// Dashes and gaps of models without images: one each, then again from the first.
const WITHOUT_IMAGES: [&[f64]; 2] = [&[6.0, 2.5], &[6.0, 1.5, 1.5, 1.5]];
/// Dots of chance and of the commonest true answer.
const DOTS: &[f64] = &[1.0, 2.2];

/// The measures and colours of a figure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Look {
    /// Width of the figure in points.
    pub width: f64,
    /// Height of the letters in points; those of ticks are smaller.
    pub letters: f64,
    pub palette: Palette,
}

/// The look of a figure that is a column wide.
#[cfg(test)]
pub(super) fn column_look() -> Look {
    Look {
        width: 252.0,
        letters: 8.0,
        palette: Palette::Colour,
    }
}

/// The mark at each point of a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Marker {
    Disc,
    Square,
    Triangle,
    Diamond,
    Cross,
    Ring,
}

const MARKERS: [Marker; 6] = [
    Marker::Disc,
    Marker::Square,
    Marker::Triangle,
    Marker::Diamond,
    Marker::Cross,
    Marker::Ring,
];

/// The stroke and the mark of a line.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Pen {
    pub stroke: Stroke,
    pub marker: Marker,
}

impl Look {
    /// Height of the letters at ticks.
    pub(super) fn small(&self) -> f64 {
        self.letters * 0.87
    }

    /// Widths of lines, in parts of those for letters of 8 points.
    pub(super) fn weight(&self) -> f64 {
        self.letters / 8.0
    }

    pub(super) fn colour(&self, style: LineStyle) -> Colour {
        let LineStyle(number) = style;
        match self.palette {
            Palette::Colour => style.rgb(),
            _ if [LineStyle::BLACK, LineStyle::REFERENCE].contains(&style) => style.rgb(),
            Palette::Grey => [GREYS[number % GREYS.len()]; 3],
        }
    }

    /// The pen of a line through points. The colours come again after the last, with another dash and mark.
    pub(super) fn pen(&self, style: LineStyle) -> Pen {
        let LineStyle(number) = style;
        let colours = match self.palette {
            Palette::Colour => COLOURS.len(),
            Palette::Grey => GREYS.len(),
        };
        let (dash, marker) = if style == LineStyle::BLACK {
            (DASHES[0], Marker::Ring)
        } else {
            let turn = number / colours;
            (
                DASHES[(number + turn) % DASHES.len()],
                MARKERS[(number + 3 * turn) % MARKERS.len()],
            )
        };
        let width = 1.1 * self.weight();
        Pen {
            stroke: self.dashed(self.colour(style), width, dash),
            marker,
        }
    }

    /// The stroke of the line of a model without images, the `place`th of the figure.
    pub(super) fn without_images(&self, place: usize) -> Stroke {
        let dash = WITHOUT_IMAGES[place % WITHOUT_IMAGES.len()];
        self.dashed(INK, 0.8 * self.weight(), dash)
    }

    /// The stroke of chance.
    pub(super) fn dots(&self) -> Stroke {
        self.dashed(INK, 0.8 * self.weight(), DOTS)
    }

    /// A thin solid line.
    pub(super) fn thin(&self, colour: Colour) -> Stroke {
        Stroke::solid(colour, 0.5 * self.weight())
    }

    fn dashed(&self, colour: Colour, width: f64, dash: &[f64]) -> Stroke {
        let lengths = dash.iter().map(|length| length * self.weight());
        Stroke {
            colour,
            width,
            dash: lengths.collect(),
        }
    }

    /// The mark of a pen, by its name in pgfplots.
    pub(super) fn pgf_mark(pen: &Pen) -> &'static str {
        match pen.marker {
            Marker::Disc => "*",
            Marker::Square => "square*",
            Marker::Triangle => "triangle*",
            Marker::Diamond => "diamond*",
            Marker::Cross => "x",
            Marker::Ring => "o",
        }
    }

    /// Draws the mark of a pen.
    pub(super) fn mark(&self, sheet: &mut Sheet, pen: &Pen, [x, y]: [f64; 2]) {
        use super::sheet::{Mark, PAPER};
        let reach = 1.9 * self.weight();
        let fill = pen.stroke.colour;
        let edge = Stroke::solid(fill, 0.8 * self.weight());
        match pen.marker {
            Marker::Disc => sheet.marks.push(Mark::Disc {
                centre: [x, y],
                radius: reach,
                fill: Some(fill),
                edge: None,
            }),
            Marker::Ring => sheet.marks.push(Mark::Disc {
                centre: [x, y],
                radius: reach,
                fill: Some(PAPER),
                edge: Some(edge),
            }),
            Marker::Square => {
                let side = reach * 0.9;
                let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
                let corners = corners.map(|(across, down)| [x + across * side, y + down * side]);
                sheet.area(corners.to_vec(), fill, 1.0);
            }
            Marker::Triangle => {
                let high = reach * 1.25;
                let corners = [
                    [x, y - high],
                    [x + high, y + reach * 0.8],
                    [x - high, y + reach * 0.8],
                ];
                sheet.area(corners.to_vec(), fill, 1.0);
            }
            Marker::Diamond => {
                let long = reach * 1.3;
                let corners = [[x, y - long], [x + long, y], [x, y + long], [x - long, y]];
                sheet.area(corners.to_vec(), fill, 1.0);
            }
            Marker::Cross => {
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

    /// Contrast with white after the Web Content Accessibility Guidelines 2.1: (1 + 0.05) / (L + 0.05).
    fn contrast(colour: Colour) -> f64 {
        let light = colour.map(|code| {
            let share = f64::from(code) / 255.0;
            if share <= 0.04045 {
                share / 12.92
            } else {
                ((share + 0.055) / 1.055).powf(2.4)
            }
        });
        1.05 / (0.2126 * light[0] + 0.7152 * light[1] + 0.0722 * light[2] + 0.05)
    }

    #[test]
    fn lines_stand_out_from_white_and_no_two_of_them_look_the_same() {
        for palette in [Palette::Colour, Palette::Grey] {
            let look = Look {
                width: 252.0,
                letters: 8.0,
                palette,
            };
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
