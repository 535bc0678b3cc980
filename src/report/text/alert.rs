//! Warnings above the numbers of a report: [`Alert`].

use crate::text::terminal::line;
use serde::Serialize;

/// Share of unreadable replies above which an alert names the model; chosen.
pub const MAX_UNREAD: f64 = 0.02;

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
    /// More than 2 % of the replies missing in a condition.
    MissingReplies,
    /// Replies that do not depend on the image.
    ImageIgnored,
    /// A run that is named twice, or that adds no reply to the other runs.
    Runs,
    /// A run in which trials have no reply yet.
    NotComplete,
    /// Trials without a reply, which are not scored.
    Failed,
    /// Requests that cost more than their limit.
    Cost,
    /// More than 2 % of replies without a readable answer.
    Unread,
    /// Answers of people that are not a choice of the question.
    NoChoice,
    /// Replies whose lenient parsing differs in this version.
    Reading,
    /// An answer that is true so often that a constant reply scores well.
    Answers,
    /// Fewer clusters than an interval needs.
    Clusters,
    /// Models that did not answer the same questions.
    Items,
    /// Different questions, wording of a question, or order of choices.
    Questions,
    /// Different data, or different files with the same names.
    Data,
    /// Images that differ by seed, noise model, enhancer or program version.
    Light,
    /// An enhancer whose output may be misinterpreted, or whose images were resized.
    Enhancer,
    /// Images whose EXIF orientation was applied or ignored.
    Read,
    /// Images with a different size or encoding.
    Images,
    /// Different prompts.
    Prompts,
    /// Different parameters of the models.
    Parameters,
    /// A constraint on the replies of some runs only, or replies that violate it.
    Constrain,
    /// A model that is listed several times, because runs asked it in different ways or got different replies.
    Models,
    /// Different served models under one name, or different addresses.
    Served,
    /// Different versions of this program.
    Version,
    /// Levels that differ in brightness but not in noise.
    Noise,
    /// Dark photographs that do not match their frames in exposure.
    Pairs,
    /// Limits of the observer's numbers.
    Observer,
}

/// The alerts as lines of the terminal, each marked with `!`; empty without an alert.
#[must_use]
pub fn lines(alerts: &[Alert]) -> String {
    alerts.iter().map(|alert| line("! ", &alert.text, "  ")).collect()
}
