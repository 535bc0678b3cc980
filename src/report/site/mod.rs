//! A site of many runs: a leaderboard and a page a run ([`products`]). It needs no server and no network.

mod board;
mod choices;
mod open;
mod page;

use serde::Serialize;

use super::csv;
use super::json::Rows;
use super::table::Table;
use crate::error::{Error, Result};

pub(crate) use choices::{ChoiceRow, choice_rows};
pub(crate) use open::{OpenRow, open_rows};

/// The schema of `data.json`.
pub(crate) const SCHEMA: &str = "darkqa.site/1";

/// Name of the file with all rows of the site.
pub(crate) const DATA: &str = "data.json";

/// Folder of the pages of runs.
pub(crate) const PAGES: &str = "runs";

/// A leaderboard and the pages behind it.
pub(crate) struct Site {
    pub(crate) groups: Vec<SiteGroup>,
    /// Runs that stand in no table, each with the reason.
    pub(crate) others: Vec<(RunLink, String)>,
    /// The page of each run, with its link.
    pub(crate) pages: Vec<(RunLink, Vec<u8>)>,
}

/// A run as rows name it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub(crate) struct RunLink {
    /// Name of the run: its folder.
    pub(crate) name: String,
    /// Name of the file of its page.
    pub(crate) page: String,
    /// The day when the run was last written.
    pub(crate) date: String,
    /// The version that made it.
    pub(crate) version: String,
}

impl RunLink {
    /// Path of the page from the leaderboard.
    pub(crate) fn path(&self) -> String {
        format!("{PAGES}/{}", self.page)
    }
}

/// Rows that can be compared: of one set of questions, one light and one prompt.
pub(crate) struct SiteGroup {
    /// What its rows share, in words.
    pub(crate) title: String,
    /// Digests and settings that its rows share, by name.
    pub(crate) shared: Vec<(String, String)>,
    /// What differs from the first table of its kind; `None` for the first.
    pub(crate) differs: Option<GroupDifference>,
    pub(crate) rows: GroupRows,
}

/// What differs between two groups.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub(crate) struct GroupDifference {
    /// The number of the other group.
    pub(crate) from: usize,
    /// A line for each setting.
    pub(crate) lines: Vec<String>,
}

/// The rows of a group.
pub(crate) enum GroupRows {
    /// Questions with choices, and on what their ranks are based.
    Choices(Vec<ChoiceRow>, Ranking),
    /// Open questions.
    Open(Vec<OpenRow>),
}

/// On what the ranks of a group are based, in words.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Ranking {
    pub(crate) words: String,
}

/// A group in `data.json`.
#[derive(Serialize)]
struct GroupData<'a> {
    kind: &'static str,
    title: &'a str,
    shared: Vec<[&'a str; 2]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    differs: Option<&'a GroupDifference>,
    #[serde(skip_serializing_if = "Option::is_none")]
    ranking: Option<&'a str>,
    rows: Rows<'a>,
}

/// The content of `data.json`.
#[derive(Serialize)]
struct SiteData<'a> {
    schema: &'static str,
    version: &'static str,
    runs: Vec<&'a RunLink>,
    groups: Vec<GroupData<'a>>,
}

/// The files of a site by name: the leaderboard, the pages, `data.json`, and the tables as CSV.
///
/// # Errors
/// If a file cannot be made.
pub(crate) fn products(site: Site) -> Result<Vec<(String, Vec<u8>)>> {
    let tables: Vec<Table> = site.groups.iter().enumerate().map(table).collect();
    let mut named: Vec<&Table> = tables.iter().collect();
    named.sort_by_key(|table| table.name);
    let named: Vec<Table> = named.into_iter().cloned().collect();
    let mut files = csv::files(&named)?;
    let downloads: Vec<String> = files.iter().map(|(name, _)| name.clone()).collect();
    files.push((DATA.to_owned(), data(&site, &tables)?));
    let index = page::index(&site, &downloads)?;
    files.push(("index.html".to_owned(), index.into_bytes()));
    let pages = site.pages.into_iter();
    files.extend(pages.map(|(link, page)| (link.path(), page)));
    Ok(files)
}

/// The table of a group with its number.
fn table((index, group): (usize, &SiteGroup)) -> Table {
    match &group.rows {
        GroupRows::Choices(rows, _) => choices::table(index + 1, rows),
        GroupRows::Open(rows) => open::table(index + 1, rows),
    }
}

fn data(site: &Site, tables: &[Table]) -> Result<Vec<u8>> {
    let groups = site.groups.iter().zip(tables).map(|(group, table)| {
        let shared = group.shared.iter();
        let (kind, ranking) = match &group.rows {
            GroupRows::Choices(_, ranking) => ("choices", Some(&*ranking.words)),
            GroupRows::Open(_) => ("openeqa", None),
        };
        GroupData {
            kind,
            title: &group.title,
            shared: shared.map(|(name, value)| [&**name, &**value]).collect(),
            differs: group.differs.as_ref(),
            ranking,
            rows: Rows::of(table),
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
