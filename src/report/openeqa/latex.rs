//! The table for a paper, as LaTeX with booktabs: [`table`].

use super::OpenReport;
use super::rows::Rows;
use crate::report::latex::{self, escaped};
use crate::report::subject::{percent, points};
use crate::score::open::{Against, Group, OpenCell};

/// Scores by level, in the form of the paper's table: a score, and in brackets what is lost from the lit frames.
pub(super) fn table(report: &OpenReport<'_>) -> String {
    let rows = Rows::new(report.summary);
    let shown = |cell: Option<&OpenCell>| {
        let Some(score) = cell.and_then(|cell| cell.score) else {
            return "--".to_owned();
        };
        let change = cell.and_then(|cell| {
            let summary = report.summary;
            summary.change(&cell.subject, Against::Lit, &cell.group)
        });
        let change = change.map(|change| points(change.difference.value));
        let change = change.map(|change| format!(" {{\\scriptsize({})}}", escaped(&change)));
        format!("{}{}", percent(score.value), change.unwrap_or_default())
    };
    let lines = rows.lines.keys().map(|line| {
        let at = |level: &_| shown(rows.cell(line, *level, &Group::All));
        let name = [escaped(line.model), escaped(&line.light())];
        name.into_iter().chain(rows.levels.iter().map(at)).collect()
    });
    let mut lines: Vec<Vec<String>> = lines.collect();
    for subject in &rows.blind {
        let cell = report.summary.cell(subject, &Group::All);
        let name = escaped(&format!("{} without images", subject.model));
        let mut row = vec![name, String::new(), shown(cell)];
        row.resize(rows.levels.len().max(1) + 2, String::new());
        lines.push(row);
    }
    let head: Vec<String> = ["Model", "Light"]
        .map(str::to_owned)
        .into_iter()
        .chain(rows.levels.iter().map(ToString::to_string))
        .collect();
    let judge = escaped(report.judge.unwrap_or("nobody"));
    let caption = format!(
        "OpenEQA by LLM-Match in \\% (marked by {judge}, protocol {}), with the difference from L0; {} questions.",
        report.protocol,
        report.questions.len()
    );
    let columns = format!("ll{}", "r".repeat(rows.levels.len().max(1)));
    String::from("% Table of darkqa-eval; \\usepackage{booktabs} in the preamble.\n")
        + &latex::table(&caption, &columns, &head, &lines)
}
