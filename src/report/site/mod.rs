//! Site of many runs, with a leaderboard and a page for each run: [`products`]. It needs no server and no network.
//!
//! HTML page of the leaderboard: [`index`].

mod board;
mod choices;
mod content;
mod open;

use serde::Serialize;

use super::page::STYLE;
use super::template::render;
use crate::json::JsonRows;
use crate::text::table::{self, Table};
use crate::text::terminal::readable;
use board::BoardTable;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::text::counted;

pub use choices::{ModelRunRow, choice_rows};
pub use content::{DATA, GroupDifference, GroupRows, LeaderboardSite, Ranking, SiteGroup};
pub use open::{GroupDigests, OpenRow, PAGES, RunLink, open_rows};

/// Schema of `data.json`.
pub const SCHEMA: &str = "darkqa.site/1";

/// Group in `data.json`.
#[derive(Serialize)]
struct GroupData<'a> {
    kind: &'static str,
    title: &'a str,
    digests: &'a GroupDigests,
    shared: Vec<[&'a str; 2]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    differs: Option<&'a GroupDifference>,
    #[serde(skip_serializing_if = "Option::is_none")]
    ranking: Option<&'a str>,
    rows: JsonRows<'a>,
}

/// Content of `data.json`.
#[derive(Serialize)]
struct SiteData<'a> {
    schema: &'static str,
    version: &'static str,
    runs: Vec<&'a RunLink>,
    groups: Vec<GroupData<'a>>,
}

/// Files of a site by name: the leaderboard, the pages, `data.json`, and the tables as CSV.
///
/// # Errors
/// If a file cannot be made.
pub fn products(site: LeaderboardSite) -> Result<Vec<(String, Vec<u8>)>> {
    let tables: Vec<Table> = site.groups.iter().zip(1..).map(|(group, number)| table(number, group)).collect();
    // Tables of the same name share a file.
    let mut by_name = tables.clone();
    by_name.sort_by_key(|table| table.name);
    let mut files = table::files(&by_name)?;
    let downloads: Vec<String> = files.iter().map(|(name, _)| name.clone()).collect();
    files.push((DATA.to_owned(), data(&site, &tables)?));
    let index = index(&site, &downloads)?;
    files.push(("index.html".to_owned(), index.into_bytes()));
    for (link, page) in site.pages {
        files.push((link.path(), page));
    }
    Ok(files)
}

/// Table of a group with its number on the site.
fn table(number: usize, group: &SiteGroup) -> Table {
    match &group.rows {
        GroupRows::Choices(rows, _) => choices::table(number, &group.digests, rows),
        GroupRows::Open(rows) => open::table(number, &group.digests, rows),
    }
}

/// Contents of `data.json`.
fn data(site: &LeaderboardSite, tables: &[Table]) -> Result<Vec<u8>> {
    let groups = site.groups.iter().zip(tables).map(|(group, table)| {
        let (kind, ranking) = match &group.rows {
            GroupRows::Choices(_, ranking) => ("choices", Some(&*ranking.words)),
            GroupRows::Open(_) => ("openeqa", None),
        };
        GroupData {
            kind,
            title: &group.title,
            digests: &group.digests,
            shared: group.shared.iter().map(|(name, value)| [&**name, &**value]).collect(),
            differs: group.differs.as_ref(),
            ranking,
            rows: JsonRows::new(table),
        }
    });
    let data = SiteData {
        schema: SCHEMA,
        version: env!("CARGO_PKG_VERSION"),
        runs: site.pages.iter().map(|(link, _)| link).collect(),
        groups: groups.collect(),
    };
    let mut text = serde_json::to_vec_pretty(&data).map_err(|e| Error::data(DATA, e))?;
    text.push(b'\n');
    Ok(text)
}

const PAGE: &str = include_str!("index.html");
const OWN_STYLE: &str = include_str!("site.css");

/// Script of the page: the names and theme shared by all pages, then sorting and filtering of the tables.
const SCRIPT: &str = concat!(include_str!("../page/script/base.js"), include_str!("site.js"));

/// Note on tables of open questions: their rows are not ranked.
const NOT_RANKED: &str = "Scores are in %, over the answers that were marked. These rows are not ranked: scores of open answers have no test of one model against another here.";

/// Values of the page template.
#[derive(Serialize)]
struct SitePage<'a> {
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
fn index(site: &LeaderboardSite, downloads: &[String]) -> Result<String> {
    let others = site
        .others
        .iter()
        .map(|(run, why)| ExcludedRun { name: readable(&run.name), link: run.path(), why: readable(why) })
        .collect();
    render(
        PAGE,
        SitePage {
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
