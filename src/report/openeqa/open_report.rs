//! The data of a report on open questions: [`OpenReport`].

use crate::tables::EnhancerRow;
use crate::text::alert::Alert;
use crate::text::noise_profiles::NoiseProfiles;
use crate::types::manifests::RunManifest;
use crate::types::{RunQuestion, Thumbnail};
use darkqa_score::choice::llm_match::Protocol;
use darkqa_score::model_in_condition::ModelInCondition;
use darkqa_score::open::{AnswerOutcome, OpenSummary};

/// Everything that a report on open questions shows.
#[derive(Debug, Clone)]
pub(crate) struct OpenReport<'a> {
    pub summary: &'a OpenSummary,
    /// The manifest of the run, or of the first of several.
    pub manifest: &'a RunManifest,
    /// The names and manifests of all runs.
    pub runs: Vec<(&'a str, &'a RunManifest)>,
    /// Warnings above everything, if there are several runs.
    pub alerts: &'a [Alert],
    /// How the enhancers were used.
    pub enhancers: &'a [EnhancerRow],
    /// Name of the judge; `None` if no judge was named.
    pub judge: Option<&'a str>,
    /// Protocol by which the answers are judged.
    pub protocol: Protocol,
    /// The folder of the run as a command on it names it.
    pub folder: String,
    /// The questions in the order of their file.
    pub questions: &'a [RunQuestion],
    /// The answers, each to one of the questions.
    pub answers: &'a [ReportedAnswer],
    /// Thumbnails of images, by walk and condition.
    pub thumbnails: &'a [Thumbnail],
}

impl OpenReport<'_> {
    /// The names of all runs.
    pub(in crate::report) fn names(&self) -> Vec<String> {
        self.runs
            .iter()
            .map(|(name, _)| (*name).to_owned())
            .collect()
    }

    /// The noise profiles of the noisy images.
    pub(super) fn noise_profiles(&self) -> NoiseProfiles {
        NoiseProfiles::new(self.answers.iter().map(|answer| &answer.subject))
    }
}

/// One answer of one subject to one question.
#[derive(Debug, Clone)]
pub(crate) struct ReportedAnswer {
    pub subject: ModelInCondition,
    /// Index of the question in the report.
    pub question: usize,
    /// The full text of the answer; `None` if there is none.
    pub answer: Option<String>,
    pub outcome: AnswerOutcome,
    /// The judge's reply to the answer; `None` if there is none.
    pub judgement: Option<String>,
    /// Why no answer came, in words; `None` if one came, or if nothing was asked yet.
    pub failure: Option<String>,
}
