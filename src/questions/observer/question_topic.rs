//! Subject of a question, parsed from its text: [`QuestionTopic`].

use crate::rules::{RuleBook, Rules};
use crate::statistics::Segment;
use darkqa_base::types::Question;

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
