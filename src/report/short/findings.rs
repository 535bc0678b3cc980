//! Start of a report in the terminal, with its findings: [`findings`].

use std::fmt::Write;

use super::styled_lines;
use crate::report::finding_groups::{Finding, FindingGroups};
use crate::report::text::alert::{Alert, lines};
use crate::report::text::terminal::line;
use crate::report::text::wrapped::wrapped;
use crate::runs::report_length::ReportLength;
use crate::types::text::counted;
use crate::types::text::escape_hidden;

/// Width of the column of group titles, in characters.
const GROUP_WIDTH: usize = 15;

/// Head, alerts and summary, then the main finding of each group, or all findings with a note on how to read them.
pub(crate) fn findings(
    head: &str,
    alerts: &[Alert],
    groups: &FindingGroups<'_>,
    length: ReportLength,
    how_to_read: &str,
) -> String {
    let mut text = match length {
        // As wide as the tables.
        ReportLength::Full => line("", head, " ") + &lines(alerts),
        _ => format!("{head}\n") + &alerts.iter().map(styled_lines::alert).collect::<String>(),
    };
    if groups.count() == 0 {
        return text + "\n";
    }
    let _ = write!(text, "\n{}\n", styled_lines::summary(&groups.summary()));
    if length == ReportLength::Summary {
        for (title, finding) in groups.main_findings() {
            text += &row(title, finding);
        }
        let all = counted(groups.count(), "finding");
        return text + &wrapped(" ", &format!("All {all}, and how to read them: --findings"), " ") + "\n";
    }
    for group in groups.all() {
        text += &styled_lines::heading(group.title);
        for sentence in group.sentences() {
            text += &styled_lines::sentence(sentence);
        }
    }
    text + &wrapped(" ", how_to_read, " ") + "\n"
}

/// Title of a group and its main finding, with the intervals below.
fn row(title: &str, finding: &Finding<'_>) -> String {
    let tone = finding.main_sentence().tone;
    let first = format!(" {title:<GROUP_WIDTH$}{}  ", tone.sign());
    let rest = " ".repeat(first.chars().count());
    let lines = wrapped(&first, &escape_hidden(&(finding.text() + ".")), &rest);
    let text = styled_lines::colour_sign(&lines, GROUP_WIDTH + 2, tone);
    let intervals = finding.intervals_text();
    if intervals.is_empty() {
        return text;
    }
    text + &wrapped(&rest, &intervals, &rest)
}
