//! The trials to ask: [`Plan`].

use std::collections::{BTreeMap, BTreeSet};

use crate::engine::images::trials::trial::Trial;
use crate::types::{Condition, TrialKey};

/// The trials about one source that share their images, or have none.
#[derive(Debug)]
pub(crate) struct TrialGroup<I> {
    /// Condition of the images; `None` if only text is sent.
    pub(crate) condition: Option<Condition>,
    pub(crate) trials: Vec<Trial<I>>,
}

impl<I> TrialGroup<I> {
    fn is_untouched(&self) -> bool {
        self.condition == Some(Condition::L0)
    }
}

/// All groups about one source.
#[derive(Debug)]
pub(crate) struct SourcePlan<I> {
    /// Index of the source among those of the run.
    pub(crate) source: usize,
    pub(crate) groups: Vec<TrialGroup<I>>,
}

impl<I> SourcePlan<I> {
    /// The conditions in which the source is shown.
    pub(crate) fn conditions(&self) -> impl Iterator<Item = &Condition> {
        self.groups.iter().filter_map(|group| group.condition.as_ref())
    }

    fn trial_count(&self) -> usize {
        self.groups.iter().map(|group| group.trials.len()).sum()
    }
}

/// The trials of one phase of a run, and the ones that remain to be asked.
#[derive(Debug)]
pub(crate) struct Plan<I> {
    /// Keys of all trials, answered or not, source by source.
    pub(crate) keys: Vec<TrialKey>,
    /// Number of trials, answered or not, by source index.
    pub(crate) by_source: BTreeMap<usize, usize>,
    /// The trials that remain to be asked, in the same order.
    pub(crate) sources: Vec<SourcePlan<I>>,
}

impl<I> Plan<I> {
    /// A plan in which all trials remain to be asked.
    pub(crate) fn new(sources: Vec<SourcePlan<I>>) -> Self {
        let keys = sources
            .iter()
            .flat_map(|source| &source.groups)
            .flat_map(|group| &group.trials)
            .map(|trial| trial.key)
            .collect();
        let mut by_source = BTreeMap::new();
        for part in &sources {
            *by_source.entry(part.source).or_default() += part.trial_count();
        }
        let mut plan = Self { keys, by_source, sources };
        plan.exclude(|_| false);
        plan
    }

    /// Removes the trials that need not be asked; returns their number.
    pub(crate) fn exclude(&mut self, is_excluded: impl Fn(&TrialKey) -> bool) -> usize {
        let before = self.remaining();
        for source in &mut self.sources {
            for group in &mut source.groups {
                group.trials.retain(|trial| !is_excluded(&trial.key));
            }
            source.groups.retain(|group| !group.trials.is_empty());
        }
        self.sources.retain(|source| !source.groups.is_empty());
        before - self.remaining()
    }

    /// Adds the wanted images of all groups that are not in the plan, without trials.
    pub(crate) fn add_images(&mut self, all: Vec<SourcePlan<I>>, is_wanted: impl Fn(usize, &Condition) -> bool) {
        let positions: BTreeMap<usize, usize> = self.sources.iter().map(|part| part.source).zip(0..).collect();
        for SourcePlan { source, groups } in all {
            let position = positions.get(&source).copied();
            let planned: BTreeSet<Condition> =
                position.map(|position| self.sources[position].conditions().cloned().collect()).unwrap_or_default();
            let groups: Vec<TrialGroup<I>> = groups
                .into_iter()
                .filter_map(|group| group.condition)
                .filter(|condition| !planned.contains(condition) && is_wanted(source, condition))
                .map(|condition| TrialGroup { condition: Some(condition), trials: Vec::new() })
                .collect();
            match position {
                Some(position) => self.sources[position].groups.extend(groups),
                None if groups.is_empty() => {}
                None => self.sources.push(SourcePlan { source, groups }),
            }
        }
    }

    /// Moves groups of untouched images to the front until they have at least `trials` trials, because these show
    /// whether a server looks at the images at all. Nothing is moved if fewer than `min_trials` exist. Only groups of
    /// sources for which `is_cheap` is true are moved, because the frames of a moved group are read twice.
    pub(crate) fn ask_untouched_first(&mut self, min_trials: usize, trials: usize, is_cheap: impl Fn(usize) -> bool) {
        let available: usize =
            self.groups().filter(|(_, group)| group.is_untouched()).map(|(_, group)| group.trials.len()).sum();
        if available < min_trials {
            return;
        }
        let mut first = Vec::new();
        let mut moved = 0;
        for part in self.sources.iter_mut().filter(|part| is_cheap(part.source)) {
            if moved < trials
                && part.groups.len() > 1
                && let Some(index) = part.groups.iter().position(TrialGroup::is_untouched)
            {
                moved += part.groups[index].trials.len();
                first.push(SourcePlan { source: part.source, groups: vec![part.groups.remove(index)] });
            }
        }
        first.append(&mut self.sources);
        self.sources = first;
    }

    /// Number of trials that remain to be asked and whose keys satisfy `is_counted`.
    pub(crate) fn remaining_where(&self, is_counted: impl Fn(&TrialKey) -> bool) -> usize {
        self.groups().flat_map(|(_, group)| &group.trials).filter(|trial| is_counted(&trial.key)).count()
    }

    /// Number of trials that remain to be asked.
    pub(crate) fn remaining(&self) -> usize {
        self.sources.iter().map(SourcePlan::trial_count).sum()
    }

    /// The conditions of the remaining trials.
    pub(crate) fn conditions(&self) -> BTreeSet<&Condition> {
        self.sources.iter().flat_map(SourcePlan::conditions).collect()
    }

    /// The groups of the remaining trials, each with the index of its source.
    pub(crate) fn groups(&self) -> impl Iterator<Item = (usize, &TrialGroup<I>)> {
        self.sources.iter().flat_map(|part| part.groups.iter().map(|group| (part.source, group)))
    }
}
