//! Content of a site: [`LeaderboardSite`].

use serde::Serialize;

use super::choices::ModelRunRow;
use super::open::{GroupDigests, OpenRow, RunLink};

/// Name of the file with all rows of the site.
pub const DATA: &str = "data.json";

/// A leaderboard and the pages of its runs.
pub struct LeaderboardSite {
    pub groups: Vec<SiteGroup>,
    /// Runs that are in no table, each with the reason.
    pub others: Vec<(RunLink, String)>,
    /// HTML page of each run, with its link.
    pub pages: Vec<(RunLink, Vec<u8>)>,
}

/// Rows that can be compared, because their runs have the same questions, images and prompts. Each group is a table.
pub struct SiteGroup {
    /// Text for the settings that all rows share.
    pub title: String,
    pub digests: GroupDigests,
    /// Settings that all rows share: name and value.
    pub shared: Vec<(String, String)>,
    /// Differences from the first table of the same kind; `None` for the first.
    pub differs: Option<GroupDifference>,
    pub rows: GroupRows,
}

/// Differences between two groups.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct GroupDifference {
    /// Number of the other group.
    pub from: usize,
    /// One line for each setting.
    pub lines: Vec<String>,
}

/// Rows of a group.
pub enum GroupRows {
    /// Multiple-choice questions, with the basis of the ranks.
    Choices(Vec<ModelRunRow>, Ranking),
    /// Open questions.
    Open(Vec<OpenRow>),
}

/// Text for the basis of a group's ranks.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Ranking {
    pub words: String,
}
