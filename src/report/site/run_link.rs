//! A run as rows name it, [`RunLink`], and by what rows can be compared, [`GroupDigests`].

use serde::Serialize;

/// Folder of the pages of runs.
pub(crate) const PAGES: &str = "runs";

/// A run as rows name it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub(crate) struct RunLink {
    /// Name of the run: its folder.
    pub(crate) name: String,
    /// Name of the file of its page.
    pub(crate) page: String,
    /// The day when the run was last written.
    pub(crate) date: String,
    /// The version that made it.
    pub(crate) version: String,
}

impl RunLink {
    /// Path of the page from the leaderboard.
    pub(crate) fn path(&self) -> String {
        format!("{PAGES}/{}", self.page)
    }
}

/// By what the rows of a group can be compared.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub(crate) struct GroupDigests {
    /// The questions, with their words and choices.
    pub(crate) questions: String,
    /// All that decides raw images.
    pub(crate) light: String,
    /// The words around the questions; empty if the runs do not say.
    pub(crate) prompts: String,
}
