//! What a question of the rulebook is about, by its words alone: [`QuestionTopic`].

use crate::questions::rules::{RuleBook, Rules};
use crate::types::Question;

/// What a question is about.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum QuestionTopic {
    /// The type of the room.
    Room,
    /// Whether the room suits an activity, by its place in the rulebook.
    Activity(usize),
    /// Whether a class is there.
    Presence(String),
    /// The colour of a class.
    Color(String),
    /// What is closest.
    Closest,
}

impl QuestionTopic {
    /// Reads a question by the rulebook's own words; the evidence, which holds the answer, is not looked at.
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
        let told = |template: &str, class: &str| {
            template
                .replace("{article}", book.article(class))
                .replace("{object}", book.name(class))
        };
        let class = |template: &str| {
            let mut classes = book.class.keys();
            classes.find(|class| text == told(template, class)).cloned()
        };
        class(&book.presence.text)
            .map(Self::Presence)
            .or_else(|| class(&book.color.text).map(Self::Color))
    }
}

/// Whether a question is one of the rulebook's, so that the observer can answer it.
#[must_use]
pub(crate) fn understood(question: &Question, rules: &Rules) -> bool {
    QuestionTopic::of(question, rules.book()).is_some()
}
