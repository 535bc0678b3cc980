//! Answers given against true answers: [`Confusion`], [`Hallucination`] and [`Collapse`].

use std::collections::{BTreeMap, BTreeSet};

use super::choice::ReadingMode;
use super::estimate::Estimate;
use super::grid::{ClusterCount, Grid};
use super::subject::Subject;
use crate::types::Family;

/// Maximum number of different answers of a family that gets a confusion table.
const MAX_LABELS: usize = 26;

/// Confusion table of one subject on one family, in the strict reading.
#[derive(Debug, Clone, PartialEq)]
pub struct Confusion {
    pub subject: Subject,
    pub family: Family,
    /// The different answers, sorted.
    pub labels: Vec<String>,
    /// Number of replies by true answer, then by answer given. The last column counts replies without a readable answer.
    pub counts: Vec<Vec<usize>>,
}

/// Confusion tables of every subject, for families with at most [`MAX_LABELS`] different answers.
#[must_use]
pub(crate) fn confusions(grid: &Grid<'_>) -> Vec<Confusion> {
    let mut all = Vec::new();
    for family in grid.families() {
        let items = grid
            .items
            .iter()
            .filter(|item| item.record.detail.family == *family);
        let labels: BTreeSet<&str> = items
            .flat_map(|item| item.record.detail.choices.iter().map(String::as_str))
            .collect();
        if labels.len() > MAX_LABELS {
            continue;
        }
        let labels: Vec<String> = labels.into_iter().map(str::to_owned).collect();
        for (index, subject) in grid.subjects.iter().enumerate() {
            let counts = counts(grid, index, family, &labels);
            if counts.iter().flatten().any(|count| *count > 0) {
                all.push(Confusion {
                    subject: subject.clone(),
                    family: family.clone(),
                    labels: labels.clone(),
                    counts,
                });
            }
        }
    }
    all
}

fn counts(grid: &Grid<'_>, subject: usize, family: &Family, labels: &[String]) -> Vec<Vec<usize>> {
    let mut counts = vec![vec![0; labels.len() + 1]; labels.len()];
    for (item, result) in grid.of_family(subject, Some(family)) {
        let Some(chosen) = result.reading(ReadingMode::Strict) else {
            continue;
        };
        let position = |index: usize| {
            let text = item.record.detail.choices.get(index)?;
            labels.binary_search(text).ok()
        };
        if let Some(truth) = position(item.record.detail.truth) {
            let predicted = chosen.and_then(|index| position(usize::from(index)));
            counts[truth][predicted.unwrap_or(labels.len())] += 1;
        }
    }
    counts
}

/// Distribution of the answers given, compared with the true answers. A model that no longer sees gives the same answer
/// to everything.
#[derive(Debug, Clone, PartialEq)]
pub struct Collapse {
    /// The answer given most often.
    pub top: String,
    /// Share of that answer among all replies.
    pub share: f64,
    /// Share of the same replies for which that answer is true.
    pub truth: f64,
    /// Entropy of the answers given, in bits, over replies with a readable answer.
    pub entropy: f64,
    /// Entropy of the true answers, in bits, over all replies.
    pub true_entropy: f64,
    /// Number of replies, readable or not.
    pub n: usize,
}

impl Confusion {
    /// For each answer, the number of times it was given and the number of times it was true.
    #[must_use]
    pub fn shares(&self) -> Vec<(usize, usize)> {
        let predicted = |label: usize| self.counts.iter().map(|row| row[label]).sum();
        let labels = self.counts.iter().enumerate();
        labels
            .map(|(label, row)| (predicted(label), row.iter().sum()))
            .collect()
    }

    /// Collapse of the answers; `None` if no answer could be read.
    #[must_use]
    pub fn collapse(&self) -> Option<Collapse> {
        let shares = self.shares();
        let n: usize = shares.iter().map(|(_, truth)| truth).sum();
        // Of several most frequent answers, the first by name.
        let (top, (predicted, truth)) = shares
            .iter()
            .enumerate()
            .rev()
            .max_by_key(|(_, (predicted, _))| *predicted)?;
        if *predicted == 0 {
            return None;
        }
        Some(Collapse {
            top: self.labels[top].clone(),
            share: *predicted as f64 / n as f64,
            truth: *truth as f64 / n as f64,
            entropy: entropy(shares.iter().map(|(predicted, _)| *predicted)),
            true_entropy: entropy(shares.iter().map(|(_, truth)| *truth)),
            n,
        })
    }
}

/// Shannon entropy of counts, in bits.
fn entropy(counts: impl Iterator<Item = usize> + Clone) -> f64 {
    let all: usize = counts.clone().sum();
    let terms = counts.filter(|count| *count > 0).map(|count| {
        let share = count as f64 / all as f64;
        -share * libm::log2(share)
    });
    terms.sum()
}

/// Rates at which a subject reports absent objects and overlooks present ones.
#[derive(Debug, Clone, PartialEq)]
pub struct Hallucination {
    pub subject: Subject,
    /// Share of "yes" among replies to questions whose truth is "no".
    pub false_positive: Option<Estimate>,
    /// Share of "no" among replies to questions whose truth is "yes".
    pub false_negative: Option<Estimate>,
}

/// Hallucination of every subject on presence questions (DarkQA, section IV). Replies without a readable answer count as
/// replies, but as neither "yes" nor "no".
#[must_use]
pub(crate) fn hallucinations(grid: &Grid<'_>) -> Vec<Hallucination> {
    let subjects = grid.subjects.iter().enumerate();
    let rates = subjects.map(|(index, subject)| Hallucination {
        subject: subject.clone(),
        false_positive: rate(grid, index, "no", "yes"),
        false_negative: rate(grid, index, "yes", "no"),
    });
    rates
        .filter(|rates| rates.false_positive.is_some() || rates.false_negative.is_some())
        .collect()
}

/// Share of `answer` among replies to presence questions whose true answer is `truth`.
fn rate(grid: &Grid<'_>, subject: usize, truth: &str, answer: &str) -> Option<Estimate> {
    let mut clusters = BTreeMap::<u32, ClusterCount>::new();
    for (item, result) in grid.of_family(subject, Some(&Family::Presence)) {
        let choices = &item.record.detail.choices;
        let is = |index: usize, text: &str| {
            choices
                .get(index)
                .is_some_and(|choice| choice.eq_ignore_ascii_case(text))
        };
        if let Some(chosen) = result.reading(ReadingMode::Strict)
            && is(item.record.detail.truth, truth)
        {
            let count = clusters.entry(item.cluster).or_default();
            count.replies += 1;
            count.right += u32::from(chosen.is_some_and(|index| is(usize::from(index), answer)));
        }
    }
    let counts: Vec<ClusterCount> = clusters.into_values().collect();
    Estimate::clustered(&counts)
}
