//! Shapes of a drawn figure, in points: [`Sheet`]. They can be written as PDF or as SVG.

use std::sync::Arc;

use crate::error::{Error, Result};
use crate::types::Rgb;

use super::font::Font;

/// Position in points: distance from the left, and from the top.
pub(crate) type Point = [f64; 2];

/// Red, green and blue.
pub(crate) type Colour = [u8; 3];

/// Colour of grid lines.
pub(super) const GRID: Colour = [221, 221, 221];
/// Colour of the background, and of hollow markers.
pub(super) const PAPER: Colour = [255, 255, 255];

/// A drawn figure: its shapes from the lowest to the topmost.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Sheet {
    /// Width and height in points.
    pub size: [f64; 2],
    pub shapes: Vec<Shape>,
}

/// Colour, width and dashes of a line.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Stroke {
    pub colour: Colour,
    /// Width in points.
    pub width: f64,
    /// Lengths of dashes and gaps in points; empty for a solid line.
    pub dash: Vec<f64>,
}

impl Stroke {
    /// Stroke without dashes; `width` is in points.
    pub(super) fn solid(colour: Colour, width: f64) -> Self {
        Self { colour, width, dash: Vec::new() }
    }
}

/// One shape of a figure.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Shape {
    /// An open line through points.
    Line {
        points: Vec<Point>,
        stroke: Stroke,
    },
    /// A filled polygon.
    Area {
        corners: Vec<Point>,
        fill: Colour,
        /// From 0 (invisible) to 1.
        opacity: f64,
    },
    /// A circle.
    Disc {
        centre: Point,
        radius: f64,
        fill: Option<Colour>,
        edge: Option<Stroke>,
    },
    Label(TextLabel),
    /// A bitmap image.
    Picture {
        /// Upper left corner.
        corner: Point,
        /// Width and height in points.
        size: [f64; 2],
        image: Arc<Rgb>,
    },
}

/// Text on one line.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct TextLabel {
    pub text: String,
    /// Start of the baseline: its left end, or its lower end if the text runs upwards.
    pub start: Point,
    /// Font size in points.
    pub size: f64,
    pub direction: TextDirection,
}

/// Direction in which a text runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum TextDirection {
    Right,
    Up,
}

/// Part of a text's baseline that is at its position.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

#[cfg(test)]
impl Sheet {
    /// Bottom centre of the first label with a text.
    pub(super) fn label_position(&self, text: &str) -> Point {
        self.shapes
            .iter()
            .find_map(|shape| match shape {
                Shape::Label(label) if label.text == text => {
                    let width = Font::bundled().width(text, label.size);
                    Some([label.start[0] + width / 2.0, label.start[1]])
                }
                _ => None,
            })
            .unwrap()
    }
}

impl Sheet {
    pub(super) fn line(&mut self, points: &[Point], stroke: &Stroke) {
        self.shapes.push(Shape::Line { points: points.to_vec(), stroke: stroke.clone() });
    }

    pub(super) fn area(&mut self, corners: Vec<Point>, fill: Colour, opacity: f64) {
        self.shapes.push(Shape::Area { corners, fill, opacity });
    }

    /// Adds a horizontal text whose anchor is at a position.
    pub(super) fn label(&mut self, text: &str, position: Point, size: f64, anchor: Anchor) {
        self.rotated_label(text, position, size, anchor, TextDirection::Right);
    }

    /// Adds a text in any direction.
    pub(super) fn rotated_label(
        &mut self,
        text: &str,
        [x, y]: Point,
        size: f64,
        anchor: Anchor,
        direction: TextDirection,
    ) {
        if text.is_empty() {
            return;
        }
        let width = Font::bundled().width(text, size);
        let offset = match anchor {
            Anchor::Start => 0.0,
            Anchor::Middle => width / 2.0,
            Anchor::End => width,
        };
        let start = match direction {
            TextDirection::Right => [x - offset, y],
            TextDirection::Up => [x, y + offset],
        };
        self.shapes.push(Shape::Label(TextLabel { text: text.to_owned(), start, size, direction }));
    }

    /// Adds a white background, for viewers with a dark one.
    pub(super) fn on_paper(mut self) -> Self {
        let [width, height] = self.size;
        let background = Shape::Area {
            corners: vec![[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]],
            fill: PAPER,
            opacity: 1.0,
        };
        self.shapes.insert(0, background);
        self
    }

    /// Adds the shapes of another sheet, with its upper left corner at a position.
    pub(super) fn insert(&mut self, other: Sheet, [left, top]: Point) {
        let moved = |[x, y]: Point| [x + left, y + top];
        self.shapes.extend(other.shapes.into_iter().map(|shape| match shape {
            Shape::Line { points, stroke } => Shape::Line { points: points.into_iter().map(moved).collect(), stroke },
            Shape::Area { corners, fill, opacity } => {
                Shape::Area { corners: corners.into_iter().map(moved).collect(), fill, opacity }
            }
            Shape::Disc { centre, radius, fill, edge } => Shape::Disc { centre: moved(centre), radius, fill, edge },
            Shape::Label(label) => Shape::Label(TextLabel { start: moved(label.start), ..label }),
            Shape::Picture { corner, size, image } => Shape::Picture { corner: moved(corner), size, image },
        }));
    }

    /// Checks that the bundled font has all characters of the sheet.
    ///
    /// # Errors
    /// If the font lacks a character; the error names the text and the character.
    pub(crate) fn check_characters(&self) -> Result<()> {
        let font = Font::bundled();
        for shape in &self.shapes {
            let Shape::Label(TextLabel { text, .. }) = shape else {
                continue;
            };
            if let Some(letter) = text.chars().find(|letter| !font.has(*letter)) {
                let problem = format!(
                    "the font of figures has Latin and Greek letters, not {letter:?} of {text:?}: give the name in other letters with --label OLD=NEW"
                );
                return Err(Error::usage("figures", problem));
            }
        }
        Ok(())
    }
}
