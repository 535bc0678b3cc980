//! Accuracy of probabilities averaged over the orders of the choices: [`accuracy`].

use std::collections::{BTreeMap, BTreeSet};

use super::confident_reply::usable_probabilities;
use crate::estimate::ClusterCount;
use crate::estimate::Estimate;
use crate::grid::Grid;
use darkqa_base::types::QuestionId;

/// Replies to one question in one repeat, over all orders of its choices.
#[derive(Default)]
struct AskedInOrders<'a> {
    cluster: u32,
    truth: &'a str,
    /// Orders in which the choices were shown.
    shown: BTreeSet<&'a [String]>,
    /// Sum of the probabilities of each choice, by its text.
    by_text: BTreeMap<&'a str, f64>,
}

/// Share of questions whose true choice has the highest probability on average over the orders; `None` if no question
/// was asked in several orders. A preference for letters averages out.
pub(super) fn accuracy(grid: &Grid<'_>, subject: usize) -> Option<Estimate> {
    let mut questions = BTreeMap::<(&QuestionId, u32), AskedInOrders<'_>>::new();
    for (index, item) in grid.items.iter().enumerate() {
        let Some(trial) = grid.trial(subject, index) else {
            continue;
        };
        let Some(options) = usable_probabilities(Some(trial)) else {
            continue;
        };
        let asked = questions.entry((trial.question(), trial.repeat())).or_default();
        asked.cluster = item.cluster;
        asked.truth = trial.choices().get(trial.truth()?)?;
        asked.shown.insert(trial.choices());
        for (text, p) in trial.choices().iter().zip(&options.p) {
            *asked.by_text.entry(text).or_default() += p;
        }
    }
    let mut counts = vec![ClusterCount::default(); grid.clusters];
    for asked in questions.values().filter(|asked| asked.shown.len() > 1) {
        let truth = asked.by_text.get(asked.truth).copied().unwrap_or(0.0);
        let is_right = asked.by_text.iter().all(|(text, p)| *text == asked.truth || *p < truth);
        let count = &mut counts[asked.cluster as usize];
        count.replies += 1;
        count.right += u32::from(is_right);
    }
    Estimate::clustered(&counts)
}
