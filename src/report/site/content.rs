//! The content of a site: [`Site`].

use serde::Serialize;

use super::choices::ChoiceRow;
use super::open::OpenRow;
use super::run_link::{GroupDigests, RunLink};

/// Name of the file with all rows of the site.
pub(crate) const DATA: &str = "data.json";

/// A leaderboard and the pages behind it.
pub(crate) struct Site {
    pub(crate) groups: Vec<SiteGroup>,
    /// Runs that stand in no table, each with the reason.
    pub(crate) others: Vec<(RunLink, String)>,
    /// The page of each run, with its link.
    pub(crate) pages: Vec<(RunLink, Vec<u8>)>,
}

/// Rows that can be compared: of one set of questions, one light and one prompt.
pub(crate) struct SiteGroup {
    /// The settings that its rows share, in words.
    pub(crate) title: String,
    /// The digests of its questions, light and prompts.
    pub(crate) digests: GroupDigests,
    /// Settings that its rows share, by name.
    pub(crate) shared: Vec<(String, String)>,
    /// Differences from the first table of its kind; `None` for the first.
    pub(crate) differs: Option<GroupDifference>,
    pub(crate) rows: GroupRows,
}

/// Differences between two groups.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub(crate) struct GroupDifference {
    /// The number of the other group.
    pub(crate) from: usize,
    /// A line for each setting.
    pub(crate) lines: Vec<String>,
}

/// The rows of a group.
pub(crate) enum GroupRows {
    /// Questions with choices, and on what their ranks are based.
    Choices(Vec<ChoiceRow>, Ranking),
    /// Open questions.
    Open(Vec<OpenRow>),
}

/// On what the ranks of a group are based, in words.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Ranking {
    pub(crate) words: String,
}
