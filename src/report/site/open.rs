//! Rows of models that answered open questions: [`OpenRow`].

use std::collections::{BTreeMap, BTreeSet};

use super::board::{BoardCell, BoardRow, BoardTable};
use super::run_link::{GroupDigests, RunLink};
use crate::text::table::ColumnKind::{Count, Share, Text};
use crate::text::table::{Table, TableBuilder, TableCell};
use crate::text::words::light;
use crate::types::{AxisLevel, View};
use darkqa_score::estimate::Estimate;
use darkqa_score::open::{Group, OpenSummary};

/// A model of a run in one light, raw or with an enhancer, with its score (LLM-Match) at each level.
#[derive(Debug, Clone)]
pub(crate) struct OpenRow {
    model: String,
    run: RunLink,
    light: String,
    /// The score at each level, with the number of answers that are scored, and of those that were to be.
    levels: BTreeMap<AxisLevel, (Option<Estimate>, usize, usize)>,
    /// The score without images; `None` if it was not asked so.
    blind: Option<Estimate>,
}

/// The rows of a run, over all its questions. Untouched frames are L0 of every light.
pub(crate) fn open_rows(summary: &OpenSummary, run: &RunLink) -> Vec<OpenRow> {
    let cells = || summary.cells.iter().filter(|cell| cell.group == Group::All);
    let seeing = || cells().filter(|cell| cell.subject.view == Some(View::Image));
    let mut rows = Vec::new();
    let mut series = Vec::new();
    for cell in seeing() {
        let subject = &cell.subject;
        let own = (&subject.model, &subject.variant, subject.enhancer.as_ref());
        if !series.contains(&own) {
            series.push(own);
        }
    }
    let is_alone = |model: &String| series.iter().filter(|own| own.0 == model).count() == 1;
    for (model, variant, enhancer) in &series {
        let is_clean = variant.is_untouched() && enhancer.is_none();
        if is_clean && !is_alone(model) {
            continue;
        }
        let levels = seeing()
            .filter(|cell| {
                let subject = &cell.subject;
                let is_own = subject.variant == **variant && subject.enhancer.as_ref() == *enhancer;
                // The untouched frames are where every light begins; those of an enhancer are its own.
                let is_start = subject.variant.is_untouched() && subject.enhancer.is_none();
                subject.model == **model && (is_own || is_start && enhancer.is_none())
            })
            .filter_map(|cell| {
                let level = cell.subject.level?;
                Some((level, (cell.score, cell.scored(), cell.planned)))
            });
        let mut blind = cells()
            .filter(|cell| cell.subject.view == Some(View::Blind) && cell.subject.model == **model);
        rows.push(OpenRow {
            model: (*model).clone(),
            run: run.clone(),
            light: light(variant, *enhancer),
            levels: levels.collect(),
            blind: blind.next().and_then(|cell| cell.score),
        });
    }
    rows
}

/// The rows as a table for files, with a line for each level.
pub(super) fn table(number: usize, digests: &GroupDigests, rows: &[OpenRow]) -> Table {
    let lines = rows.iter().flat_map(|row| {
        row.levels
            .iter()
            .map(move |(level, cell)| (row, level.to_string(), *cell))
    });
    let blind = rows.iter().filter_map(|row| {
        let score = row.blind?;
        Some((row, "blind".to_owned(), (Some(score), score.n, score.n)))
    });
    let lines: Vec<_> = lines.chain(blind).collect();
    TableBuilder::new("openeqa", lines)
        .column(Count, "csv group", |_| number)
        .column(Text, "csv model", |(row, ..)| row.model.clone())
        .column(Text, "csv run", |(row, ..)| row.run.name.clone())
        .column(Text, "csv light", |(row, ..)| row.light.clone())
        .column(Text, "csv level", |(_, level, _)| level.clone())
        .column(Share, "csv score low high n", |(.., (score, ..))| *score)
        .column(Count, "csv due", |(.., (_, _, due))| *due)
        .column(Text, "csv date", |(row, ..)| row.run.date.clone())
        .column(Text, "csv version", |(row, ..)| row.run.version.clone())
        .column(Text, "csv page", |(row, ..)| row.run.path())
        .column(Text, "csv questions", |_| digests.questions.clone())
        .column(Text, "csv light_digest", |_| digests.light.clone())
        .column(Text, "csv prompts", |_| digests.prompts.clone())
        .build()
}

/// The rows as the page shows them.
pub(super) fn board(rows: &[OpenRow]) -> BoardTable {
    let levels: BTreeSet<AxisLevel> = rows
        .iter()
        .flat_map(|row| row.levels.keys().copied())
        .collect();
    let has_blind = rows.iter().any(|row| row.blind.is_some());
    let mut head = vec!["model".to_owned(), "light".to_owned(), "scored".to_owned()];
    head.extend(levels.iter().map(ToString::to_string));
    head.extend(has_blind.then(|| "without images".to_owned()));
    head.extend(["date", "version"].map(str::to_owned));
    let board_row = |row: &OpenRow| {
        let [scored, due] = row.levels.values().fold([0, 0], |[scored, due], cell| {
            [scored + cell.1, due + cell.2]
        });
        let share = |score: Option<Estimate>| BoardCell::new(Share, &TableCell::from(score));
        let mut cells = vec![
            BoardCell::text(&row.model)
                .small(&row.run.name)
                .header(row.run.path()),
            BoardCell::text(&row.light),
            BoardCell::text(&format!("{scored} of {due}"))
                .keyed(scored.to_string())
                .class(""),
        ];
        cells.extend(levels.iter().map(|level| match row.levels.get(level) {
            Some((score, ..)) => share(*score),
            None => BoardCell::new(Share, &TableCell::Absent),
        }));
        if has_blind {
            cells.push(share(row.blind));
        }
        cells.push(BoardCell::text(&row.run.date));
        cells.push(BoardCell::text(&row.run.version));
        BoardRow {
            words: format!("{} {}", row.model, row.run.name).to_lowercase(),
            cells,
        }
    };
    BoardTable {
        rows: rows.iter().map(board_row).collect(),
        head,
    }
}
