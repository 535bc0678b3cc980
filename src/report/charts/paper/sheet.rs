//! Shapes of a drawn figure, in points: [`Sheet`]. They can be written as PDF or as SVG.

use std::sync::Arc;

use darkqa_base::error::{Error, Result};
use darkqa_base::types::Rgb;

use super::font::Font;

/// Position in points: distance from the left, and from the top.
pub(super) type Point = [f64; 2];

/// Red, green and blue.
pub(super) type Colour = [u8; 3];

/// Colour of grid lines.
pub(super) const GRID: Colour = [221, 221, 221];
/// Colour of the background, and of hollow markers.
pub(super) const PAPER: Colour = [255, 255, 255];

/// A drawn figure: its shapes from the lowest to the topmost.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Sheet {
    /// Width and height in points.
    pub size: [f64; 2],
    pub shapes: Vec<Shape>,
}

/// Colour, width and dashes of a line.
#[derive(Debug, Clone, PartialEq)]
pub struct Stroke {
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
pub enum Shape {
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
    Group(ShapeGroup),
    /// A bitmap image.
    Picture {
        /// Upper left corner.
        corner: Point,
        /// Width and height in points.
        size: [f64; 2],
        image: Arc<Rgb>,
    },
}

/// Shapes that belong together. PDF and SVG files have the shapes alone; the page has the group with its class, data
/// and title, for its style and its script.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ShapeGroup {
    /// CSS classes.
    pub class: &'static str,
    /// Names and values of the attributes whose names begin with `data-`.
    pub data: Vec<(&'static str, String)>,
    /// Text that a browser shows at the pointer; empty for none.
    pub title: String,
    pub shapes: Vec<Shape>,
}

/// Text on one line.
#[derive(Debug, Clone, PartialEq)]
pub struct TextLabel {
    pub text: String,
    /// Start of the baseline: its left end, or its lower end if the text runs upwards.
    pub start: Point,
    /// Font size in points.
    pub size: f64,
    /// Part of the baseline that keeps its position if another font is used.
    pub anchor: Anchor,
    pub direction: TextDirection,
}

impl TextLabel {
    /// Width in points.
    pub(super) fn width(&self) -> f64 {
        Font::bundled().width(&self.text, self.size)
    }

    /// Position of the anchor.
    pub(super) fn position(&self) -> Point {
        let ([x, y], offset) = (self.start, self.anchor.offset(self.width()));
        match self.direction {
            TextDirection::Right => [x + offset, y],
            TextDirection::Up => [x, y - offset],
        }
    }
}

/// Direction in which a text runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TextDirection {
    Right,
    Up,
}

/// Part of a text's baseline that is at its position.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Anchor {
    Start,
    Middle,
    End,
}

impl Anchor {
    /// Distance of the anchor from the start of a text of a width.
    fn offset(self, width: f64) -> f64 {
        match self {
            Self::Start => 0.0,
            Self::Middle => width / 2.0,
            Self::End => width,
        }
    }
}

#[cfg(test)]
impl Sheet {
    /// Bottom centre of the first label with a text.
    pub(super) fn label_position(&self, text: &str) -> Point {
        self.ungrouped()
            .into_iter()
            .find_map(|shape| match shape {
                Shape::Label(label) if label.text == text => {
                    Some([label.start[0] + label.width() / 2.0, label.start[1]])
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

    /// Adds shapes as a group of a class.
    pub(super) fn group(&mut self, class: &'static str, shapes: impl IntoIterator<Item = Shape>) {
        let shapes = shapes.into_iter().collect();
        self.shapes.push(Shape::Group(ShapeGroup { class, shapes, ..ShapeGroup::default() }));
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
        let offset = anchor.offset(Font::bundled().width(text, size));
        let start = match direction {
            TextDirection::Right => [x - offset, y],
            TextDirection::Up => [x, y + offset],
        };
        self.shapes.push(Shape::Label(TextLabel { text: text.to_owned(), start, size, anchor, direction }));
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
        self.shapes.extend(other.shapes.into_iter().map(|shape| shape.moved([left, top])));
    }

    /// Shapes without groups, from the lowest to the topmost.
    pub(super) fn ungrouped(&self) -> Vec<&Shape> {
        let mut shapes = Vec::new();
        ungroup(&self.shapes, &mut shapes);
        shapes
    }

    /// Checks that the bundled font has all characters of the sheet.
    ///
    /// # Errors
    /// If the font lacks a character; the error names the text and the character.
    pub fn check_characters(&self) -> Result<()> {
        let font = Font::bundled();
        for shape in self.ungrouped() {
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

fn ungroup<'a>(shapes: &'a [Shape], into: &mut Vec<&'a Shape>) {
    for shape in shapes {
        match shape {
            Shape::Group(group) => ungroup(&group.shapes, into),
            shape => into.push(shape),
        }
    }
}

impl Shape {
    /// The shape at another place, moved right and down by a vector.
    fn moved(self, vector: Point) -> Self {
        let moved = |[x, y]: Point| [x + vector[0], y + vector[1]];
        match self {
            Self::Line { points, stroke } => Self::Line { points: points.into_iter().map(moved).collect(), stroke },
            Self::Area { corners, fill, opacity } => {
                Self::Area { corners: corners.into_iter().map(moved).collect(), fill, opacity }
            }
            Self::Disc { centre, radius, fill, edge } => Self::Disc { centre: moved(centre), radius, fill, edge },
            Self::Label(label) => Self::Label(TextLabel { start: moved(label.start), ..label }),
            Self::Group(group) => {
                let shapes = group.shapes.into_iter().map(|shape| shape.moved(vector)).collect();
                Self::Group(ShapeGroup { shapes, ..group })
            }
            Self::Picture { corner, size, image } => Self::Picture { corner: moved(corner), size, image },
        }
    }
}
