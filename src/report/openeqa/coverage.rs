//! Numbers of scored and unscored answers, as lines of text: [`coverage`].

use super::open_report::OpenReport;
use darkqa_score::open::{Group, OpenCell};

/// One line with the number of scored answers, then one line for each other outcome that occurs.
#[must_use]
pub(crate) fn coverage(report: &OpenReport<'_>) -> Vec<String> {
    let scored = total(report, OpenCell::scored);
    let planned = total(report, |cell| cell.planned);
    let unjudged = match report.judge {
        Some(_) => total(report, |cell| cell.unjudged),
        None => 0,
    };
    let outcomes = [
        (total(report, |cell| cell.missing), "not answered: not scored"),
        (unjudged, "not judged yet: not scored"),
        (
            total(report, |cell| cell.unmarked),
            "without a mark in the judge's reply: not scored (--protocol tolerant reads more, --judge-max-tokens gives it more room)",
        ),
        (
            total(report, |cell| cell.null),
            "without an answer (none in a file, only thoughts, no \"A:\" of a blind model): scored 0, unjudged",
        ),
        (total(report, |cell| cell.cut), "cut after their last full stop before they were judged, as upstream does"),
    ];
    let mut lines = vec![format!("{scored} of {planned} answers scored")];
    for (count, outcome) in outcomes {
        if count > 0 {
            lines.push(format!("{count} {outcome}"));
        }
    }
    lines
}

/// Sum of a count over all models and conditions.
fn total(report: &OpenReport<'_>, count: fn(&OpenCell) -> usize) -> usize {
    report.summary.cells.iter().filter(|cell| cell.group == Group::All).map(count).sum()
}
