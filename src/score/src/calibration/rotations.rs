//! Probabilities averaged over the orders in which choices are shown: [`accuracy`].

use std::collections::{BTreeMap, BTreeSet};

use super::confident_reply::usable;
use crate::estimate::ClusterCount;
use crate::estimate::Estimate;
use crate::grid::Grid;
use darkqa_ground::types::QuestionId;

/// The orders of one question in one repeat.
#[derive(Default)]
struct AskedInOrders<'a> {
    cluster: u32,
    truth: &'a str,
    /// The orders in which its choices were shown.
    shown: BTreeSet<&'a [String]>,
    /// The sum of the probabilities of each text.
    by_text: BTreeMap<&'a str, f64>,
}

/// The share of questions whose true text has the greatest probability on average over their orders; `None` if no question was asked
/// in several orders. What a model gives to a letter averages out.
pub(super) fn accuracy(grid: &Grid<'_>, subject: usize) -> Option<Estimate> {
    let mut questions = BTreeMap::<(&QuestionId, u32), AskedInOrders<'_>>::new();
    for (index, item) in grid.items.iter().enumerate() {
        let Some(trial) = grid.trial(subject, index) else {
            continue;
        };
        let Some(options) = usable(Some(trial)) else {
            continue;
        };
        let asked = questions
            .entry((trial.question(), trial.repeat()))
            .or_default();
        asked.cluster = item.cluster;
        asked.truth = trial.choices().get(trial.truth()?)?;
        asked.shown.insert(trial.choices());
        for (text, p) in trial.choices().iter().zip(&options.p) {
            *asked.by_text.entry(text).or_default() += p;
        }
    }
    let mut counts = vec![ClusterCount::default(); grid.clusters];
    for asked in questions.values().filter(|asked| asked.shown.len() > 1) {
        let mut likely = asked.by_text.iter();
        let truth = asked.by_text.get(asked.truth).copied().unwrap_or(0.0);
        let is_right = likely.all(|(text, p)| *text == asked.truth || *p < truth);
        let count = &mut counts[asked.cluster as usize];
        count.replies += 1;
        count.right += u32::from(is_right);
    }
    Estimate::clustered(&counts)
}
