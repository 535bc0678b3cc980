//! An observer who knows where to look: what could still be answered from given pixels, [`ObservedFrame`] and [`Observation`].
//!
//! The observer has a frame's masks and depth, and of its image only the pixels that it is sent. It finds out anew which
//! segments stand out of the noise ([`contrast`]) and what colour each has, and answers by the rulebook over what it sees.
//! Where nothing that it sees bears on a question it has no answer, and whoever asks takes its prior: any choice is as
//! likely as another.
//!
//! What it is: a line that says how much of the evidence the pixels still hold for one who need not find it, name it or tell
//! it from other things: a model observer in the sense of medical imaging (Barrett, Yao, Rolland and Myers, "Model observers
//! for assessment of image quality", PNAS 90:9758, 1993), with the place of the signal known and the decision by Rose's rule.
//! As the decision is about contrast against noise, no change of brightness or gain helps it. Where an enhancer does raise
//! its line, it is by two things: colours, for a gain alone does not undo the tints that rounding and clipping leave near
//! black, nor a tone curve that the dark image lacks, and an enhancer may have learned to; and averaging over more than a
//! cell, which the observer does along borders and not across.
//!
//! What it is not: a bound on every model. A model may do better where it knows what rooms look like and guesses what it
//! cannot see, and where a part of a thing tells the whole: the observer asks for half of an outline. It will mostly do
//! worse. It is told two things that a model is not: the masks with their depth, and how bright the frame was in good light
//! (one number, the mean of its linear light), which stands in for an eye that is adapted to the dark: colours are named as
//! they are after this one gain.

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

/// What the observer does, and how: a change of it is another observer.
pub(crate) const VERSION: u32 = 1;

/// A frame as the observer knows it: where everything is, and nothing of how it looks but its mean light.
#[derive(Debug)]
pub struct ObservedFrame {
    size: [usize; 2],
    /// The mask of each pixel, from 1; 0 for none.
    masks: Vec<u32>,
    /// The number of each mask in the map.
    numbers: Vec<u32>,
    /// What was measured in good light. Colours are not read from it.
    statistics: FrameStatistics,
    /// The mean linear light.
    light: f64,
}

impl ObservedFrame {
    /// Takes note of a frame.
    ///
    /// # Errors
    /// Where the frame has no classes.
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

    /// Looks at an image of the frame, whatever was done to it. One of another size is looked at through the same masks.
    #[must_use]
    pub fn look(&self, image: &Rgb, palette: &Palette) -> Observation {
        let gain = self.light / mean_light(image).max(f64::MIN_POSITIVE);
        let look = MaskContrasts::at(image, &self.masks, self.size, gain, palette);
        let number = |mask: usize| mask.checked_sub(1).and_then(|i| self.numbers.get(i));
        let visible: BTreeMap<u32, Vec<Color>> = look
            .visible()
            .filter_map(|mask| Some((*number(mask)?, look.colors(mask, palette))))
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

/// What the observer sees of a frame in one image.
#[derive(Debug, Clone)]
pub struct Observation {
    /// How many segments it sees.
    pub visible: usize,
    seen: FrameStatistics,
    /// The colours of each segment that it sees, by number, the first the most.
    colors: BTreeMap<u32, Vec<Color>>,
}

impl Observation {
    /// The answer to a question, as an index of its choices; `None` where nothing that is seen bears on it, or where the
    /// question is none of the rulebook's (see [`understood`]).
    #[must_use]
    pub fn answer(&self, question: &Question, rules: &Rules) -> Option<usize> {
        let answer = match QuestionTopic::of(question, rules.book())? {
            QuestionTopic::Room => self.room(rules),
            QuestionTopic::Activity(activity) => self.suits(activity, rules),
            QuestionTopic::Presence(class) => self.there(&class),
            QuestionTopic::Color(class) => self.color(&class, question),
            QuestionTopic::Closest => self.closest(question, rules),
        }?;
        question
            .choices
            .texts()
            .iter()
            .position(|text| *text == answer)
    }

    /// The room, by what is seen of it: where the rulebook is not sure, the one that most speaks for.
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

    /// Whether the room is one where it is done, or what it takes is seen.
    fn suits(&self, activity: usize, rules: &Rules) -> Option<String> {
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

    /// Whether a class is there: where none is seen it is more likely not, unless nothing at all is seen.
    fn there(&self, class: &str) -> Option<String> {
        (self.visible > 0).then(|| yes_no(self.seen.of_class(class) > 0))
    }

    /// The colour that most of the largest segment of a class has, of those offered.
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

    /// The nearest of what is offered and seen. Whatever is not seen is less likely to be nearer than the nearest that is.
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
