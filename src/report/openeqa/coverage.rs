//! What the scores rest on: [`coverage`].

use super::open_report::OpenReport;
use crate::score::open::{Group, OpenCell};

/// What the scores rest on, in lines.
#[must_use]
pub(super) fn coverage(report: &OpenReport<'_>) -> Vec<String> {
    let cells = report.summary.cells.iter();
    let all = cells.filter(|cell| cell.group == Group::All);
    let sum = |count: fn(&OpenCell) -> usize| -> usize { all.clone().map(count).sum() };
    let (scored, due) = (sum(OpenCell::scored), sum(|cell| cell.due));
    let mut lines = vec![format!("{scored} of {due} answers scored")];
    let mut say = |count: usize, what: &str| {
        if count > 0 {
            lines.push(format!("{count} {what}"));
        }
    };
    say(sum(|cell| cell.missing), "not answered: not scored");
    if report.judge.is_some() {
        say(sum(|cell| cell.unjudged), "not judged yet: not scored");
    }
    say(
        sum(|cell| cell.unmarked),
        "without a mark in the judge's reply: not scored (--protocol tolerant reads more, --judge-max-tokens gives it more room)",
    );
    say(
        sum(|cell| cell.null),
        "without an answer (none in a file, or no \"A:\" in the reply of a blind model): scored 0, unjudged",
    );
    say(
        sum(|cell| cell.cut),
        "cut after their last full stop before they were judged, as upstream does",
    );
    lines
}
