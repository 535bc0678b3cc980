//! Tables of a run of open questions: [`tables`].

use super::open_report::OpenReport;
use crate::report::tables::{enhancers, reading, with_training};
use crate::report::text::ladder::{Ladder, Series, SeriesByLevel};
use crate::report::text::latex::escape;
use crate::report::text::table::ColumnKind::{Accuracy, Count, Points, Share, Text};
use crate::report::text::table::SUMMARY;
use crate::report::text::table::{ColumnKind, Table, TableBuilder, TableCell};
use crate::report::text::terminal::texts;
use crate::report::text::words::ends;
use crate::types::degradations::Axis;
use crate::types::text::counted;
use darkqa_score::estimate::Estimate;
use darkqa_score::open::{Baseline, Group, OpenCell, OpenSummary};

/// Name of the page section that has all tables.
pub(super) const SECTION: &str = "scores";

/// All tables of a run; the first is the summary.
#[must_use]
pub(crate) fn tables(report: &OpenReport<'_>) -> Vec<Table> {
    let mut tables = vec![summary(report.summary)];
    tables.extend(levels(report));
    let groups: Vec<(&Group, Ladder<'_, OpenCell>)> = report
        .summary
        .groups()
        .into_iter()
        .filter(|group| **group != Group::All)
        .map(|group| (group, ladder(report.summary, group)))
        .collect();
    if !groups.is_empty() {
        let whole = ladder(report.summary, &Group::All);
        for series in whole.series.keys() {
            tables.push(by_group(report.summary, series, &whole, &groups));
        }
    }
    let mut tables = with_training(tables, &report.summary.listing);
    tables.extend(enhancers(report.enhancers).map(|table| Table { section: SECTION, ..table }));
    tables
}

/// Scores of a group of questions by series and level.
pub(super) fn ladder<'a>(summary: &'a OpenSummary, group: &Group) -> Ladder<'a, OpenCell> {
    let cells = summary.cells.iter().filter(|cell| cell.group == *group).map(|cell| (&cell.subject, cell));
    Ladder::new(cells).with_clean()
}

/// Difference of a score from a baseline, computed from unrounded means.
fn change(summary: &OpenSummary, cell: &OpenCell, baseline: Baseline) -> Option<Estimate> {
    let change = summary.change(&cell.subject, baseline, &cell.group)?;
    Some(change.difference)
}

/// Table cell of a score, with its difference from the clean frames.
fn score(summary: &OpenSummary, cell: Option<&OpenCell>) -> TableCell {
    let Some(cell) = cell else {
        return TableCell::Absent;
    };
    let change = change(summary, cell, Baseline::Clean).map(|change| change.value);
    TableCell::from(cell.score.map(|score| TableCell::Changed(score, change)))
}

/// Table of all scores.
fn summary(summary: &OpenSummary) -> Table {
    TableBuilder::new(SUMMARY, &summary.cells)
        .subject(|cell| &cell.subject, |variant| variant.word().into_owned())
        .column(Text, "csv by", |cell| cell.group.kind())
        .column(Text, "csv group", |cell| cell.group.name().to_owned())
        .column(Count, "csv due", |cell| cell.planned)
        .column(Count, "csv n", |cell| cell.scored())
        .column(Count, "csv missing", |cell| cell.missing)
        .column(Count, "csv unjudged", |cell| cell.unjudged)
        .column(Count, "csv unmarked", |cell| cell.unmarked)
        .column(Count, "csv null", |cell| cell.null)
        .column(Count, "csv cut", |cell| cell.cut)
        .column(Share, "csv value low high", |cell| cell.score)
        .column(Points, "csv change change_low change_high change_n", |cell| change(summary, cell, Baseline::Clean))
        .column(Points, "csv gain gain_low gain_high", |cell| change(summary, cell, Baseline::Raw))
        .column(Text, "csv reading", |cell| reading(&cell.subject))
        .model_facts(&summary.listing, |cell| &cell.subject)
        .build()
}

/// Tables of scores by level, one for each axis.
fn levels(report: &OpenReport<'_>) -> Vec<Table> {
    let whole = ladder(report.summary, &Group::All);
    let mut tables: Vec<Table> =
        whole.by_axis().into_iter().map(|(axis, ladder)| axis_table(report, axis, &ladder)).collect();
    if let Some(last) = tables.last_mut() {
        last.notes = notes_without_images(report.summary, &whole);
    }
    tables
}

fn axis_table(report: &OpenReport<'_>, axis: Axis, ladder: &Ladder<'_, OpenCell>) -> Table {
    let summary = report.summary;
    let of = if axis == Axis::LIGHT { String::new() } else { format!(" by {} of {}", axis.title, axis.cause) };
    let mut table = ladder
        .table("levels", &summary.listing, |cell| score(summary, cell))
        .page(SECTION, &format!("Score in %{of} with 95 % intervals (difference from L0)"))
        .column(Count, "terminal scored", |line| {
            format!("{} of {}", line.sum(OpenCell::scored), line.sum(|cell| cell.planned))
        })
        .build();
    let judge = report.judge.unwrap_or("nobody");
    let protocol = report.protocol;
    table.heading = Some(format!(
        "Score in %{of} (LLM-Match, marked by {judge}, protocol {protocol}): mean (difference from L0), and how far the widest 95 % interval over {} {}s reaches down and up",
        summary.clusters, summary.unit
    ));
    table.latex = Some(format!(
        "OpenEQA by LLM-Match in \\%{of} (marked by {}, protocol {protocol}), with the difference from L0; {}.",
        escape(judge),
        counted(report.questions.len(), "question")
    ));
    table
}

/// One note for each model without images.
fn notes_without_images(summary: &OpenSummary, ladder: &Ladder<'_, OpenCell>) -> Vec<String> {
    ladder
        .without_level
        .iter()
        .map(|(subject, cell)| {
            let text = texts(ColumnKind::Accuracy, &score(summary, Some(cell))).concat();
            let interval = cell.score.map(|share| format!(" [{}]", ends(share)));
            let text = text + &interval.unwrap_or_default();
            let (scored, planned) = (cell.scored(), cell.planned);
            let of = if scored == planned { String::new() } else { format!(" of {planned}") };
            format!("{} without images: {text}, n {scored}{of}", subject.model)
        })
        .collect()
}

/// Scores of one series, with a row for each split and category. The terminal joins the tables of all series to one
/// table, with a column for models without images.
fn by_group(
    summary: &OpenSummary,
    series: &Series<'_>,
    whole: &Ladder<'_, OpenCell>,
    groups: &[(&Group, Ladder<'_, OpenCell>)],
) -> Table {
    let light = series.light(&[]);
    let mut builder = TableBuilder::new("groups", groups.iter().enumerate())
        .page(SECTION, &format!("{}, {light}", series.model))
        .column(Text, "terminal model", |(index, _)| first_row_only(*index, series.model))
        .column(Text, "terminal light", |(index, _)| first_row_only(*index, &light))
        .column(Text, "terminal of | page split or category", |(_, (group, _))| group.name().to_owned());
    for level in &whole.levels {
        builder = builder.column(Accuracy, &*format!("terminal {level} | page {level}"), |(_, (_, ladder))| {
            let cells: Option<&SeriesByLevel<'_, OpenCell>> = ladder.series.get(series);
            let cell = cells.and_then(|cells| cells.get(level));
            score(summary, cell.copied())
        });
    }
    if !whole.without_level.is_empty() {
        builder = builder.column(Accuracy, "terminal blind", |(_, (_, ladder))| {
            let blind = ladder
                .without_level
                .iter()
                .find(|(subject, _)| subject.model == series.model)
                .or(ladder.without_level.first());
            score(summary, blind.map(|(_, cell)| *cell))
        });
    }
    let mut table = builder.build();
    table.heading = Some(String::new());
    table
}

/// Text in the first row of a table, empty in all others.
fn first_row_only(index: usize, text: &str) -> String {
    if index == 0 { text.to_owned() } else { String::new() }
}
