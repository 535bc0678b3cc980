//! HTML page of the leaderboard: [`index`].

use serde::Serialize;

use super::board::BoardTable;
use super::content::{DATA, GroupRows, Site, SiteGroup};
use super::{choices, open};
use crate::error::Result;
use crate::report::page::STYLE;
use crate::report::template::render;
use crate::report::text::readable::readable;
use crate::types::text::counted;

const PAGE: &str = include_str!("index.html");
const OWN_STYLE: &str = include_str!("site.css");
/// Script of the page: the names and theme shared by all pages, then sorting and filtering of the tables.
const SCRIPT: &str = concat!(include_str!("../page/script/base.js"), include_str!("site.js"));

/// Note on tables of open questions: their rows are not ranked.
const NOT_RANKED: &str = "Scores are in %, over the answers that were marked. These rows are not ranked: scores of open answers have no test of one model against another here.";

/// Values of the page template.
#[derive(Serialize)]
struct Page<'a> {
    groups: Vec<PageTable<'a>>,
    others: Vec<ExcludedRun>,
    downloads: &'a [String],
    data: &'static str,
    facts: String,
    version: &'static str,
    css: String,
    script: &'static str,
}

/// Table of comparable runs for the template.
#[derive(Serialize)]
struct PageTable<'a> {
    id: usize,
    kind: &'static str,
    title: String,
    ranking: &'a str,
    /// First characters of the digests of questions, light and prompts.
    digests: String,
    /// Number of the table compared with, and the differences; `None` for the first table of its kind.
    differs: Option<(usize, Vec<String>)>,
    shared: Vec<[String; 2]>,
    table: BoardTable,
}

/// A run without a table, and the reason.
#[derive(Serialize)]
struct ExcludedRun {
    name: String,
    link: String,
    why: String,
}

/// Renders the leaderboard page.
///
/// # Errors
/// If the template cannot be rendered.
pub(super) fn index(site: &Site, downloads: &[String]) -> Result<String> {
    let others = site
        .others
        .iter()
        .map(|(run, why)| ExcludedRun { name: readable(&run.name), link: run.path(), why: readable(why) })
        .collect();
    render(
        PAGE,
        Page {
            facts: format!("{} in {}", counted(site.pages.len(), "run"), counted(site.groups.len(), "table")),
            groups: site.groups.iter().zip(1..).map(|(group, id)| page_table(group, id)).collect(),
            others,
            downloads,
            data: DATA,
            version: env!("CARGO_PKG_VERSION"),
            css: [STYLE, OWN_STYLE].concat(),
            script: SCRIPT,
        },
    )
}

fn page_table(group: &SiteGroup, id: usize) -> PageTable<'_> {
    let (kind, table, ranking) = match &group.rows {
        GroupRows::Choices(rows, ranking) => ("ranked", choices::board(rows), &*ranking.words),
        GroupRows::Open(rows) => ("unranked", open::board(rows), NOT_RANKED),
    };
    PageTable {
        id,
        kind,
        title: readable(&group.title),
        ranking,
        digests: digests(group),
        differs: group.differs.as_ref().map(|differs| {
            let lines = differs.lines.iter().map(|line| readable(line)).collect();
            (differs.from, lines)
        }),
        shared: group.shared.iter().map(|(name, value)| [readable(name), readable(value)]).collect(),
        table,
    }
}

/// First 8 characters of each digest of a group, on one line.
fn digests(group: &SiteGroup) -> String {
    let digests = &group.digests;
    let named = [("questions", &digests.questions), ("light", &digests.light), ("prompts", &digests.prompts)];
    named
        .iter()
        .filter(|(_, digest)| !digest.is_empty())
        .map(|(name, digest)| {
            let prefix: String = digest.chars().take(8).collect();
            format!("{name} {}", readable(&prefix))
        })
        .collect::<Vec<_>>()
        .join(" · ")
}
