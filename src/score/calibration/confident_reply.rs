//! A reply with the confidence of the model: [`ConfidentReply`].

use crate::estimate::ClusterCount;
use crate::estimate::Estimate;
use crate::grid::Grid;
use darkqa_base::types::{OptionProbabilities, TrialOutcome, TrialRef};

/// Probability assumed for a true choice that is neither listed nor bounded. Probabilities are stored with six
/// decimals.
const MIN_PROBABILITY: f64 = 1e-6;

/// A reply with probabilities, and without reasoning before the answer.
#[derive(Debug, Clone, Copy)]
pub(super) struct ConfidentReply {
    /// Index of the item.
    pub(super) item: usize,
    /// Index of the cluster.
    pub(super) cluster: u32,
    /// Highest probability of a choice.
    pub(super) confidence: f64,
    /// True if the strict parsing finds the true choice.
    pub(super) right: bool,
    /// Brier score: sum of (p − truth)² over the choices.
    pub(super) brier: f64,
    /// Brier score of equal probabilities: 1 − 1/k for k choices.
    pub(super) guess: f64,
    /// −ln p of the true choice; p is at least the bound for choices that are not listed.
    pub(super) nll: f64,
}

impl ConfidentReply {
    /// Confidence minus correctness: confidence − 1 for a right reply, the confidence for a wrong one.
    pub(super) fn excess(&self) -> f64 {
        self.confidence - f64::from(u8::from(self.right))
    }
}

/// Evaluated replies of a subject, and numbers of other replies.
pub(super) struct SortedReplies {
    /// Replies in order of increasing confidence.
    pub(super) replies: Vec<ConfidentReply>,
    /// Number of replies with reasoning before the answer.
    pub(super) reasoned: usize,
    /// Number of replies without probabilities.
    pub(super) unstated: usize,
}

/// Collects the replies of a subject.
pub(super) fn confident_replies(grid: &Grid<'_>, subject: usize) -> SortedReplies {
    let mut sorted = SortedReplies { replies: Vec::new(), reasoned: 0, unstated: 0 };
    for (index, item) in grid.items.iter().enumerate() {
        let trial = grid.trial(subject, index);
        let Some(trial) = trial.filter(|trial| !trial.failed()) else {
            continue;
        };
        match trial.options() {
            None => sorted.unstated += 1,
            Some(options) if options.reasoned => sorted.reasoned += 1,
            Some(options) => sorted.replies.extend(reply(trial, options, index, item.cluster)),
        }
    }
    let replies = &mut sorted.replies;
    replies.sort_by(|a, b| a.confidence.total_cmp(&b.confidence));
    sorted
}

/// Returns the reply of a trial; `None` if the probabilities do not match its choices, as in an edited file.
fn reply(trial: TrialRef<'_>, options: &OptionProbabilities, item: usize, cluster: u32) -> Option<ConfidentReply> {
    let p = &options.p;
    let truth = *p.get(trial.truth()?)?;
    if p.len() != trial.choices().len() || options.mass <= 0.0 {
        return None;
    }
    let squares: f64 = p.iter().map(|p| p * p).sum();
    let least = (options.bound / options.mass).max(MIN_PROBABILITY);
    Some(ConfidentReply {
        item,
        cluster,
        confidence: options.confidence(),
        right: trial.outcome() == TrialOutcome::Right,
        brier: squares - 2.0 * truth + 1.0,
        guess: 1.0 - 1.0 / p.len() as f64,
        nll: -libm::log(truth.max(least).min(1.0)),
    })
}

/// Share of right replies, with its interval by cluster.
pub(super) fn accuracy(clusters: usize, replies: &[ConfidentReply]) -> Option<Estimate> {
    let mut counts = vec![ClusterCount::default(); clusters];
    for reply in replies {
        let count = &mut counts[reply.cluster as usize];
        count.replies += 1;
        count.right += u32::from(reply.right);
    }
    Estimate::clustered(&counts)
}

/// Probabilities of a trial, if they may be evaluated; `None` without probabilities, or with reasoning before the
/// answer.
pub(super) fn usable_probabilities(trial: Option<TrialRef<'_>>) -> Option<&OptionProbabilities> {
    let trial = trial.filter(|trial| !trial.failed())?;
    let options = trial.options()?;
    let fits = options.p.len() == trial.choices().len();
    (fits && !options.reasoned).then_some(options)
}
