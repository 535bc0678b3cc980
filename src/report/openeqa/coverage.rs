//! Counts of scored and unscored answers, in lines: [`coverage`].

use super::open_report::OpenReport;
use darkqa_score::open::{Group, OpenCell};

/// Lines with the number of scored answers, and of answers by every other outcome that occurs.
#[must_use]
pub(in crate::report) fn coverage(report: &OpenReport<'_>) -> Vec<String> {
    let all = report
        .summary
        .cells
        .iter()
        .filter(|cell| cell.group == Group::All);
    let sum = |count: fn(&OpenCell) -> usize| -> usize { all.clone().map(count).sum() };
    let (scored, planned) = (sum(OpenCell::scored), sum(|cell| cell.planned));
    let mut lines = vec![format!("{scored} of {planned} answers scored")];
    let mut add = |count: usize, what: &str| {
        if count > 0 {
            lines.push(format!("{count} {what}"));
        }
    };
    add(sum(|cell| cell.missing), "not answered: not scored");
    if report.judge.is_some() {
        add(sum(|cell| cell.unjudged), "not judged yet: not scored");
    }
    add(
        sum(|cell| cell.unmarked),
        "without a mark in the judge's reply: not scored (--protocol tolerant reads more, --judge-max-tokens gives it more room)",
    );
    add(
        sum(|cell| cell.null),
        "without an answer (none in a file, or no \"A:\" in the reply of a blind model): scored 0, unjudged",
    );
    add(
        sum(|cell| cell.cut),
        "cut after their last full stop before they were judged, as upstream does",
    );
    lines
}
