//! What is to be asked: [`Plan`].

use std::collections::BTreeSet;

use super::trial::Trial;
use crate::types::{Condition, TrialKey};

/// All trials that share their images, or that have none.
#[derive(Debug)]
pub(crate) struct TrialGroup<I> {
    /// What is shown; `None` for words alone.
    pub(crate) condition: Option<Condition>,
    pub(crate) trials: Vec<Trial<I>>,
}

/// All groups about one source.
#[derive(Debug)]
pub(crate) struct SourcePlan<I> {
    /// The source's place among those of the run.
    pub(crate) source: usize,
    pub(crate) groups: Vec<TrialGroup<I>>,
}

impl<I> SourcePlan<I> {
    /// The conditions in which the source is shown.
    pub(crate) fn conditions(&self) -> impl Iterator<Item = &Condition> {
        let groups = self.groups.iter();
        groups.filter_map(|group| group.condition.as_ref())
    }

    fn trials(&self) -> usize {
        self.groups.iter().map(|group| group.trials.len()).sum()
    }
}

/// The trials of one phase of a run, and those of them that have no reply yet.
#[derive(Debug)]
pub(crate) struct Plan<I> {
    /// Every trial, answered or not, source by source.
    pub(crate) keys: Vec<TrialKey>,
    /// What is left to ask, in the same order.
    pub(crate) sources: Vec<SourcePlan<I>>,
}

impl<I> Plan<I> {
    /// A plan of all these trials.
    pub(crate) fn new(sources: Vec<SourcePlan<I>>) -> Self {
        let groups = sources.iter().flat_map(|source| &source.groups);
        let trials = groups.flat_map(|group| &group.trials);
        let keys = trials.map(|trial| trial.key).collect();
        let mut plan = Self { keys, sources };
        plan.leave_out(|_| false);
        plan
    }

    /// Asks none of the trials that are there; how many these were.
    pub(crate) fn leave_out(&mut self, is_there: impl Fn(&TrialKey) -> bool) -> usize {
        let before = self.left();
        for source in &mut self.sources {
            for group in &mut source.groups {
                group.trials.retain(|trial| !is_there(&trial.key));
            }
            source.groups.retain(|group| !group.trials.is_empty());
        }
        self.sources.retain(|source| !source.groups.is_empty());
        before - self.left()
    }

    /// How many trials have no reply yet.
    pub(crate) fn left(&self) -> usize {
        self.sources.iter().map(SourcePlan::trials).sum()
    }

    /// The conditions in which something is left to show.
    pub(crate) fn conditions(&self) -> BTreeSet<&Condition> {
        let sources = self.sources.iter();
        sources.flat_map(SourcePlan::conditions).collect()
    }

    /// The groups that are left, each with the place of its source.
    pub(crate) fn groups(&self) -> impl Iterator<Item = (usize, &TrialGroup<I>)> {
        let sources = self.sources.iter();
        sources.flat_map(|part| part.groups.iter().map(|group| (part.source, group)))
    }
}
