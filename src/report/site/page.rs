//! The leaderboard as HTML: [`index`].

use serde::Serialize;

use super::board::BoardTable;
use super::content::{DATA, GroupRows, Site, SiteGroup};
use super::{choices, open};
use crate::error::Result;
use crate::report::page::STYLE;
use crate::report::template::filled;
use crate::text::readable::readable;

const PAGE: &str = include_str!("index.html");
const OWN_STYLE: &str = include_str!("site.css");
/// The names and the theme that all pages share, and what sorts and filters the tables.
const SCRIPT: &str = concat!(
    include_str!("../page/script/base.js"),
    include_str!("site.js")
);

/// The reason why open questions are not ranked.
const NOT_RANKED: &str = "Scores are in %, over the answers that were marked. These rows are not ranked: scores of open answers have no test of one model against another here.";

#[derive(Serialize)]
struct Page<'a> {
    groups: Vec<PageGroup<'a>>,
    others: Vec<PageOther>,
    downloads: &'a [String],
    data: &'static str,
    facts: String,
    version: &'static str,
    css: String,
    script: &'static str,
}

/// A group as the template reads it.
#[derive(Serialize)]
struct PageGroup<'a> {
    id: usize,
    kind: &'static str,
    title: String,
    ranking: &'a str,
    /// The first letters of the digests of questions, light and prompts.
    digests: String,
    /// The number of the other table and what differs; `None` for the first of its kind.
    differs: Option<(usize, Vec<String>)>,
    shared: Vec<[String; 2]>,
    table: BoardTable,
}

/// A run that stands in no table.
#[derive(Serialize)]
struct PageOther {
    name: String,
    link: String,
    why: String,
}

/// The page.
///
/// # Errors
/// If the template cannot be filled.
pub(super) fn index(site: &Site, downloads: &[String]) -> Result<String> {
    let groups = site.groups.iter().zip(1..);
    let others = site.others.iter().map(|(run, why)| PageOther {
        name: readable(&run.name),
        link: run.path(),
        why: readable(why),
    });
    let counted = |number: usize, noun: &str| crate::text::words::counted(number, noun);
    filled(
        PAGE,
        Page {
            facts: format!(
                "{} in {}",
                counted(site.pages.len(), "run"),
                counted(site.groups.len(), "table")
            ),
            groups: groups.map(|(group, id)| page_group(group, id)).collect(),
            others: others.collect(),
            downloads,
            data: DATA,
            version: env!("CARGO_PKG_VERSION"),
            css: [STYLE, OWN_STYLE].concat(),
            script: SCRIPT,
        },
    )
}

fn page_group(group: &SiteGroup, id: usize) -> PageGroup<'_> {
    let (kind, table, ranking) = match &group.rows {
        GroupRows::Choices(rows, ranking) => ("ranked", choices::board(rows), &*ranking.words),
        GroupRows::Open(rows) => ("unranked", open::board(rows), NOT_RANKED),
    };
    let shared = group.shared.iter();
    PageGroup {
        id,
        kind,
        title: readable(&group.title),
        ranking,
        digests: digests(group),
        differs: group.differs.as_ref().map(|differs| {
            let lines = differs.lines.iter().map(|line| readable(line));
            (differs.from, lines.collect())
        }),
        shared: shared
            .map(|(name, value)| [readable(name), readable(value)])
            .collect(),
        table,
    }
}

/// The digests of a group in a line.
fn digests(group: &SiteGroup) -> String {
    let digests = &group.digests;
    let named = [
        ("questions", &digests.questions),
        ("light", &digests.light),
        ("prompts", &digests.prompts),
    ];
    named
        .iter()
        .filter(|(_, digest)| !digest.is_empty())
        .map(|(name, digest)| {
            let first: String = digest.chars().take(8).collect();
            format!("{name} {}", readable(&first))
        })
        .collect::<Vec<_>>()
        .join(" · ")
}
