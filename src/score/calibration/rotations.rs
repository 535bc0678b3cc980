//! Probabilities averaged over the orders in which choices are shown: [`accuracy`].

use std::collections::{BTreeMap, BTreeSet};

use super::confident_reply::usable;
use crate::score::estimate::Estimate;
use crate::score::grid::{ClusterCount, Grid};
use crate::types::QuestionId;

/// The orders of one question in one repeat.
#[derive(Default)]
struct Orders<'a> {
    cluster: u32,
    truth: &'a str,
    orders: BTreeSet<&'a [String]>,
    /// The sum of the probabilities of each text.
    by_text: BTreeMap<&'a str, f64>,
}

/// The share of questions whose true text has the greatest probability on average over their orders; `None` if no question was asked
/// in several orders. What a model gives to a letter averages out.
pub(super) fn accuracy(grid: &Grid<'_>, subject: usize) -> Option<Estimate> {
    let mut questions = BTreeMap::<(&QuestionId, u32), Orders<'_>>::new();
    for (index, item) in grid.items.iter().enumerate() {
        let Some(record) = grid.record(subject, index) else {
            continue;
        };
        let Some(options) = usable(Some(record)) else {
            continue;
        };
        let detail = &record.detail;
        let orders = questions
            .entry((&record.question, detail.repeat))
            .or_default();
        orders.cluster = item.cluster;
        orders.truth = detail.choices.get(detail.truth)?;
        orders.orders.insert(&detail.choices);
        for (text, p) in detail.choices.iter().zip(&options.p) {
            *orders.by_text.entry(text).or_default() += p;
        }
    }
    let mut counts = vec![ClusterCount::default(); grid.clusters];
    for orders in questions.values().filter(|asked| asked.orders.len() > 1) {
        let mut likely = orders.by_text.iter();
        let truth = orders.by_text.get(orders.truth).copied().unwrap_or(0.0);
        let is_right = likely.all(|(text, p)| *text == orders.truth || *p < truth);
        let count = &mut counts[orders.cluster as usize];
        count.replies += 1;
        count.right += u32::from(is_right);
    }
    Estimate::clustered(&counts)
}
