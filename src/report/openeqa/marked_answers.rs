//! Answers to open questions with the marks of a judge: [`MarkedAnswers`].

use crate::text::words::ProfileNames;
use darkqa_base::types::manifests::RunManifest;
use darkqa_base::types::{RunQuestion, Thumbnail};
use darkqa_score::choice::llm_match::Protocol;
use darkqa_score::model_in_condition::ModelInCondition;
use darkqa_score::open::{AnswerOutcome, OpenSummary};

/// Answers to open questions, with their marks and scores.
#[derive(Debug, Clone)]
pub struct MarkedAnswers<'a> {
    pub summary: &'a OpenSummary,
    /// Manifest of the run, or of the first run of several.
    pub manifest: &'a RunManifest,
    /// Names and manifests of all runs.
    pub runs: Vec<(&'a str, &'a RunManifest)>,
    /// Name of the judge; `None` if no judge was named.
    pub judge: Option<&'a str>,
    /// Protocol by which the answers are judged.
    pub protocol: Protocol,
    /// Folder of the run, as for use in a command.
    pub folder: String,
    /// Questions in the order of their file.
    pub questions: &'a [RunQuestion],
    /// All answers to the questions.
    pub answers: &'a [ReportedAnswer],
    /// Thumbnails of images, by walk and condition.
    pub thumbnails: &'a [Thumbnail],
}

impl MarkedAnswers<'_> {
    /// Names of all runs.
    pub fn names(&self) -> Vec<String> {
        self.runs.iter().map(|(name, _)| (*name).to_owned()).collect()
    }

    /// Noise profiles of the noisy images.
    pub(super) fn noise_profiles(&self) -> ProfileNames {
        ProfileNames::new(self.answers.iter().map(|answer| &answer.subject))
    }
}

/// Answer of a model in a condition to a question.
#[derive(Debug, Clone)]
pub struct ReportedAnswer {
    pub subject: ModelInCondition,
    /// Index of the question in the report.
    pub question: usize,
    /// Full text of the answer; `None` without an answer.
    pub answer: Option<String>,
    pub outcome: AnswerOutcome,
    /// Judge's reply to the answer; `None` without a reply.
    pub judgement: Option<String>,
    /// Text for the reason why no answer came; `None` if one came, or if the question was not asked yet.
    pub failure: Option<String>,
}
