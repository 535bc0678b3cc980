//! Link from a row to its run ([`RunLink`]), and digests of the settings that comparable runs share ([`GroupDigests`]).

use serde::Serialize;

/// Folder of the pages of runs.
pub(crate) const PAGES: &str = "runs";

/// Name and page of a run.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub(crate) struct RunLink {
    /// Name of the run: its folder.
    pub(crate) name: String,
    /// File name of the run's page.
    pub(crate) page: String,
    /// Day on which the run was last written.
    pub(crate) date: String,
    /// Version of the program that made the run.
    pub(crate) version: String,
}

impl RunLink {
    /// Path of the page relative to the leaderboard.
    pub(crate) fn path(&self) -> String {
        format!("{PAGES}/{}", self.page)
    }
}

/// Digests of the settings that must be equal for the rows of a group to be comparable.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub(crate) struct GroupDigests {
    /// Digest of the questions with their texts and choices.
    pub(crate) questions: String,
    /// Digest of all settings that determine the raw images.
    pub(crate) light: String,
    /// Digest of the prompt text around the questions; empty if the runs do not record it.
    pub(crate) prompts: String,
}
