//! [`ChoiceFacts`]: the facts that reports keep of a trial with choices, and the tables that they refer to
//! ([`ChoiceTables`]).
//!
//! [`SentImages`]: the images sent with a question.
//!
//! [`TrialFacts`]: one trial as held in memory.

use std::collections::BTreeMap;
use std::hash::{Hash, Hasher};

use serde::{Deserialize, Serialize};

use super::TextPlace;
use super::interner::Interner;
use crate::types::degradations::PairFacts;
use crate::types::questions::{UnreadReason, letter};
use crate::types::records::small_number::{SmallNumber, Tokens};
use crate::types::{ChoiceDetail, Digest, FrameId, Observed, OptionProbabilities, ParsedAnswer, Record, TrialOutcome};

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

/// True if a number is [`NONE`] or that of one of `count` entries.
fn is_known(number: u32, count: usize) -> bool {
    number == NONE || (number as usize) < count
}

/// All outcomes, by their numbers in [`ChoiceFacts::to_words`].
const OUTCOMES: [TrialOutcome; 5] =
    [TrialOutcome::Right, TrialOutcome::Wrong, TrialOutcome::Answered, TrialOutcome::Unparsed, TrialOutcome::Failed];

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

impl PackedAnswer {
    /// An answer as bytes: whether there is one, and its choice or reason.
    fn to_bytes(answer: Option<Self>) -> [u8; 2] {
        let number = |why: UnreadReason| UnreadReason::ALL.iter().position(|reason| *reason == why);
        match answer {
            None => [0, 0],
            Some(Self::Chosen(index)) => [1, index],
            Some(Self::Unread(None)) => [2, 0],
            Some(Self::Unread(Some(why))) => [3, number(why).unwrap_or(UnreadReason::ALL.len()) as u8],
        }
    }

    /// An answer from its bytes; the outer `None` if they are none of an answer.
    #[expect(clippy::option_option, reason = "bytes that are no answer, and the bytes of no answer")]
    fn from_bytes(bytes: [u8; 2]) -> Option<Option<Self>> {
        Some(match bytes {
            [0, 0] => None,
            [1, index] => Some(Self::Chosen(index)),
            [2, 0] => Some(Self::Unread(None)),
            [3, why] => Some(Self::Unread(Some(*UnreadReason::ALL.get(usize::from(why))?))),
            _ => return None,
        })
    }
}

/// Facts that few trials have, as indices: the observer's view, and the model's probability of each choice.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
struct RareFacts {
    observed: u32,
    options: u32,
}

/// Tables that the facts of trials with choices refer to.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
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

    /// True if all indices within the tables exist.
    pub(super) fn is_complete(&self) -> bool {
        self.rare
            .iter()
            .all(|rare| is_known(rare.observed, self.observed.len()) && is_known(rare.options, self.options.len()))
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
    /// The facts as numbers, without the tables.
    pub(super) fn to_words(self) -> [u32; 4] {
        let [strict, lenient] = [self.strict, self.lenient].map(PackedAnswer::to_bytes);
        let answers = u32::from_le_bytes([strict[0], strict[1], lenient[0], lenient[1]]);
        let outcome = OUTCOMES.iter().position(|outcome| *outcome == self.outcome).unwrap_or(OUTCOMES.len());
        [self.images, self.rare, answers, u32::from(self.is_letter) + 2 * outcome as u32]
    }

    /// The facts from [`to_words`](Self::to_words); `None` if the numbers are none of facts with these tables.
    pub(super) fn from_words([images, rare, answers, ending]: [u32; 4], tables: &ChoiceTables) -> Option<Self> {
        let [strict, why_strict, lenient, why_lenient] = answers.to_le_bytes();
        let is_complete = is_known(images, tables.images.len()) && is_known(rare, tables.rare.len());
        is_complete.then_some(Self {
            images,
            rare,
            strict: PackedAnswer::from_bytes([strict, why_strict])?,
            lenient: PackedAnswer::from_bytes([lenient, why_lenient])?,
            outcome: *OUTCOMES.get(ending as usize / 2)?,
            is_letter: ending % 2 == 1,
        })
    }

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

/// Facts about the images sent in one request.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct SentImages {
    /// The digest of the first image file.
    pub first: Digest,
    /// The number of files and the digest of all, if there are several.
    several: Option<Box<(usize, Digest)>>,
    /// The size of all files in bytes.
    pub bytes: u64,
    /// The width and the height of the first image, in pixels.
    pub size: [u32; 2],
    /// How dark the photograph of the frame is; only for images of a pair, which are as dark as the photograph.
    pub pair: Option<Box<PairFacts>>,
    /// The frame that was shown, if it differs from that of the question.
    pub(super) shown_frame: Option<FrameId>,
}

impl SentImages {
    /// The images of a record; `None` without images.
    pub(super) fn from_detail(detail: &ChoiceDetail) -> Option<Self> {
        let first = detail.image.as_ref()?;
        let count = detail.images().count();
        let all = detail.file_digest().filter(|_| count > 1);
        Some(Self {
            first: first.digest,
            several: all.map(|all| Box::new((count, all))),
            bytes: detail.images().map(|image| image.bytes as u64).sum(),
            size: [first.width, first.height].map(|side| side as u32),
            pair: first.pair.map(Box::new),
            shown_frame: detail.shown_frame.clone(),
        })
    }

    /// The number of files.
    #[must_use]
    pub fn count(&self) -> usize {
        self.several.as_ref().map_or(1, |several| several.0)
    }

    /// The digest of the file, or of all files in order.
    #[must_use]
    pub fn digest(&self) -> Digest {
        self.several.as_ref().map_or(self.first, |several| several.1)
    }
}

/// Hashes the first file only: equal images have equal first files.
impl Hash for SentImages {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.first.hash(state);
    }
}

/// Facts of one trial, without its key. Numbers are indices into the tables of its [`Trials`](super::Trials).
#[derive(Debug, Clone)]
pub(super) struct TrialFacts<F> {
    pub(super) text: TextPlace,
    /// Hash of the reply and refusal ([`hash_reply`]).
    pub(super) reply: [u32; 2],
    pub(super) item: u32,
    pub(super) asked: u32,
    pub(super) ending: u32,
    pub(super) tokens: Tokens,
    /// Duration of the last attempt, in milliseconds.
    pub(super) latency: SmallNumber,
    pub(super) facts: F,
}

/// Hashes a reply and a refusal, to compare them between trials. Zero means no reply.
pub(super) fn hash_reply(reply: Option<&str>, refusal: Option<&str>) -> [u32; 2] {
    if reply.is_none() && refusal.is_none() {
        return [0; 2];
    }
    let mut hasher = blake3::Hasher::new();
    for text in [reply, refusal] {
        let length = text.map_or(u64::MAX, |text| text.len() as u64);
        hasher.update(&length.to_le_bytes());
        hasher.update(text.unwrap_or_default().as_bytes());
    }
    let [a, b, c, d, e, f, g, h, ..] = *hasher.finalize().as_bytes();
    [u32::from_le_bytes([a, b, c, d]).max(1), u32::from_le_bytes([e, f, g, h])]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::types::records::trials::ChoiceFacts;

    #[test]
    fn a_trial_with_choices_takes_72_bytes() {
        assert_eq!(size_of::<TrialFacts<ChoiceFacts>>(), 72);
    }

    #[test]
    fn replies_and_refusals_have_different_hashes() {
        let digests =
            [(None, None), (Some(""), None), (None, Some("")), (Some("a"), Some("b")), (Some("ab"), Some(""))]
                .map(|(reply, refusal)| hash_reply(reply, refusal));
        for (place, one) in digests.iter().enumerate() {
            assert!(!digests[place + 1..].contains(one));
        }
    }
}
