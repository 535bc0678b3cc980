//! The one HTML file that people open first: [`page`].
//!
//! All numbers and figures are in it as text and SVG, so that it reads and prints without a script; the items, with their
//! small images, are packed data that its script unfolds. It opens without a network, and its policy allows none.

mod items;
mod sections;
mod shown;
pub(super) mod tables;

pub use shown::PageInputs;
pub(crate) use shown::PageRun;

use serde::Serialize;
use serde_json::{Value, json};

use super::chart::Figure;
use super::table::Table;
use super::template::filled;
use crate::error::Result;
use crate::score::findings::Findings;
use crate::types::Record;
use crate::types::manifest::{RunManifest, Status};

/// The parts of the page.
const PAGE: &str = include_str!("page.html");
pub(super) const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");

/// What the template is filled with. It is no JSON on the way: the cells of a large run are a hundred thousand.
#[derive(Serialize)]
struct Page<'a> {
    title: String,
    /// What must be read before any number.
    alerts: Vec<String>,
    intro: Vec<String>,
    sections: Vec<sections::PageSection<'a>>,
    runs: Vec<Value>,
    /// The items, packed.
    data: String,
    css: &'static str,
    script: &'static str,
}

/// The page.
///
/// # Errors
/// Where a figure cannot be drawn.
pub(crate) fn page<'a>(
    findings: &'a Findings<'a>,
    tables: &[Table],
    figures: &[Figure],
    shown: &PageInputs<'a>,
) -> Result<String> {
    filled(
        PAGE,
        Page {
            title: title(shown),
            alerts: alerts(shown),
            intro: intro(findings),
            sections: sections::sections(tables, figures, shown.thumbnails),
            runs: shown.runs.iter().map(facts).collect(),
            data: items::packed(findings, shown)?,
            css: STYLE,
            script: SCRIPT,
        },
    )
}

fn title(shown: &PageInputs<'_>) -> String {
    match &*shown.runs {
        [one] => format!("Seeing in the dark: {}", one.name),
        several => format!("Seeing in the dark: {} runs compared", several.len()),
    }
}

/// What must be read before any number: which run is not whole.
fn alerts(shown: &PageInputs<'_>) -> Vec<String> {
    let broken = shown
        .runs
        .iter()
        .filter(|run| run.manifest.status != Status::Complete || run.manifest.counts.failed > 0);
    let told = broken.map(|run| {
        let (status, counts) = (run.manifest.status, run.manifest.counts);
        format!(
            "{}: {status}; {} of {} trials answered, {} failed. Failed trials are not scored; the same command asks them again.",
            run.name, counts.answered, counts.trials, counts.failed
        )
    });
    told.collect()
}

fn intro(findings: &Findings<'_>) -> Vec<String> {
    let (grid, unit) = (&findings.grid, findings.unit);
    let frames: std::collections::BTreeSet<_> = grid
        .items
        .iter()
        .map(|item| &item.record.detail.frame)
        .collect();
    vec![format!(
        "{} items about {} frames, {} subjects (model × condition). Strict reading. Intervals are 95 %, by {unit} \
         ({} clusters); differences are paired by item, tested by swapping whole {unit}s, and corrected by Holm over the comparisons of one kind and model; \
         “tied” says that nothing is shown, not that there is nothing.",
        grid.items.len(),
        frames.len(),
        grid.subjects.len(),
        grid.clusters
    )]
}

fn facts(run: &PageRun<'_>) -> Value {
    let manifest = run.manifest;
    let mut rows = about(manifest);
    rows.extend(spent(run.records));
    rows.extend(run.cost.iter().map(|cost| fact("cost", cost.clone())));
    rows.extend(settings(manifest));
    json!({"name": run.name, "rows": rows})
}

/// What a manifest says, as rows of names and values.
pub(super) fn manifest_facts(manifest: &RunManifest) -> Vec<(String, String)> {
    [about(manifest), settings(manifest)].concat()
}

fn fact(name: &str, value: impl Into<String>) -> (String, String) {
    (name.to_owned(), value.into())
}

fn settings(manifest: &RunManifest) -> Vec<(String, String)> {
    let texts = |map: &std::collections::BTreeMap<String, serde_json::Value>| {
        let rows = map.iter().map(|(name, value)| match value {
            serde_json::Value::String(text) => (name.clone(), text.clone()),
            other => (name.clone(), other.to_string()),
        });
        rows.collect::<Vec<_>>()
    };
    let platform = manifest.platform.iter();
    let platform = platform.map(|(name, value)| (name.clone(), value.clone()));
    platform
        .chain(texts(&manifest.identity))
        .chain(texts(&manifest.settings))
        .collect()
}

fn about(manifest: &RunManifest) -> Vec<(String, String)> {
    vec![
        fact("status", manifest.status.to_string()),
        fact("made by", format!("darkqa-eval {}", manifest.version)),
        fact("created", manifest.created.clone()),
        fact("updated", manifest.updated.clone()),
    ]
}

/// What the replies took: requests, tokens, bytes, time, and who answered.
fn spent(records: &[Record]) -> Vec<(String, String)> {
    let requests: u64 = records
        .iter()
        .map(|record| u64::from(record.attempts))
        .sum();
    let tokens = |of: fn(&crate::types::Usage) -> Option<u64>| -> u64 {
        let usages = records.iter().filter_map(|record| record.usage.as_ref());
        usages.filter_map(of).sum()
    };
    let bytes: u64 = records
        .iter()
        .filter_map(|record| record.detail.image.as_ref())
        .map(|image| image.bytes as u64)
        .sum();
    let mut waits: Vec<u64> = records
        .iter()
        .filter_map(|record| record.latency_ms)
        .collect();
    waits.sort_unstable();
    let served: std::collections::BTreeSet<&str> = records
        .iter()
        .filter_map(|record| record.served_model.as_deref())
        .collect();
    let at = |share: f64| {
        let last = waits.len().saturating_sub(1) as f64;
        waits
            .get((last * share).round() as usize)
            .map_or("–".to_owned(), |ms| format!("{ms} ms"))
    };
    vec![
        fact(
            "requests",
            format!("{requests} for {} trials", records.len()),
        ),
        fact(
            "tokens",
            format!(
                "{} of prompts, {} of replies",
                tokens(|usage| usage.prompt_tokens),
                tokens(|usage| usage.completion_tokens)
            ),
        ),
        fact("image bytes", format!("{bytes}")),
        fact(
            "latency",
            format!("median {}, 95 % within {}", at(0.5), at(0.95)),
        ),
        fact(
            "served as",
            served.into_iter().collect::<Vec<_>>().join(", "),
        ),
    ]
}
