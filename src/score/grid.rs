//! Records laid out for counting: every subject by every item, as a [`Grid`].

use std::collections::{BTreeMap, BTreeSet, HashMap};

use super::choice::ReadingMode;
use super::cluster::Clusters;
use super::subject::Subject;
use crate::types::{AnswerReading, Family, QuestionId, Record, TrialOutcome};

/// What came of one item for one subject.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TrialResult {
    /// It was not asked.
    Absent,
    /// No reply came.
    Failed,
    /// A reply came; each reading is the index of a choice, or nothing where none could be read.
    Read {
        /// The strict reading.
        strict: Option<u8>,
        /// The lenient one.
        lenient: Option<u8>,
    },
}

impl TrialResult {
    /// The reading in one mode; `None` where no reply came.
    #[must_use]
    #[expect(clippy::option_option, reason = "no reply came, or none could be read")]
    pub fn reading(self, mode: ReadingMode) -> Option<Option<u8>> {
        match (self, mode) {
            (Self::Absent | Self::Failed, _) => None,
            (Self::Read { strict, .. }, ReadingMode::Strict) => Some(strict),
            (Self::Read { lenient, .. }, ReadingMode::Lenient) => Some(lenient),
        }
    }
}

/// One question in one order of its choices, asked the n-th time.
#[derive(Debug, Clone, Copy)]
pub struct GridItem<'a> {
    /// A record of it: its question, frame, family, choices and truth.
    pub record: &'a Record,
    /// The cluster of its frame.
    pub cluster: u32,
}

impl GridItem<'_> {
    /// Whether a reading is the true choice.
    #[must_use]
    pub fn is_right(&self, chosen: Option<u8>) -> bool {
        chosen.map(usize::from) == Some(self.record.detail.truth)
    }

    /// Whether it is of a family; of `None` all are.
    #[must_use]
    pub fn is_of(&self, family: Option<&Family>) -> bool {
        family.is_none_or(|family| self.record.detail.family == *family)
    }
}

/// Every subject by every item.
#[derive(Debug)]
pub struct Grid<'a> {
    /// Who was asked in which light, in order.
    pub subjects: Vec<Subject>,
    /// What was asked, by frame, question, order of choices and turn.
    pub items: Vec<GridItem<'a>>,
    /// How many clusters the items are in.
    pub clusters: usize,
    marks: Vec<TrialResult>,
    source: &'a [Record],
    /// Where each mark's record is in the source; [`u32::MAX`] where there is none.
    places: Vec<u32>,
}

/// How many replies a cluster holds, and how many of them are right.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ClusterCount {
    /// Right ones.
    pub right: u32,
    /// All.
    pub replies: u32,
}

impl<'a> Grid<'a> {
    /// Lays records out; of two for the same subject and item the later one counts. Records of frames without a cluster are
    /// left out.
    #[must_use]
    pub fn new(records: &'a [Record], clusters: &Clusters) -> Self {
        let mut subjects = BTreeMap::<Subject, usize>::new();
        let mut numbers = HashMap::<(&QuestionId, &[String], u32), usize>::new();
        let mut items: Vec<GridItem<'a>> = Vec::new();
        for record in records {
            let Some(cluster) = clusters.of(&record.detail.frame, &record.question) else {
                continue;
            };
            subjects.entry(Subject::of(record)).or_default();
            numbers.entry(key(record)).or_insert_with(|| {
                items.push(GridItem { record, cluster });
                items.len() - 1
            });
        }
        for (number, (_, index)) in subjects.iter_mut().enumerate() {
            *index = number;
        }
        items.sort_by(|a, b| place(a.record).cmp(&place(b.record)));
        for (index, item) in items.iter().enumerate() {
            numbers.insert(key(item.record), index);
        }
        let size = subjects.len() * items.len();
        let (mut marks, mut places) = (vec![TrialResult::Absent; size], vec![u32::MAX; size]);
        for (index, record) in records.iter().enumerate() {
            let (subject, item) = (
                subjects.get(&Subject::of(record)),
                numbers.get(&key(record)),
            );
            if let (Some(subject), Some(item)) = (subject, item) {
                let at = subject * items.len() + item;
                marks[at] = mark(record);
                places[at] = index as u32;
            }
        }
        Self {
            subjects: subjects.into_keys().collect(),
            items,
            clusters: clusters.count(),
            marks,
            source: records,
            places,
        }
    }

    /// What came of an item for a subject, by their indices.
    #[must_use]
    pub fn mark(&self, subject: usize, item: usize) -> TrialResult {
        self.marks[subject * self.items.len() + item]
    }

    /// The record behind a mark; `None` where the item was not asked.
    #[must_use]
    pub fn record(&self, subject: usize, item: usize) -> Option<&'a Record> {
        let place = self.places[subject * self.items.len() + item];
        self.source.get(place as usize)
    }

    /// The index of a subject.
    #[must_use]
    pub fn find(&self, subject: &Subject) -> Option<usize> {
        self.subjects.binary_search(subject).ok()
    }

    /// The items of a family with what came of each for a subject.
    pub fn of_family<'s>(
        &'s self,
        subject: usize,
        family: Option<&'s Family>,
    ) -> impl Iterator<Item = (&'s GridItem<'a>, TrialResult)> + 's {
        let marks = &self.marks[subject * self.items.len()..(subject + 1) * self.items.len()];
        let all = self.items.iter().zip(marks.iter().copied());
        all.filter(move |(item, _)| item.is_of(family))
    }

    /// Right answers and replies of a subject by cluster.
    #[must_use]
    pub fn counts(
        &self,
        subject: usize,
        family: Option<&Family>,
        mode: ReadingMode,
    ) -> Vec<ClusterCount> {
        let mut counts = vec![ClusterCount::default(); self.clusters];
        for (item, mark) in self.of_family(subject, family) {
            if let Some(chosen) = mark.reading(mode) {
                let count = &mut counts[item.cluster as usize];
                count.replies += 1;
                count.right += u32::from(item.is_right(chosen));
            }
        }
        counts
    }

    /// The families asked about, in order.
    #[must_use]
    pub fn families(&self) -> Vec<&'a Family> {
        let families: BTreeSet<&Family> = self
            .items
            .iter()
            .map(|item| &item.record.detail.family)
            .collect();
        families.into_iter().collect()
    }

    /// What is counted by itself: all families together, then each.
    #[must_use]
    pub fn groups(&self) -> Vec<Option<&'a Family>> {
        let families = self.families().into_iter().map(Some);
        std::iter::once(None).chain(families).collect()
    }
}

fn key(record: &Record) -> (&QuestionId, &[String], u32) {
    (
        &record.question,
        &record.detail.choices,
        record.detail.repeat,
    )
}

/// What items are ordered by.
fn place(record: &Record) -> impl Ord + '_ {
    (
        &record.detail.frame,
        &record.question,
        record.detail.repeat,
        &record.detail.choices,
    )
}

fn mark(record: &Record) -> TrialResult {
    let chosen = |reading: AnswerReading| {
        let index = reading.chosen?;
        Some(index.min(usize::from(u8::MAX)) as u8)
    };
    match (record.detail.outcome, record.detail.strict) {
        (TrialOutcome::Failed, _) | (_, None) => TrialResult::Failed,
        (_, Some(strict)) => TrialResult::Read {
            strict: chosen(strict),
            lenient: record.detail.lenient.and_then(chosen),
        },
    }
}
