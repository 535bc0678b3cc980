//! Answers given against the true ones: [`Confusion`], and what it tells of hallucination and collapse.

use std::collections::{BTreeMap, BTreeSet};

use super::choice::ReadingMode;
use super::estimate::Estimate;
use super::grid::{ClusterCount, Grid};
use super::subject::Subject;
use crate::types::Family;

/// A family with more different answers than this has no table of them.
const MOST_LABELS: usize = 26;

/// The answers of one subject to one family, in the strict reading.
#[derive(Debug, Clone, PartialEq)]
pub struct Confusion {
    /// Whose.
    pub subject: Subject,
    /// The family.
    pub family: Family,
    /// The different answers, in order.
    pub labels: Vec<String>,
    /// By true answer, then by the answer given; the last column counts replies without a readable answer.
    pub counts: Vec<Vec<usize>>,
}

/// The confusions of every subject, for families of few different answers.
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
        if labels.len() > MOST_LABELS {
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
    for (item, mark) in grid.of_family(subject, Some(family)) {
        let Some(chosen) = mark.reading(ReadingMode::Strict) else {
            continue;
        };
        let place = |index: usize| {
            let text = item.record.detail.choices.get(index)?;
            labels.binary_search(text).ok()
        };
        if let Some(truth) = place(item.record.detail.truth) {
            let given = chosen.and_then(|index| place(usize::from(index)));
            counts[truth][given.unwrap_or(labels.len())] += 1;
        }
    }
    counts
}

/// How the answers given are spread, beside the true ones: a model that no longer sees says the same to everything.
#[derive(Debug, Clone, PartialEq)]
pub struct Collapse {
    /// The answer given most often.
    pub top: String,
    /// Its share of all replies.
    pub share: f64,
    /// How often it is the true answer, as a share of the same replies.
    pub truth: f64,
    /// The entropy of the answers given, in bits, over replies with a readable answer.
    pub entropy: f64,
    /// The entropy of the true answers, in bits, over all replies.
    pub true_entropy: f64,
    /// How many replies.
    pub n: usize,
}

impl Confusion {
    /// How often each answer was given, and how often it was true.
    #[must_use]
    pub fn shares(&self) -> Vec<(usize, usize)> {
        let given = |label: usize| self.counts.iter().map(|row| row[label]).sum();
        let labels = self.counts.iter().enumerate();
        labels
            .map(|(label, row)| (given(label), row.iter().sum()))
            .collect()
    }

    /// How far the answers have fallen together; `None` where no answer could be read.
    #[must_use]
    pub fn collapse(&self) -> Option<Collapse> {
        let shares = self.shares();
        let n: usize = shares.iter().map(|(_, truth)| truth).sum();
        // Of equals the first by name.
        let (top, (given, truth)) = shares
            .iter()
            .enumerate()
            .rev()
            .max_by_key(|(_, (given, _))| *given)?;
        if *given == 0 {
            return None;
        }
        Some(Collapse {
            top: self.labels[top].clone(),
            share: *given as f64 / n as f64,
            truth: *truth as f64 / n as f64,
            entropy: entropy(shares.iter().map(|(given, _)| *given)),
            true_entropy: entropy(shares.iter().map(|(_, truth)| *truth)),
            n,
        })
    }
}

/// Shannon's entropy of counts, in bits.
fn entropy(counts: impl Iterator<Item = usize> + Clone) -> f64 {
    let all: usize = counts.clone().sum();
    let terms = counts.filter(|count| *count > 0).map(|count| {
        let share = count as f64 / all as f64;
        -share * libm::log2(share)
    });
    terms.sum()
}

/// How often a model sees what is not there, and overlooks what is.
#[derive(Debug, Clone, PartialEq)]
pub struct Hallucination {
    /// Whose.
    pub subject: Subject,
    /// The share of "yes" among replies to questions whose truth is "no".
    pub false_positive: Option<Estimate>,
    /// The share of "no" among replies to questions whose truth is "yes".
    pub false_negative: Option<Estimate>,
}

/// The hallucination of every subject on the questions whether an object is there (DarkQA, section IV); replies without a
/// readable answer are among the replies, and are neither.
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

fn rate(grid: &Grid<'_>, subject: usize, truth: &str, said: &str) -> Option<Estimate> {
    let mut clusters = BTreeMap::<u32, ClusterCount>::new();
    for (item, mark) in grid.of_family(subject, Some(&Family::Presence)) {
        let choices = &item.record.detail.choices;
        let is = |index: usize, text: &str| {
            choices
                .get(index)
                .is_some_and(|choice| choice.eq_ignore_ascii_case(text))
        };
        if let Some(chosen) = mark.reading(ReadingMode::Strict)
            && is(item.record.detail.truth, truth)
        {
            let count = clusters.entry(item.cluster).or_default();
            count.replies += 1;
            count.right += u32::from(chosen.is_some_and(|index| is(usize::from(index), said)));
        }
    }
    let counts: Vec<ClusterCount> = clusters.into_values().collect();
    Estimate::clustered(&counts)
}
