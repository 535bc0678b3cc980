//! The report on accuracy in multiple-choice questions: [`Report::from_findings`].

use std::collections::BTreeMap;

use serde::Serialize;

use crate::charts::chart::Figure;
use crate::charts::figures::{DisplayNames, figure_specs};
use crate::charts::paper::figure;
use crate::charts::views;
use crate::content::{Measure, PageParts, Report};
use crate::finding_groups::FindingGroups;
use crate::json::{JsonRows, RunsHead, SummaryRuns, document};
use crate::page::{PageHead, PageInputs, items_note, packed_items};
use crate::sentences::{Sentence, how_to_read, sentences};
use crate::short::{facts, short_table, who_is_judged};
use crate::tables::{
    BASELINE, LEVELS, SECTIONS, enhancer_effects, observer_notes, strict_groups, summary_rows, tables, with_training,
};
use crate::text::alert::{Alert, AlertKind};
use crate::text::table::Table;
use crate::text::words::ProfileNames;
use darkqa_base::error::Result;
use darkqa_base::types::UnreadReason;
use darkqa_runs::outcome::ReportLength;
use darkqa_score::comparisons::PooledFinding;
use darkqa_score::findings::Findings;
use darkqa_score::model_in_condition::models_under_test;

impl<'a> Report<'a> {
    /// The report on the accuracy of models. Notes about the observer follow `alerts`.
    #[must_use]
    pub fn from_findings(findings: &'a Findings<'a>, alerts: Vec<Alert>) -> Self {
        let shown = findings.shown();
        let notes = observer_notes(&findings.observer).into_iter().map(|note| Alert::new(AlertKind::Observer, note));
        let sentences = sentences(shown);
        Self {
            measure: Box::new(Accuracy { findings: shown, with_observer: findings }),
            facts: facts(shown),
            alerts: alerts.into_iter().chain(notes).collect(),
            how_to_read: how_to_read(&sentences),
            sentences,
            tables: with_training(tables(findings), &findings.grid.listing),
        }
    }
}

/// Share of right answers.
struct Accuracy<'a> {
    /// Findings without a hidden observer.
    findings: &'a Findings<'a>,
    /// Findings with the observer, for the files.
    with_observer: &'a Findings<'a>,
}

/// Head of the summary.
#[derive(Serialize)]
struct SummaryHead<'a> {
    #[serde(flatten)]
    runs: RunsHead<'a>,
    /// Noise profiles of the noisy images.
    readings: ProfileNames,
    unread: &'a BTreeMap<UnreadReason, usize>,
    alerts: &'a [Alert],
    findings: &'a [Sentence],
    /// Rows of `groups.csv`, without the observer if the report hides it; omitted if empty.
    #[serde(skip_serializing_if = "Option::is_none")]
    groups: Option<JsonRows<'a>>,
    /// Rows of `baseline.csv`; omitted if the report has no such table.
    #[serde(skip_serializing_if = "Option::is_none")]
    baseline: Option<JsonRows<'a>>,
}

impl Measure for Accuracy<'_> {
    fn figures(&self) -> Result<Vec<Figure>> {
        figure_specs(self.findings, &DisplayNames::default())
            .into_iter()
            .chain(views::figure_specs(self.findings))
            .map(|spec| figure(spec.name, &spec.caption, &spec.chart))
            .collect()
    }

    fn page_parts<'p>(&'p self, report: &'p Report<'_>, inputs: &'p PageInputs<'_>) -> Result<PageParts<'p>> {
        let grid = &self.findings.grid;
        let models = grid.subjects.iter().map(|subject| &*subject.model);
        let has_people = models.clone().any(|model| grid.listing.is_people(model));
        let has_models = models_under_test(models).iter().any(|model| !grid.listing.is_people(model));
        let people = (has_people && has_models)
            .then(|| "The summary and the chart are about models, not about people.".to_owned());
        let size = format!("{} (95 %) · strict parsing", report.head());
        Ok(PageParts {
            head: PageHead::new(self.findings, &FindingGroups::new(&report.sentences), inputs)?,
            intro: std::iter::once(size).chain(people).chain(self.profiles().open_question()).collect(),
            notes: items_note(grid).into_iter().collect(),
            answers_title: "Answers given against true answers",
            items: packed_items(grid, &self.findings.confusions, inputs)?,
            ..PageParts::in_the_dark(&who_is_judged(grid), &SECTIONS, inputs)
        })
    }

    fn json(&self, report: &Report<'_>, runs: SummaryRuns<'_>, length: ReportLength) -> Result<String> {
        let groups = strict_groups(self.findings);
        let head = SummaryHead {
            runs: runs.head("darkqa.summary/1"),
            readings: self.profiles(),
            unread: &self.findings.summary.unread,
            alerts: &report.alerts,
            findings: &report.sentences,
            groups: (!groups.is_empty()).then_some(JsonRows(&groups)),
            baseline: report.tables.iter().find(|table| table.name == BASELINE).map(JsonRows::new),
        };
        let rows = summary_rows(&self.findings.summary, &self.findings.grid.listing);
        document(head, &rows, &report.tables, length)
    }

    fn short_tables(&self, _: &Report<'_>) -> String {
        short_table(self.findings)
    }

    fn short_markdown_tables<'t>(&self, tables: &'t [Table]) -> Vec<&'t Table> {
        let mut levels: Vec<&Table> =
            tables.iter().filter(|table| table.name == LEVELS && !table.rows.is_empty()).collect();
        if self.findings.common.is_some() && levels.len() > 1 {
            // Models that were asked different questions are compared on the questions that they share.
            levels.retain(|table| table.caption.contains("all models"));
        }
        levels
    }

    fn profiles(&self) -> ProfileNames {
        ProfileNames::new(&self.findings.grid.subjects)
    }

    fn enhancer_effects(&self) -> Vec<&PooledFinding> {
        enhancer_effects(self.findings)
    }

    fn first_failures(&self) -> Option<&Findings<'_>> {
        Some(self.with_observer).filter(|findings| !findings.first_failures.is_empty())
    }
}
