//! What the scores rest on: [`coverage`].

use super::open_report::OpenReport;
use crate::score::open::Group;

/// What the scores rest on, in lines.
#[must_use]
pub(super) fn coverage(report: &OpenReport<'_>) -> Vec<String> {
    let cells = report.summary.cells.iter();
    let all = cells.filter(|cell| cell.group == Group::All);
    let (mut due, mut scored) = (0, 0);
    let (mut missing, mut unjudged, mut unmarked, mut null, mut cut) = (0, 0, 0, 0, 0);
    for cell in all {
        due += cell.due;
        scored += cell.score.map_or(0, |score| score.n);
        missing += cell.missing;
        unjudged += cell.unjudged;
        unmarked += cell.unmarked;
        null += cell.null;
        cut += cell.cut;
    }
    let mut lines = vec![format!("{scored} of {due} answers scored")];
    let mut say = |count: usize, what: &str| {
        if count > 0 {
            lines.push(format!("{count} {what}"));
        }
    };
    say(missing, "not answered: not scored");
    if report.judge.is_some() {
        say(unjudged, "not judged yet: not scored");
    }
    say(
        unmarked,
        "without a mark in the judge's reply: not scored (--protocol tolerant reads more, --judge-max-tokens gives it more room)",
    );
    say(
        null,
        "without an answer (none in a file, or no \"A:\" in the reply of a blind model): scored 0, unjudged",
    );
    say(
        cut,
        "cut after their last full stop before they were judged, as upstream does",
    );
    lines
}
