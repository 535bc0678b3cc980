//! Data of the page besides the findings: [`PageInputs`].

use crate::types::manifest::RunManifest;
use crate::types::{Record, RunQuestion, Thumbnail};

/// A run on the page.
#[derive(Debug, Clone)]
pub struct PageRun<'a> {
    /// Name of the run: its folder.
    pub name: String,
    /// The folder of the run as a command on it names it; of an absolute path the name alone, behind `DIR/`.
    pub folder: String,
    pub manifest: &'a RunManifest,
    /// Records of the run, for totals of requests, tokens and latency.
    pub records: Vec<&'a Record>,
    /// Cost of the records in words; `None` if it is not known.
    pub cost: Option<String>,
}

/// Data of the page besides the findings.
#[derive(Debug)]
pub struct PageInputs<'a> {
    /// The runs that the page is about.
    pub runs: Vec<PageRun<'a>>,
    /// Questions of the runs; empty if the runs do not store them.
    pub questions: &'a [RunQuestion],
    /// Thumbnails of the images; empty if the runs do not store them.
    pub thumbnails: &'a [Thumbnail],
}
