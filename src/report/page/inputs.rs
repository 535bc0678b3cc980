//! Data of the page besides the findings: [`PageInputs`].

use std::collections::{HashMap, HashSet};

use super::run_usage::RunUsage;
use crate::error::Result;
use crate::types::manifests::RunManifest;
use crate::types::{QuestionId, RunQuestion, TextPlace, Thumbnail};

/// A run on the page.
#[derive(Debug, Clone)]
pub struct PageRun<'a> {
    /// Name of the run: its folder.
    pub name: String,
    /// The folder of the run as a command on it names it; of an absolute path the name alone, behind `DIR/`.
    pub folder: String,
    pub manifest: &'a RunManifest,
    /// The usage of the run's trials.
    pub usage: RunUsage,
    /// Cost of the replies in words; `None` if it is not known.
    pub cost: Option<String>,
}

/// Reads questions by their names.
pub(crate) type ReadQuestions<'a> =
    Box<dyn Fn(&HashSet<&QuestionId>) -> Result<HashMap<QuestionId, RunQuestion>> + 'a>;

/// Data of the page besides the findings.
pub struct PageInputs<'a> {
    /// The runs that the page is about.
    pub runs: Vec<PageRun<'a>>,
    /// Reads those of the wanted questions that the runs store.
    pub questions: ReadQuestions<'a>,
    /// Thumbnails of the images; empty if the runs do not store them.
    pub thumbnails: &'a [Thumbnail],
    /// Reads what stands in the place of a reply: its text, that of a refusal, or what the error states.
    pub texts: Box<dyn Fn(TextPlace) -> Result<String> + 'a>,
}
