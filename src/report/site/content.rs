//! Content of a site: [`LeaderboardSite`].

use serde::Serialize;

use super::choices::ModelRunRow;
use super::open::{GroupDigests, OpenRow, RunLink};

/// Name of the file with all rows of the site.
pub(crate) const DATA: &str = "data.json";

/// A leaderboard and the pages of its runs.
pub(crate) struct LeaderboardSite {
    pub(crate) groups: Vec<SiteGroup>,
    /// Runs that are in no table, each with the reason.
    pub(crate) others: Vec<(RunLink, String)>,
    /// HTML page of each run, with its link.
    pub(crate) pages: Vec<(RunLink, Vec<u8>)>,
}

/// Rows that can be compared, because their runs have the same questions, images and prompts. Each group is a table.
pub(crate) struct SiteGroup {
    /// Text for the settings that all rows share.
    pub(crate) title: String,
    pub(crate) digests: GroupDigests,
    /// Settings that all rows share: name and value.
    pub(crate) shared: Vec<(String, String)>,
    /// Differences from the first table of the same kind; `None` for the first.
    pub(crate) differs: Option<GroupDifference>,
    pub(crate) rows: GroupRows,
}

/// Differences between two groups.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub(crate) struct GroupDifference {
    /// Number of the other group.
    pub(crate) from: usize,
    /// One line for each setting.
    pub(crate) lines: Vec<String>,
}

/// Rows of a group.
pub(crate) enum GroupRows {
    /// Multiple-choice questions, with the basis of the ranks.
    Choices(Vec<ModelRunRow>, Ranking),
    /// Open questions.
    Open(Vec<OpenRow>),
}

/// Text for the basis of a group's ranks.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Ranking {
    pub(crate) words: String,
}
