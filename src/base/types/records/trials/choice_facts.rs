//! [`ChoiceFacts`]: the facts that reports keep of a trial with choices, and the tables that they refer to
//! ([`ChoiceTables`]).

use std::collections::BTreeMap;

use super::interner::Interner;
use super::sent_images::SentImages;
use crate::types::questions::{UnreadReason, letter};
use crate::types::{ChoiceDetail, FrameId, Observed, OptionProbabilities, ParsedAnswer, Record, TrialOutcome};

/// The index that means "no entry".
const NONE: u32 = u32::MAX;

/// The result of one trial with choices. Numbers are indices into [`ChoiceTables`].
#[derive(Debug, Clone, Copy)]
pub struct ChoiceFacts {
    images: u32,
    rare: u32,
    strict: Option<PackedAnswer>,
    lenient: Option<PackedAnswer>,
    pub(super) outcome: TrialOutcome,
    /// Whether the reply is the letter of a choice and nothing else.
    pub(super) is_letter: bool,
}

/// An [`ParsedAnswer`] in two bytes.
#[derive(Debug, Clone, Copy)]
enum PackedAnswer {
    Chosen(u8),
    Unread(Option<UnreadReason>),
}

impl From<ParsedAnswer> for PackedAnswer {
    fn from(reading: ParsedAnswer) -> Self {
        match reading.chosen {
            // A question has at most 26 choices.
            Some(index) => Self::Chosen(index.min(usize::from(u8::MAX)) as u8),
            None => Self::Unread(reading.why),
        }
    }
}

impl From<PackedAnswer> for ParsedAnswer {
    fn from(reading: PackedAnswer) -> Self {
        match reading {
            PackedAnswer::Chosen(index) => Self { chosen: Some(usize::from(index)), why: None },
            PackedAnswer::Unread(why) => Self { chosen: None, why },
        }
    }
}

/// Facts that few trials have, as indices: the observer's view, and the model's probability of each choice.
#[derive(Debug, Clone, Copy)]
struct RareFacts {
    observed: u32,
    options: u32,
}

/// Tables that the facts of trials with choices refer to.
#[derive(Debug, Clone, Default)]
pub struct ChoiceTables {
    images: Interner<SentImages>,
    observed: Interner<Observed>,
    options: Vec<OptionProbabilities>,
    rare: Vec<RareFacts>,
}

impl ChoiceTables {
    /// Extracts the facts of a record that reports need.
    pub fn extract_facts(&mut self, record: &Record<ChoiceDetail>) -> ChoiceFacts {
        let detail = &record.detail;
        let images = SentImages::from_detail(detail).map_or(NONE, |images| self.images.intern(images));
        let observed = detail.observed.as_ref().map(|observed| Observed {
            from: observed.from,
            things: observed.things,
            seen: observed.seen,
            detected: observed.detected,
            explained_ppm: observed.explained_ppm,
            outlines: BTreeMap::new(),
        });
        let observed = observed.map_or(NONE, |observed| self.observed.intern(observed));
        let reply = record.reply.as_deref();
        ChoiceFacts {
            images,
            rare: self.add_rare(observed, detail.options.clone()),
            strict: detail.strict.map(PackedAnswer::from),
            lenient: detail.lenient.map(PackedAnswer::from),
            outcome: detail.outcome,
            is_letter: reply.is_some_and(|reply| is_letter(reply, detail.choices.len())),
        }
    }

    /// Copies facts from other tables into these.
    pub fn move_from(&mut self, facts: ChoiceFacts, other: &Self) -> ChoiceFacts {
        let images = other.images(facts).cloned();
        let observed = other.observed(facts).cloned();
        let observed = observed.map_or(NONE, |observed| self.observed.intern(observed));
        ChoiceFacts {
            images: images.map_or(NONE, |images| self.images.intern(images)),
            rare: self.add_rare(observed, other.options(facts).cloned()),
            ..facts
        }
    }

    /// The index of new rare facts; [`NONE`] if the trial has neither.
    fn add_rare(&mut self, observed: u32, options: Option<OptionProbabilities>) -> u32 {
        if observed == NONE && options.is_none() {
            return NONE;
        }
        let number = self.options.len() as u32;
        self.rare.push(RareFacts { observed, options: options.as_ref().map_or(NONE, |_| number) });
        self.options.extend(options);
        self.rare.len() as u32 - 1
    }

    /// The images that were sent.
    pub fn images(&self, facts: ChoiceFacts) -> Option<&SentImages> {
        (facts.images != NONE).then(|| self.images.get(facts.images))
    }

    /// The frame that was shown, if it differs from that of the question.
    pub fn shown_frame(&self, facts: ChoiceFacts) -> Option<&FrameId> {
        self.images(facts)?.shown_frame.as_ref()
    }

    /// The observer's view, without the outlines of single objects.
    pub(super) fn observed(&self, facts: ChoiceFacts) -> Option<&Observed> {
        let number = self.rare.get(facts.rare as usize)?.observed;
        (number != NONE).then(|| self.observed.get(number))
    }

    /// The model's probability of each choice.
    pub(super) fn options(&self, facts: ChoiceFacts) -> Option<&OptionProbabilities> {
        let number = self.rare.get(facts.rare as usize)?.options;
        self.options.get(number as usize)
    }
}

impl ChoiceFacts {
    /// The strict parsing of the reply; `None` if no reply came.
    pub(super) fn strict(self) -> Option<ParsedAnswer> {
        self.strict.map(ParsedAnswer::from)
    }

    /// The lenient parsing of the reply; `None` if no reply came.
    pub(super) fn lenient(self) -> Option<ParsedAnswer> {
        self.lenient.map(ParsedAnswer::from)
    }

    /// The same answers, scored against `reference` instead of the truth. Images and the observer's view are dropped.
    pub(super) fn scored_against(self, reference: usize) -> Self {
        let outcome = match self.strict() {
            None => TrialOutcome::Failed,
            Some(reading) if reading.chosen == Some(reference) => TrialOutcome::Right,
            Some(ParsedAnswer { chosen: None, .. }) => TrialOutcome::Unparsed,
            Some(_) => TrialOutcome::Wrong,
        };
        Self { images: NONE, rare: NONE, outcome, ..self }
    }
}

/// True if a reply is the letter of one of the first `choices` choices and nothing else.
fn is_letter(reply: &str, choices: usize) -> bool {
    let mut characters = reply.chars();
    let first = characters.next();
    characters.next().is_none() && (0..choices).any(|index| Some(letter(index)) == first)
}
