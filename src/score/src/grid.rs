//! Records as a table of every subject by every item: [`Grid`].

use std::collections::{BTreeMap, BTreeSet, HashMap};

use super::choice::ReadingMode;
use super::cluster::Clusters;
use super::estimate::ClusterCount;
use super::subject::Subject;
use darkqa_ground::types::degradation::Kind;
use darkqa_ground::types::{
    AnswerReading, AskedItem, ChoiceDetail, Family, KindReading, ModelListing, TrialOutcome,
    TrialRef, Trials,
};

/// Result of one item for one subject.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TrialResult {
    /// The item was not asked.
    Absent,
    /// The trial failed: there is no reply.
    Failed,
    /// There is a reply. Each reading is the index of a choice, or `None` if no choice could be read.
    Read {
        /// Choice in the strict reading.
        strict: Option<u8>,
        /// Choice in the lenient reading.
        lenient: Option<u8>,
    },
}

impl TrialResult {
    /// Whether the item was asked, with or without a reply.
    #[must_use]
    pub fn is_asked(self) -> bool {
        self != Self::Absent
    }

    /// Whether there is a reply, readable or not.
    #[must_use]
    pub fn is_reply(self) -> bool {
        matches!(self, Self::Read { .. })
    }

    /// The reading in one mode; `None` if there is no reply, `Some(None)` if no choice could be read.
    #[must_use]
    pub fn reading(self, mode: ReadingMode) -> Option<Option<u8>> {
        match (self, mode) {
            (Self::Absent | Self::Failed, _) => None,
            (Self::Read { strict, .. }, ReadingMode::Strict) => Some(strict),
            (Self::Read { lenient, .. }, ReadingMode::Lenient) => Some(lenient),
        }
    }
}

/// One question in one order of its choices and one repeat.
#[derive(Debug, Clone, Copy)]
pub struct GridItem<'a> {
    /// The question as asked.
    pub asked: &'a AskedItem,
    /// Index of its cluster.
    pub cluster: u32,
}

impl GridItem<'_> {
    /// Whether a reading is the true choice of the item; never if nobody knows that.
    #[must_use]
    pub fn is_right(&self, chosen: Option<u8>) -> bool {
        chosen.is_some_and(|chosen| self.asked.truth == Some(usize::from(chosen)))
    }

    /// Whether the item belongs to a family; always true for `None`.
    #[must_use]
    pub fn is_of(&self, family: Option<&Family>) -> bool {
        family.is_none_or(|family| *self.asked.family == *family)
    }
}

/// Results of every subject on every item.
#[derive(Debug)]
pub struct Grid<'a> {
    /// Subjects (model and condition), the models in their order, else sorted.
    pub subjects: Vec<Subject>,
    /// The order, groups and marks of the models.
    pub listing: ModelListing,
    /// Items, sorted by frame, question, repeat and order of choices.
    pub items: Vec<GridItem<'a>>,
    /// Number of clusters of all items.
    pub clusters: usize,
    /// Results, subject by subject.
    results: Vec<TrialResult>,
    /// Index of each subject.
    indices: BTreeMap<Subject, usize>,
    trials: &'a Trials<ChoiceDetail>,
    /// Place of the trial behind each result; [`u32::MAX`] if there is none.
    places: Vec<u32>,
}

impl<'a> Grid<'a> {
    /// Table of trials whose true choice is known. Of two trials of the same subject and item, the later one counts. Trials of frames
    /// without a cluster are ignored.
    #[must_use]
    pub fn new(trials: &'a Trials<ChoiceDetail>, clusters: &Clusters) -> Self {
        Self::for_models(trials, clusters, &ModelListing::default(), |_| true)
    }

    /// Table of the trials of some models in their order, else as [`Grid::new`].
    #[must_use]
    pub fn for_models(
        trials: &'a Trials<ChoiceDetail>,
        clusters: &Clusters,
        listing: &ModelListing,
        is_shown: impl Fn(&str) -> bool,
    ) -> Self {
        // A question whose true choice nobody knows is never scored.
        Self::build(trials, clusters, listing, |asked, model| {
            asked.truth.is_some() && is_shown(model)
        })
    }

    /// Table of the answers to questions without a known true choice, for inspection only.
    #[must_use]
    pub fn without_truths(
        trials: &'a Trials<ChoiceDetail>,
        clusters: &Clusters,
        listing: &ModelListing,
    ) -> Self {
        Self::build(trials, clusters, listing, |asked, _| asked.truth.is_none())
    }

    fn build(
        trials: &'a Trials<ChoiceDetail>,
        clusters: &Clusters,
        listing: &ModelListing,
        is_shown: impl Fn(&AskedItem, &str) -> bool,
    ) -> Self {
        let met = GridScope::new(trials, |item, model| {
            let has_cluster = clusters.get(&item.frame, &item.question).is_some();
            has_cluster && is_shown(item, model)
        });
        let asked = trials.asked();
        let mut indices = BTreeMap::<Subject, usize>::new();
        let mut subjects_of = Vec::with_capacity(asked.len());
        for (asked, is_met) in asked.iter().zip(met.asked) {
            let subject = asked
                .filter(|_| is_met)
                .map(|(model, condition)| Subject::new(model, condition));
            subjects_of.push(subject.clone());
            indices.extend(subject.map(|subject| (subject, 0)));
        }
        let mut subjects: Vec<Subject> = indices.keys().cloned().collect();
        // Subjects of one model stay sorted: the sort is stable.
        subjects.sort_by_cached_key(|subject| listing.place(&subject.model));
        for (number, subject) in subjects.iter().enumerate() {
            indices.insert(subject.clone(), number);
        }
        let subject_of: Vec<Option<usize>> = subjects_of
            .iter()
            .map(|subject| indices.get(subject.as_ref()?).copied())
            .collect();
        let mut keys = HashMap::<_, u32>::new();
        let mut items: Vec<GridItem<'a>> = Vec::new();
        for asked in met.items.iter().map(|number| trials.item(*number)) {
            if let Some(cluster) = clusters.get(&asked.frame, &asked.question) {
                keys.entry(asked.key()).or_insert_with(|| {
                    items.push(GridItem { asked, cluster });
                    0
                });
            }
        }
        items.sort_by(|a, b| sort_key(a.asked).cmp(&sort_key(b.asked)));
        for (item, index) in items.iter().zip(0..) {
            keys.insert(item.asked.key(), index);
        }
        let mut item_of = vec![u32::MAX; trials.item_count()];
        for number in &met.items {
            item_of[*number] = keys[&trials.item(*number).key()];
        }
        let size = subjects.len() * items.len();
        let (mut results, mut places) = (vec![TrialResult::Absent; size], vec![u32::MAX; size]);
        for (place, trial) in (0..).zip(trials.iter()) {
            let item = item_of[trial.item_number()];
            let subject = subject_of[trial.asked_number()].filter(|_| item != u32::MAX);
            // An item may be met with one model, and not be shown of another.
            if let Some(subject) = subject.filter(|_| is_shown(trial.item(), trial.model())) {
                let cell = subject * items.len() + item as usize;
                results[cell] = result(trial);
                places[cell] = place;
            }
        }
        Self {
            subjects,
            listing: listing.clone(),
            indices,
            items,
            clusters: clusters.count(),
            results,
            trials,
            places,
        }
    }

    /// Result of an item for a subject, by their indices.
    #[must_use]
    pub fn result(&self, subject: usize, item: usize) -> TrialResult {
        self.results[subject * self.items.len() + item]
    }

    /// The trial behind a result; `None` if the item was not asked.
    #[must_use]
    pub fn trial(&self, subject: usize, item: usize) -> Option<TrialRef<'a>> {
        let place = self.places[subject * self.items.len() + item];
        self.trials.get(place as usize)
    }

    /// True if the two parsings of some reply of a subject differ.
    #[must_use]
    pub fn parsings_differ(&self, subject: usize) -> bool {
        let results = &self.results[subject * self.items.len()..(subject + 1) * self.items.len()];
        results.iter().any(
            |result| matches!(result, TrialResult::Read { strict, lenient } if strict != lenient),
        )
    }

    /// Index of a subject, if the grid has it.
    #[must_use]
    pub fn find(&self, subject: &Subject) -> Option<usize> {
        self.indices.get(subject).copied()
    }

    /// The variants that were asked, sorted: kinds of degradation in each light reading.
    #[must_use]
    pub fn variants(&self) -> BTreeSet<&KindReading> {
        self.subjects
            .iter()
            .map(|subject| &subject.variant)
            .filter(|variant| variant.kind.is_some())
            .collect()
    }

    /// The variant where only one is shown: of the first kind that was asked and those that extend it the last, in its first light
    /// reading. So noise stays the main one if other kinds are asked too.
    #[must_use]
    pub fn main_variant(&self) -> Option<KindReading> {
        let variants = self.variants();
        let root = variants.first()?.kind.map(Kind::root);
        let kind = variants
            .iter()
            .copied()
            .rfind(|variant| variant.kind.map(Kind::root) == root)?
            .kind;
        variants
            .into_iter()
            .find(|variant| variant.kind == kind)
            .cloned()
    }

    /// Index of the first subject that stands for another, if the grid has one: that subject itself, or one whose group of
    /// runs meets its own.
    #[must_use]
    pub fn stand_in(&self, subject: &Subject) -> Option<usize> {
        self.find(subject).or_else(|| {
            self.subjects
                .iter()
                .position(|other| other.matches_up_to_group(subject))
        })
    }

    /// Items of a family, each with its result for a subject.
    pub fn family_items<'s>(
        &'s self,
        subject: usize,
        family: Option<&'s Family>,
    ) -> impl Iterator<Item = (&'s GridItem<'a>, TrialResult)> + 's {
        let results = &self.results[subject * self.items.len()..(subject + 1) * self.items.len()];
        self.items
            .iter()
            .zip(results.iter().copied())
            .filter(move |(item, _)| item.is_of(family))
    }

    /// Numbers of right replies and of replies of a subject, by cluster.
    #[must_use]
    pub fn counts(
        &self,
        subject: usize,
        family: Option<&Family>,
        mode: ReadingMode,
    ) -> Vec<ClusterCount> {
        let mut counts = vec![ClusterCount::default(); self.clusters];
        for (item, result) in self.family_items(subject, family) {
            if let Some(chosen) = result.reading(mode) {
                let count = &mut counts[item.cluster as usize];
                count.replies += 1;
                count.right += u32::from(item.is_right(chosen));
            }
        }
        counts
    }

    /// The grid with some of its items; `kept` has a value for each item. Clusters keep their numbers.
    #[must_use]
    pub fn restricted(&self, kept: &[bool]) -> Self {
        let cells = |subject: usize| {
            kept.iter()
                .enumerate()
                .filter(|(_, kept)| **kept)
                .map(move |(item, _)| subject * self.items.len() + item)
        };
        let cells: Vec<usize> = (0..self.subjects.len()).flat_map(cells).collect();
        let items = self.items.iter().zip(kept);
        Self {
            subjects: self.subjects.clone(),
            listing: self.listing.clone(),
            indices: self.indices.clone(),
            items: items
                .filter(|(_, kept)| **kept)
                .map(|(item, _)| *item)
                .collect(),
            clusters: self.clusters,
            results: cells.iter().map(|cell| self.results[*cell]).collect(),
            trials: self.trials,
            places: cells.iter().map(|cell| self.places[*cell]).collect(),
        }
    }

    /// The families of the items, sorted.
    #[must_use]
    pub fn families(&self) -> Vec<&'a Family> {
        let families: BTreeSet<&Family> =
            self.items.iter().map(|item| &*item.asked.family).collect();
        families.into_iter().collect()
    }

    /// The groups that are counted separately: all families together (`None`), then each family.
    #[must_use]
    pub fn groups(&self) -> Vec<Option<&'a Family>> {
        let families = self.families().into_iter().map(Some);
        std::iter::once(None).chain(families).collect()
    }
}

/// The models in conditions and the items that a grid includes.
struct GridScope {
    /// Whether a model in a condition is shown, by its number.
    asked: Vec<bool>,
    /// The numbers of the items, in the order of the first trials about them.
    items: Vec<usize>,
}

impl GridScope {
    fn new(trials: &Trials<ChoiceDetail>, is_shown: impl Fn(&AskedItem, &str) -> bool) -> Self {
        let mut met = Self {
            asked: vec![false; trials.asked().len()],
            items: Vec::new(),
        };
        // Most trials are about an item and of a model that were met together with others.
        let mut is_met = vec![false; trials.item_count()];
        for trial in trials.iter() {
            let (item, asked) = (trial.item_number(), trial.asked_number());
            if is_met[item] && met.asked[asked] || !is_shown(trial.item(), trial.model()) {
                continue;
            }
            met.asked[asked] = true;
            if !is_met[item] {
                is_met[item] = true;
                met.items.push(item);
            }
        }
        met
    }
}

/// Sort key of items.
fn sort_key(asked: &AskedItem) -> impl Ord + '_ {
    (&asked.frame, &asked.question, asked.repeat, &asked.choices)
}

fn result(trial: TrialRef<'_>) -> TrialResult {
    let chosen = |reading: AnswerReading| {
        let index = reading.chosen?;
        Some(index.min(usize::from(u8::MAX)) as u8)
    };
    match (trial.outcome(), trial.strict()) {
        (TrialOutcome::Failed, _) | (_, None) => TrialResult::Failed,
        (_, Some(strict)) => TrialResult::Read {
            strict: chosen(strict),
            lenient: trial.lenient().and_then(chosen),
        },
    }
}
