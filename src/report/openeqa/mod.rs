//! The report on open questions: [`Report::from_marked_answers`]. Its measure is the score that a judge gives to answers
//! ([`MarkedAnswers`]).
//!
//! Charts of scores by level of degradation: [`figures`].

mod marked_answers;
mod page;
mod tables;

use std::collections::BTreeMap;
use std::path::Path;

use serde::Serialize;

use crate::charts::chart::{Chart, Figure, LineContent, LineStyle, Panel, PlotLine};
use crate::charts::paper::figure;
use crate::content::{Measure, PageParts, Report};
use crate::json::{SummaryRuns, document};
use crate::page::{PageHead, PageInputs};
use crate::tables::{EnhancerRow, LEVELS};
use crate::text::alert::{Alert, AlertKind};
use crate::text::ladder::{Ladder, LadderSeries, SeriesByLevel};
use crate::text::table::Table;
use crate::text::terminal::render;
use crate::text::words::ProfileNames;
use darkqa_base::error::Result;
use darkqa_base::types::AxisLevel;
use darkqa_base::types::manifests::RunManifest;
use darkqa_base::types::text::{counted, plural};
use darkqa_runs::outcome::ReportLength;
use darkqa_score::model_in_condition::ModelInCondition;
use darkqa_score::open::{AnswerOutcome, Group, OpenCell};
use tables::ladder;

pub use marked_answers::{MarkedAnswers, ReportedAnswer};

impl<'a> Report<'a> {
    /// The report on answers to open questions. The alerts of the runs precede those about missing answers and marks.
    pub fn from_marked_answers(answers: MarkedAnswers<'a>, alerts: &[Alert], enhancer_rows: &[EnhancerRow]) -> Self {
        let measured = format!(
            "OpenEQA by LLM-Match, marked by {}, protocol {}",
            answers.judge.unwrap_or("nobody"),
            answers.protocol
        );
        Self {
            facts: std::iter::once(measured).chain(page::coverage(&answers)).collect(),
            alerts: alerts.iter().cloned().chain(coverage_alerts(&answers)).collect(),
            sentences: Vec::new(),
            how_to_read: String::new(),
            tables: tables::tables(&answers, enhancer_rows),
            measure: Box::new(answers),
        }
    }
}

/// Head of `summary.json`.
#[derive(Serialize)]
struct OpenHead<'a> {
    schema: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    folder: Option<&'a Path>,
    run: &'a RunManifest,
    /// Further runs of the report, by name.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    joined: BTreeMap<&'a str, &'a RunManifest>,
    judge: Option<&'a str>,
    protocol: String,
    clustered_by: &'static str,
    clusters: usize,
    /// Noise profiles of the noisy images.
    readings: ProfileNames,
    alerts: &'a [Alert],
}

impl Measure for MarkedAnswers<'_> {
    fn figures(&self) -> Result<Vec<Figure>> {
        figures(self)
    }

    fn page_parts<'p>(&'p self, _: &'p Report<'_>, _: &'p PageInputs<'_>) -> Result<PageParts<'p>> {
        let heading = match &*self.runs {
            [(name, _)] => format!("OpenEQA in the dark: {name}"),
            several => format!("OpenEQA in the dark: {} runs compared", several.len()),
        };
        Ok(PageParts {
            class: "",
            title: heading.clone(),
            heading,
            head: page::summary(self).map(|summary| PageHead::from_summary(&summary)),
            family: "category",
            intro: page::intro(self),
            notes: Vec::new(),
            sections: &page::SECTIONS,
            answers_title: "",
            items: page::packed(self)?,
        })
    }

    fn json(&self, report: &Report<'_>, runs: SummaryRuns<'_>, length: ReportLength) -> Result<String> {
        let head = OpenHead {
            schema: "darkqa.openeqa-summary/1",
            folder: runs.first_folder(),
            run: self.manifest,
            joined: self.runs.iter().skip(1).copied().collect(),
            judge: self.judge,
            protocol: self.protocol.to_string(),
            clustered_by: self.summary.unit,
            clusters: self.summary.clusters,
            readings: self.profiles(),
            alerts: &report.alerts,
        };
        document(head, &report.tables[0], &report.tables, length)
    }

    fn short_tables(&self, report: &Report<'_>) -> String {
        if self.judge.is_some() { render(&report.tables) } else { String::new() }
    }

    fn short_markdown_tables<'t>(&self, tables: &'t [Table]) -> Vec<&'t Table> {
        tables.iter().filter(|table| table.name == LEVELS && !table.rows.is_empty()).collect()
    }

    fn profiles(&self) -> ProfileNames {
        ProfileNames::new(self.answers.iter().map(|answer| &answer.subject))
    }

    fn has_findings(&self) -> bool {
        false
    }

    fn latex_title(&self) -> &'static str {
        "Table"
    }

    fn files(&self) -> Result<Vec<(String, Vec<u8>)>> {
        tables::files(self)
    }
}

/// Alerts about missing marks and answers, and a missing judge.
fn coverage_alerts(answers: &MarkedAnswers<'_>) -> Vec<Alert> {
    let (status, counts) = (answers.manifest.status, answers.manifest.counts);
    let unmarked = answers.answers.iter().filter(|answer| answer.outcome == AnswerOutcome::Unmarked).count();
    let unmarked = (unmarked > 0).then(|| {
        let text =
            format!("{} not scored, because the judge gave no mark.", plural(unmarked, "answer is", "answers are"));
        Alert::new(AlertKind::Unread, text)
    });
    let missing = (counts.answered < counts.trials).then(|| {
        let text = format!(
            "{status}: {} of {} answers and marks are stored, {} failed; those that are missing are not scored.",
            counts.answered, counts.trials, counts.failed
        );
        Alert::new(AlertKind::NotComplete, text)
    });
    let unjudged = answers
        .judge
        .is_none()
        .then(|| Alert::new(AlertKind::NotComplete, "No answer is marked: name a judge with --judge NAME."));
    [unmarked, missing, unjudged].into_iter().flatten().collect()
}

/// Draws a chart of all questions and a chart with a panel for each category. Empty if the run has fewer than two
/// levels.
fn figures(report: &MarkedAnswers<'_>) -> Result<Vec<Figure>> {
    let whole = ladder(report.summary, &Group::All);
    if whole.levels.len() < 2 {
        return Ok(Vec::new());
    }
    let categories: Vec<Panel> = report
        .summary
        .groups()
        .into_iter()
        .filter(|group| matches!(group, Group::Category(_)))
        .flat_map(|group| panels(report, group, &whole))
        .collect();
    let note = format!(
        "bands and bars are 95 % intervals by {}, {}",
        report.summary.unit,
        counted(report.summary.clusters, "cluster")
    );
    let charts = [
        (
            "scores",
            if whole.without_level.is_empty() {
                "Score by level."
            } else {
                "Score by level. Broken lines: without images."
            },
            panels(report, &Group::All, &whole),
            1,
        ),
        ("categories", "Score by category.", categories, 3),
    ];
    let mut figures = Vec::new();
    for (name, caption, panels, columns) in charts {
        if panels.is_empty() {
            continue;
        }
        figures.push(figure(name, caption, &Chart { panels, columns, note: note.clone() })?);
    }
    Ok(figures)
}

/// Panels of a group of questions: one per degradation axis.
fn panels(report: &MarkedAnswers<'_>, group: &Group, whole: &Ladder<'_, OpenCell>) -> Vec<Panel> {
    ladder(report.summary, group)
        .by_axis()
        .into_iter()
        .map(|(_, ladder)| panel(report, group, whole, &ladder))
        .collect()
}

/// One panel: a curve per series, and a flat line per model without images. A series has the same line style in every
/// panel: that of its position in `whole`, the ladder of all questions.
fn panel(
    report: &MarkedAnswers<'_>,
    group: &Group,
    whole: &Ladder<'_, OpenCell>,
    ladder: &Ladder<'_, OpenCell>,
) -> Panel {
    let series_count = whole.series.len();
    let curves = ladder.series.iter().map(|(series, cells)| {
        let position = whole.series.keys().position(|other| other == series);
        let style = LineStyle(position.unwrap_or(series_count));
        curve(ladder, series, cells, style)
    });
    let flat_lines = ladder
        .without_level
        .iter()
        .enumerate()
        .filter_map(|(index, (subject, cell))| flat_line(subject, cell, LineStyle(series_count + index)));
    Panel::over_levels("score in %", title(report, group), curves.chain(flat_lines).collect())
}

/// Scores of a series over the levels. L0 is the start of the series in the ladder.
fn curve(
    ladder: &Ladder<'_, OpenCell>,
    series: &LadderSeries<'_>,
    cells: &SeriesByLevel<'_, OpenCell>,
    style: LineStyle,
) -> PlotLine {
    let clean = ladder.l0_cell(series).map(|cell| (AxisLevel::L0, cell));
    let degraded = cells.iter().map(|(level, cell)| (*level, *cell)).filter(|(level, _)| *level != AxisLevel::L0);
    let points = clean.into_iter().chain(degraded).filter_map(|(level, cell)| Some((level, cell.score?))).collect();
    PlotLine {
        name: format!("{}, {}", series.model, series.light(&[])),
        style,
        content: LineContent::Curve(points),
        model: Some(series.model.to_owned()),
        items: None,
    }
}

/// Score of a model without images, which is the same at all levels; `None` without a score.
fn flat_line(subject: &ModelInCondition, cell: &OpenCell, style: LineStyle) -> Option<PlotLine> {
    Some(PlotLine {
        name: format!("{} without images", subject.model),
        style,
        content: LineContent::Flat(cell.score?.value),
        model: Some(subject.model.clone()),
        items: None,
    })
}

/// Title of a panel: the name of the group and its number of questions.
fn title(report: &MarkedAnswers<'_>, group: &Group) -> String {
    let questions = match group {
        Group::All => report.questions.len(),
        Group::Split(name) | Group::Category(name) => {
            report.questions.iter().filter(|question| question.family.name() == name).count()
        }
    };
    format!("{}, n {questions}", group.name())
}
