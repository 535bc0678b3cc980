//! A model observer: what the rules could still answer from given pixels, [`ObservedFrame`] and [`Observation`].
//!
//! The observer has a frame's masks and depth, but sees only the pixels of the image that it is sent. It measures which
//! segments are visible in the noise ([`contrast`]) and their colours, and answers by the rulebook from these segments.
//! If no visible segment helps with a question, it has no answer. The caller then guesses: all choices are equally likely.
//!
//! The observer measures how much evidence the pixels still hold if nothing has to be found, named or told apart. It is a
//! model observer as in medical imaging (Barrett, Yao, Rolland and Myers, "Model observers for assessment of image quality",
//! PNAS 90:9758, 1993): the place of the signal is known, and the decision follows Rose's criterion. The decision compares
//! contrast with noise, so a change of brightness or gain does not help. An enhancer can help in two ways:
//!
//! - Colours. A gain alone removes neither the tints that rounding and clipping leave near black, nor a missing tone curve.
//!   An enhancer may have learned to remove both.
//! - Averaging over more than a cell. The observer averages along borders only.
//!
//! The observer is not an upper bound for all models. A model may do better if it guesses from its knowledge of rooms, or if
//! a small part of an object is enough; the observer needs half of an outline. Most models will do worse. The observer has
//! two inputs that a model does not have: the masks with their depth, and the mean linear light of the clean frame (one
//! number). The second replaces an eye that is adapted to the dark: colours are named after this one gain.

pub(crate) mod contrast;
mod wording;

use std::collections::BTreeMap;

use super::colors::{Color, Palette};
use super::room::classify;
use super::rules::{ClassFlag, Rules};
use super::statistics::scene::SceneMaps;
use super::statistics::{FrameStatistics, Segment, measure};
use crate::error::Result;
use crate::types::{Digest, Frame, Labels, Question, Rgb};

use contrast::{MaskContrasts, mean_light};
use wording::QuestionTopic;
pub(crate) use wording::understood;

/// Version of the observer's method; it enters the digest of the model.
pub(crate) const VERSION: u32 = 1;

/// What the observer knows of a frame: the place of every segment and the mean light, but no pixels.
#[derive(Debug)]
pub struct ObservedFrame {
    size: [usize; 2],
    /// Mask of each pixel, from 1; 0 for no mask.
    masks: Vec<u32>,
    /// Number of each mask in the map of segments.
    numbers: Vec<u32>,
    /// Statistics of the clean frame. Their colours are not used.
    statistics: FrameStatistics,
    /// Mean linear light of the clean frame, from 0 to 1.
    light: f64,
}

impl ObservedFrame {
    /// Prepares a clean frame for observation.
    ///
    /// # Errors
    /// If the frame has no classes.
    pub fn new(frame: &Frame, labels: &Labels, rules: &Rules, palette: &Palette) -> Result<Self> {
        let key = Digest::of(frame.id.0.as_bytes());
        let statistics = measure(frame, labels, rules, palette, key)?;
        let scene = SceneMaps::of(frame, labels)?;
        Ok(Self {
            size: scene.size,
            light: mean_light(&frame.rgb),
            statistics,
            masks: scene.masks,
            numbers: scene.numbers,
        })
    }

    /// Observes a degraded or enhanced image of the frame. For an image of another size, the masks are scaled.
    #[must_use]
    pub fn look(&self, image: &Rgb, palette: &Palette) -> Observation {
        let gain = self.light / mean_light(image).max(f64::MIN_POSITIVE);
        let contrasts = MaskContrasts::measure(image, &self.masks, self.size, gain, palette);
        let number = |mask: usize| mask.checked_sub(1).and_then(|i| self.numbers.get(i));
        let visible: BTreeMap<u32, Vec<Color>> = contrasts
            .visible()
            .filter_map(|mask| Some((*number(mask)?, contrasts.colors(mask, palette))))
            .collect();
        let mut seen = self.statistics.clone();
        seen.segments
            .retain(|segment| visible.contains_key(&segment.id));
        let (mut classes, mut words) = (BTreeMap::new(), BTreeMap::new());
        for segment in &seen.segments {
            *classes.entry(segment.class.clone()).or_insert(0) += segment.area;
            if !segment.word.is_empty() {
                *words.entry(segment.word.clone()).or_insert(0) += segment.area;
            }
        }
        (seen.classes, seen.words) = (classes, words);
        seen.loose.clear();
        Observation {
            visible: seen.segments.len(),
            seen,
            colors: visible,
        }
    }
}

/// The segments that the observer sees in one image of a frame.
#[derive(Debug, Clone)]
pub struct Observation {
    /// Number of visible segments.
    pub visible: usize,
    /// Statistics of the frame, with the visible segments only.
    seen: FrameStatistics,
    /// Colours of each visible segment, by its number; the best comes first.
    colors: BTreeMap<u32, Vec<Color>>,
}

impl Observation {
    /// The answer to a question, as an index of its choices. `None` if no visible segment helps, or if the question is not
    /// one of the rulebook (see [`understood`]).
    #[must_use]
    pub fn answer(&self, question: &Question, rules: &Rules) -> Option<usize> {
        let answer = match QuestionTopic::of(question, rules.book())? {
            QuestionTopic::Room => self.room(rules),
            QuestionTopic::Activity(activity) => self.affordance(activity, rules),
            QuestionTopic::Presence(class) => self.presence(&class),
            QuestionTopic::Color(class) => self.color(&class, question),
            QuestionTopic::Closest => self.closest(question, rules),
        }?;
        question
            .choices
            .texts()
            .iter()
            .position(|text| *text == answer)
    }

    /// The room type by the visible segments. If the rulebook gives none, the type with the highest score.
    fn room(&self, rules: &Rules) -> Option<String> {
        let book = rules.book();
        let signs = classify(&self.seen, book);
        signs.room.ok().or_else(|| {
            let asked = book.room.order.iter().rev();
            let scored = asked.filter_map(|room| Some((signs.scores.get(room)?, room)));
            scored
                .max_by_key(|(score, _)| **score)
                .map(|(_, room)| room.clone())
        })
    }

    /// Yes if the activity belongs to the type of room, or if the objects that it needs are visible.
    fn affordance(&self, activity: usize, rules: &Rules) -> Option<String> {
        let book = rules.book();
        let activity = book.activity.get(activity)?;
        let seen = |token: &String| self.seen.shows(token, book);
        let enabled = activity
            .enablers
            .iter()
            .any(|tokens| tokens.iter().all(seen));
        let yes = enabled || activity.rooms.contains(&self.room(rules)?);
        Some(yes_no(yes))
    }

    /// Yes if the class is visible, else no, because absence is then more likely. `None` if no segment is visible.
    fn presence(&self, class: &str) -> Option<String> {
        (self.visible > 0).then(|| yes_no(self.seen.of_class(class) > 0))
    }

    /// The best colour of the largest visible segment of a class, among the colours offered.
    fn color(&self, class: &str, question: &Question) -> Option<String> {
        let segments = self
            .seen
            .segments
            .iter()
            .filter(|segment| segment.class == class);
        let largest = segments.max_by_key(|segment| segment.area)?;
        let mut colors = self.colors.get(&largest.id)?.iter();
        let offered = |color: &&Color| {
            let mut texts = question.choices.texts().iter();
            texts.any(|text| text == color.name())
        };
        colors.find(offered).map(|color| color.name().to_owned())
    }

    /// The nearest object that is offered and visible. An object that is not visible is less likely to be nearer.
    fn closest(&self, question: &Question, rules: &Rules) -> Option<String> {
        let book = rules.book();
        let offered = |segment: &&Segment| {
            let name = book.name(&segment.class);
            book.is(&segment.class, ClassFlag::Asked)
                && question.choices.texts().iter().any(|text| text == name)
        };
        let segments = self.seen.segments.iter().filter(offered);
        let measured = segments.filter_map(|segment| Some((segment.measured(book)?, segment)));
        let nearest = measured.min_by_key(|(depth, _)| (depth.median, depth.p10));
        nearest.map(|(_, segment)| book.name(&segment.class).to_owned())
    }
}

fn yes_no(yes: bool) -> String {
    super::rule_context::YES_NO[usize::from(!yes)].to_owned()
}
