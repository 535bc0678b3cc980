//! Site of many runs, with a leaderboard and a page for each run: [`products`]. It needs no server and no network.

mod board;
mod choices;
mod content;
mod open;
mod page;
mod run_link;

use serde::Serialize;

use crate::error::{Error, Result};
use crate::report::json::Rows;
use crate::report::text::csv;
use crate::report::text::table::Table;

pub(crate) use choices::{ChoiceRow, choice_rows};
pub(crate) use content::{DATA, GroupDifference, GroupRows, Ranking, Site, SiteGroup};
pub(crate) use open::{OpenRow, open_rows};
pub(crate) use run_link::{GroupDigests, PAGES, RunLink};

/// Schema of `data.json`.
pub(crate) const SCHEMA: &str = "darkqa.site/1";

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
    rows: Rows<'a>,
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
pub(crate) fn products(site: Site) -> Result<Vec<(String, Vec<u8>)>> {
    let tables: Vec<Table> = site.groups.iter().zip(1..).map(|(group, number)| table(number, group)).collect();
    // Tables of the same name share a file.
    let mut by_name = tables.clone();
    by_name.sort_by_key(|table| table.name);
    let mut files = csv::files(&by_name)?;
    let downloads: Vec<String> = files.iter().map(|(name, _)| name.clone()).collect();
    files.push((DATA.to_owned(), data(&site, &tables)?));
    let index = page::index(&site, &downloads)?;
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
fn data(site: &Site, tables: &[Table]) -> Result<Vec<u8>> {
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
            rows: Rows::new(table),
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
