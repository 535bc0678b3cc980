//! Questions that are scored together: [`Group`], by the [`QuestionGroups`] of each.

use std::collections::BTreeSet;

/// What a question belongs to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct QuestionGroups {
    /// Its walk.
    pub episode: String,
    /// Its category.
    pub category: String,
    /// Its split.
    pub split: String,
}

/// Questions that are scored together.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum Group {
    /// All.
    All,
    /// Those of a split.
    Split(String),
    /// Those of a category.
    Category(String),
}

impl Group {
    /// Whether a question belongs to it.
    pub(super) fn has(&self, topic: &QuestionGroups) -> bool {
        match self {
            Self::All => true,
            Self::Split(split) => *split == topic.split,
            Self::Category(category) => *category == topic.category,
        }
    }

    /// The name in files and tables.
    #[must_use]
    pub fn name(&self) -> &str {
        match self {
            Self::All => "all",
            Self::Split(name) | Self::Category(name) => name,
        }
    }

    /// What it groups by.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        match self {
            Self::All => "all",
            Self::Split(_) => "split",
            Self::Category(_) => "category",
        }
    }
}

/// All questions; the splits and the categories where there are several.
pub(super) fn groups(topics: &[QuestionGroups]) -> Vec<Group> {
    let splits: BTreeSet<&String> = topics.iter().map(|topic| &topic.split).collect();
    let categories: BTreeSet<&String> = topics.iter().map(|topic| &topic.category).collect();
    let several = |names: BTreeSet<&String>, make: fn(String) -> Group| {
        let several = names.len() > 1;
        let names = names.into_iter().filter(move |_| several);
        names.cloned().map(make).collect::<Vec<_>>()
    };
    std::iter::once(Group::All)
        .chain(several(splits, Group::Split))
        .chain(several(categories, Group::Category))
        .collect()
}
