//! Detection of replies that follow the text of a question and ignore its image: [`ImageDependence`], [`Independence`].
//!
//! A server that drops images, or that caches replies by the text, gives the same answer to a wording (a question with
//! its choices in one order) for all images. Two tests use the replies to images whose true answer is not the usual
//! reply to the wording:
//!
//! - If nearly all of these replies are the usual reply, the replies do not depend on the image. A model that sees or
//!   guesses gives the usual reply at most every second time, or as often as the letter that it prefers (exact binomial
//!   test).
//! - If at least a third of these replies are the usual reply, some images may be lost. Then replies to images with the
//!   same true answer depend on the wording. They do not if a model answers by the image, even if it confuses answers,
//!   or if it guesses, even if it prefers letters. Replies to images with the same true answer and the same number of
//!   choices are therefore permuted, and the pairs of equal replies to one wording are counted (stratified permutation
//!   test; p by Phipson and Smyth 2010, doi:10.2202/1544-6115.1585).
//!
//! Only untouched images are used, because a model may fall back on the text in the dark.

#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

use statrs::function::beta::beta_reg;

use super::record::Detail;
use crate::statistics::bootstrap::SplitMix;
use darkqa_base::types::{Condition, Digest, Record, Treatment, TrialRef, Via};

/// A reply about an untouched image whose true answer is known.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct LitReply {
    /// Digest of the question and its choices in the order shown.
    pub wording: Digest,
    /// Number of choices.
    pub choices: usize,
    /// Index of the true choice.
    pub truth: usize,
    /// Index of the choice in the lenient parsing.
    pub chosen: usize,
}

impl LitReply {
    /// Extracts the reply of a record, with the digest of its wording. `None` unless it is the first reply of a model
    /// to a question about an untouched image with a known true choice.
    pub fn from_record<D: Detail>(record: &Record<D>, wording: impl FnOnce() -> Digest) -> Option<Self> {
        let asked = record.detail.asked();
        let is_counted =
            record.condition.as_ref().is_some_and(is_untouched) && asked.repeat == 0 && record.via != Via::File;
        let (truth, chosen) = asked.truth.zip(record.detail.chosen()).filter(|_| is_counted)?;
        Some(Self { wording: wording(), choices: asked.choices.len(), truth, chosen })
    }

    /// Extracts the reply of a trial, under the same conditions as [`Self::from_record`].
    pub fn from_trial(trial: TrialRef<'_>, wording: impl FnOnce() -> Digest) -> Option<Self> {
        let is_counted = trial.condition().is_some_and(is_untouched) && trial.repeat() == 0 && trial.via() != Via::File;
        let chosen = trial.lenient().and_then(|reading| reading.chosen);
        let (truth, chosen) = trial.truth().zip(chosen).filter(|_| is_counted)?;
        Some(Self { wording: wording(), choices: trial.choices().len(), truth, chosen })
    }
}

fn is_untouched(condition: &Condition) -> bool {
    condition.treatment == Treatment::Untouched && condition.enhancer.is_none()
}

/// Extent to which replies do not depend on the image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Extent {
    /// Nearly all replies.
    All,
    /// A part of the replies.
    Part,
    /// All replies, because they are the same letter, given as the index of the choice.
    OneLetter(usize),
}

/// Replies of a model that do not depend on the image.
#[derive(Debug, Clone, PartialEq)]
pub struct Independence {
    pub extent: Extent,
    /// Number of replies about untouched images.
    pub replies: usize,
    /// Number of wordings that were shown with several images.
    pub wordings: usize,
    /// Number of replies to images whose true answer is not the usual reply to the wording.
    pub other_truth: usize,
    /// Number of these replies that are the usual reply.
    pub usual: usize,
    /// p-value of the binomial test for all replies, or of the permutation test for a part; `None` for one letter,
    /// which may be a preference.
    pub p: Option<f64>,
}

/// Verdict level of a test. It is repeated whenever the number of replies has grown by half, from 24 to 100,000:
/// at most 20 times, so that at most 1 % of the models that answer by the image or guess are reported in a run.
const LEVEL: f64 = 0.0005;

/// Number of permutations (chosen, so that the smallest p-value is 0.0001).
const PERMUTATIONS: usize = 9_999;

/// Minimum number of replies for a test (chosen).
pub const MIN_REPLIES: usize = 24;

/// Minimum number of replies to images whose true answer is not the usual reply (chosen).
const MIN_OTHER_TRUTH: usize = 12;

/// Maximum number of permuted replies, so that the test takes less than a second (chosen).
const MAX_PERMUTED: usize = 2_000;

/// Minimum share of usual replies for which all replies count as independent of the image (chosen).
const NEARLY_ALL: f64 = 0.9;

/// Minimum share of one letter among all replies of a model that always answers the same letter (chosen).
const ONE_LETTER: f64 = 0.98;

impl Independence {
    /// Tests the replies of a model, in any order; `None` if they may depend on the image.
    #[must_use]
    pub fn find(replies: &[LitReply]) -> Option<Self> {
        if replies.len() < MIN_REPLIES {
            return None;
        }
        let mut sorted = replies.to_vec();
        sorted.sort_unstable();
        let letter = one_letter(&sorted);
        let counts = Counts::new(&sorted, letter);
        let share = counts.usual as f64 / counts.other_truth.max(1) as f64;
        if counts.other_truth < MIN_OTHER_TRUTH || share < 1.0 / 3.0 {
            return None;
        }
        let (extent, p) = match letter {
            Some(letter) => (Extent::OneLetter(letter), None),
            None if share >= NEARLY_ALL => (Extent::All, Some(counts.binomial_test(&sorted)?)),
            None => (Extent::Part, Some(permutation_test(&sorted)?)),
        };
        Some(Self {
            extent,
            replies: replies.len(),
            wordings: counts.wordings,
            other_truth: counts.other_truth,
            usual: counts.usual,
            p,
        })
    }

    /// Describes the finding about a model, in two sentences.
    #[must_use]
    pub fn words(&self, model: &str) -> String {
        let Self { replies, wordings, other_truth, usual, .. } = self;
        let (finding, test, cause) = match self.extent {
            Extent::OneLetter(choice) => {
                let letter = char::from(b'A'.saturating_add(choice.min(25) as u8));
                return format!(
                    "{model} answers {letter} whatever the image and the question: {usual} of {other_truth} replies to untouched images \
                     with another true answer. Its accuracy measures no sight."
                );
            }
            Extent::All => (
                format!("The replies of {model} do not depend on the image"),
                "exact binomial test",
                "The server may drop images, or cache replies by the text.",
            ),
            Extent::Part => (
                format!("A part of the replies of {model} does not depend on the image"),
                "permutation test",
                "The server may drop or mix up some images, or the model goes by the words.",
            ),
        };
        let p = match self.p {
            Some(p) if p >= 0.0001 => format!("p = {p:.4}"),
            _ => "p < 0.0001".to_owned(),
        };
        format!(
            "{finding}: {usual} of {other_truth} replies to untouched images are the usual reply to the wording although another answer is \
             true ({replies} replies, {wordings} wordings, {test}: {p}). {cause}"
        )
    }
}

/// Replies of one model, tested whenever their number has grown by half.
#[derive(Debug, Clone, Default)]
pub struct ImageDependence {
    replies: Vec<LitReply>,
    /// Number of replies at the last test.
    tested: usize,
    is_found: bool,
}

impl ImageDependence {
    /// Adds a reply. Returns the finding as soon as there is one, and only once.
    pub fn add(&mut self, reply: LitReply) -> Option<Independence> {
        if self.is_found {
            return None;
        }
        self.replies.push(reply);
        let next = (self.tested + self.tested / 2).max(MIN_REPLIES);
        if self.replies.len() < next {
            return None;
        }
        self.tested = self.replies.len();
        let found = Independence::find(&self.replies);
        self.is_found = found.is_some();
        found
    }
}

/// Letter of nearly all replies; `None` if no letter is so frequent.
fn one_letter(replies: &[LitReply]) -> Option<usize> {
    let (letter, count) = most_frequent(replies)?;
    (count as f64 >= ONE_LETTER * replies.len() as f64).then_some(letter)
}

/// Most frequent choice with its number of replies; the one with the higher index if two are equally frequent.
fn most_frequent(replies: &[LitReply]) -> Option<(usize, usize)> {
    let mut counts = BTreeMap::<usize, usize>::new();
    for reply in replies {
        *counts.entry(reply.chosen).or_default() += 1;
    }
    counts.into_iter().max_by_key(|(_, count)| *count)
}

/// Counts of the usual reply to a wording among replies to images with another true answer.
struct Counts {
    wordings: usize,
    other_truth: usize,
    usual: usize,
}

impl Counts {
    /// Counts over wordings with several replies. The replies must be sorted by wording. `letter` is the usual reply to
    /// all wordings, if given.
    fn new(sorted: &[LitReply], letter: Option<usize>) -> Self {
        let mut counts = Self { wordings: 0, other_truth: 0, usual: 0 };
        for replies in sorted
            .chunk_by(|one, other| one.wording == other.wording)
            .filter(|replies| replies.len() > 1 || letter.is_some())
        {
            counts.wordings += 1;
            let Some(usual) = letter.or_else(|| Some(most_frequent(replies)?.0)) else {
                continue;
            };
            for reply in replies.iter().filter(|reply| reply.truth != usual) {
                counts.other_truth += 1;
                counts.usual += usize::from(reply.chosen == usual);
            }
        }
        counts
    }

    /// p-value of this number of usual replies if each is given at most every second time, or as often as the most
    /// frequent letter of all replies; `None` if it is above the level.
    fn binomial_test(&self, replies: &[LitReply]) -> Option<f64> {
        let (_, preferred) = most_frequent(replies)?;
        let chance = (preferred as f64 / replies.len() as f64).max(0.5);
        let (n, x) = (self.other_truth as f64, self.usual as f64);
        // Probability of at least x of n (DLMF 8.17.5).
        let p = beta_reg(x, n - x + 1.0, chance);
        (p <= LEVEL).then_some(p)
    }
}

/// p-value of the number of pairs of equal replies to one wording, under permutation of the replies to images with the
/// same true answer; `None` if it is above the level, which ends the test early.
fn permutation_test(sorted: &[LitReply]) -> Option<f64> {
    // Every n-th of the sorted replies has nearly the same composition as all replies.
    let step = sorted.len().div_ceil(MAX_PERMUTED);
    let mut replies: Vec<LitReply> = sorted.iter().copied().step_by(step).collect();
    replies.sort_unstable_by_key(|reply| (reply.choices, reply.truth, *reply));
    let mut numbers = BTreeMap::<Digest, usize>::new();
    for reply in &replies {
        let next = numbers.len();
        numbers.entry(reply.wording).or_insert(next);
    }
    let wordings: Vec<usize> = replies.iter().map(|reply| numbers[&reply.wording]).collect();
    let mut chosen: Vec<usize> = replies.iter().map(|reply| reply.chosen).collect();
    let same_truth = |one: &LitReply, other: &LitReply| (one.choices, one.truth) == (other.choices, other.truth);
    let strata: Vec<usize> = replies.chunk_by(same_truth).map(<[_]>::len).collect();
    let answers = chosen.iter().max().map_or(1, |most| most + 1);
    let mut pairs = EqualPairs { counts: vec![0; numbers.len() * answers], answers };
    let observed = pairs.count(&wordings, &chosen);
    let mut random = SplitMix(0);
    let most_exceeding = (LEVEL * (PERMUTATIONS + 1) as f64) as usize - 1;
    let mut exceeding = 0;
    for _ in 0..PERMUTATIONS {
        let mut rest = &mut chosen[..];
        for size in &strata {
            let (stratum, behind) = rest.split_at_mut(*size);
            random.shuffle(stratum);
            rest = behind;
        }
        exceeding += usize::from(pairs.count(&wordings, &chosen) >= observed);
        if exceeding > most_exceeding {
            return None;
        }
    }
    Some((1 + exceeding) as f64 / (1 + PERMUTATIONS) as f64)
}

/// Counts the pairs of equal replies to one wording.
struct EqualPairs {
    /// Number of replies by wording and answer; 0 between two calls.
    counts: Vec<u32>,
    answers: usize,
}

impl EqualPairs {
    fn count(&mut self, wordings: &[usize], chosen: &[usize]) -> u64 {
        let mut pairs = 0;
        for (wording, chosen) in wordings.iter().zip(chosen) {
            let count = &mut self.counts[wording * self.answers + chosen];
            pairs += u64::from(*count);
            *count += 1;
        }
        for (wording, chosen) in wordings.iter().zip(chosen) {
            self.counts[wording * self.answers + chosen] = 0;
        }
        pairs
    }
}
