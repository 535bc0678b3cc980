//! HTML page of a run of open questions: [`page`].

use std::collections::BTreeSet;

use super::coverage::coverage;
use super::items::packed;
use super::open_report::OpenReport;
use super::tables::{SECTION, ladder};
use crate::error::Result;
use crate::report::charts::chart::Figure;
use crate::report::page::{OpenContent, page_of_open_questions};
use crate::report::tables::Section;
use crate::report::text::table::Table;
use crate::report::text::words::{percent, points};
use crate::types::degradations::Axis;
use crate::types::text::{counted, plural};
use darkqa_score::model_in_condition::ModelInCondition;
use darkqa_score::open::{AnswerOutcome, Baseline, Group};

/// Sections of the page before the items.
const SECTIONS: [Section; 1] = [(SECTION, "Scores", "", &["scores", "categories"])];

/// Maximum number of clauses in the summary (chosen to fit one screen).
const MAX_CLAUSES: usize = 3;

/// Renders the page.
///
/// # Errors
/// If the items cannot be serialized or the template cannot be rendered.
pub(super) fn page(report: &OpenReport<'_>, tables: &[Table], figures: &[Figure]) -> Result<String> {
    let content = OpenContent {
        title: match &*report.runs {
            [(name, _)] => format!("OpenEQA in the dark: {name}"),
            several => format!("OpenEQA in the dark: {} runs compared", several.len()),
        },
        summary: summary(report),
        intro: intro(report),
        alerts: &alerts(report),
        tables,
        sections: &SECTIONS,
        runs: &report.runs,
        items: packed(report)?,
    };
    page_of_open_questions(content, figures)
}

/// One sentence with the scores at the darkest level: differences from L0, and of each enhancer from raw frames. The
/// differences are not tested.
fn summary(report: &OpenReport<'_>) -> Option<String> {
    let whole = ladder(report.summary, &Group::All);
    let clauses: Vec<String> = whole
        .series
        .iter()
        .filter(|(series, _)| series.axis() == Some(Axis::LIGHT))
        .filter_map(|(series, cells)| {
            let (level, cell) = cells.last_key_value()?;
            let score = percent(cell.score?.value);
            let model = report.summary.listing.label(series.model);
            let light = series.light(&[]);
            Some(if series.is_enhanced() {
                let gain = change_text(report, &cell.subject, Baseline::Raw)?;
                format!("{light}: {score} % ({gain} against raw)")
            } else {
                let loss = change_text(report, &cell.subject, Baseline::Clean)?;
                format!("{model} {light} scores {score} % at {level} ({loss} against L0)")
            })
        })
        .collect();
    match clauses.len() {
        0 => None,
        count if count > MAX_CLAUSES => {
            Some(format!("{}; {} more below.", clauses[..MAX_CLAUSES].join("; "), count - MAX_CLAUSES))
        }
        _ => Some(clauses.join("; ") + "."),
    }
}

/// Difference of a score from a baseline, with its interval; `None` if they share no questions.
fn change_text(report: &OpenReport<'_>, subject: &ModelInCondition, baseline: Baseline) -> Option<String> {
    let change = report.summary.change(subject, baseline, &Group::All)?;
    let difference = change.difference;
    let [value, low, high] = [difference.value, difference.low, difference.high].map(points);
    Some(format!("{value} [{low}, {high}]"))
}

/// Warnings at the top of the page: missing marks, missing answers, no judge.
fn alerts(report: &OpenReport<'_>) -> Vec<String> {
    let (status, counts) = (report.manifest.status, report.manifest.counts);
    let mut alerts: Vec<String> = report.alerts.iter().map(|alert| alert.text.clone()).collect();
    let unmarked = report.answers.iter().filter(|answer| answer.outcome == AnswerOutcome::Unmarked).count();
    if unmarked > 0 {
        alerts.push(format!(
            "{} not scored, because the judge gave no mark.",
            plural(unmarked, "answer is", "answers are")
        ));
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

/// Lines at the top of the page on questions, score, intervals and coverage.
fn intro(report: &OpenReport<'_>) -> Vec<String> {
    let (summary, judge) = (report.summary, report.judge.unwrap_or("nobody"));
    let walks: BTreeSet<_> = report.questions.iter().map(|question| &question.frame).collect();
    let mut lines = vec![
        format!(
            "{} about {}. Score: 100 · mean((mark − 1) / 4), marks from 1 to 5 by {judge}, protocol {}. Intervals are \
             95 %, by {} ({}); differences are of unrounded means, on the questions that are scored in both.",
            counted(report.questions.len(), "question"),
            counted(walks.len(), "walk"),
            report.protocol,
            summary.unit,
            counted(summary.clusters, "cluster")
        ),
        coverage(report).join("; ") + ".",
    ];
    lines.extend(report.noise_profiles().open_question());
    lines
}
