//! Strict score of a data set whose questions form groups: share of groups with only right answers ([`StrictScore`]).

use std::collections::{BTreeMap, BTreeSet, HashMap};

use crate::choice::ParsingMode;
use crate::estimate::{ClusterCount, Estimate};
use crate::grid::{Grid, TrialResult};
use crate::model_in_condition::ModelInCondition;
use darkqa_base::types::{Family, QuestionId, RunQuestion, StrictGroup};

/// Share of groups in which a subject answers all questions right, in one parsing.
#[derive(Debug, Clone, PartialEq)]
pub struct GroupCell {
    pub subject: ModelInCondition,
    /// Family whose pure groups are scored; `None` for all groups.
    pub family: Option<Family>,
    /// Parsing of the replies.
    pub mode: ParsingMode,
    /// Number of groups in which every question was answered right every time.
    pub right: usize,
    /// Number of groups with a question that was not asked or has no reply. They are not scored.
    pub incomplete: usize,
    /// Share of `right` among the complete groups; `None` without complete groups.
    pub share: Option<Estimate>,
    /// Number of clusters of the complete groups.
    pub clusters: usize,
}

/// Probability that uniform guesses are right on all questions of a group.
#[derive(Debug, Clone, PartialEq)]
pub struct GroupChance {
    /// Question family; `None` for all groups.
    pub family: Option<Family>,
    /// Mean over the groups that the run asks completely; `None` without such groups.
    pub share: Option<Estimate>,
}

/// Strict score: the share of groups of related questions in which every answer is right. Some benchmarks report it in
/// addition to accuracy.
///
/// A group is right if all its questions are right, in every order of choices and every repeat in which they were
/// asked. It is scored if every question of the group in the data set has a reply. Groups that share a cluster belong
/// to one cluster.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct StrictScore {
    /// Cells, ordered by subject, family and parsing.
    pub cells: Vec<GroupCell>,
    /// Chance for all groups, then for each family.
    pub chance: Vec<GroupChance>,
    /// Number of groups with at least one question in the run.
    pub groups: usize,
    /// Number of groups of one question, for which the strict score is the accuracy.
    pub single: usize,
    /// Number of groups whose questions are about several frames.
    pub across_frames: usize,
    /// Number of groups that the run asks only in part, so that no subject can complete them.
    pub never_complete: usize,
}

/// Asked questions of a group.
struct Group<'a> {
    /// Number of questions in the data set.
    size: usize,
    questions: Vec<&'a RunQuestion>,
    /// Family of all questions; `None` if there are several families.
    family: Option<&'a Family>,
    /// Indices of the items in the grid.
    items: Vec<usize>,
    /// Index of the cluster of groups.
    cluster: usize,
}

/// Result of a group for one subject.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum GroupResult {
    /// No question of the group was asked.
    Absent,
    Incomplete,
    Right,
    Wrong,
}

impl StrictScore {
    /// Computes the strict score of a grid from the groups that its questions name; `None` if no question names a
    /// group.
    #[must_use]
    pub fn new(grid: &Grid<'_>, questions: &[RunQuestion]) -> Option<Self> {
        let groups = groups(grid, questions);
        if groups.is_empty() {
            return None;
        }
        let families: BTreeSet<&Family> = groups.iter().filter_map(|group| group.family).collect();
        let families: Vec<Option<&Family>> = std::iter::once(None).chain(families.into_iter().map(Some)).collect();
        let mut cells = Vec::new();
        for subject in 0..grid.subjects.len() {
            for family in &families {
                let groups = family_groups(&groups, *family);
                for mode in ParsingMode::ALL {
                    cells.extend(cell(grid, subject, *family, &groups, mode));
                }
            }
        }
        Some(Self {
            cells,
            chance: families
                .iter()
                .map(|family| GroupChance {
                    family: family.cloned(),
                    share: chance(grid, &family_groups(&groups, *family)),
                })
                .collect(),
            groups: groups.len(),
            single: groups.iter().filter(|group| group.size == 1).count(),
            across_frames: groups
                .iter()
                .map(|group| group.questions.iter().map(|question| &question.frame))
                .filter(|frames| frames.clone().collect::<BTreeSet<_>>().len() > 1)
                .count(),
            never_complete: groups.iter().filter(|group| !group.is_complete()).count(),
        })
    }

    /// Cell of the same subject and family in the lenient parsing.
    pub fn lenient(&self, strict: &GroupCell) -> Option<&GroupCell> {
        self.cells.iter().find(|cell| {
            cell.mode == ParsingMode::Lenient && cell.family == strict.family && cell.subject == strict.subject
        })
    }
}

/// Groups of the questions, sorted by name, with their items and clusters.
fn groups<'a>(grid: &Grid<'_>, questions: &'a [RunQuestion]) -> Vec<Group<'a>> {
    let mut by_name = BTreeMap::<&str, Vec<(&StrictGroup, &RunQuestion)>>::new();
    for question in questions {
        if let Some(group) = &question.group {
            by_name.entry(&group.name).or_default().push((group, question));
        }
    }
    let mut items = HashMap::<&QuestionId, Vec<usize>>::new();
    for (index, item) in grid.items.iter().enumerate() {
        items.entry(&*item.asked.question).or_default().push(index);
    }
    let mut groups: Vec<Group<'a>> = by_name
        .into_values()
        .map(|members| {
            let questions: Vec<&RunQuestion> = members.iter().map(|(_, question)| *question).collect();
            let family = questions.first().map(|question| &question.family);
            let of_group = questions.iter().filter_map(|question| items.get(&question.id));
            Group {
                size: members.iter().map(|(group, _)| group.size).max().unwrap_or(0),
                family: family
                    .filter(|family| questions.iter().map(|question| &question.family).all(|other| other == *family)),
                items: of_group.flatten().copied().collect(),
                questions,
                cluster: 0,
            }
        })
        .collect();
    join_clusters(grid, &mut groups);
    groups
}

/// Puts groups that share a cluster of the grid into one cluster, so that groups of different clusters are independent.
fn join_clusters(grid: &Grid<'_>, groups: &mut [Group<'_>]) {
    let mut roots: Vec<usize> = (0..groups.len()).collect();
    let mut first = HashMap::<u32, usize>::new();
    for (index, group) in groups.iter().enumerate() {
        for item in &group.items {
            let known = *first.entry(grid.items[*item].cluster).or_insert(index);
            let (one, other) = (root(&roots, known), root(&roots, index));
            // The smallest index is the root, so that paths stay short.
            roots[one.max(other)] = one.min(other);
        }
    }
    for (index, group) in groups.iter_mut().enumerate() {
        group.cluster = root(&roots, index);
    }
}

/// Groups of a family; all groups without one.
fn family_groups<'g, 'a>(groups: &'g [Group<'a>], family: Option<&Family>) -> Vec<&'g Group<'a>> {
    groups.iter().filter(|group| family.is_none() || group.family == family).collect()
}

/// Follows parents up to the root of a group.
fn root(parents: &[usize], mut group: usize) -> usize {
    while parents[group] != group {
        group = parents[group];
    }
    group
}

impl Group<'_> {
    /// True if the run asks every question of the group in the data set.
    fn is_complete(&self) -> bool {
        self.questions.len() == self.size
    }

    /// Result of the group for a subject. Orders and repeats that the subject was not asked are ignored, if every
    /// question has a reply and no trial failed.
    fn result(&self, grid: &Grid<'_>, subject: usize, mode: ParsingMode) -> GroupResult {
        let mut replied = BTreeSet::<&QuestionId>::new();
        let (mut is_asked, mut has_failed, mut is_right) = (false, false, true);
        for &item in &self.items {
            let result = grid.result(subject, item);
            is_asked |= result.is_asked();
            has_failed |= result == TrialResult::Failed;
            if let Some(chosen) = result.parsed(mode) {
                let item = &grid.items[item];
                replied.insert(&*item.asked.question);
                is_right &= item.is_right(chosen);
            }
        }
        if !is_asked {
            GroupResult::Absent
        } else if has_failed || replied.len() < self.size {
            GroupResult::Incomplete
        } else if is_right {
            GroupResult::Right
        } else {
            GroupResult::Wrong
        }
    }
}

/// Computes the cell of a subject on the groups of a family; `None` if the subject was asked none of their questions.
fn cell(
    grid: &Grid<'_>,
    subject: usize,
    family: Option<&Family>,
    groups: &[&Group<'_>],
    mode: ParsingMode,
) -> Option<GroupCell> {
    let mut counts = BTreeMap::<usize, ClusterCount>::new();
    let (mut incomplete, mut is_asked) = (0, false);
    for group in groups {
        let result = group.result(grid, subject, mode);
        is_asked |= result != GroupResult::Absent;
        match result {
            GroupResult::Absent | GroupResult::Incomplete => incomplete += 1,
            GroupResult::Right | GroupResult::Wrong => {
                let count = counts.entry(group.cluster).or_default();
                count.replies += 1;
                count.right += u32::from(result == GroupResult::Right);
            }
        }
    }
    let clusters = counts.len();
    let counts: Vec<ClusterCount> = counts.into_values().collect();
    is_asked.then(|| GroupCell {
        subject: grid.subjects[subject].clone(),
        family: family.cloned(),
        mode,
        right: counts.iter().map(|count| count.right as usize).sum(),
        incomplete,
        share: Estimate::clustered(&counts),
        clusters,
    })
}

/// Mean over the groups of the product of 1 / number of choices, with one factor for each time that a question of the
/// group was asked. `None` if the run asks no group completely. Groups are sorted by name, so that the order of
/// questions cannot change the rounding.
fn chance(grid: &Grid<'_>, groups: &[&Group<'_>]) -> Option<Estimate> {
    let groups: Vec<&&Group<'_>> = groups.iter().filter(|group| group.is_complete()).collect();
    let sum: f64 = groups
        .iter()
        .map(|group| -> f64 {
            let mut questions: Vec<&RunQuestion> = group.questions.clone();
            questions.sort_by(|one, other| one.id.cmp(&other.id));
            questions
                .iter()
                .map(|question| {
                    let times =
                        group.items.iter().filter(|item| *grid.items[**item].asked.question == question.id).count();
                    let times = i32::try_from(times.max(1)).unwrap_or(i32::MAX);
                    (question.choices.len() as f64).recip().powi(times)
                })
                .product()
        })
        .sum();
    let n = groups.len();
    (n > 0).then(|| Estimate::exact(sum / n as f64, n))
}

#[cfg(test)]
mod tests;
