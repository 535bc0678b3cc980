//! The report on questions without true answers: [`Report::from_self_agreement`].
//!
//! The measure is agreement with the model's own answer at L0. Reports always give it with its floor, its ceiling and
//! other measures that are needed to interpret it, and never call it accuracy.
//!
//! Sections of the page: [`SECTIONS`]. Figures: [`figures`].

mod tables;

use std::collections::BTreeSet;

use serde::Serialize;

use super::tables::{ENHANCERS, Section, with_training};
use crate::charts::chart::{Chart, Figure, LineContent, LineStyle, Panel, PlotLine, Scale};
use crate::charts::paper::figure;
use crate::content::{Measure, PageParts, Report};
use crate::finding_groups::FindingGroups;
use crate::json::{JsonRows, RunsHead, SummaryRuns, document};
use crate::page::{PageHead, PageInputs, items_note, packed_items};
use crate::sentences::{Sentence, self_agreement};
use crate::short::who_is_judged;
use crate::text::alert::Alert;
use crate::text::ladder::{Ladder, LadderSeries, SeriesByLevel};
use crate::text::table::Table;
use crate::text::terminal::{table, wrapped};
use crate::text::words::ProfileNames;
use darkqa_base::error::Result;
use darkqa_base::types::AxisLevel;
use darkqa_base::types::text::{counted, plural};
use darkqa_runs::outcome::ReportLength;
use darkqa_score::accuracies::Health;
use darkqa_score::comparisons::self_agreement::SelfAgreement;
use darkqa_score::comparisons::self_agreement::cell::{AgreementCell, CellRole};
use darkqa_score::estimate::Estimate;
use tables::{AGREEMENT, HOW_TO_READ, levels, notes};

impl<'a> Report<'a> {
    /// The report on the agreement of models with their own answers at L0.
    pub fn from_self_agreement(found: &'a SelfAgreement<'a>, alerts: Vec<Alert>) -> Self {
        Self {
            measure: Box::new(OwnAnswers { found }),
            facts: facts(found),
            alerts,
            sentences: self_agreement(found),
            how_to_read: HOW_TO_READ.to_owned(),
            tables: with_training(tables::tables(found), &found.grid.listing),
        }
    }
}

/// Agreement of each model with its own answers at L0.
struct OwnAnswers<'a> {
    found: &'a SelfAgreement<'a>,
}

impl Measure for OwnAnswers<'_> {
    fn figures(&self) -> Result<Vec<Figure>> {
        figures(self.found)
    }

    fn page_parts<'p>(&'p self, report: &'p Report<'_>, inputs: &'p PageInputs<'_>) -> Result<PageParts<'p>> {
        let grid = &self.found.grid;
        let groups = FindingGroups::new(&report.sentences);
        Ok(PageParts {
            class: "no-truth",
            head: (groups.count() > 0).then(|| PageHead::without_images(&groups)),
            intro: intro(self.found),
            notes: items_note(grid).into_iter().collect(),
            answers_title: "Answers given against those at L0",
            items: packed_items(grid, &self.found.confusions, inputs)?,
            ..PageParts::in_the_dark(&who_is_judged(grid), &SECTIONS, inputs)
        })
    }

    fn json(&self, report: &Report<'_>, runs: SummaryRuns<'_>, length: ReportLength) -> Result<String> {
        let own_answers = report.tables.iter().find(|table| table.name == tables::OWN_ANSWERS);
        let head = Head {
            runs: runs.head("darkqa.self-agreement/1"),
            measure: AGREEMENT,
            readings: self.profiles(),
            alerts: &report.alerts,
            findings: &report.sentences,
            own_answers: own_answers.map(JsonRows::new),
        };
        document(head, &tables::summary(self.found), &report.tables, length)
    }

    fn short_tables(&self, _: &Report<'_>) -> String {
        short_tables(self.found)
    }

    fn short_markdown_tables<'t>(&self, tables: &'t [Table]) -> Vec<&'t Table> {
        tables.iter().filter(|table| table.name == AGREEMENT && !table.rows.is_empty()).collect()
    }

    fn profiles(&self) -> ProfileNames {
        ProfileNames::new(&self.found.grid.subjects)
    }
}

/// Lines at the top of the page.
fn intro(found: &SelfAgreement<'_>) -> Vec<String> {
    let unit = found.unit;
    let facts = format!(
        "Nobody knows the true answers to these questions. Each model is compared with its own answers at L0: {}, {} (model × \
         condition). Strict parsing. Intervals are 95 %, by {unit} ({}); differences are paired by item, tested by swapping whole \
         {unit}s, and corrected by Holm over the comparisons of one kind and model.",
        counted(found.items(), "item"),
        counted(found.grid.subjects.len(), "subject"),
        counted(found.grid.clusters, "cluster")
    );
    let readings = ProfileNames::new(&found.grid.subjects);
    std::iter::once(facts).chain(readings.open_question()).collect()
}

/// Head of the summary.
#[derive(Serialize)]
struct Head<'a> {
    #[serde(flatten)]
    runs: RunsHead<'a>,
    measure: &'static str,
    readings: ProfileNames,
    alerts: &'a [Alert],
    findings: &'a [Sentence],
    /// Rows of `own_answers.csv`.
    own_answers: Option<JsonRows<'a>>,
}

/// Table of each axis with a wrapped heading, and the notes.
fn short_tables(found: &SelfAgreement<'_>) -> String {
    let mut text = String::new();
    for levels in levels(found) {
        text += &wrapped(" ", levels.heading.as_deref().unwrap_or_default(), " ");
        text += &table(&[levels]);
    }
    for note in notes(found) {
        text += &wrapped(" ", &note, "   ");
    }
    text
}

/// Facts at the head of the report: models, questions, images, replies with failures, and the unit of the intervals.
fn facts(found: &SelfAgreement<'_>) -> Vec<String> {
    let items = &found.grid.items;
    let models = found.models();
    let who = match &models[..] {
        [one] => (*one).to_owned(),
        several => counted(several.len(), "model"),
    };
    let questions: BTreeSet<_> = items.iter().map(|item| &*item.asked.question).collect();
    let frames: BTreeSet<_> = items.iter().map(|item| &*item.asked.frame).collect();
    let replies: usize = found.health.iter().map(|health| health.replies).sum();
    let failed: usize = found.health.iter().map(Health::failures).sum();
    vec![
        who,
        format!("{} without answers", counted(questions.len(), "question")),
        counted(frames.len(), "image"),
        format!("{}, {failed} failed", plural(replies, "reply", "replies")),
        format!("intervals by {}", found.unit),
    ]
}

/// All sections of the page in order.
const SECTIONS: [Section; 8] = [
    (
        "agreement",
        "Agreement with its own answer at L0",
        "The share of questions that a model answers as it does at L0, of those to which its answer at L0 could be read. Under L0 stands \
         the ceiling: the same image asked again. The floor is the same model without an image. Evidence kept is the share of the way \
         from the floor to the ceiling. κ takes off what equal habits give, question by question. Entropy is 0 if a question gets one \
         answer about all images, and 1 if all its answers are equally frequent: a model that answers no to everything agrees with \
         itself, and its entropy is 0.",
        &["agreement", "evidence"],
    ),
    (
        "thresholds",
        "Darkness threshold",
        "The exposure drop at which a model keeps half of its evidence: half-way from the ceiling to the floor.",
        &[],
    ),
    (
        "questions",
        "The questions",
        "What each model answers at L0. A question with one answer about 95 % of the images or more is not informative: agreement is \
         given with and without such questions.",
        &[],
    ),
    (
        "models",
        "The models at L0",
        "How far two models agree with each other at L0. Each is compared with itself, so that their agreements can be compared only as far as that.",
        &[],
    ),
    (
        ENHANCERS,
        "Images and enhancement",
        "Enhanced less raw, in percentage points of agreement. At L0 an enhancer is compared with the same image asked again: less \
         agreement there is harm, unless the photographs were taken in the dark.",
        &[],
    ),
    ("answers", "What changes in the dark", "Answers against those at L0, not against the truth.", &[]),
    ("comparisons", "Comparisons", "Each paired by item, in percentage points of agreement.", &[]),
    (
        "health",
        "Parse health",
        "What became of the trials, by the strict parsing. A reply that cannot be read does not agree; failed trials do not count.",
        &[],
    ),
];

/// Draws agreement by level with its floor, and the evidence kept, each with a panel for each variant. Empty if only
/// one level was asked.
///
/// # Errors
/// If a figure cannot be drawn.
fn figures(found: &SelfAgreement<'_>) -> Result<Vec<Figure>> {
    let ladder = Ladder::new(found.whole().map(|cell| (&cell.subject, cell))).with_clean();
    if ladder.levels.len() < 2 {
        return Ok(Vec::new());
    }
    let note = format!(
        "n = {} in {}; bands and bars are 95 % intervals by {unit}; strict parsing",
        counted(found.items(), "item"),
        counted(found.grid.clusters, &found.unit.to_string()),
        unit = found.unit
    );
    let agreement = panels(found, &ladder, |cell| cell.agreement, |panel| panel.extend(floors(found)));
    let evidence = panels(
        found,
        &ladder,
        |cell| match cell.role() {
            // The ceiling is 100 % by definition.
            CellRole::Ceiling => None,
            _ => cell.evidence?.ok(),
        },
        |_| {},
    );
    let charts = [
        (
            "agreement",
            "Agreement of each model with its own answer at L0, not with the truth. L0: the same images asked again, the ceiling. \
             Broken lines: without images, the floor.",
            "agreement in %",
            agreement,
        ),
        (
            "evidence",
            "Evidence kept: the share of the way from the floor to the ceiling. Below 0 and above 100 % the line lies on the edge.",
            "evidence kept in %",
            evidence,
        ),
    ];
    let mut figures = Vec::new();
    for (name, caption, measure, panels) in charts {
        let panels = panels.into_iter().filter(has_points);
        let panels: Vec<Panel> = panels.map(|panel| Panel { y: Scale::Percent(measure), ..panel }).collect();
        if panels.is_empty() {
            continue;
        }
        figures.push(figure(name, caption, &Chart { panels, columns: 2, note: note.clone() })?);
    }
    Ok(figures)
}

/// True if a curve of the panel has a point.
fn has_points(panel: &Panel) -> bool {
    panel.lines.iter().any(|line| matches!(&line.content, LineContent::Curve(points) if !points.is_empty()))
}

/// One panel for each variant, raw or with one enhancer, with a line for each model. `add` adds further lines to a
/// panel.
fn panels(
    found: &SelfAgreement<'_>,
    ladder: &Ladder<'_, AgreementCell>,
    value: impl Fn(&AgreementCell) -> Option<Estimate>,
    add: impl Fn(&mut Vec<PlotLine>),
) -> Vec<Panel> {
    let mut panels: Vec<(String, Vec<PlotLine>)> = Vec::new();
    for (series, cells) in &ladder.series {
        // A series of clean frames alone has one level and makes no line.
        if series.axis().is_none() {
            continue;
        }
        let line = line(found, series, cells, &value);
        let title = series.light(&[]);
        match panels.iter_mut().find(|(known, _)| *known == title) {
            Some((_, lines)) => lines.push(line),
            None => panels.push((title, vec![line])),
        }
    }
    panels
        .into_iter()
        .map(|(title, mut lines)| {
            add(&mut lines);
            let panel = Panel::over_levels("", format!("{title}, n {}", found.items()), lines);
            Panel { x: Scale::Levels { lux: found.set.lux }, ..panel }
        })
        .collect()
}

fn line(
    found: &SelfAgreement<'_>,
    series: &LadderSeries<'_>,
    cells: &SeriesByLevel<'_, AgreementCell>,
    value: impl Fn(&AgreementCell) -> Option<Estimate>,
) -> PlotLine {
    let points: Vec<(AxisLevel, Estimate)> =
        cells.iter().filter_map(|(level, cell)| Some((*level, value(cell)?))).collect();
    PlotLine {
        name: series.model.to_owned(),
        style: style(found, series.model),
        content: LineContent::Curve(points),
        model: Some(series.model.to_owned()),
        items: None,
    }
}

/// Line style of a model, by its index in the report.
fn style(found: &SelfAgreement<'_>, model: &str) -> LineStyle {
    let models = found.models();
    let index = models.iter().position(|known| *known == model);
    LineStyle(index.unwrap_or(models.len()))
}

/// Horizontal line for each model that was asked without images.
fn floors(found: &SelfAgreement<'_>) -> Vec<PlotLine> {
    found
        .whole()
        .filter(|cell| cell.role() == CellRole::Floor)
        .filter_map(|cell| {
            let model = &*cell.subject.model;
            Some(PlotLine {
                name: format!("{model} without images"),
                style: style(found, model),
                content: LineContent::Flat(cell.agreement?.value),
                model: Some(model.to_owned()),
                items: None,
            })
        })
        .collect()
}
