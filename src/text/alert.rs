//! Warnings above the numbers of a report: [`Alert`].

use crate::text::terminal::line;
use serde::Serialize;

/// Share of unreadable replies of a model above which an alert names it; chosen.
pub(crate) const MAX_UNREAD: f64 = 0.02;

/// One line above a report.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Alert {
    pub kind: AlertKind,
    /// One or two plain sentences, with the names of the runs and the values that differ.
    pub text: String,
}

impl Alert {
    /// An alert of a kind.
    #[must_use]
    pub fn new(kind: AlertKind, text: impl Into<String>) -> Self {
        let text = text.into();
        Self { kind, text }
    }
}

/// The subject of an alert; alerts are shown in this order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum AlertKind {
    /// Replies that do not depend on the image.
    ImageIgnored,
    /// A run that is named again, or that adds no reply to those of the others.
    Runs,
    /// A run in which trials have no reply yet.
    NotComplete,
    /// Trials without a reply, which are not scored.
    Failed,
    /// Requests that cost more than their limit.
    Cost,
    /// Replies in which no answer can be read, above 2 %.
    Unread,
    /// Answers of people that are no choice of their question.
    NoChoice,
    /// Replies that the lenient parsing of this version reads differently.
    Reading,
    /// Fewer clusters than an interval needs.
    Clusters,
    /// Models that did not answer the same questions.
    Items,
    /// Other questions, other words of one question, or other orders of its choices.
    Questions,
    /// Other data, or other files under the same names.
    Data,
    /// Other images by the seed, the noise model, an enhancer or the program.
    Light,
    /// An enhancer whose images may be read in a wrong way, or were resized for it.
    Enhancer,
    /// Images that were turned when their files were read, or of which the file states a turn that was not made.
    Read,
    /// Images of another size or encoding.
    Images,
    /// Other words around the questions.
    Prompts,
    /// Other parameters of the models.
    Parameters,
    /// A constraint on the replies of one side, or replies that do not keep it.
    Constrain,
    /// A model that stands apart from itself, because runs asked it in different ways or got other replies.
    Models,
    /// Other models behind one name, or another address.
    Served,
    /// Another version of this program.
    Version,
    /// Levels that differ in brightness and not in noise.
    Noise,
    /// Photographs in the dark that are no pair of one exposure with their frames.
    Pairs,
    /// Limits of the observer's numbers.
    Observer,
}

/// The alerts as lines of the terminal, each marked with `!`; empty without an alert.
#[must_use]
pub(crate) fn lines(alerts: &[Alert]) -> String {
    alerts
        .iter()
        .map(|alert| line(["! ", &alert.text, "  "]))
        .collect()
}
