//! Data of the page other than the findings: [`PageInputs`].

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
    /// Folder of the run, as for use in a command; an absolute path is shortened to `DIR/` and the folder's name.
    pub folder: String,
    pub manifest: &'a RunManifest,
    pub usage: RunUsage,
    /// Text for the cost of the replies; `None` if it is unknown.
    pub cost: Option<String>,
}

/// Function that reads questions by id.
pub(crate) type ReadQuestions<'a> = Box<dyn Fn(&HashSet<&QuestionId>) -> Result<HashMap<QuestionId, RunQuestion>> + 'a>;

/// Data of the page other than the findings.
pub struct PageInputs<'a> {
    /// Runs on the page.
    pub runs: Vec<PageRun<'a>>,
    /// Reads the wanted questions, as far as the runs store them.
    pub questions: ReadQuestions<'a>,
    /// Thumbnails of the images; empty if the runs do not store them.
    pub thumbnails: &'a [Thumbnail],
    /// Reads the text of a reply, of a refusal, or of an error message.
    pub texts: Box<dyn Fn(TextPlace) -> Result<String> + 'a>,
}
