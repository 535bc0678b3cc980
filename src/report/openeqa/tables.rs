//! The tables of a run of open questions: [`tables`].

use super::open_report::OpenReport;
use crate::report::ladder::{Ladder, Series, SeriesByLevel};
use crate::report::latex::escaped;
use crate::report::table::ColumnKind::{Accuracy, Count, Points, Share, Text};
use crate::report::table::{ColumnKind, Table, TableBuilder, TableCell};
use crate::report::tables::{SUMMARY, reading};
use crate::report::terminal::texts;
use crate::score::estimate::Estimate;
use crate::score::open::{Baseline, Group, OpenCell, OpenSummary};
use crate::score::subject::Subject;

/// The section of the page with all tables.
pub(super) const SECTION: &str = "scores";

/// Every table of a run; the first is the summary.
#[must_use]
pub(crate) fn tables(report: &OpenReport<'_>) -> Vec<Table> {
    let mut tables = vec![summary(report.summary), levels(report)];
    let of = |group| ladder(report.summary, group);
    let groups: Vec<(&Group, Ladder<'_, OpenCell>)> = report
        .summary
        .groups()
        .into_iter()
        .filter(|group| **group != Group::All)
        .map(|group| (group, of(group)))
        .collect();
    if !groups.is_empty() {
        let whole = of(&Group::All);
        let series = whole.series.keys();
        tables.extend(series.map(|series| by_group(report.summary, series, &whole, &groups)));
    }
    tables
}

/// The scores of a group over the levels.
pub(super) fn ladder<'a>(summary: &'a OpenSummary, group: &Group) -> Ladder<'a, OpenCell> {
    let cells = summary.cells.iter().filter(|cell| cell.group == *group);
    Ladder::new(cells.map(|cell| (&cell.subject, cell))).with_lit()
}

/// A score, and what it differs by from the lit frames; of the unrounded means.
fn score(summary: &OpenSummary, cell: Option<&OpenCell>) -> TableCell {
    let Some(cell) = cell else {
        return TableCell::Absent;
    };
    let change = summary.change(&cell.subject, Baseline::Lit, &cell.group);
    let change = change.map(|change| change.difference.value);
    TableCell::from(cell.score.map(|score| TableCell::Changed(score, change)))
}

fn summary(summary: &OpenSummary) -> Table {
    let change = |cell: &OpenCell, against| -> Option<Estimate> {
        let change = summary.change(&cell.subject, against, &cell.group)?;
        Some(change.difference)
    };
    let drop = "csv drop drop_low drop_high drop_n";
    TableBuilder::new(SUMMARY, &summary.cells)
        .subject(|cell| &cell.subject, |variant| variant.word().to_owned())
        .column(Text, "csv by", |cell| cell.group.kind())
        .column(Text, "csv group", |cell| cell.group.name().to_owned())
        .column(Count, "csv due", |cell| cell.due)
        .column(Count, "csv n", |cell| cell.scored())
        .column(Count, "csv missing", |cell| cell.missing)
        .column(Count, "csv unjudged", |cell| cell.unjudged)
        .column(Count, "csv unmarked", |cell| cell.unmarked)
        .column(Count, "csv null", |cell| cell.null)
        .column(Count, "csv cut", |cell| cell.cut)
        .column(Share, "csv value low high", |cell| cell.score)
        .column(Points, drop, |cell| change(cell, Baseline::Lit))
        .column(Points, "csv gain gain_low gain_high", |cell| {
            change(cell, Baseline::Raw)
        })
        .column(Text, "csv reading", |cell| reading(&cell.subject))
        .made()
}

fn levels(report: &OpenReport<'_>) -> Table {
    let summary = report.summary;
    let ladder = ladder(summary, &Group::All);
    let mut table = ladder
        .layout("levels", |cell| score(summary, cell))
        .page(
            SECTION,
            "Score in % ± half of the 95 % interval (difference from L0)",
        )
        .column(Count, "terminal scored", |line| {
            format!(
                "{} of {}",
                line.sum(OpenCell::scored),
                line.sum(|cell| cell.due)
            )
        })
        .made();
    let judge = report.judge.unwrap_or("nobody");
    let protocol = report.protocol;
    table.heading = Some(format!(
        "Score in % (LLM-Match, marked by {judge}, protocol {protocol}): mean ± half of the 95 % interval over {} {}s (drop from L0)",
        summary.clusters, summary.unit
    ));
    table.latex = Some(format!(
        "OpenEQA by LLM-Match in \\% (marked by {}, protocol {protocol}), with the difference from L0; {} questions.",
        escaped(judge),
        report.questions.len()
    ));
    let floors = ladder.floors.iter();
    let notes = floors.map(|(subject, cell)| {
        let shown = texts(ColumnKind::Accuracy, &score(summary, Some(cell))).concat();
        let (scored, due) = (cell.scored(), cell.due);
        let of = if scored == due {
            String::new()
        } else {
            format!(" of {due}")
        };
        format!("{} without images: {shown}, n {scored}{of}", subject.model)
    });
    table.notes = notes.collect();
    table
}

/// The scores of one series: a row a split or category. All of them are one table in the terminal, where blind models stand beside.
fn by_group(
    summary: &OpenSummary,
    series: &Series<'_>,
    whole: &Ladder<'_, OpenCell>,
    groups: &[(&Group, Ladder<'_, OpenCell>)],
) -> Table {
    let rows = groups.iter().enumerate();
    let once = |place: usize, text: &str| {
        if place == 0 {
            text.to_owned()
        } else {
            String::new()
        }
    };
    let light = series.light();
    let mut layout = TableBuilder::new("groups", rows)
        .page(SECTION, &format!("{}, {light}", series.model))
        .column(Text, "terminal model", |(place, _)| {
            once(*place, series.model)
        })
        .column(Text, "terminal light", |(place, _)| once(*place, &light))
        .column(
            Text,
            "terminal of | page split or category",
            |(_, (group, _))| group.name().to_owned(),
        );
    for level in &whole.levels {
        layout = layout.column(
            Accuracy,
            &*format!("terminal {level} | page {level}"),
            |(_, (_, ladder))| {
                let steps: Option<&SeriesByLevel<'_, OpenCell>> = ladder.series.get(series);
                let cell = steps.and_then(|steps| steps.get(level));
                score(summary, cell.copied())
            },
        );
    }
    if !whole.floors.is_empty() {
        layout = layout.column(Accuracy, "terminal blind", |(_, (_, ladder))| {
            let is_same = |(subject, _): &&(&Subject, &OpenCell)| subject.model == series.model;
            let mut floors = ladder.floors.iter();
            let own = floors.find(is_same).or(ladder.floors.first());
            score(summary, own.map(|(_, cell)| *cell))
        });
    }
    let mut table = layout.made();
    table.heading = Some(String::new());
    table
}
