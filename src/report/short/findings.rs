//! The opening of a report in the terminal: [`findings`].

use std::fmt::Write;

use super::marked;
use crate::report::finding_groups::{Finding, FindingGroups};
use crate::report::report_length::ReportLength;
use crate::text::alert::{Alert, lines};
use crate::text::terminal::line;
use crate::text::words::counted;
use crate::text::wrapped::wrapped;
use crate::types::text::escape_hidden;

/// Width of the column of groups, in characters.
const GROUP: usize = 15;

/// The head, the alerts and the summary; then the first finding of each group, or all findings and how to read them.
pub(in crate::report) fn findings(
    head: &str,
    alerts: &[Alert],
    groups: &FindingGroups<'_>,
    length: ReportLength,
    how_to_read: &str,
) -> String {
    let mut text = match length {
        // As wide as the tables.
        ReportLength::Full => line("", head, " ") + &lines(alerts),
        _ => format!("{head}\n") + &alerts.iter().map(marked::alert).collect::<String>(),
    };
    if groups.count() == 0 {
        return text + "\n";
    }
    let _ = write!(text, "\n{}\n", marked::summary(&groups.summary()));
    if length == ReportLength::Summary {
        for (title, finding) in groups.first() {
            text += &row(title, finding);
        }
        let all = counted(groups.count(), "finding");
        return text
            + &wrapped(
                " ",
                &format!("All {all}, and how to read them: --findings"),
                " ",
            )
            + "\n";
    }
    for group in groups.all() {
        text += &marked::heading(group.title);
        for sentence in group.sentences() {
            text += &marked::sentence(sentence);
        }
    }
    text + &wrapped(" ", how_to_read, " ") + "\n"
}

/// A finding behind the title of its group, with its intervals beneath.
fn row(title: &str, finding: &Finding<'_>) -> String {
    let tone = finding.shown().tone;
    let first = format!(" {title:<GROUP$}{}  ", tone.sign());
    let rest = " ".repeat(first.chars().count());
    let lines = wrapped(&first, &escape_hidden(&(finding.text() + ".")), &rest);
    let text = marked::signed(&lines, GROUP + 2, tone);
    let intervals = finding.interval_words();
    if intervals.is_empty() {
        return text;
    }
    text + &wrapped(&rest, &intervals, &rest)
}
