//! Given answers compared with true answers: [`Confusion`], [`Hallucination`], [`FalseAnswer`] and [`Collapse`].

use std::collections::{BTreeMap, BTreeSet};

use crate::choice::ParsingMode;
use crate::comparisons::paired::PairedComparison;
use crate::estimate::{ClusterCount, Estimate};
use crate::grid::{Grid, GridItem};
use crate::model_in_condition::ModelInCondition;
use darkqa_base::types::{AxisLevel, Family};

/// Maximum number of different answers of a family that gets a confusion table.
const MAX_LABELS: usize = 26;

/// Confusion table of one subject on one family, in the strict parsing.
#[derive(Debug, Clone, PartialEq)]
pub struct Confusion {
    pub subject: ModelInCondition,
    pub family: Family,
    /// All possible answers, sorted.
    pub labels: Vec<String>,
    /// Number of replies by true answer, then by given answer. The last column counts unreadable replies.
    pub counts: Vec<Vec<usize>>,
    /// Most common answer; `None` without a readable reply.
    pub collapse: Option<Collapse>,
}

/// Confusion tables of every subject, for families with at most [`MAX_LABELS`] different answers.
#[must_use]
pub fn confusions(grid: &Grid<'_>) -> Vec<Confusion> {
    let mut all = Vec::new();
    for family in grid.families() {
        let labels: BTreeSet<&str> = grid
            .items
            .iter()
            .filter(|item| *item.asked.family == *family)
            .flat_map(|item| item.asked.choices.iter().map(String::as_str))
            .collect();
        if labels.len() > MAX_LABELS {
            continue;
        }
        let labels: Vec<String> = labels.into_iter().map(str::to_owned).collect();
        for (index, subject) in grid.subjects.iter().enumerate() {
            let counts = counts(grid, index, family, &labels);
            if counts.iter().flatten().any(|count| *count > 0) {
                let mut confusion = Confusion {
                    subject: subject.clone(),
                    family: family.clone(),
                    labels: labels.clone(),
                    counts,
                    collapse: None,
                };
                confusion.collapse = Collapse::from_confusion(grid, index, &confusion);
                all.push(confusion);
            }
        }
    }
    all
}

/// Number of replies of a subject, by true answer and given answer.
fn counts(grid: &Grid<'_>, subject: usize, family: &Family, labels: &[String]) -> Vec<Vec<usize>> {
    let mut counts = vec![vec![0; labels.len() + 1]; labels.len()];
    for (item, result) in grid.family_items(subject, Some(family)) {
        let Some(chosen) = result.parsed(ParsingMode::Strict) else {
            continue;
        };
        let [truth, predicted] = [item.asked.truth, chosen.map(usize::from)]
            .map(|index| labels.binary_search(item.asked.choices.get(index?)?).ok());
        if let Some(truth) = truth {
            counts[truth][predicted.unwrap_or(labels.len())] += 1;
        }
    }
    counts
}

impl Confusion {
    /// Number of times that each answer was given, and number of times that it was true.
    #[must_use]
    pub fn shares(&self) -> Vec<(usize, usize)> {
        self.counts
            .iter()
            .enumerate()
            .map(|(label, row)| {
                let predicted = self.counts.iter().map(|row| row[label]).sum();
                (predicted, row.iter().sum())
            })
            .collect()
    }
}

/// Distribution of the given answers, compared with the true answers. A model that cannot see anything gives the same
/// answer to every question.
#[derive(Debug, Clone, PartialEq)]
pub struct Collapse {
    /// Most common answer.
    pub top: String,
    /// Share of that answer among all replies, readable or not, with its interval by cluster.
    pub share: Estimate,
    /// Share of the same replies for which that answer is true.
    pub truth: f64,
    /// Expected share of that answer if one of the choices is drawn at random for each of the same replies.
    pub guess: f64,
    /// Entropy of the given answers in bits, over readable replies.
    pub entropy: f64,
    /// Entropy of the true answers in bits, over all replies.
    pub true_entropy: f64,
    /// Number of clusters of the replies.
    pub clusters: usize,
    /// Comparison of the share with that of the same model at L0; `None` for L0 itself, enhanced images and models
    /// without L0.
    pub clean: Option<AgainstClean>,
}

/// Comparison of the share of an answer with its share at L0, on the same items.
///
/// The tested answer is the most common one of both sides together. Swapping the sides does not change this choice, so
/// the test keeps its size although the data select the answer.
#[derive(Debug, Clone, PartialEq)]
pub struct AgainstClean {
    /// Shares of the answer in the strict parsing, with their difference.
    pub strict: PairedComparison,
    /// Shares of the answer in the lenient parsing.
    pub lenient: PairedComparison,
    /// True if the answer is the most common one of both sides together.
    pub is_commonest: bool,
}

impl AgainstClean {
    fn new(grid: &Grid<'_>, subject: usize, family: &Family, answer: &str) -> Option<Self> {
        let dark = &grid.subjects[subject];
        if dark.enhancer.is_some() || !dark.variant.is_degraded() {
            return None;
        }
        let clean = ModelInCondition::with_images(&dark.model, AxisLevel::L0, &dark.variant, None);
        let clean = grid.find_up_to_group(&clean)?;
        let mut times = BTreeMap::<&str, usize>::new();
        for (index, item) in grid.items.iter().enumerate() {
            if !item.is_in_family(Some(family)) {
                continue;
            }
            let [a, b] = grid.results([subject, clean], index).map(|result| result.parsed(ParsingMode::Strict));
            let (Some(a), Some(b)) = (a, b) else { continue };
            for given in [a, b].into_iter().flatten() {
                if let Some(text) = item.asked.choices.get(usize::from(given)) {
                    *times.entry(text).or_default() += 1;
                }
            }
        }
        let own = times.get(answer).copied().unwrap_or(0);
        let [strict, lenient] = ParsingMode::ALL.map(|mode| {
            PairedComparison::counting(
                grid,
                [subject, clean],
                mode,
                |_, item| item.is_in_family(Some(family)),
                |item, chosen| {
                    let given = chosen.and_then(|index| item.asked.choices.get(usize::from(index)));
                    given.is_some_and(|given| given == answer)
                },
            )
        });
        Some(Self { strict: strict?, lenient: lenient?, is_commonest: times.values().all(|times| *times <= own) })
    }

    /// p-value of no difference in a parsing; 1 if another answer is more common.
    pub(crate) fn p(&self, mode: ParsingMode) -> f64 {
        if self.is_commonest { mode.of([&self.strict, &self.lenient]).tested.p } else { 1.0 }
    }

    pub(crate) fn parsed_mut(&mut self, mode: ParsingMode) -> &mut PairedComparison {
        mode.of([&mut self.strict, &mut self.lenient])
    }

    /// True if the answer is shown to be more common than at L0, in both parsings and after the correction over all
    /// sentences.
    fn is_detected(&self) -> bool {
        [self.strict.tested, self.lenient.tested].iter().all(|one| one.difference.value > 0.0 && one.is_detected())
    }
}

/// Minimum excess of the share of an answer over its true share for an answer collapse (chosen).
pub const MIN_EXCESS: f64 = 0.2;

/// Minimum number of clusters for an answer collapse (chosen, the same as for thresholds).
const MIN_CLUSTERS: usize = 8;

impl Collapse {
    /// Describes the most common answer of a subject, the first by name of several.
    fn from_confusion(grid: &Grid<'_>, subject: usize, confusion: &Confusion) -> Option<Self> {
        let shares = confusion.shares();
        let (top, (predicted, truth)) = shares.iter().enumerate().rev().max_by_key(|(_, (predicted, _))| *predicted)?;
        if *predicted == 0 {
            return None;
        }
        let top = &confusion.labels[top];
        let mut clusters = BTreeMap::<u32, ClusterCount>::new();
        let mut guess = 0.0;
        for (item, result) in grid.family_items(subject, Some(&confusion.family)) {
            let Some(chosen) = result.parsed(ParsingMode::Strict) else {
                continue;
            };
            let choices = &*item.asked.choices;
            let given = chosen.and_then(|index| choices.get(usize::from(index)));
            let count = clusters.entry(item.cluster).or_default();
            count.replies += 1;
            count.right += u32::from(given == Some(top));
            if choices.contains(top) {
                guess += 1.0 / choices.len() as f64;
            }
        }
        let counts: Vec<ClusterCount> = clusters.into_values().collect();
        let share = Estimate::clustered(&counts)?;
        Some(Self {
            top: top.clone(),
            share,
            truth: *truth as f64 / share.n as f64,
            guess: guess / share.n as f64,
            entropy: entropy(shares.iter().map(|(predicted, _)| *predicted)),
            true_entropy: entropy(shares.iter().map(|(_, truth)| *truth)),
            clusters: counts.len(),
            clean: AgainstClean::new(grid, subject, &confusion.family, top),
        })
    }

    /// True if one answer is far too frequent, and detected to be more frequent than for the same model at L0.
    #[must_use]
    pub fn is_shown(&self) -> bool {
        self.is_far_too_frequent() && self.clean.as_ref().is_some_and(AgainstClean::is_detected)
    }

    /// True if one answer is far too frequent: its share is [`MIN_EXCESS`] above its true share, and its interval is
    /// above both its true share and the share expected by guessing. A model that guesses yes or no, when few answers
    /// are “yes”, does not collapse.
    #[must_use]
    pub fn is_far_too_frequent(&self) -> bool {
        let rounding = 1e-9;
        self.clusters >= MIN_CLUSTERS
            && self.share.value - self.truth >= MIN_EXCESS - rounding
            && self.share.low > f64::max(self.truth, self.guess)
    }
}

/// Shannon entropy of counts, in bits.
fn entropy(counts: impl Iterator<Item = usize> + Clone) -> f64 {
    let all: usize = counts.clone().sum();
    counts
        .filter(|count| *count > 0)
        .map(|count| {
            let share = count as f64 / all as f64;
            -share * libm::log2(share)
        })
        .sum()
}

/// A false answer to a presence question.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum FalseAnswer {
    /// “no” about a present object: a miss.
    No,
    /// “yes” about an absent object: a hallucination.
    Yes,
}

impl FalseAnswer {
    /// The answer as a word.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::No => "no",
            Self::Yes => "yes",
        }
    }

    /// True if an item is a presence question to which this answer is false, because the other word is true.
    pub(crate) fn is_false_for(self, item: &GridItem<'_>) -> bool {
        let truth = match self {
            Self::No => Self::Yes,
            Self::Yes => Self::No,
        };
        let known = item.asked.truth;
        item.is_in_family(Some(&Family::Presence)) && known.is_some_and(|known| truth.is_choice(item, known))
    }

    /// True if a parsed reply is this answer. An unreadable reply is neither word.
    pub(crate) fn is_given(self, item: &GridItem<'_>, chosen: Option<u8>) -> bool {
        chosen.is_some_and(|index| self.is_choice(item, usize::from(index)))
    }

    fn is_choice(self, item: &GridItem<'_>, index: usize) -> bool {
        let choice = item.asked.choices.get(index);
        choice.is_some_and(|choice| choice.eq_ignore_ascii_case(self.word()))
    }
}

/// Rates at which a subject reports absent objects and overlooks present ones.
#[derive(Debug, Clone, PartialEq)]
pub struct Hallucination {
    pub subject: ModelInCondition,
    /// Share of "yes" among replies to questions whose truth is "no".
    pub false_positive: Option<Estimate>,
    /// Share of "no" among replies to questions whose truth is "yes".
    pub false_negative: Option<Estimate>,
}

/// Computes the hallucination of every subject on presence questions (DarkQA, section IV). Unreadable replies count as
/// replies, but as neither "yes" nor "no".
#[must_use]
pub fn hallucinations(grid: &Grid<'_>) -> Vec<Hallucination> {
    grid.subjects
        .iter()
        .enumerate()
        .map(|(index, subject)| Hallucination {
            subject: subject.clone(),
            false_positive: rate(grid, index, FalseAnswer::Yes),
            false_negative: rate(grid, index, FalseAnswer::No),
        })
        .filter(|rates| rates.false_positive.is_some() || rates.false_negative.is_some())
        .collect()
}

/// Share of a false answer among the replies to presence questions to which it is false.
fn rate(grid: &Grid<'_>, subject: usize, answer: FalseAnswer) -> Option<Estimate> {
    let mut clusters = BTreeMap::<u32, ClusterCount>::new();
    for (item, result) in grid.family_items(subject, Some(&Family::Presence)) {
        if let Some(chosen) = result.parsed(ParsingMode::Strict)
            && answer.is_false_for(item)
        {
            let count = clusters.entry(item.cluster).or_default();
            count.replies += 1;
            count.right += u32::from(answer.is_given(item, chosen));
        }
    }
    let counts: Vec<ClusterCount> = clusters.into_values().collect();
    Estimate::clustered(&counts)
}
