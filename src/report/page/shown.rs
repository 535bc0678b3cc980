//! What the page shows besides the findings: [`PageInputs`].

use crate::types::manifest::RunManifest;
use crate::types::{Record, RunQuestion, Thumbnail};

/// A run on the page.
#[derive(Debug, Clone)]
pub struct PageRun<'a> {
    /// What it is called: its folder.
    pub name: String,
    /// Its manifest.
    pub manifest: &'a RunManifest,
    /// Its records, for what they took.
    pub records: &'a [Record],
    /// What they cost, in words, where that is known.
    pub cost: Option<String>,
}

/// What is shown besides the findings.
#[derive(Debug)]
pub struct PageInputs<'a> {
    /// The runs.
    pub runs: Vec<PageRun<'a>>,
    /// The questions, where they are kept.
    pub questions: &'a [RunQuestion],
    /// The small copies of images, where they are kept.
    pub thumbnails: &'a [Thumbnail],
}
