//! The marks of a figure for a paper, in points: [`Sheet`]. PDF and SVG are two ways to write the same marks.

use std::sync::Arc;

use crate::error::{Error, Result};
use crate::types::Rgb;

use super::font::Font;

/// A place in points, from the left and from the top.
pub(crate) type Place = [f64; 2];

/// Red, green and blue.
pub(crate) type Colour = [u8; 3];

/// Colour of grid lines.
pub(super) const GRID: Colour = [221, 221, 221];
/// Colour of the paper, in hollow marks.
pub(super) const PAPER: Colour = [255, 255, 255];

/// The marks of a figure, in the order in which they are drawn.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Sheet {
    /// Width and height in points.
    pub size: [f64; 2],
    pub marks: Vec<Mark>,
}

/// How a line is drawn.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Stroke {
    pub colour: Colour,
    /// Width in points.
    pub width: f64,
    /// Lengths of dashes and gaps in points; empty for a solid line.
    pub dash: Vec<f64>,
}

impl Stroke {
    /// A solid line.
    pub(super) fn solid(colour: Colour, width: f64) -> Self {
        let dash = Vec::new();
        Self {
            colour,
            width,
            dash,
        }
    }
}

/// One mark.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Mark {
    /// An open line through places.
    Line { places: Vec<Place>, stroke: Stroke },
    /// A filled polygon.
    Area {
        corners: Vec<Place>,
        fill: Colour,
        /// From 0, not visible, to 1.
        opacity: f64,
    },
    /// A circle.
    Disc {
        centre: Place,
        radius: f64,
        fill: Option<Colour>,
        edge: Option<Stroke>,
    },
    /// Words on one line.
    Words(Words),
    /// A picture.
    Picture {
        /// Its left upper corner.
        corner: Place,
        /// Width and height in points.
        size: [f64; 2],
        image: Arc<Rgb>,
    },
}

/// Words on one line.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Words {
    pub text: String,
    /// The left end of the baseline; of words that run upwards the lower end.
    pub start: Place,
    /// Height of the letters in points.
    pub size: f64,
    pub turn: Turn,
}

/// Which way words run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Turn {
    Right,
    Up,
}

/// Where words stand to their place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

impl Sheet {
    pub(super) fn line(&mut self, places: &[Place], stroke: &Stroke) {
        self.marks.push(Mark::Line {
            places: places.to_vec(),
            stroke: stroke.clone(),
        });
    }

    pub(super) fn area(&mut self, corners: Vec<Place>, fill: Colour, opacity: f64) {
        self.marks.push(Mark::Area {
            corners,
            fill,
            opacity,
        });
    }

    /// Words whose anchor is at a place on their baseline.
    pub(super) fn words(&mut self, text: &str, place: Place, size: f64, anchor: Anchor) {
        self.turned_words(text, place, size, anchor, Turn::Right);
    }

    pub(super) fn turned_words(
        &mut self,
        text: &str,
        [x, y]: Place,
        size: f64,
        anchor: Anchor,
        turn: Turn,
    ) {
        if text.is_empty() {
            return;
        }
        let width = Font::bundled().width(text, size);
        let back = match anchor {
            Anchor::Start => 0.0,
            Anchor::Middle => width / 2.0,
            Anchor::End => width,
        };
        let start = match turn {
            Turn::Right => [x - back, y],
            Turn::Up => [x, y + back],
        };
        self.marks.push(Mark::Words(Words {
            text: text.to_owned(),
            start,
            size,
            turn,
        }));
    }

    /// The same marks on a white ground, for viewers with a dark one.
    pub(super) fn on_paper(mut self) -> Self {
        let [width, height] = self.size;
        let corners = vec![[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]];
        let ground = Mark::Area {
            corners,
            fill: PAPER,
            opacity: 1.0,
        };
        self.marks.insert(0, ground);
        self
    }

    /// Draws another sheet with its left upper corner at a place.
    pub(super) fn place(&mut self, other: Sheet, at: Place) {
        let moved = |[x, y]: Place| [x + at[0], y + at[1]];
        self.marks
            .extend(other.marks.into_iter().map(|mark| match mark {
                Mark::Line { places, stroke } => Mark::Line {
                    places: places.into_iter().map(moved).collect(),
                    stroke,
                },
                Mark::Area {
                    corners,
                    fill,
                    opacity,
                } => Mark::Area {
                    corners: corners.into_iter().map(moved).collect(),
                    fill,
                    opacity,
                },
                Mark::Disc {
                    centre,
                    radius,
                    fill,
                    edge,
                } => Mark::Disc {
                    centre: moved(centre),
                    radius,
                    fill,
                    edge,
                },
                Mark::Words(words) => Mark::Words(Words {
                    start: moved(words.start),
                    ..words
                }),
                Mark::Picture {
                    corner,
                    size,
                    image,
                } => Mark::Picture {
                    corner: moved(corner),
                    size,
                    image,
                },
            }));
    }

    /// Checks that the font of figures has all letters of the sheet.
    ///
    /// # Errors
    /// If it lacks a letter; the error names the words and the letter.
    pub(crate) fn check_letters(&self) -> Result<()> {
        let font = Font::bundled();
        for mark in &self.marks {
            let Mark::Words(Words { text, .. }) = mark else {
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
