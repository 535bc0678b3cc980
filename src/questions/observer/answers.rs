//! Answers from the seen objects: [`Observation::answer`].
//!
//! Subject of a question, parsed from its text: [`QuestionTopic`].

use super::{ColorPosterior, Observation};
use crate::colors::{Color, Palette};
use crate::room::classify;
use crate::rule_context::YES_NO;
use crate::rules::{ClassFlag, RuleBook, Rules};
use crate::statistics::Segment;
use darkqa_base::types::Question;

impl Observation {
    /// Answers a question with the index of a choice. `None` if no seen object decides it, or if the question is not
    /// one of the rulebook (see [`is_in_rulebook`]).
    #[must_use]
    pub fn answer(&self, question: &Question, rules: &Rules, palette: &Palette) -> Option<usize> {
        let answer = match QuestionTopic::from_question(question, rules.book())? {
            QuestionTopic::Room => self.room(rules),
            QuestionTopic::Activity(activity) => self.affordance(activity, rules),
            QuestionTopic::Presence(thing) => self.presence(&thing, rules),
            QuestionTopic::Color(thing) => self.color(&thing, question, rules, palette),
            QuestionTopic::Closest => self.closest(question, rules),
        }?;
        question.choices.texts().iter().position(|text| *text == answer)
    }

    /// Room type by the seen segments; if the rulebook gives none, the type with the highest score, unless several
    /// types share it.
    fn room(&self, rules: &Rules) -> Option<String> {
        let book = rules.book();
        let signs = classify(&self.statistics, book);
        signs.room.ok().or_else(|| {
            let highest = signs.scores.values().max()?;
            let best: Vec<&String> =
                signs.scores.iter().filter(|(_, score)| *score == highest).map(|(room, _)| room).collect();
            match best[..] {
                [room] if book.room.order.contains(room) => Some(room.clone()),
                _ => None,
            }
        })
    }

    /// Yes if all objects that the activity needs are seen; else the answer follows from the room type, if it is known.
    fn affordance(&self, activity: usize, rules: &Rules) -> Option<String> {
        let book = rules.book();
        let activity = book.activity.get(activity)?;
        let enabled =
            activity.enablers.iter().any(|tokens| tokens.iter().all(|token| self.statistics.has_token(token, book)));
        let yes = enabled || activity.rooms.contains(&self.room(rules)?);
        Some(yes_no(yes))
    }

    /// Yes if the object is seen. No if it is not, although at least half of the area of all objects is seen:
    /// otherwise, the answers for a black image would be no.
    fn presence(&self, thing: &ThingWord, rules: &Rules) -> Option<String> {
        let is_seen = self.statistics.segments.iter().any(|segment| thing.matches(segment, rules.book()));
        (is_seen || self.sees_half(rules)).then(|| yes_no(is_seen))
    }

    /// True if at least half of the area of the frame's objects is seen, or of all segments if the frame has no
    /// objects.
    fn sees_half(&self, rules: &Rules) -> bool {
        let book = rules.book();
        let is_thing = |segment: &&Segment| !book.has_flag(&segment.class, ClassFlag::Structural);
        let has_things = self.frame.segments.iter().any(|segment| is_thing(&segment));
        let [seen, all] = [&self.statistics.segments, &self.frame.segments].map(|segments| -> u64 {
            segments.iter().filter(|segment| !has_things || is_thing(segment)).map(|segment| segment.area).sum()
        });
        all > 0 && 2 * seen >= all
    }

    /// Colour of the largest segment with this word, among the colours offered; `None` if the segment is not seen.
    fn color(&self, thing: &ThingWord, question: &Question, rules: &Rules, palette: &Palette) -> Option<String> {
        let largest = self
            .frame
            .segments
            .iter()
            .filter(|segment| thing.matches(segment, rules.book()))
            .max_by_key(|segment| (segment.area, std::cmp::Reverse(segment.id)))?;
        let color: &ColorPosterior = self.colors.get(&largest.id)?.as_ref()?;
        let texts = question.choices.texts();
        let offered: Vec<Color> =
            Color::ALL.into_iter().filter(|color| texts.iter().any(|text| text == color.name())).collect();
        let color = color.name(palette, &offered)?;
        Some(color.name().to_owned())
    }

    /// Nearest of the offered objects that are seen; `None` unless objects of at least two offered classes are seen.
    fn closest(&self, question: &Question, rules: &Rules) -> Option<String> {
        let book = rules.book();
        let texts = question.choices.texts();
        let measured: Vec<_> = self
            .statistics
            .segments
            .iter()
            .filter(|segment| {
                let word = segment.question_word(book);
                book.has_flag(&segment.class, ClassFlag::Asked) && texts.iter().any(|text| Some(&**text) == word)
            })
            .filter_map(|segment| Some((segment.reliable_depth(book)?, segment)))
            .collect();
        let (_, nearest) = measured.iter().min_by_key(|(depth, _)| (depth.median, depth.p10))?;
        let has_two = measured.iter().any(|(_, segment)| segment.class != nearest.class);
        has_two.then(|| nearest.question_word(book).map(str::to_owned))?
    }
}

fn yes_no(yes: bool) -> String {
    YES_NO[usize::from(!yes)].to_owned()
}

/// Word that a question uses for an object, with the class of the word.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct ThingWord {
    pub(crate) class: String,
    word: String,
}

impl ThingWord {
    /// True if questions use this word for a segment.
    pub(super) fn matches(&self, segment: &Segment, book: &RuleBook) -> bool {
        segment.class == self.class && segment.question_word(book) == Some(&*self.word)
    }
}

/// Subject of a question of the rulebook.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum QuestionTopic {
    /// The type of the room.
    Room,
    /// Whether the room suits an activity, given by its index in the rulebook.
    Activity(usize),
    /// Whether an object is visible.
    Presence(ThingWord),
    /// The colour of an object.
    Color(ThingWord),
    /// The object that is closest to the camera.
    Closest,
}

impl QuestionTopic {
    /// Parses the text of a question by the templates of the rulebook. The evidence is not read, because it contains
    /// the answer.
    pub(crate) fn from_question(question: &Question, book: &RuleBook) -> Option<Self> {
        let text = question.text.trim();
        if text == book.room_type.text {
            return Some(Self::Room);
        }
        if text == book.closest.text {
            return Some(Self::Closest);
        }
        let activity = book
            .activity
            .iter()
            .position(|activity| text == book.affordance.text.replace("{activity}", &activity.activity));
        if let Some(activity) = activity {
            return Some(Self::Activity(activity));
        }
        let word = |singular: &str, plural: &str| {
            book.class.iter().find_map(|(class, rule)| {
                let word = rule.words.iter().find(|word| text == book.fill_template(singular, plural, word))?;
                Some(ThingWord { class: class.clone(), word: word.clone() })
            })
        };
        word(&book.presence.text, &book.presence.plural)
            .map(Self::Presence)
            .or_else(|| word(&book.color.text, &book.color.plural).map(Self::Color))
    }
}

/// True if a question is one of the rulebook, so that the observer can answer it.
#[must_use]
pub fn is_in_rulebook(question: &Question, rules: &Rules) -> bool {
    QuestionTopic::from_question(question, rules.book()).is_some()
}
