//! The HTML page of a run of open questions: [`page`].

use std::collections::BTreeSet;

use super::coverage::coverage;
use super::items::packed;
use super::open_report::OpenReport;
use super::tables::SECTION;
use crate::drawing::chart::Figure;
use crate::error::Result;
use crate::report::page::{OpenContent, page_of_open_questions};
use crate::tables::Section;
use crate::text::table::Table;
use darkqa_score::open::AnswerOutcome;

/// The sections of the page before the items.
const SECTIONS: [Section; 1] = [(SECTION, "Scores", "", &["scores", "categories"])];

/// The page as HTML.
///
/// # Errors
/// If the items cannot be written or the template cannot be filled.
pub(super) fn page(
    report: &OpenReport<'_>,
    tables: &[Table],
    figures: &[Figure],
) -> Result<String> {
    let content = OpenContent {
        title: match &*report.runs {
            [(name, _)] => format!("OpenEQA in the dark: {name}"),
            several => format!("OpenEQA in the dark: {} runs compared", several.len()),
        },
        intro: intro(report),
        alerts: &alerts(report),
        tables,
        sections: &SECTIONS,
        runs: &report.runs,
        items: packed(report)?,
    };
    page_of_open_questions(content, figures)
}

/// Warnings at the top of the page: missing marks, missing answers, no judge.
fn alerts(report: &OpenReport<'_>) -> Vec<String> {
    let (status, counts) = (report.manifest.status, report.manifest.counts);
    let mut alerts: Vec<String> = report
        .alerts
        .iter()
        .map(|alert| alert.text.clone())
        .collect();
    let unmarked = report
        .answers
        .iter()
        .filter(|answer| answer.outcome == AnswerOutcome::Unmarked);
    match unmarked.count() {
        0 => {}
        n => alerts.push(format!(
            "{n} answers are not scored: the judge's replies to them have no mark."
        )),
    }
    if counts.answered < counts.trials {
        alerts.push(format!(
            "{status}: {} of {} answers and marks are stored, {} failed; those that are missing are not scored.",
            counts.answered, counts.trials, counts.failed
        ));
    }
    if report.judge.is_none() {
        alerts.push("Nothing is marked: no judge was named.".to_owned());
    }
    alerts
}

fn intro(report: &OpenReport<'_>) -> Vec<String> {
    let (summary, judge) = (report.summary, report.judge.unwrap_or("nobody"));
    let mut lines = vec![
        format!(
            "{} questions about {} walks. Score: 100 · mean((mark − 1) / 4), marks from 1 to 5 by {judge}, protocol {}. Intervals are \
             95 %, by {} ({} clusters); differences are of unrounded means, on the questions that are scored in both.",
            report.questions.len(),
            report
                .questions
                .iter()
                .map(|question| &question.frame)
                .collect::<BTreeSet<_>>()
                .len(),
            report.protocol,
            summary.unit,
            summary.clusters
        ),
        coverage(report).join("; ") + ".",
    ];
    lines.extend(report.noise_profiles().open_question());
    lines
}
