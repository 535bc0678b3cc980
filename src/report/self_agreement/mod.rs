//! Report on questions without true answers: its files ([`products`]), its summary ([`summary`]) and its text
//! ([`text()`]).
//!
//! The measure is agreement with the model's own answer at L0. Reports always give it with its floor, its ceiling and
//! other measures that are needed to interpret it, and never call it accuracy.

mod agreement_report;
mod figures;
mod levels;
mod measure;
mod sections;
mod tables;
mod text;

use serde::Serialize;

use crate::error::Result;
use crate::report::finding_groups::FindingGroups;
use crate::report::json::{Rows, RunsHead, SummaryRuns, document};
use crate::report::page::{PageContent, PageHead, PageInputs, page_of};
use crate::report::products::files;
use crate::report::sentences::Sentence;
use crate::report::short::who_is_judged;
use crate::report::text::alert::Alert;
use crate::report::text::noise_profiles::NoiseProfiles;
use crate::report::text::table::Table;
use crate::runs::report_length::ReportLength;
use crate::types::text::counted;
use darkqa_score::comparisons::self_agreement::SelfAgreement;

pub(crate) use agreement_report::AgreementReport;
pub(crate) use text::text;

use self::measure::{AGREEMENT, HOW_TO_READ};
use crate::types::Truths;

/// Files of a report by name: numbers as CSV, the main tables as LaTeX, figures as SVG, and the HTML page.
///
/// # Errors
/// If a file cannot be made.
pub(crate) fn products<'a>(report: &'a AgreementReport<'a>, inputs: &PageInputs<'a>) -> Result<Vec<(String, Vec<u8>)>> {
    let figures = figures::figures(report.found)?;
    let groups = FindingGroups::new(&report.sentences);
    let content = PageContent {
        who: who_is_judged(&report.found.grid),
        head: (groups.count() > 0).then(|| PageHead::without_images(&groups)),
        intro: intro(report.found),
        alerts: &report.alerts,
        groups,
        how_to_read: HOW_TO_READ.to_owned(),
        tables: &report.tables,
        sections: &sections::SECTIONS,
        grid: &report.found.grid,
        confusions: &report.found.confusions,
        answers_title: "Answers given against those at L0",
        truths: Truths::Unknown,
    };
    let page = page_of(content, &figures, inputs)?;
    files(&report.tables, &report.sentences, figures, page, inputs)
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
    let readings = NoiseProfiles::new(&found.grid.subjects);
    std::iter::once(facts).chain(readings.open_question()).collect()
}

/// Content for a Markdown report.
pub(super) struct MarkdownParts<'a> {
    /// Numbers of models, questions and replies.
    pub(super) head: String,
    pub(super) alerts: &'a [Alert],
    pub(super) sentences: &'a [Sentence],
    pub(super) how_to_read: &'static str,
    pub(super) tables: &'a [Table],
    /// Name of the tables by level.
    pub(super) levels: &'static str,
}

/// Selects the content for a Markdown report.
pub(super) fn markdown_parts<'a>(report: &'a AgreementReport<'_>) -> MarkdownParts<'a> {
    MarkdownParts {
        head: text::head(report),
        alerts: &report.alerts,
        sentences: &report.sentences,
        how_to_read: HOW_TO_READ,
        tables: &report.tables,
        levels: AGREEMENT,
    }
}

/// Head of the summary.
#[derive(Serialize)]
struct Head<'a> {
    #[serde(flatten)]
    runs: RunsHead<'a>,
    measure: &'static str,
    readings: NoiseProfiles,
    alerts: &'a [Alert],
    findings: &'a [Sentence],
    /// Rows of `own_answers.csv`.
    own_answers: Option<Rows<'a>>,
}

/// Serializes the summary of runs as JSON, with the rows of `summary.csv`.
///
/// # Errors
/// If the document cannot be serialized.
pub(crate) fn summary(report: &AgreementReport<'_>, runs: SummaryRuns<'_>, length: ReportLength) -> Result<String> {
    let own_answers = report.tables.iter().find(|table| table.name == tables::OWN_ANSWERS);
    let head = Head {
        runs: runs.head("darkqa.self-agreement/1"),
        measure: AGREEMENT,
        readings: NoiseProfiles::new(&report.found.grid.subjects),
        alerts: &report.alerts,
        findings: &report.sentences,
        own_answers: own_answers.map(Rows::new),
    };
    document(head, &tables::summary(report.found), &report.tables, length)
}
