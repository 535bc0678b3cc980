//! Trial results as a table, subjects by items: [`Grid`].

use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};

use super::choice::ParsingMode;
use super::cluster::Clusters;
use super::estimate::{ClusterCount, Estimate};
use super::model_in_condition::ModelInCondition;
use darkqa_base::types::degradations::Kind;
use darkqa_base::types::{
    AskedItem, ChoiceDetail, Condition, Family, ModelListing, ParsedAnswer, TrialOutcome, TrialRef, Trials, Variant,
};

/// Marks a missing index.
const NO_INDEX: u32 = u32::MAX;

/// Result of one item for one subject.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TrialResult {
    /// The item was not asked.
    Absent,
    /// The trial failed, so no reply exists.
    Failed,
    /// The model replied. Each reading is the index of the choice read from the reply, or `None` if it is unreadable.
    Read {
        /// Choice in the strict parsing.
        strict: Option<u8>,
        /// Choice in the lenient parsing.
        lenient: Option<u8>,
    },
}

impl TrialResult {
    /// True if the item was asked, with or without a reply.
    #[must_use]
    pub fn is_asked(self) -> bool {
        self != Self::Absent
    }

    /// True if the model replied, readably or not.
    #[must_use]
    pub fn is_reply(self) -> bool {
        matches!(self, Self::Read { .. })
    }

    /// Parsed choice in a mode: `None` without a reply, `Some(None)` for an unreadable reply.
    #[must_use]
    pub fn parsed(self, mode: ParsingMode) -> Option<Option<u8>> {
        match (self, mode) {
            (Self::Absent | Self::Failed, _) => None,
            (Self::Read { strict, .. }, ParsingMode::Strict) => Some(strict),
            (Self::Read { lenient, .. }, ParsingMode::Lenient) => Some(lenient),
        }
    }
}

/// One repeat of a question in one wording, with its choices in one order, about one draw of the noise.
#[derive(Debug, Clone, Copy)]
pub struct GridItem<'a> {
    /// The question as asked.
    pub asked: &'a AskedItem,
    /// Draw of the noise, from 0. Replies to images without drawn noise belong to draw 0.
    pub draw: u16,
    /// Index of its cluster.
    pub cluster: u32,
}

impl GridItem<'_> {
    /// True if a parsed choice is the true one; always false if the true choice is unknown.
    #[must_use]
    pub fn is_right(&self, chosen: Option<u8>) -> bool {
        chosen.is_some_and(|chosen| self.asked.truth == Some(usize::from(chosen)))
    }

    /// True if the item belongs to a family; always true for `None`.
    #[must_use]
    pub fn is_in_family(&self, family: Option<&Family>) -> bool {
        family.is_none_or(|family| *self.asked.family == *family)
    }
}

/// Results of every subject on every item.
///
/// A subject without drawn noise, such as a model at L0, is asked about draw 0 alone. Beside a subject that has draws,
/// its reply stands for all of them ([`Grid::results`], [`Grid::compared_trial`]); alone, it counts once
/// ([`Grid::result`], [`Grid::trial`]).
#[derive(Debug)]
pub struct Grid<'a> {
    /// Subjects (model and condition), in the order of the models in `listing`, then sorted.
    pub subjects: Vec<ModelInCondition>,
    /// Order, groups and labels of the models.
    pub listing: ModelListing,
    /// Items, sorted by frame, question, repeat, wording, choices and draw.
    pub items: Vec<GridItem<'a>>,
    /// Number of clusters.
    pub clusters: usize,
    /// Results of all items for the first subject, then for the next one, and so on. Without drawn noise, those of draw
    /// 0 are repeated for the other draws.
    results: Vec<TrialResult>,
    /// Whether each subject has drawn noise.
    has_draws: Vec<bool>,
    /// Index of each subject.
    indices: BTreeMap<ModelInCondition, usize>,
    trials: &'a Trials<ChoiceDetail>,
    /// Index in `trials` of the trial of each result; [`NO_INDEX`] if the item was not asked.
    trial_indices: Vec<u32>,
}

impl<'a> Grid<'a> {
    /// Creates the table of all trials whose true choice is known. A later trial replaces an earlier one of the same
    /// subject and item. Trials whose frame has no cluster are ignored.
    #[must_use]
    pub fn new(trials: &'a Trials<ChoiceDetail>, clusters: &Clusters) -> Self {
        Self::for_models(trials, clusters, &ModelListing::default(), |_| true)
    }

    /// Like [`Grid::new`], but only with the models for which `is_shown` is true, in the order of `listing`.
    #[must_use]
    pub fn for_models(
        trials: &'a Trials<ChoiceDetail>,
        clusters: &Clusters,
        listing: &ModelListing,
        is_shown: impl Fn(&str) -> bool,
    ) -> Self {
        // Questions without a known true choice are never scored.
        Self::build(trials, clusters, listing, |asked, model| asked.truth.is_some() && is_shown(model))
    }

    /// Creates the table of trials whose true choice is unknown, for inspection only.
    #[must_use]
    pub fn without_truths(trials: &'a Trials<ChoiceDetail>, clusters: &Clusters, listing: &ModelListing) -> Self {
        Self::build(trials, clusters, listing, |asked, _| asked.truth.is_none())
    }

    fn build(
        trials: &'a Trials<ChoiceDetail>,
        clusters: &Clusters,
        listing: &ModelListing,
        is_shown: impl Fn(&AskedItem, &str) -> bool,
    ) -> Self {
        let scope = GridScope::new(trials, |item, model| {
            let has_cluster = clusters.get(&item.frame, &item.question).is_some();
            has_cluster && is_shown(item, model)
        });
        let subject_by_asked: Vec<Option<ModelInCondition>> = trials
            .asked()
            .into_iter()
            .zip(&scope.asked)
            .map(|(asked, is_in_scope)| {
                let (model, condition) = asked.filter(|_| *is_in_scope)?;
                Some(ModelInCondition::new(model, condition))
            })
            .collect();
        let sorted: BTreeSet<&ModelInCondition> = subject_by_asked.iter().flatten().collect();
        let mut subjects: Vec<ModelInCondition> = sorted.into_iter().cloned().collect();
        // The sort is stable, so the subjects of a model stay sorted.
        subjects.sort_by_cached_key(|subject| listing.place(&subject.model));
        let indices: BTreeMap<ModelInCondition, usize> = subjects.iter().cloned().zip(0..).collect();
        let index_by_asked: Vec<Option<usize>> =
            subject_by_asked.iter().map(|subject| indices.get(subject.as_ref()?).copied()).collect();
        let mut seen = HashSet::new();
        let mut items: Vec<GridItem<'a>> = scope
            .items
            .iter()
            .filter_map(|&(number, draw)| {
                let asked = trials.item(number);
                let cluster = clusters.get(&asked.frame, &asked.question)?;
                seen.insert((asked.key(), draw)).then_some(GridItem { asked, draw, cluster })
            })
            .collect();
        items.sort_by(|a, b| sort_key(a).cmp(&sort_key(b)));
        let index_by_key: HashMap<_, u32> = items.iter().map(|item| (item.asked.key(), item.draw)).zip(0..).collect();
        let mut index_by_item = vec![NO_INDEX; trials.item_count() + scope.later.len()];
        for &(number, draw) in &scope.items {
            if let Some(place) = scope.place(number, draw) {
                index_by_item[place] = index_by_key[&(trials.item(number).key(), draw)];
            }
        }
        let size = subjects.len() * items.len();
        let mut results = vec![TrialResult::Absent; size];
        let mut trial_indices = vec![NO_INDEX; size];
        for (index, trial) in (0..).zip(trials.iter()) {
            let place = scope.place(trial.item_number(), scope.draws[trial.asked_number()]);
            let item = place.map_or(NO_INDEX, |place| index_by_item[place]);
            let subject = index_by_asked[trial.asked_number()].filter(|_| item != NO_INDEX);
            // An item can be in the table because of one model, and still not be shown for another model.
            if let Some(subject) = subject.filter(|_| is_shown(trial.item(), trial.model())) {
                let cell = subject * items.len() + item as usize;
                results[cell] = trial_result(trial);
                trial_indices[cell] = index;
            }
        }
        let has_draws: Vec<bool> = subjects.iter().map(has_drawn_noise).collect();
        for (index, item) in items.iter().enumerate().filter(|(_, item)| item.draw > 0) {
            let Some(first) = index_by_key.get(&(item.asked.key(), 0)) else { continue };
            for subject in (0..subjects.len()).filter(|subject| !has_draws[*subject]) {
                let [cell, first] = [index, *first as usize].map(|item| subject * items.len() + item);
                results[cell] = results[first];
                trial_indices[cell] = trial_indices[first];
            }
        }
        Self {
            has_draws,
            subjects,
            listing: listing.clone(),
            indices,
            items,
            clusters: clusters.count(),
            results,
            trials,
            trial_indices,
        }
    }

    /// Result of an item for a subject alone, both by index.
    #[must_use]
    pub fn result(&self, subject: usize, item: usize) -> TrialResult {
        self.results([subject], item)[0]
    }

    /// Results of an item for subjects that are compared, all by index: each subject without drawn noise has its reply
    /// of draw 0 in all draws. If no subject has drawn noise, only draw 0 is asked.
    #[must_use]
    pub fn results<const N: usize>(&self, subjects: [usize; N], item: usize) -> [TrialResult; N] {
        let is_asked = self.has_item(subjects, item);
        subjects.map(|subject| if is_asked { self.compared_result(subject, item) } else { TrialResult::Absent })
    }

    /// True if an item counts for subjects that are compared: it is of draw 0, or one of them has drawn noise.
    #[must_use]
    pub fn has_item(&self, subjects: impl IntoIterator<Item = usize>, item: usize) -> bool {
        self.items[item].draw == 0 || subjects.into_iter().any(|subject| self.has_draws[subject])
    }

    /// Result of an item for a subject beside others of which one has drawn noise.
    #[must_use]
    pub fn compared_result(&self, subject: usize, item: usize) -> TrialResult {
        self.results[subject * self.items.len() + item]
    }

    /// The trial of an item and a subject alone, both by index; `None` if the item was not asked.
    #[must_use]
    pub fn trial(&self, subject: usize, item: usize) -> Option<TrialRef<'a>> {
        if self.has_item([subject], item) { self.compared_trial(subject, item) } else { None }
    }

    /// The trial of an item and a subject beside others of which one has drawn noise.
    #[must_use]
    pub fn compared_trial(&self, subject: usize, item: usize) -> Option<TrialRef<'a>> {
        let index = self.trial_indices[subject * self.items.len() + item];
        self.trials.get(index as usize)
    }

    /// True if the strict and the lenient parsing of any reply of a subject differ.
    #[must_use]
    pub fn parsings_differ(&self, subject: usize) -> bool {
        let start = subject * self.items.len();
        self.results[start..start + self.items.len()]
            .iter()
            .any(|result| matches!(result, TrialResult::Read { strict, lenient } if strict != lenient))
    }

    /// Index of a subject; `None` if the grid does not contain it.
    #[must_use]
    pub fn find(&self, subject: &ModelInCondition) -> Option<usize> {
        self.indices.get(subject).copied()
    }

    /// All variants of the subjects, sorted: each kind of degradation in each noise profile.
    #[must_use]
    pub fn variants(&self) -> BTreeSet<&Variant> {
        self.subjects.iter().map(|subject| &subject.variant).filter(|variant| variant.kind.is_some()).collect()
    }

    /// The variant to show if only one can be shown. Among the first kind of degradation and the kinds that extend it,
    /// this is the last kind, in its first noise profile. Noise therefore remains the main variant if other kinds are
    /// asked as well.
    #[must_use]
    pub fn main_variant(&self) -> Option<Variant> {
        let variants = self.variants();
        let root = variants.first()?.kind.map(Kind::root);
        let kind = variants.iter().copied().rfind(|variant| variant.kind.map(Kind::root) == root)?.kind;
        variants.into_iter().find(|variant| variant.kind == kind).cloned()
    }

    /// Index of a subject or, if the grid does not contain it, of the first subject that differs only in its group of
    /// runs and whose group overlaps. `None` if the grid contains neither.
    #[must_use]
    pub fn find_up_to_group(&self, subject: &ModelInCondition) -> Option<usize> {
        self.find(subject).or_else(|| self.subjects.iter().position(|other| other.matches_up_to_group(subject)))
    }

    /// Items of a family (of all families for `None`), each with its result for a subject.
    pub fn family_items<'s>(
        &'s self,
        subject: usize,
        family: Option<&'s Family>,
    ) -> impl Iterator<Item = (&'s GridItem<'a>, TrialResult)> + 's {
        let items = self.items.iter().enumerate().filter(move |(_, item)| item.is_in_family(family));
        items.map(move |(index, item)| (item, self.result(subject, index)))
    }

    /// Number of replies and of right replies of a subject in each cluster.
    #[must_use]
    pub fn counts(&self, subject: usize, family: Option<&Family>, mode: ParsingMode) -> Vec<ClusterCount> {
        let mut counts = vec![ClusterCount::default(); self.clusters];
        for (item, result) in self.family_items(subject, family) {
            if let Some(chosen) = result.parsed(mode) {
                let count = &mut counts[item.cluster as usize];
                count.replies += 1;
                count.right += u32::from(item.is_right(chosen));
            }
        }
        counts
    }

    /// Number of failed trials of a subject in each cluster; empty if none failed.
    #[must_use]
    pub fn failed(&self, subject: usize, family: Option<&Family>) -> Vec<u32> {
        let mut failed = Vec::new();
        for (item, result) in self.family_items(subject, family) {
            if result == TrialResult::Failed {
                failed.resize(self.clusters, 0);
                failed[item.cluster as usize] += 1;
            }
        }
        failed
    }

    /// Accuracy of a subject. Its interval holds for all values of the missing replies. `None` without a reply.
    #[must_use]
    pub fn accuracy(&self, subject: usize, family: Option<&Family>, mode: ParsingMode) -> Option<Estimate> {
        Estimate::with_missing(&self.counts(subject, family, mode), &self.failed(subject, family))
    }

    /// Returns the grid of the items for which `kept` is true; `kept` has one value per item. Cluster indices do not
    /// change.
    #[must_use]
    pub fn select_items(&self, kept: &[bool]) -> Self {
        let kept_items: Vec<usize> =
            kept.iter().enumerate().filter(|(_, is_kept)| **is_kept).map(|(item, _)| item).collect();
        let cells: Vec<usize> = (0..self.subjects.len())
            .map(|subject| subject * self.items.len())
            .flat_map(|start| kept_items.iter().map(move |item| start + item))
            .collect();
        Self {
            subjects: self.subjects.clone(),
            listing: self.listing.clone(),
            indices: self.indices.clone(),
            items: kept_items.iter().map(|item| self.items[*item]).collect(),
            clusters: self.clusters,
            results: cells.iter().map(|cell| self.results[*cell]).collect(),
            has_draws: self.has_draws.clone(),
            trials: self.trials,
            trial_indices: cells.iter().map(|cell| self.trial_indices[*cell]).collect(),
        }
    }

    /// All families of the items, sorted.
    #[must_use]
    pub fn families(&self) -> Vec<&'a Family> {
        let families: BTreeSet<&Family> = self.items.iter().map(|item| &*item.asked.family).collect();
        families.into_iter().collect()
    }

    /// Groups that are scored separately: all families together (`None`), then each family.
    #[must_use]
    pub fn groups(&self) -> Vec<Option<&'a Family>> {
        std::iter::once(None).chain(self.families().into_iter().map(Some)).collect()
    }
}

/// The subjects and items to include in a grid: those with at least one shown trial.
struct GridScope {
    /// True for each included pair of model and condition, by its index in [`Trials::asked`].
    asked: Vec<bool>,
    /// Numbers of the included items with their draws, in the order of their first shown trials.
    items: Vec<(usize, u16)>,
    /// Draw of the noise of each pair of model and condition.
    draws: Vec<u16>,
    /// Places of the included items in draws after the first.
    later: HashMap<(usize, u16), usize>,
}

impl GridScope {
    fn new(trials: &Trials<ChoiceDetail>, is_shown: impl Fn(&AskedItem, &str) -> bool) -> Self {
        let draw = |asked: Option<(&str, Option<&Condition>)>| asked.and_then(|(_, condition)| condition?.draw());
        let mut scope = Self {
            asked: vec![false; trials.asked().len()],
            items: Vec::new(),
            draws: trials.asked().into_iter().map(|asked| draw(asked).unwrap_or(0)).collect(),
            later: HashMap::new(),
        };
        let mut is_included = vec![false; trials.item_count()];
        for trial in trials.iter() {
            let (item, asked) = (trial.item_number(), trial.asked_number());
            let draw = scope.draws[asked];
            // Most trials add neither a subject nor an item; `is_shown` is not called for them.
            let is_known = scope.place(item, draw).is_some_and(|place| draw > 0 || is_included[place]);
            let adds_nothing = is_known && scope.asked[asked];
            if adds_nothing || !is_shown(trial.item(), trial.model()) {
                continue;
            }
            scope.asked[asked] = true;
            if !is_known {
                if draw == 0 {
                    is_included[item] = true;
                } else {
                    let place = trials.item_count() + scope.later.len();
                    scope.later.insert((item, draw), place);
                }
                scope.items.push((item, draw));
            }
        }
        scope
    }

    /// Place of an item in a draw: its number for the first draw, and a place after all numbers for others; `None` if it
    /// is not included in a later draw.
    fn place(&self, item: usize, draw: u16) -> Option<usize> {
        if draw == 0 { Some(item) } else { self.later.get(&(item, draw)).copied() }
    }
}

fn sort_key<'i>(item: &'i GridItem<'_>) -> impl Ord + 'i {
    (&item.asked.frame, item.asked.key(), item.draw)
}

/// True if the images of a subject differ by draw of the noise.
fn has_drawn_noise(subject: &ModelInCondition) -> bool {
    subject.variant.kind.is_some_and(Kind::has_noise)
}

fn trial_result(trial: TrialRef<'_>) -> TrialResult {
    match (trial.outcome(), trial.strict()) {
        (TrialOutcome::Failed, _) | (_, None) => TrialResult::Failed,
        (_, Some(strict)) => {
            TrialResult::Read { strict: chosen_index(strict), lenient: trial.lenient().and_then(chosen_index) }
        }
    }
}

/// Index of the parsed choice, at most 255; `None` if no choice could be parsed.
fn chosen_index(reading: ParsedAnswer) -> Option<u8> {
    let index = reading.chosen?;
    Some(index.min(usize::from(u8::MAX)) as u8)
}
