//! Answers and marks as the files of `facebookresearch/open-eqa`, which its scripts read: [`files`].

use std::collections::BTreeMap;

use serde::Serialize;

use super::open_report::{OpenReport, ReportedAnswer};
use crate::error::{Error, Result};
use crate::score::open::AnswerOutcome;
use crate::score::subject::Subject;

/// The folder of these files.
const FOLDER: &str = "upstream";

#[derive(Serialize)]
struct Answer<'a> {
    question_id: &'a str,
    answer: Option<&'a str>,
}

/// For each model in each condition `NAME.json`, its answers, and where a judge has marked them `NAME-JUDGE-metrics.json`. What
/// was not answered or not marked is left out. Where several people answered one question there is no such file, which has one
/// answer a question.
pub(super) fn files(report: &OpenReport<'_>) -> Result<Vec<(String, Vec<u8>)>> {
    let mut by_subject = BTreeMap::<&Subject, BTreeMap<usize, Vec<&ReportedAnswer>>>::new();
    for told in report.answers {
        if told.outcome != AnswerOutcome::Missing {
            let questions = by_subject.entry(&told.subject).or_default();
            questions.entry(told.question).or_default().push(told);
        }
    }
    let mut made = Vec::new();
    for (subject, questions) in by_subject {
        let single: Option<Vec<(usize, &ReportedAnswer)>> = questions
            .into_iter()
            .map(|(question, told)| match &told[..] {
                [one] => Some((question, *one)),
                _ => None,
            })
            .collect();
        let Some(single) = single else {
            continue;
        };
        let stem = safe(&format!("{}-{}", subject.model, subject.condition()));
        let answers = single.iter().map(|(question, told)| Answer {
            question_id: &report.questions[*question].id.0,
            answer: told.answer.as_deref(),
        });
        let answers: Vec<Answer<'_>> = answers.collect();
        made.push((format!("{FOLDER}/{stem}.json"), written(&answers)?));
        let Some(judge) = report.judge else {
            continue;
        };
        let marks = single.iter().filter_map(|(question, told)| {
            let mark = match told.outcome {
                AnswerOutcome::Marked(mark) => mark,
                // Upstream's own score of an answer that is none.
                AnswerOutcome::Null => 0,
                AnswerOutcome::Missing | AnswerOutcome::Unjudged | AnswerOutcome::Unmarked => {
                    return None;
                }
            };
            Some((&*report.questions[*question].id.0, mark))
        });
        let marks: serde_json::Map<String, serde_json::Value> = marks
            .map(|(id, mark)| (id.to_owned(), mark.into()))
            .collect();
        let name = format!("{FOLDER}/{stem}-{}-metrics.json", safe(judge));
        made.push((name, written(&marks)?));
    }
    Ok(made)
}

/// A name for a file.
fn safe(name: &str) -> String {
    name.replace(|c: char| !(c.is_alphanumeric() || "-_.+".contains(c)), "_")
}

fn written(value: &impl Serialize) -> Result<Vec<u8>> {
    let mut text = serde_json::to_vec_pretty(value).map_err(|e| Error::data(FOLDER, e))?;
    text.push(b'\n');
    Ok(text)
}
