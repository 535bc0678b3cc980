//! What a run of open questions says: [`OpenReport`].

use crate::score::llm_match::Protocol;
use crate::score::open::{AnswerOutcome, OpenSummary};
use crate::score::subject::Subject;
use crate::types::manifest::RunManifest;
use crate::types::{RunQuestion, Thumbnail};

/// Everything that a run of open questions says.
#[derive(Debug, Clone)]
pub(crate) struct OpenReport<'a> {
    /// The scores.
    pub summary: &'a OpenSummary,
    /// The run.
    pub manifest: &'a RunManifest,
    /// Who marked the answers; `None` for nobody.
    pub judge: Option<&'a str>,
    /// How they were judged.
    pub protocol: Protocol,
    /// What the run is called: its folder.
    pub name: String,
    /// The questions in the order of their file.
    pub questions: &'a [RunQuestion],
    /// The answers, each to one of the questions.
    pub answers: &'a [ReportedAnswer],
    /// The small copies of images, by walk and condition.
    pub thumbnails: &'a [Thumbnail],
}

/// One answer.
#[derive(Debug, Clone)]
pub(crate) struct ReportedAnswer {
    /// Whose.
    pub subject: Subject,
    /// The question's place.
    pub question: usize,
    /// In its own words; `None` where there is none.
    pub answer: Option<String>,
    /// What came of it.
    pub outcome: AnswerOutcome,
}
