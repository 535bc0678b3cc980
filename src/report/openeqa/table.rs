//! The table at the end of a run of open questions: [`render`].

use std::fmt::Write;
use std::path::Path;

use comfy_table::{CellAlignment, Table};

use super::rows::Rows;
use super::{OpenReport, coverage};
use crate::report::products::PAGE;
use crate::report::table::plain;
use crate::score::open::{Group, OpenCell};
use crate::score::subject::Subject;
use crate::types::AxisLevel;
use crate::types::manifest::{Counts, Status};

/// Renders a run: how far it has come where it is not complete, scores by level, by split and by category, what they rest on, and
/// where it lies.
#[must_use]
pub fn render(report: &OpenReport<'_>, folder: &Path) -> String {
    let rows = Rows::new(report.summary);
    let mut text = String::new();
    let run = report.manifest;
    if run.status != Status::Complete {
        let Counts {
            trials,
            answered,
            failed,
        } = run.counts;
        let _ = writeln!(
            text,
            "{}: {answered} of {trials} answers and marks there, {failed} failed",
            run.status
        );
    }
    match report.judge {
        Some(judge) => {
            let _ = writeln!(
                text,
                "Score in % (LLM-Match, marked by {judge}, protocol {}): mean ± half of the 95 % interval over {} {}s (drop from \
                 L0)",
                report.protocol, report.summary.clusters, report.summary.unit
            );
            let _ = writeln!(text, "{}", levels(&rows));
            for subject in &rows.blind {
                let cell = report.summary.cell(subject, &Group::All);
                let _ = writeln!(
                    text,
                    "{} without images: {}, {}",
                    subject.model,
                    rows.shown(cell),
                    cell.map_or(String::new(), rest)
                );
            }
            if report.summary.groups().len() > 1 {
                let _ = writeln!(text, "{}", groups(report, &rows));
            }
        }
        None => text.push_str("Nothing is marked: --judge NAME has the answers marked\n"),
    }
    for line in coverage(report) {
        let _ = writeln!(text, "{line}");
    }
    let _ = writeln!(text, "run: {}", folder.display());
    let _ = writeln!(text, "report: {}", folder.join(PAGE).display());
    text
}

/// Scored of due.
fn rest(cell: &OpenCell) -> String {
    let scored = cell.score.map_or(0, |score| score.n);
    if scored == cell.due {
        format!("n {scored}")
    } else {
        format!("n {scored} of {}", cell.due)
    }
}

fn head(first: &[&str], levels: impl Iterator<Item = String>, last: &[&str]) -> Vec<String> {
    let own = |names: &[&str]| -> Vec<String> { names.iter().map(ToString::to_string).collect() };
    [own(first), levels.collect(), own(last)].concat()
}

fn levels(rows: &Rows<'_>) -> Table {
    let mut table = plain();
    let names = rows.levels.iter().map(ToString::to_string);
    table.set_header(head(&["model", "light"], names, &["scored"]));
    for line in rows.lines.keys() {
        let cells: Vec<Option<&OpenCell>> = rows
            .levels
            .iter()
            .map(|level| rows.cell(line, *level, &Group::All))
            .collect();
        let (mut scored, mut due) = (0, 0);
        for cell in cells.iter().flatten() {
            scored += cell.score.map_or(0, |score| score.n);
            due += cell.due;
        }
        let shown = cells.iter().map(|cell| rows.shown(*cell));
        let row = [line.model.to_owned(), line.light()];
        table.add_row(
            row.into_iter()
                .chain(shown)
                .chain([format!("{scored} of {due}")]),
        );
    }
    aligned(table, 2)
}

/// A row a split or category, of each line.
fn groups(report: &OpenReport<'_>, rows: &Rows<'_>) -> Table {
    let mut table = plain();
    let blind = (!rows.blind.is_empty()).then_some("blind");
    let names = rows.levels.iter().map(ToString::to_string);
    table.set_header(head(&["model", "light", "of"], names, blind.as_slice()));
    let among = report.summary.groups();
    for line in rows.lines.keys() {
        for (number, group) in among
            .iter()
            .filter(|group| ***group != Group::All)
            .enumerate()
        {
            let own = if number == 0 {
                [line.model.to_owned(), line.light()]
            } else {
                Default::default()
            };
            let at = |level: &AxisLevel| rows.shown(rows.cell(line, *level, group));
            let same = |subject: &&&Subject| subject.model == line.model;
            let blind = blind.map(|_| {
                let subject = rows.blind.iter().find(same).or(rows.blind.first());
                rows.shown(subject.and_then(|subject| report.summary.cell(subject, group)))
            });
            table.add_row(
                own.into_iter()
                    .chain([group.name().to_owned()])
                    .chain(rows.levels.iter().map(at))
                    .chain(blind),
            );
        }
    }
    aligned(table, 3)
}

/// Numbers to the right.
fn aligned(mut table: Table, words: usize) -> Table {
    for column in table.column_iter_mut().skip(words) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}
