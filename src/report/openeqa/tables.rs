//! Tables of a run of open questions: [`tables`].
//!
//! Files of answers and marks in the format of `facebookresearch/open-eqa`, for its scripts: [`files`].

use std::collections::BTreeMap;

use serde::Serialize;

use super::marked_answers::{MarkedAnswers, ReportedAnswer};
use crate::tables::{EnhancerRow, LEVELS, enhancers, with_training};
use crate::text::ladder::{Ladder, LadderSeries, SeriesByLevel};
use crate::text::latex::escape;
use crate::text::table::ColumnKind::{self, Accuracy, Count, Points, Share, Text};
use crate::text::table::{SUMMARY, Table, TableBuilder, TableCell};
use crate::text::terminal::texts;
use crate::text::words::ends;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::degradations::Axis;
use darkqa_base::types::text::counted;
use darkqa_score::estimate::Estimate;
use darkqa_score::model_in_condition::ModelInCondition;
use darkqa_score::open::{AnswerOutcome, Baseline, Group, OpenCell, OpenSummary};

/// Name of the page section that has all tables.
pub(super) const SECTION: &str = "scores";

/// All tables of a run; the first is the summary.
#[must_use]
pub(super) fn tables(report: &MarkedAnswers<'_>, enhancer_rows: &[EnhancerRow]) -> Vec<Table> {
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
    tables.extend(enhancers(enhancer_rows, &[]).map(|table| Table { section: SECTION, ..table }));
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
        .column(Text, "csv reading", |cell| TableCell::profile(&cell.subject))
        .model_facts(&summary.listing, |cell| &cell.subject)
        .build()
}

/// Tables of scores by level, one for each axis.
fn levels(report: &MarkedAnswers<'_>) -> Vec<Table> {
    let whole = ladder(report.summary, &Group::All);
    let mut tables: Vec<Table> =
        whole.by_axis().into_iter().map(|(axis, ladder)| axis_table(report, axis, &ladder)).collect();
    if let Some(last) = tables.last_mut() {
        last.notes = notes_without_images(report.summary, &whole);
    }
    tables
}

fn axis_table(report: &MarkedAnswers<'_>, axis: Axis, ladder: &Ladder<'_, OpenCell>) -> Table {
    let summary = report.summary;
    let of = if axis == Axis::LIGHT { String::new() } else { format!(" by {} of {}", axis.title, axis.cause) };
    let mut table = ladder
        .table(LEVELS, &summary.listing, |cell| score(summary, cell))
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
    series: &LadderSeries<'_>,
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

/// Folder of these files in a run.
const FOLDER: &str = "upstream";

#[derive(Serialize)]
struct UpstreamAnswer<'a> {
    question_id: &'a str,
    answer: Option<&'a str>,
    /// Condition, so that `--answers` assigns the answer to it; omitted at L0, as in upstream's own files. Upstream's
    /// scripts read only the first two fields.
    #[serde(skip_serializing_if = "Option::is_none")]
    condition: Option<&'a str>,
}

/// Writes for each subject `NAME.json` with its answers and, if there is a judge, `NAME-JUDGE-metrics.json` with its
/// marks.
///
/// Missing answers and marks are left out. A subject with several answers to a question gets no files, because the
/// format has one answer for each question.
pub(super) fn files(report: &MarkedAnswers<'_>) -> Result<Vec<(String, Vec<u8>)>> {
    let mut by_subject = BTreeMap::<&ModelInCondition, BTreeMap<usize, Vec<&ReportedAnswer>>>::new();
    for reported in report.answers {
        if reported.outcome != AnswerOutcome::Missing {
            let questions = by_subject.entry(&reported.subject).or_default();
            questions.entry(reported.question).or_default().push(reported);
        }
    }
    let mut files = Vec::new();
    for (subject, questions) in by_subject {
        let answers_by_question: Option<Vec<(usize, &ReportedAnswer)>> = questions
            .into_iter()
            .map(|(question, reported)| match &reported[..] {
                [single] => Some((question, *single)),
                _ => None,
            })
            .collect();
        let Some(answers_by_question) = answers_by_question else {
            continue;
        };
        let condition = subject.condition();
        let stem = file_name(&format!("{}-{condition}", subject.model));
        let answers: Vec<UpstreamAnswer<'_>> = answers_by_question
            .iter()
            .map(|(question, reported)| UpstreamAnswer {
                question_id: &report.questions[*question].id.0,
                answer: reported.answer.as_deref(),
                condition: Some(&*condition).filter(|condition| *condition != "L0"),
            })
            .collect();
        files.push((format!("{FOLDER}/{stem}.json"), json_file(&answers)?));
        let Some(judge) = report.judge else {
            continue;
        };
        let marks: serde_json::Map<String, serde_json::Value> = answers_by_question
            .iter()
            .filter_map(|(question, reported)| {
                let mark = match reported.outcome {
                    AnswerOutcome::Marked(mark) => mark,
                    // Upstream's score of a null answer.
                    AnswerOutcome::Null => 0,
                    AnswerOutcome::Missing | AnswerOutcome::Unjudged | AnswerOutcome::Unmarked => {
                        return None;
                    }
                };
                Some((&*report.questions[*question].id.0, mark))
            })
            .map(|(id, mark)| (id.to_owned(), mark.into()))
            .collect();
        let name = format!("{FOLDER}/{stem}-{}-metrics.json", file_name(judge));
        files.push((name, json_file(&marks)?));
    }
    Ok(files)
}

/// Replaces characters of a name that are unsafe in file names.
fn file_name(name: &str) -> String {
    name.replace(|c: char| !(c.is_alphanumeric() || "-_.+".contains(c)), "_")
}

fn json_file(value: &impl Serialize) -> Result<Vec<u8>> {
    let mut text = serde_json::to_vec_pretty(value).map_err(|e| Error::data(FOLDER, e))?;
    text.push(b'\n');
    Ok(text)
}
