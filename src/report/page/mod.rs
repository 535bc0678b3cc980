//! HTML page of a report: [`page`], made of the report and the parts that depend on its measure ([`PageParts`](crate::content::PageParts)).
//!
//! Numbers and figures are text and SVG, so that the page can be read and printed without scripts. The items and their
//! thumbnails are packed data, which a script displays. The page needs no network, and its content security policy
//! allows none.
//!
//! Sections of the page before the items: [`page_sections`].
//!
//! Tables of the page: [`page_tables`].

pub(super) mod data;
mod head;
mod items;
mod prompts;
mod run_usage;

use serde::Serialize;
use serde_json::{Value, json};

use super::tables::{ACCURACY, ENHANCERS};
use crate::charts::chart::Figure;
use crate::charts::samples::{SampleTable, samples_of};
use crate::content::Report;
use crate::finding_groups::{FindingGroup, FindingGroups};
use crate::sentences::Sentence;
use crate::tables::Section;
use crate::template::render;
use crate::text::alert::{Alert, AlertKind};
use crate::text::table::{ColumnKind, Table, TableCell, TableFormat, TableRow};
use crate::text::words::{ends, interval, words};
use darkqa_base::error::Result;
use darkqa_base::types::Thumbnail;
use darkqa_base::types::flags::setting_spelling;
use darkqa_base::types::manifests::RunManifest;
use darkqa_score::estimate::Estimate;
use darkqa_score::significance::Verdict;

pub use data::fitting_thumbnails;
pub use head::PageHead;
pub use items::{note as items_note, packed as packed_items};
pub use prompts::RunPrompts;
pub use run_usage::{PageInputs, PageRun, RunUsage};

/// Template of the page.
const PAGE: &str = include_str!("page.html");

/// CSS of the page.
pub(super) const STYLE: &str = include_str!("page.css");

/// Script of names, theme, and charts that are drawn at the available width.
const CHART_SCRIPT: &str = concat!(include_str!("script/base.js"), include_str!("script/charts.js"));

/// Script of the items and their images.
const SCRIPT: &str = concat!(
    include_str!("script/images.js"),
    include_str!("script/open.js"),
    include_str!("script/filters.js"),
    include_str!("script/items.js")
);

/// Values of the template. They are not converted to JSON first, because a large run has 100,000 cells.
#[derive(Serialize)]
struct Page<'a> {
    /// CSS class of the body; pages without true answers have one.
    class: &'static str,
    title: String,
    /// Title without the names of runs.
    heading: String,
    /// First screen; `None` for a page without one.
    head: Option<PageHead>,
    /// Noun for families of questions.
    family: &'static str,
    /// Warnings at the top of the page.
    alerts: Vec<&'a str>,
    intro: Vec<String>,
    /// Number of findings; `None` for a kind of report without findings.
    findings: Option<usize>,
    groups: Vec<PageGroup<'a>>,
    how_to_read: &'a str,
    /// Heading of the confusion matrix.
    answers_title: &'static str,
    sections: Vec<PageSection<'a>>,
    runs: Vec<Value>,
    /// Items as compressed JSON in base64.
    data: String,
    css: &'static str,
    script: String,
}

/// Group of findings for the template.
#[derive(Serialize)]
struct PageGroup<'a> {
    title: &'static str,
    sentences: Vec<PageSentence<'a>>,
}

/// Sentence of a finding for the template.
#[derive(Serialize)]
struct PageSentence<'a> {
    class: &'static str,
    sign: char,
    text: &'a str,
    detail: &'a str,
}

impl<'a> PageGroup<'a> {
    fn new(group: &FindingGroup<'a>) -> Self {
        Self { title: group.title, sentences: group.sentences().map(PageSentence::new).collect() }
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

/// Renders the page of a report.
///
/// # Errors
/// If the items cannot be serialized or the template cannot be rendered.
pub fn page(report: &Report<'_>, figures: &[Figure], inputs: &PageInputs<'_>) -> Result<String> {
    let parts = report.measure.page_parts(report, inputs)?;
    let groups = FindingGroups::new(&report.sentences);
    // A property of the noise profile holds for every run with it: a line of the introduction, no warning.
    let (notes, warnings): (Vec<&Alert>, Vec<&Alert>) =
        report.alerts.iter().partition(|alert| alert.kind == AlertKind::Noise);
    let notes = notes.into_iter().map(|note| note.text.clone());
    render(
        PAGE,
        Page {
            class: parts.class,
            title: parts.title,
            heading: parts.heading,
            head: parts.head,
            family: parts.family,
            alerts: warnings.iter().map(|alert| &*alert.text).collect(),
            findings: report.measure.has_findings().then_some(groups.count()),
            groups: groups.all().iter().map(PageGroup::new).collect(),
            how_to_read: &report.how_to_read,
            answers_title: parts.answers_title,
            intro: parts.intro.into_iter().chain(notes).chain(parts.notes).collect(),
            sections: page_sections(parts.sections, &report.tables, figures, inputs.thumbnails),
            runs: inputs.runs.iter().map(run_facts).collect(),
            data: parts.items,
            css: STYLE,
            script: [CHART_SCRIPT, SCRIPT].concat(),
        },
    )
}

/// Facts about a run, as JSON for the template.
fn run_facts(run: &PageRun<'_>) -> Value {
    let manifest = run.manifest;
    let mut rows = status_facts(manifest);
    rows.extend(run.usage.iter().flat_map(RunUsage::facts));
    rows.extend(run.cost.iter().map(|cost| fact("cost", cost.clone())));
    rows.extend(manifest.enhancers.iter().flat_map(|(name, note)| {
        note.latency.iter().map(move |latency| fact(&format!("latency of {name}"), latency.to_string()))
    }));
    rows.extend(setting_facts(manifest));
    json!({"name": run.name, "rows": rows})
}

fn fact(name: &str, value: impl Into<String>) -> (String, String) {
    (name.to_owned(), value.into())
}

/// Platform and settings of a run: names and values.
fn setting_facts(manifest: &RunManifest) -> Vec<(String, String)> {
    let platform = manifest.platform.iter().map(|(name, value)| (name.clone(), value.clone()));
    let settings = manifest
        .identity
        .iter()
        .chain(&manifest.settings)
        .map(|(name, value)| (setting_spelling(name), setting_text(value)));
    platform.chain(settings).chain(column_facts(manifest)).collect()
}

/// Settings of each model, enhancer, noise profile and variant. The camera of a profile is given by its name.
fn column_facts(manifest: &RunManifest) -> Vec<(String, String)> {
    let mut rows = Vec::new();
    for (column, values) in &manifest.columns {
        let column = match column.as_str() {
            "reading" => "noise profile",
            other => other,
        };
        for (value, content) in values {
            let settings: Vec<String> = content
                .as_object()
                .into_iter()
                .flatten()
                .filter(|(_, value)| !value.is_null())
                .map(|(name, value)| format!("{} {}", setting_spelling(name), setting_text(value)))
                .collect();
            rows.push(fact(&format!("{column} {value}"), settings.join(", ")));
        }
    }
    rows
}

/// Text for the value of a setting, as a person writes it: the values of a list with commas, and the fields of an object
/// with commas after its name. The camera of a profile, an object outside a list, is given by its name alone.
fn setting_text(value: &Value) -> String {
    let named = |fields: &serde_json::Map<String, Value>| fields.get("name").and_then(Value::as_str).map(str::to_owned);
    match value {
        Value::String(text) => text.clone(),
        Value::Null => "not set".to_owned(),
        Value::Object(fields) => named(fields).unwrap_or_else(|| field_texts(fields)),
        Value::Array(values) if values.is_empty() => "none".to_owned(),
        Value::Array(values) => {
            let texts = values.iter().map(|value| match value {
                Value::Object(fields) => match named(fields) {
                    Some(name) => format!("{name}: {}", field_texts(fields)),
                    None => field_texts(fields),
                },
                other => setting_text(other),
            });
            let separator = if values.iter().any(Value::is_object) { "; " } else { ", " };
            texts.collect::<Vec<String>>().join(separator)
        }
        Value::Number(number) => {
            number.as_f64().filter(|_| number.is_f64()).map_or(number.to_string(), |n| n.to_string())
        }
        other @ Value::Bool(_) => other.to_string(),
    }
}

/// The fields of an object but its name, each with its value; unset ones are left out.
fn field_texts(fields: &serde_json::Map<String, Value>) -> String {
    let texts =
        fields.iter().filter(|(field, value)| *field != "name" && !value.is_null()).map(|(field, value)| match value {
            Value::Object(_) => format!("{} ({})", field.replace('_', " "), setting_text(value)),
            value => format!("{} {}", field.replace('_', " "), setting_text(value)),
        });
    texts.collect::<Vec<String>>().join(", ")
}

/// Status, version and dates of a run: names and values.
fn status_facts(manifest: &RunManifest) -> Vec<(String, String)> {
    vec![
        fact("status", manifest.status.to_string()),
        fact("made by", format!("darkqa-eval {}", manifest.version)),
        fact("created", manifest.created.clone()),
        fact("updated", manifest.updated.clone()),
    ]
}

/// Section for the template.
#[derive(Serialize)]
pub(super) struct PageSection<'a> {
    id: &'static str,
    title: &'static str,
    note: &'static str,
    figures: Vec<&'a Figure>,
    samples: Vec<SampleTable>,
    tables: Vec<PageTable<'a>>,
}

/// Sections that have a table, a figure or samples.
fn page_sections<'a>(
    sections: &[Section],
    tables: &'a [Table],
    figures: &'a [Figure],
    thumbnails: &[Thumbnail],
) -> Vec<PageSection<'a>> {
    // Without an enhancer, the images are those of the accuracies.
    let has_enhanced = thumbnails.iter().any(|thumbnail| thumbnail.condition.enhancer.is_some());
    let is_of_accuracy = !has_enhanced && sections.iter().any(|section| section.0 == ACCURACY);
    let section_of_samples = if is_of_accuracy { ACCURACY } else { ENHANCERS };
    sections
        .iter()
        .filter_map(|&(id, title, note, figure_names)| {
            let figures: Vec<&Figure> = figures.iter().filter(|figure| figure_names.contains(&figure.name)).collect();
            let samples = if id == section_of_samples { samples_of(thumbnails) } else { Vec::new() };
            let tables = page_tables(tables, id);
            let has_content = !tables.is_empty() || !figures.is_empty() || !samples.is_empty();
            has_content.then_some(PageSection { id, title, note, figures, samples, tables })
        })
        .collect()
}

/// Maximum number of rows of a table that is not folded.
const MAX_OPEN_ROWS: usize = 60;

/// Minimum number of rows without a detected effect that are folded (chosen); fewer stay visible.
const MIN_FOLDED_ROWS: usize = 3;

/// Table for the template.
#[derive(Serialize)]
pub struct PageTable<'a> {
    caption: &'a str,
    /// True if the table is closed until the reader opens it.
    folded: bool,
    /// Line below the table; `None` without one.
    foot: Option<&'a str>,
    head: Vec<&'a str>,
    rows: Vec<PageRow<'a>>,
    /// Rows of tests without a detected effect, closed until the reader opens them; `None` without any.
    unshown: Option<FoldedRows<'a>>,
}

/// Rows of tests without a detected effect.
#[derive(Serialize)]
struct FoldedRows<'a> {
    /// Number of rows, and the largest effect among them.
    summary: String,
    rows: Vec<PageRow<'a>>,
}

#[derive(Serialize)]
struct PageRow<'a> {
    /// Heading above the row; `None` without one.
    heading: Option<&'a str>,
    cells: Vec<PageCell>,
}

#[derive(Serialize)]
struct PageCell {
    text: String,
    /// Both ends of the interval, shown below the text; empty without an interval.
    ends: String,
    class: &'static str,
}

/// Tables of a section that have rows.
fn page_tables<'a>(tables: &'a [Table], section: &str) -> Vec<PageTable<'a>> {
    tables
        .iter()
        .filter(|table| table.section == section)
        .map(|table| {
            let (mut folded, mut visible): (Vec<&TableRow>, Vec<&TableRow>) =
                table.rows_in(TableFormat::Page).partition(|row| is_undetected(row));
            if folded.len() < MIN_FOLDED_ROWS {
                folded.clear();
                visible = table.rows_in(TableFormat::Page).collect();
            }
            let rows = page_rows(table, &visible);
            PageTable {
                caption: &table.caption,
                folded: table.is_folded || rows.len() > MAX_OPEN_ROWS,
                unshown: (!folded.is_empty())
                    .then(|| FoldedRows { summary: summary(table, &folded), rows: page_rows(table, &folded) }),
                foot: table.foot.as_deref(),
                head: table
                    .columns
                    .iter()
                    .filter_map(|column| column.heads.page.as_deref())
                    // Columns of verdicts have no head; screen readers need one.
                    .map(|head| if head.is_empty() { "verdict" } else { head })
                    .collect(),
                rows,
            }
        })
        .filter(|table| !table.rows.is_empty() || table.unshown.is_some())
        .collect()
}

/// True for the row of a test that detected no effect.
fn is_undetected(row: &TableRow) -> bool {
    row.cells.iter().any(|cell| match cell {
        TableCell::Verdict(verdict) => !verdict.is_shown(),
        _ => false,
    })
}

/// Rows for the template, with a heading where the group changes.
fn page_rows<'a>(table: &'a Table, rows: &[&'a TableRow]) -> Vec<PageRow<'a>> {
    let mut last_group: Option<&str> = None;
    rows.iter()
        .map(|row| {
            let group = row.group.as_deref();
            let heading = (group != last_group).then(|| group.unwrap_or_default());
            last_group = group;
            PageRow {
                heading,
                cells: table
                    .cells(row)
                    .filter(|(column, _)| column.heads.page.is_some())
                    .map(|(column, cell)| page_cell(column.kind, cell))
                    .collect(),
            }
        })
        .collect()
}

/// First difference in a row, with its text.
fn difference(table: &Table, row: &TableRow) -> Option<(Estimate, String)> {
    table.cells(row).find_map(|(column, cell)| match (column.kind, cell) {
        (ColumnKind::Points, TableCell::Estimate(difference)) => Some((*difference, words(column.kind, cell))),
        _ => None,
    })
}

/// Number of rows without a detected effect, and the largest difference among them with the names in its row.
fn summary(table: &Table, rows: &[&TableRow]) -> String {
    let count = match rows.len() {
        1 => "1 row in which nothing is shown".to_owned(),
        count => format!("{count} rows in which nothing is shown"),
    };
    let largest = rows
        .iter()
        .filter_map(|row| Some((row, difference(table, row)?)))
        .max_by(|(_, (a, _)), (_, (b, _))| a.value.abs().total_cmp(&b.value.abs()));
    let Some((row, (_, text))) = largest else {
        return count;
    };
    let names: Vec<String> = table
        .cells(row)
        .filter(|(column, _)| column.heads.page.is_some())
        .map_while(|(column, cell)| match (column.kind, cell) {
            (ColumnKind::Text, cell) => Some(words(column.kind, cell)),
            _ => None,
        })
        .filter(|name| !name.is_empty())
        .collect();
    format!("{count}; the largest difference is {text} ({})", names.join(", "))
}

/// Cell for the template.
fn page_cell(kind: ColumnKind, cell: &TableCell) -> PageCell {
    let class = match (kind, cell) {
        (_, TableCell::Below(_)) => "below",
        (_, TableCell::Verdict(Verdict::Better)) => "better",
        (_, TableCell::Verdict(Verdict::Worse)) | (ColumnKind::Failures, TableCell::Count(1..)) => "worse",
        (_, TableCell::Verdict(_)) => "unshown",
        (ColumnKind::Text, _) => "text",
        _ => "",
    };
    PageCell { text: words(kind, cell), ends: interval(kind, cell).map(ends).unwrap_or_default(), class }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_are_written_without_signs_of_json() {
        for (value, text) in [
            (json!([1, 2]), "1, 2"),
            (json!([]), "none"),
            (json!({"random": 0}), "random 0"),
            (json!(200.0), "200"),
            (json!(0.7), "0.7"),
            (json!(true), "true"),
            (json!(null), "not set"),
            (json!({"name": "eld-canon", "gain": [1, 2]}), "eld-canon"),
            (
                json!([{"name": "m", "endpoints": ["http://127.0.0.1/v1"], "pace": {"rpm": null, "max-wait": 120.0}, "headers": []}]),
                "m: endpoints http://127.0.0.1/v1, headers none, pace (max-wait 120)",
            ),
        ] {
            assert_eq!(setting_text(&value), text);
        }
    }
}
