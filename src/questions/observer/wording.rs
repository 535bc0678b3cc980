//! The subject of a question, read from its text: [`QuestionTopic`].

use crate::questions::rules::{RuleBook, Rules};
use crate::types::Question;

/// Subject of a question of the rulebook.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum QuestionTopic {
    /// The type of the room.
    Room,
    /// Whether the room suits an activity, given by its index in the rulebook.
    Activity(usize),
    /// Whether an object of a class is visible.
    Presence(String),
    /// The colour of the object of a class.
    Color(String),
    /// The object that is closest to the camera.
    Closest,
}

impl QuestionTopic {
    /// Compares the text of a question with the templates of the rulebook. The evidence, which holds the answer, is not read.
    pub(super) fn of(question: &Question, book: &RuleBook) -> Option<Self> {
        let text = question.text.trim();
        if text == book.room_type.text {
            return Some(Self::Room);
        }
        if text == book.closest.text {
            return Some(Self::Closest);
        }
        let activity = book.activity.iter().position(|activity| {
            text == book
                .affordance
                .text
                .replace("{activity}", &activity.activity)
        });
        if let Some(activity) = activity {
            return Some(Self::Activity(activity));
        }
        let fill = |template: &str, class: &str| {
            template
                .replace("{article}", book.article(class))
                .replace("{object}", book.name(class))
        };
        let class = |template: &str| {
            let mut classes = book.class.keys();
            classes.find(|class| text == fill(template, class)).cloned()
        };
        class(&book.presence.text)
            .map(Self::Presence)
            .or_else(|| class(&book.color.text).map(Self::Color))
    }
}

/// Whether a question is one of the rulebook, so that the observer can answer it.
#[must_use]
pub(crate) fn understood(question: &Question, rules: &Rules) -> bool {
    QuestionTopic::of(question, rules.book()).is_some()
}
