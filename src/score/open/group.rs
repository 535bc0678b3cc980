//! Groups of questions that are scored together ([`Group`]), and the groups of one question ([`QuestionGroups`]).

use std::collections::BTreeSet;

/// Walk, category and split of a question.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct QuestionGroups {
    /// Name of the walk.
    pub episode: String,
    /// Name of the category.
    pub category: String,
    /// Name of the split.
    pub split: String,
}

/// A group of questions that are scored together.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum Group {
    /// All questions of the run.
    All,
    /// The questions of a split.
    Split(String),
    /// The questions of a category.
    Category(String),
}

impl Group {
    /// True if a question belongs to the group.
    pub(super) fn contains(&self, question: &QuestionGroups) -> bool {
        match self {
            Self::All => true,
            Self::Split(split) => *split == question.split,
            Self::Category(category) => *category == question.category,
        }
    }

    /// Name of the group in files and tables.
    #[must_use]
    pub fn name(&self) -> &str {
        match self {
            Self::All => "all",
            Self::Split(name) | Self::Category(name) => name,
        }
    }

    /// Kind of group in files: `all`, `split` or `category`.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        match self {
            Self::All => "all",
            Self::Split(_) => "split",
            Self::Category(_) => "category",
        }
    }
}

/// Groups to score: all questions, then each split and each category if there are several.
pub(super) fn groups(questions: &[QuestionGroups]) -> Vec<Group> {
    let splits: BTreeSet<&String> = questions.iter().map(|question| &question.split).collect();
    let categories: BTreeSet<&String> = questions.iter().map(|question| &question.category).collect();
    let mut groups = vec![Group::All];
    if splits.len() > 1 {
        groups.extend(splits.into_iter().cloned().map(Group::Split));
    }
    if categories.len() > 1 {
        groups.extend(categories.into_iter().cloned().map(Group::Category));
    }
    groups
}
