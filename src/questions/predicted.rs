//! Answers from the maps that a network predicts for an image: [`PredictedMaps`], [`PredictedFrame`].
//!
//! The predicted maps are measured like those of a frame, and each family of questions is answered from the
//! measurements. Only the text and the choices of a question are used.

use std::cmp::Reverse;
use std::sync::Arc;

use ndarray::{Array2, ShapeError};

use crate::colors::{Color, Palette};
use crate::observer::answers::QuestionTopic;
use crate::rule_context::YES_NO;
use crate::rules::Rules;
use crate::statistics::{FrameStatistics, Segment, measure};
use darkqa_base::error::{Error, Result};
use darkqa_base::labels;
use darkqa_base::types::{DepthKind, Digest, Frame, FrameId, Question, Rgb, Segmentation};

/// Label space of predicted classes.
const SPACE: &str = "mpcat40";

/// Minimum area of a class that counts as present, in millionths of the image: half of the area that a question about
/// presence needs (chosen).
const PRESENT_PPM: u64 = 1_500;

/// Maps that a network predicted for an image.
#[derive(Debug)]
pub struct PredictedMaps {
    /// Image in the size of the maps.
    pub image: Rgb,
    /// Class of each pixel, row by row, as a number of mpcat40.
    pub classes: Vec<u16>,
    /// Distance of each pixel from the camera in millimetres, row by row.
    pub distance_mm: Vec<u32>,
    /// Room types, each with its probability.
    pub rooms: Vec<(&'static str, f32)>,
}

/// Measurements of predicted maps.
#[derive(Debug)]
pub struct PredictedFrame {
    statistics: FrameStatistics,
    rooms: Vec<(&'static str, f32)>,
}

impl PredictedFrame {
    /// Measures predicted maps by the rules.
    ///
    /// # Errors
    /// If the maps and the image differ in size.
    pub fn new(maps: PredictedMaps, rules: &Rules, palette: &Palette) -> Result<Self> {
        let fault = |e: ShapeError| Error::data("predicted maps", e);
        let size = (maps.image.height(), maps.image.width());
        let frame = Frame {
            id: FrameId(String::new()),
            scene: String::new(),
            rgb: maps.image,
            depth: Some(Array2::from_shape_vec(size, maps.distance_mm).map_err(fault)?),
            depth_kind: DepthKind::Euclid,
            intrinsics: None,
            semantic: Some(Array2::from_shape_vec(size, maps.classes).map_err(fault)?),
            segments: None,
            segmentation: Segmentation::Instances,
            names: Arc::default(),
            room: None,
        };
        let labels =
            labels::space(SPACE).ok_or_else(|| Error::data("predicted maps", "no label space of this name"))?;
        let key = Digest::from_bytes(&[]);
        Ok(Self { statistics: measure(&frame, &labels, rules, palette, key)?, rooms: maps.rooms })
    }

    /// Answers a question with the index of a choice. `None` if the subject of the question is not found in the image,
    /// or if the question is not one of the rulebook.
    #[must_use]
    pub fn answer(&self, question: &Question, rules: &Rules, palette: &Palette) -> Option<usize> {
        let book = rules.book();
        let choices = question.choices.texts();
        let index = |answer: &str| choices.iter().position(|text| text == answer);
        match QuestionTopic::from_question(question, book)? {
            QuestionTopic::Room => index(self.room()?),
            QuestionTopic::Activity(activity) => {
                let suitable = &book.activity.get(activity)?.rooms;
                let probability: f32 = self
                    .rooms
                    .iter()
                    .filter(|(room, _)| suitable.iter().any(|suitable| suitable == room))
                    .map(|(_, share)| share)
                    .sum();
                index(yes_no(probability >= 0.5))
            }
            QuestionTopic::Presence(thing) => {
                let pixels = self.statistics.class_pixels(&thing.class);
                index(yes_no(self.statistics.ppm(pixels) >= PRESENT_PPM))
            }
            QuestionTopic::Color(thing) => index(self.color(&thing.class, choices, palette)?),
            QuestionTopic::Closest => self.closest(choices, rules),
        }
    }

    /// Most probable room type.
    fn room(&self) -> Option<&'static str> {
        let (room, _) = self.rooms.iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
        Some(room)
    }

    fn segments(&self, class: &str) -> impl Iterator<Item = &Segment> {
        self.statistics.segments.iter().filter(move |segment| segment.class == class)
    }

    /// Colour of the largest segment of a class: the name of its median if that is offered, else the most common
    /// offered name of its pixels.
    fn color(&self, class: &str, offered: &[String], palette: &Palette) -> Option<&'static str> {
        let is_offered = |name: &str| offered.iter().any(|text| text == name);
        let largest = self.segments(class).max_by_key(|segment| (segment.area, Reverse(segment.id)))?;
        palette.color(largest.median).map(Color::name).filter(|name| is_offered(name)).or_else(|| {
            Color::ALL
                .into_iter()
                .zip(largest.colors)
                .filter(|(color, pixels)| *pixels > 0 && is_offered(color.name()))
                .max_by_key(|(_, pixels)| *pixels)
                .map(|(color, _)| color.name())
        })
    }

    /// Index of the choice whose nearest segment has the smallest median distance; `None` unless at least two of the
    /// offered things are found.
    fn closest(&self, choices: &[String], rules: &Rules) -> Option<usize> {
        let found: Vec<(u32, usize)> = choices
            .iter()
            .enumerate()
            .filter_map(|(choice, word)| {
                let (class, _) = rules.book().class.iter().find(|(_, rule)| rule.words.contains(word))?;
                let nearest = self.segments(class).filter_map(|segment| Some(segment.depth?.median)).min()?;
                Some((nearest, choice))
            })
            .collect();
        let (_, nearest) = found.iter().min()?;
        (found.len() > 1).then_some(*nearest)
    }
}

fn yes_no(yes: bool) -> &'static str {
    YES_NO[usize::from(!yes)]
}
