//! Files of answers and marks in the format of `facebookresearch/open-eqa`, for its scripts: [`files`].

use std::collections::BTreeMap;

use serde::Serialize;

use super::open_report::{OpenReport, ReportedAnswer};
use crate::error::{Error, Result};
use darkqa_score::model_in_condition::ModelInCondition;
use darkqa_score::open::AnswerOutcome;

/// Folder of these files in a run.
const FOLDER: &str = "upstream";

#[derive(Serialize)]
struct UpstreamAnswer<'a> {
    question_id: &'a str,
    answer: Option<&'a str>,
    /// Condition, so that `--answers` assigns the answer to it; omitted at L0, as in upstream's own files. Upstream's
    /// scripts read only the first two fields.
    #[serde(skip_serializing_if = "Option::is_none")]
    condition: Option<&'a str>,
}

/// Writes for each subject `NAME.json` with its answers and, if there is a judge, `NAME-JUDGE-metrics.json` with its
/// marks.
///
/// Missing answers and marks are left out. A subject with several answers to a question gets no files, because the
/// format has one answer for each question.
pub(super) fn files(report: &OpenReport<'_>) -> Result<Vec<(String, Vec<u8>)>> {
    let mut by_subject = BTreeMap::<&ModelInCondition, BTreeMap<usize, Vec<&ReportedAnswer>>>::new();
    for reported in report.answers {
        if reported.outcome != AnswerOutcome::Missing {
            let questions = by_subject.entry(&reported.subject).or_default();
            questions.entry(reported.question).or_default().push(reported);
        }
    }
    let mut files = Vec::new();
    for (subject, questions) in by_subject {
        let answers_by_question: Option<Vec<(usize, &ReportedAnswer)>> = questions
            .into_iter()
            .map(|(question, reported)| match &reported[..] {
                [single] => Some((question, *single)),
                _ => None,
            })
            .collect();
        let Some(answers_by_question) = answers_by_question else {
            continue;
        };
        let condition = subject.condition();
        let stem = file_name(&format!("{}-{condition}", subject.model));
        let answers: Vec<UpstreamAnswer<'_>> = answers_by_question
            .iter()
            .map(|(question, reported)| UpstreamAnswer {
                question_id: &report.questions[*question].id.0,
                answer: reported.answer.as_deref(),
                condition: Some(&*condition).filter(|condition| *condition != "L0"),
            })
            .collect();
        files.push((format!("{FOLDER}/{stem}.json"), json_file(&answers)?));
        let Some(judge) = report.judge else {
            continue;
        };
        let marks: serde_json::Map<String, serde_json::Value> = answers_by_question
            .iter()
            .filter_map(|(question, reported)| {
                let mark = match reported.outcome {
                    AnswerOutcome::Marked(mark) => mark,
                    // Upstream's score of a null answer.
                    AnswerOutcome::Null => 0,
                    AnswerOutcome::Missing | AnswerOutcome::Unjudged | AnswerOutcome::Unmarked => {
                        return None;
                    }
                };
                Some((&*report.questions[*question].id.0, mark))
            })
            .map(|(id, mark)| (id.to_owned(), mark.into()))
            .collect();
        let name = format!("{FOLDER}/{stem}-{}-metrics.json", file_name(judge));
        files.push((name, json_file(&marks)?));
    }
    Ok(files)
}

/// Replaces characters of a name that are unsafe in file names.
fn file_name(name: &str) -> String {
    name.replace(|c: char| !(c.is_alphanumeric() || "-_.+".contains(c)), "_")
}

fn json_file(value: &impl Serialize) -> Result<Vec<u8>> {
    let mut text = serde_json::to_vec_pretty(value).map_err(|e| Error::data(FOLDER, e))?;
    text.push(b'\n');
    Ok(text)
}
