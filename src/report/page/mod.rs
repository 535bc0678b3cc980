//! The HTML page of questions with choices: [`page`] of an evaluation, [`page_of`] of any content.
//!
//! All numbers and figures are text and SVG, so that the page can be read and printed without scripts. The items, with their
//! thumbnails, are packed data that its script reads. The page needs no network, and its content security policy allows none.

pub(super) mod data;
mod head;
mod inputs;
mod items;
mod run_usage;
mod sample;
mod sections;
mod strip;
mod tables;

pub(crate) use data::shown_thumbnails;
pub(in crate::report) use head::PageHead;
pub use inputs::PageInputs;
pub(crate) use inputs::PageRun;
pub(crate) use run_usage::RunUsage;

use serde::Serialize;
use serde_json::{Value, json};

use crate::drawing::chart::Figure;
use crate::error::Result;
use crate::report::choice_report::ChoiceReport;
use crate::report::finding_groups::{FindingGroup, FindingGroups};
use crate::report::short::{head, who_is_judged};
use crate::report::template::filled;
use crate::sentences::{Sentence, how_to_read};
use crate::tables::{SECTIONS, Section};
use crate::text::alert::Alert;
use crate::text::noise_profiles::NoiseProfiles;
use crate::text::table::Table;
use crate::types::Truths;
use crate::types::flags::spelled_setting;
use crate::types::manifests::RunManifest;
use darkqa_score::answers::confusion::Confusion;
use darkqa_score::grid::Grid;
use darkqa_score::model_in_condition::{ModelInCondition, models_under_test};

/// The template of the page, its style and its script.
const PAGE: &str = include_str!("page.html");
pub(super) const STYLE: &str = include_str!("page.css");
/// Parts shared by pages: names, the theme, and charts that are drawn at the available width.
const CHART_SCRIPT: &str = concat!(
    include_str!("script/base.js"),
    include_str!("script/charts.js")
);
/// The items and their images; the parts of one script.
const SCRIPT: &str = concat!(
    include_str!("script/images.js"),
    include_str!("script/open.js"),
    include_str!("script/items.js")
);

/// The values of the template. They are not converted to JSON first, because a large run has 100,000 cells.
#[derive(Serialize)]
struct Page<'a> {
    /// Class of the body: that of pages on which nothing is known to be right or wrong.
    class: &'static str,
    title: String,
    /// Heading: the title without the names of runs.
    heading: String,
    /// The first screen; `None` of a page without one.
    head: Option<PageHead>,
    /// The noun for families of questions.
    family: &'static str,
    /// Warnings at the top of the page.
    alerts: Vec<&'a str>,
    intro: Vec<String>,
    /// The number of findings; `None` of an experiment that has none.
    findings: Option<usize>,
    groups: Vec<PageGroup<'a>>,
    how_to_read: String,
    /// Heading of the table of answers against answers.
    answers_title: &'static str,
    sections: Vec<sections::PageSection<'a>>,
    runs: Vec<Value>,
    /// The items, as compressed JSON in base64.
    data: String,
    css: &'static str,
    script: String,
}

/// A group of findings, as the template reads it.
#[derive(Serialize)]
struct PageGroup<'a> {
    title: &'static str,
    sentences: Vec<PageSentence<'a>>,
}

/// A finding in words, as the template reads it.
#[derive(Serialize)]
struct PageSentence<'a> {
    class: &'static str,
    sign: char,
    text: &'a str,
    detail: &'a str,
}

impl<'a> PageGroup<'a> {
    fn new(group: &FindingGroup<'a>) -> Self {
        Self {
            title: group.title,
            sentences: group.sentences().map(PageSentence::new).collect(),
        }
    }
}

impl<'a> PageSentence<'a> {
    fn new(sentence: &'a Sentence) -> Self {
        Self {
            class: sentence.tone.class(),
            sign: sentence.tone.sign(),
            text: &sentence.text,
            detail: &sentence.detail,
        }
    }
}

/// The content of a page, besides its figures and the facts of its runs.
pub(crate) struct PageContent<'a> {
    /// The models in words, for the heading.
    pub(crate) who: String,
    /// The first screen; `None` of a page without one.
    pub(in crate::report) head: Option<PageHead>,
    /// Lines about the numbers as a whole.
    pub(crate) intro: Vec<String>,
    pub(crate) alerts: &'a [Alert],
    pub(in crate::report) groups: FindingGroups<'a>,
    pub(crate) how_to_read: String,
    pub(crate) tables: &'a [Table],
    /// The sections in order.
    pub(crate) sections: &'static [Section],
    /// The items and the replies to them.
    pub(crate) grid: &'a Grid<'a>,
    /// Answers against answers, and the heading of their table.
    pub(crate) confusions: &'a [Confusion],
    pub(crate) answers_title: &'static str,
    /// Whether the true answers are known.
    pub(crate) truths: Truths,
}

/// The page of an evaluation as HTML.
///
/// # Errors
/// If the items cannot be written or the template cannot be filled.
pub(crate) fn page<'a>(
    report: &'a ChoiceReport<'a>,
    figures: &[Figure],
    inputs: &PageInputs<'a>,
) -> Result<String> {
    let findings = report.findings;
    let groups = FindingGroups::new(&report.sentences);
    let content = PageContent {
        who: who_is_judged(&findings.grid),
        head: PageHead::new(report, &groups, inputs)?,
        intro: intro(report),
        alerts: &report.alerts,
        groups,
        how_to_read: how_to_read(&report.sentences),
        tables: &report.tables,
        sections: &SECTIONS,
        grid: &findings.grid,
        confusions: &findings.confusions,
        answers_title: "Answers given against true answers",
        truths: Truths::Known,
    };
    page_of(content, figures, inputs)
}

/// A page as HTML.
///
/// # Errors
/// If the items cannot be written or the template cannot be filled.
pub(crate) fn page_of<'a>(
    content: PageContent<'a>,
    figures: &[Figure],
    inputs: &PageInputs<'a>,
) -> Result<String> {
    let sections = content.sections;
    filled(
        PAGE,
        Page {
            class: match content.truths {
                Truths::Known => "",
                Truths::Unknown => "no-truth",
            },
            title: title(&content.who, inputs),
            heading: heading(&content.who, inputs),
            head: content.head,
            family: "family",
            alerts: content.alerts.iter().map(|alert| &*alert.text).collect(),
            findings: Some(content.groups.count()),
            groups: content.groups.all().iter().map(PageGroup::new).collect(),
            how_to_read: content.how_to_read,
            answers_title: content.answers_title,
            intro: [content.intro, Vec::from_iter(sample::words(content.grid))].concat(),
            sections: sections::sections(sections, content.tables, figures, inputs.thumbnails),
            runs: inputs.runs.iter().map(facts).collect(),
            data: items::packed(content.grid, content.confusions, inputs)?,
            css: STYLE,
            script: [CHART_SCRIPT, SCRIPT].concat(),
        },
    )
}

/// The content of the page of open questions, besides its figures.
pub(in crate::report) struct OpenContent<'a> {
    pub(in crate::report) title: String,
    /// The scores in one sentence; `None` without scores at two levels.
    pub(in crate::report) summary: Option<String>,
    pub(in crate::report) intro: Vec<String>,
    pub(in crate::report) alerts: &'a [String],
    pub(in crate::report) tables: &'a [Table],
    pub(in crate::report) sections: &'static [Section],
    /// The names and manifests of the runs.
    pub(in crate::report) runs: &'a [(&'a str, &'a RunManifest)],
    /// The items, as compressed JSON in base64.
    pub(in crate::report) items: String,
}

/// The page of open questions as HTML.
///
/// # Errors
/// If the template cannot be filled.
pub(in crate::report) fn page_of_open_questions(
    content: OpenContent<'_>,
    figures: &[Figure],
) -> Result<String> {
    filled(
        PAGE,
        Page {
            class: "",
            heading: content.title.clone(),
            title: content.title,
            head: content.summary.as_deref().map(PageHead::from_summary),
            family: "category",
            alerts: content.alerts.iter().map(String::as_str).collect(),
            findings: None,
            groups: Vec::new(),
            how_to_read: String::new(),
            answers_title: "",
            intro: content.intro,
            sections: sections::sections(content.sections, content.tables, figures, &[]),
            runs: content
                .runs
                .iter()
                .map(|(name, manifest)| json!({"name": name, "rows": manifest_facts(manifest)}))
                .collect(),
            data: content.items,
            css: STYLE,
            script: [CHART_SCRIPT, SCRIPT].concat(),
        },
    )
}

/// `MODEL in the dark`, or how many runs are compared.
fn heading(who: &str, inputs: &PageInputs<'_>) -> String {
    match &*inputs.runs {
        [_] => format!("{who} in the dark"),
        several => format!("{who} in the dark: {} runs compared", several.len()),
    }
}

/// The heading, with the name of a single run.
fn title(who: &str, inputs: &PageInputs<'_>) -> String {
    let heading = heading(who, inputs);
    match &*inputs.runs {
        [one] => format!("{heading} · {}", one.name),
        _ => heading,
    }
}

fn intro(report: &ChoiceReport<'_>) -> Vec<String> {
    let grid = &report.findings.grid;
    let size = format!("{} (95 %) · strict parsing", head(report));
    let readings = NoiseProfiles::new(&grid.subjects);
    let is_people = |subject: &ModelInCondition| grid.listing.is_people(&subject.model);
    let models = grid.subjects.iter().map(|subject| &*subject.model);
    let judged = models_under_test(models);
    let has_people = grid.subjects.iter().any(is_people);
    let has_models = judged.iter().any(|model| !grid.listing.is_people(model));
    let people = (has_people && has_models)
        .then(|| "The summary and the chart are about models, not about people.".to_owned());
    std::iter::once(size)
        .chain(people)
        .chain(readings.open_question())
        .collect()
}

fn facts(run: &PageRun<'_>) -> Value {
    let manifest = run.manifest;
    let mut rows = about(manifest);
    rows.extend(run.usage.facts());
    rows.extend(run.cost.iter().map(|cost| fact("cost", cost.clone())));
    rows.extend(settings(manifest));
    json!({"name": run.name, "rows": rows})
}

/// The facts of a manifest, as rows of names and values.
fn manifest_facts(manifest: &RunManifest) -> Vec<(String, String)> {
    [about(manifest), settings(manifest)].concat()
}

fn fact(name: &str, value: impl Into<String>) -> (String, String) {
    (name.to_owned(), value.into())
}

fn settings(manifest: &RunManifest) -> Vec<(String, String)> {
    let known = manifest.identity.iter().chain(&manifest.settings);
    manifest
        .platform
        .iter()
        .map(|(name, value)| (name.clone(), value.clone()))
        .chain(known.map(|(name, value)| (spelled_setting(name), setting_text(value))))
        .chain(columns(manifest))
        .collect()
}

/// The settings of each model, enhancer, noise profile and variant, with the camera of a profile by its name.
fn columns(manifest: &RunManifest) -> Vec<(String, String)> {
    let mut rows = Vec::new();
    for (column, values) in &manifest.columns {
        let column = match column.as_str() {
            "reading" => "noise profile",
            other => other,
        };
        for (value, content) in values {
            let fields = content.as_object().into_iter().flatten();
            let set: Vec<String> = fields
                .filter(|(_, value)| !value.is_null())
                .map(|(name, value)| format!("{} {}", spelled_setting(name), setting_text(value)))
                .collect();
            rows.push(fact(&format!("{column} {value}"), set.join(", ")));
        }
    }
    rows
}

/// The value of a setting: a text as it is, a thing with a name by its name.
fn setting_text(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Null => "not set".to_owned(),
        Value::Object(fields) => match fields.get("name") {
            Some(Value::String(name)) => name.clone(),
            _ => value.to_string(),
        },
        other => other.to_string(),
    }
}

fn about(manifest: &RunManifest) -> Vec<(String, String)> {
    vec![
        fact("status", manifest.status.to_string()),
        fact("made by", format!("darkqa-eval {}", manifest.version)),
        fact("created", manifest.created.clone()),
        fact("updated", manifest.updated.clone()),
    ]
}
