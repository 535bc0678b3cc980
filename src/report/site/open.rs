//! Leaderboard rows of models that answered open questions: [`OpenRow`].
//!
//! Link from a row to its run ([`RunLink`]), and digests of the settings that comparable runs share ([`GroupDigests`]).

use std::collections::{BTreeMap, BTreeSet};

use percent_encoding::{NON_ALPHANUMERIC, utf8_percent_encode};
use serde::Serialize;

use super::board::{BoardCell, BoardRow, BoardTable};
use crate::text::table::ColumnKind::{Count, Share, Text};
use crate::text::table::{Table, TableBuilder, TableCell};
use crate::text::words;
use darkqa_base::types::{AxisLevel, Variant, View};
use darkqa_score::estimate::Estimate;
use darkqa_score::open::{Group, OpenCell, OpenSummary};

/// Scores (LLM-Match) of one model in one run by level, in one variant, raw or with an enhancer.
#[derive(Debug, Clone)]
pub struct OpenRow {
    model: String,
    run: RunLink,
    light: String,
    levels: BTreeMap<AxisLevel, LevelScore>,
    /// Score without images; `None` if the model was not asked without images.
    blind: Option<Estimate>,
}

/// Score at one level.
#[derive(Debug, Clone, Copy)]
struct LevelScore {
    score: Option<Estimate>,
    /// Number of scored answers.
    scored: usize,
    /// Number of answers that the run plans.
    planned: usize,
}

/// Rows of a run over all its questions. The clean frames are L0 of every variant without an enhancer.
pub fn open_rows(summary: &OpenSummary, run: &RunLink) -> Vec<OpenRow> {
    let cells: Vec<&OpenCell> = summary.cells.iter().filter(|cell| cell.group == Group::All).collect();
    let with_images: Vec<&OpenCell> =
        cells.iter().copied().filter(|cell| cell.subject.view == Some(View::Image)).collect();
    let mut all_series = Vec::new();
    for cell in &with_images {
        let subject = &cell.subject;
        let series = (&subject.model, &subject.variant, subject.enhancer.as_ref());
        if !all_series.contains(&series) {
            all_series.push(series);
        }
    }
    let mut rows = Vec::new();
    for (model, variant, enhancer) in &all_series {
        let is_clean = variant.is_untouched() && enhancer.is_none();
        let has_other_series =
            all_series.iter().any(|other| other.0 == *model && (other.1 != *variant || other.2 != *enhancer));
        if is_clean && has_other_series {
            continue;
        }
        let levels = with_images
            .iter()
            .filter(|cell| {
                let subject = &cell.subject;
                let is_in_series = subject.variant == **variant && subject.enhancer.as_ref() == *enhancer;
                let is_clean = subject.variant.is_untouched() && subject.enhancer.is_none();
                subject.model == **model && (is_in_series || is_clean && enhancer.is_none())
            })
            .filter_map(|cell| {
                let score = LevelScore { score: cell.score, scored: cell.scored(), planned: cell.planned };
                Some((cell.subject.level?, score))
            })
            .collect();
        let blind = cells.iter().find(|cell| cell.subject.view == Some(View::Blind) && cell.subject.model == **model);
        rows.push(OpenRow {
            model: (*model).clone(),
            run: run.clone(),
            light: words::light(variant, *enhancer),
            levels,
            blind: blind.and_then(|cell| cell.score),
        });
    }
    rows
}

/// Row of the file: one level of an [`OpenRow`].
struct FileRow<'a> {
    row: &'a OpenRow,
    level: String,
    score: Option<Estimate>,
    planned: usize,
}

/// Table for files, with a row for each level. `number` is the group's number on the site.
pub(super) fn table(number: usize, digests: &GroupDigests, rows: &[OpenRow]) -> Table {
    let levels = rows.iter().flat_map(|row| {
        row.levels.iter().map(move |(level, score)| FileRow {
            row,
            level: level.to_string(),
            score: score.score,
            planned: score.planned,
        })
    });
    let blind = rows.iter().filter_map(|row| {
        let score = row.blind?;
        Some(FileRow { row, level: "blind".to_owned(), score: Some(score), planned: score.n })
    });
    TableBuilder::new("openeqa", levels.chain(blind))
        .column(Count, "csv group", |_| number)
        .column(Text, "csv model", |line| line.row.model.clone())
        .column(Text, "csv run", |line| line.row.run.name.clone())
        .column(Text, "csv light", |line| line.row.light.clone())
        .column(Text, "csv level", |line| line.level.clone())
        .column(Share, "csv score low high n", |line| line.score)
        .column(Count, "csv due", |line| line.planned)
        .column(Text, "csv date", |line| line.row.run.date.clone())
        .column(Text, "csv version", |line| line.row.run.version.clone())
        .column(Text, "csv page", |line| line.row.run.path())
        .column(Text, "csv questions", |_| digests.questions.clone())
        .column(Text, "csv light_digest", |_| digests.light.clone())
        .column(Text, "csv prompts", |_| digests.prompts.clone())
        .build()
}

/// Table for the page.
pub(super) fn board(rows: &[OpenRow]) -> BoardTable {
    let levels: BTreeSet<AxisLevel> = rows.iter().flat_map(|row| row.levels.keys().copied()).collect();
    let has_blind = rows.iter().any(|row| row.blind.is_some());
    let mut head = vec!["model".to_owned(), "light".to_owned(), "scored".to_owned()];
    head.extend(levels.iter().map(ToString::to_string));
    head.extend(has_blind.then(|| "without images".to_owned()));
    head.extend(["date", "version"].map(str::to_owned));
    BoardTable { rows: rows.iter().map(|row| board_row(row, &levels, has_blind)).collect(), head }
}

/// Row for the page, with a cell for each level, and one without images if `has_blind`.
fn board_row(row: &OpenRow, levels: &BTreeSet<AxisLevel>, has_blind: bool) -> BoardRow {
    let scored: usize = row.levels.values().map(|level| level.scored).sum();
    let planned: usize = row.levels.values().map(|level| level.planned).sum();
    let mut cells = vec![
        BoardCell::text(&row.model).with_line(&row.run.name).into_header(row.run.path()),
        BoardCell::text(&row.light),
        BoardCell::text(&format!("{scored} of {planned}")).with_key(scored.to_string()).with_class(""),
    ];
    for level in levels {
        cells.push(match row.levels.get(level) {
            Some(score) => row.run.level_cell(&row.model, &row.light, *level, score.score),
            None => BoardCell::new(Share, &TableCell::Absent),
        });
    }
    if has_blind {
        cells.push(BoardCell::new(Share, &TableCell::from(row.blind)));
    }
    cells.push(BoardCell::text(&row.run.date));
    cells.push(BoardCell::text(&row.run.version));
    BoardRow { words: format!("{} {}", row.model, row.run.name).to_lowercase(), cells }
}

/// Folder of the pages of runs.
pub const PAGES: &str = "runs";

/// Name and page of a run.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct RunLink {
    /// Name of the run: its folder.
    pub name: String,
    /// File name of the run's page.
    pub page: String,
    /// Day on which the run was last written.
    pub date: String,
    /// Version of the program that made the run.
    pub version: String,
}

impl RunLink {
    /// Path of the page relative to the leaderboard.
    pub fn path(&self) -> String {
        format!("{PAGES}/{}", self.page)
    }

    /// Cell with an accuracy or a score, which leads to its items on the page of the run. `light` is named as there;
    /// that of L0 is always untouched. A cell without a number has no link.
    pub(super) fn level_cell(&self, model: &str, light: &str, level: AxisLevel, share: Option<Estimate>) -> BoardCell {
        let cell = BoardCell::new(Share, &TableCell::from(share));
        if share.is_none() {
            return cell;
        }
        let untouched = words::light(&Variant::NONE, None);
        let light = if level == AxisLevel::L0 { &untouched } else { light };
        let level = level.to_string();
        let filters = [("model", model), ("light", light), ("level", &*level)]
            .map(|(name, value)| format!("{name}={}", utf8_percent_encode(value, NON_ALPHANUMERIC)));
        cell.with_link(format!("{}#{}", self.path(), filters.join("&")))
    }
}

/// Digests of the settings that must be equal for the rows of a group to be comparable.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct GroupDigests {
    /// Digest of the questions with their texts and choices.
    pub questions: String,
    /// Digest of all settings that determine the raw images.
    pub light: String,
    /// Digest of the prompt text around the questions; empty if the runs do not record it.
    pub prompts: String,
}
