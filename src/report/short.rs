//! Terminal text of a report on multiple-choice questions: [`text()`].

pub(super) mod findings;
mod foot;
mod name_column;
mod styled_lines;

use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::Path;

use self::foot::BELOW;
use self::name_column::{LEVEL_WIDTH, NameColumn};
use crate::report::choice_report::ChoiceReport;
use crate::report::finding_groups::FindingGroups;
use crate::report::sentences::how_to_read;
use crate::report::text::frame_count::frames;
use crate::report::text::ladder::{Ladder, SeriesByLevel};
use crate::report::text::noise_profiles::NoiseProfiles;
use crate::report::text::terminal::render;
use crate::report::text::words::{percent, widest_reach_of};
use crate::report::text::wrapped::{WIDTH, wrapped};
use crate::runs::report_length::ReportLength;
use crate::types::manifests::RunManifest;
use crate::types::text::{counted, plural};
use crate::types::{Axis, AxisLevel};
use darkqa_score::accuracies::{AccuracyCell, Health};
use darkqa_score::choice::ParsingMode;
use darkqa_score::grid::Grid;
use darkqa_score::model_in_condition::models_under_test;

/// Width of the interval column, in characters.
const INTERVAL_WIDTH: usize = 15;

/// Maximum width of the name column, in characters.
const MAX_NAME_WIDTH: usize = 40;

/// Maximum number of rows of the table.
const MAX_ROWS: usize = 24;

/// Maximum number of levels side by side in the table; more would leave too little room for names.
const MAX_LEVELS: usize = 7;

/// Renders a report on multiple-choice questions as text. `runs` are the manifests with the folders of their runs.
#[must_use]
pub(crate) fn text(report: &ChoiceReport<'_>, runs: &[(&RunManifest, &Path)], length: ReportLength) -> String {
    let groups = FindingGroups::new(&report.sentences);
    let mut text = findings::findings(&head(report), &report.alerts, &groups, length, &how_to_read(&report.sentences));
    match length {
        ReportLength::Findings => return text,
        ReportLength::Summary => text += &styled_lines::table(&accuracy_table(report)),
        ReportLength::Full => text += &render(&report.tables),
    }
    text += &open_question(report);
    for (_, folder) in runs {
        let _ = writeln!(text, "run: {}", folder.display());
    }
    text
}

/// Note on the question that a single noise profile leaves open; empty without noise or with several noise profiles.
fn open_question(report: &ChoiceReport<'_>) -> String {
    NoiseProfiles::new(&report.findings.grid.subjects)
        .open_question()
        .map_or_else(String::new, |question| wrapped(" ", &question, " "))
}

/// Models of a grid, in the order of its subjects.
fn models<'g>(grid: &'g Grid<'_>) -> Vec<&'g str> {
    let mut models: Vec<&str> = grid.subjects.iter().map(|subject| &*subject.model).collect();
    models.dedup();
    models
}

/// Name of the model under test or number of models, then the names of people. References such as `random` count only
/// if no other model ran.
pub(super) fn who_is_judged(grid: &Grid<'_>) -> String {
    let mut models = models(grid);
    let judged = models_under_test(models.iter().copied());
    models.retain(|model| judged.contains(model));
    models_and_people(grid, models)
}

/// Name of the only model or number of models, then the names of people, separated by commas.
fn models_and_people(grid: &Grid<'_>, models: Vec<&str>) -> String {
    let (people, models): (Vec<&str>, Vec<&str>) = models.into_iter().partition(|model| grid.listing.is_people(model));
    let model = match &models[..] {
        [] => String::new(),
        [one] => (*one).to_owned(),
        several => counted(several.len(), "model"),
    };
    let people = people.into_iter().map(|name| format!("{name} (people)"));
    let names: Vec<String> = Some(model).filter(|model| !model.is_empty()).into_iter().chain(people).collect();
    names.join(", ")
}

/// Models under test and people as in [`who_is_judged`], then the references that ran with them.
fn everyone(grid: &Grid<'_>) -> String {
    let models = models(grid);
    let judged = models_under_test(models.iter().copied());
    let references = models.into_iter().filter(|model| !judged.contains(model)).collect::<Vec<_>>();
    let references = match &references[..] {
        [_, _, _, ..] => vec![counted(references.len(), "reference")],
        few => few.iter().map(|name| (*name).to_owned()).collect(),
    };
    std::iter::once(who_is_judged(grid)).chain(references).collect::<Vec<_>>().join(", ")
}

/// Head line of the report: models, questions, frames, replies, failures, and the unit of the intervals.
pub(super) fn head(report: &ChoiceReport<'_>) -> String {
    let findings = report.findings;
    let grid = &findings.grid;
    let questions: BTreeSet<_> = grid.items.iter().map(|item| &*item.asked.question).collect();
    let replies: usize = findings.health.iter().map(|health| health.replies).sum();
    let failed: usize = findings.health.iter().map(Health::failures).sum();
    let replies = plural(replies, "reply", "replies");
    format!(
        "{} · {} · {} · {replies}, {failed} failed · intervals by {}",
        everyone(grid),
        counted(questions.len(), "question"),
        frames(grid),
        findings.unit
    )
}

/// Row of the accuracy table.
#[derive(Clone)]
struct AccuracyRow<'a> {
    /// Title of the block that contains the row.
    block: String,
    name: String,
    /// Group of the model; `None` if it has none or if the report has a single model.
    group: Option<&'a str>,
    cells: &'a SeriesByLevel<'a, AccuracyCell>,
}

impl AccuracyRow<'_> {
    /// Axis of the row's levels.
    fn axis(&self) -> Axis {
        self.cells.keys().find_map(|level| level.axis()).unwrap_or(Axis::LIGHT)
    }
}

/// Table of accuracies by level. With several models, it has one block per light condition and one row per model; with
/// a single model, one block and one row per light condition.
fn accuracy_table(report: &ChoiceReport<'_>) -> String {
    let common = report.findings.common.as_ref();
    let summary = common.map_or(&report.findings.summary, |common| &common.summary);
    let cells = summary.family_cells(None, ParsingMode::Strict);
    let ladder = Ladder::new(cells.map(|cell| (&cell.subject, cell))).with_pairs(report.findings).with_clean();
    let mut models: Vec<&str> = ladder.series.keys().map(|series| series.model).collect();
    models.dedup();
    let mut rows: Vec<AccuracyRow<'_>> = Vec::new();
    let is_single = models.len() == 1;
    for (series, cells) in &ladder.series {
        let listing = &report.findings.grid.listing;
        let (block, name) = block_and_name(&ladder.light(series), &listing.label(series.model), is_single);
        let group = listing.group(series.model);
        rows.push(AccuracyRow { block, name, group: group.filter(|_| !is_single), cells });
    }
    // Sort by block, which makes the rows of a light condition adjacent.
    rows.sort_by(|a, b| a.block.cmp(&b.block));
    let hidden = rows.len().saturating_sub(MAX_ROWS);
    rows.truncate(MAX_ROWS);
    let levels: Vec<AxisLevel> = ladder.levels.iter().copied().collect();
    let longest_name = rows.iter().map(|row| row.name.chars().count()).max();
    let longest_title = rows.iter().map(|row| row.block.chars().count()).max();
    let most_levels = Axis::ALL
        .map(|axis| levels.iter().filter(|level| level.belongs_to(axis)).count())
        .into_iter()
        .max()
        .unwrap_or_default();
    let room = WIDTH.saturating_sub(1 + most_levels.min(MAX_LEVELS) * LEVEL_WIDTH + INTERVAL_WIDTH).max(12);
    let name_width = longest_name.max(longest_title).unwrap_or(0).min(room.min(MAX_NAME_WIDTH));
    let texts = rows.iter().flat_map(|row| [&*row.block, &*row.name]);
    let names = NameColumn::new(texts, name_width);
    let shared_note = common.map(|common| {
        let questions = counted(common.shared_questions, "question");
        format!(" on the {questions} that all models with images answered")
    });
    let counts: BTreeSet<usize> =
        rows.iter().flat_map(|row| row.cells.values()).filter_map(|cell| Some(cell.accuracy?.n)).collect();
    let count_note = match (counts.first(), counts.last()) {
        (Some(least), Some(most)) if least < most => format!("; n from {least} to {most}"),
        _ => String::new(),
    };
    let mut text = format!(" accuracy in %{}{count_note}\n", shared_note.unwrap_or_default());
    for block in rows.chunk_by(|a, b| a.block == b.block) {
        for axis in Axis::ALL {
            let block: Vec<AccuracyRow<'_>> = block.iter().filter(|row| row.axis() == axis).cloned().collect();
            let levels: Vec<AxisLevel> = levels.iter().copied().filter(|level| level.belongs_to(axis)).collect();
            for levels in levels.chunks(MAX_LEVELS) {
                text += &block_lines(report, &block, levels, &names);
            }
        }
    }
    if hidden > 0 {
        let _ = writeln!(text, " {} --full", counted(hidden, "more row"));
    }
    text += &foot::baselines(report, &ladder);
    text + &foot::about_models(report, &ladder.models)
}

/// Rows of a block at some levels, below a heading with its title and the levels; empty if no row has a cell at these
/// levels.
fn block_lines(
    report: &ChoiceReport<'_>,
    block: &[AccuracyRow<'_>],
    levels: &[AxisLevel],
    names: &NameColumn,
) -> String {
    let mut text = String::new();
    let mut last_group = None;
    for row in block {
        let cells: Vec<Option<&AccuracyCell>> = levels.iter().map(|level| row.cells.get(level).copied()).collect();
        if cells.iter().all(Option::is_none) {
            continue;
        }
        if text.is_empty() {
            let heads = levels.iter().map(|level| format!("{level} "));
            text += &names.line(&row.block, heads, "95 %");
        }
        if row.group != last_group {
            last_group = row.group;
            let _ = writeln!(text, " — {}", last_group.unwrap_or_default());
        }
        let reach = widest_reach_of(cells.iter().flatten().filter_map(|cell| cell.accuracy));
        text += &names.line(&row.name, cells.iter().map(|cell| accuracy_text(report, *cell)), &reach);
    }
    text
}

/// Block title and row name of a series.
fn block_and_name(light: &str, model: &str, is_single: bool) -> (String, String) {
    if is_single { (model.to_owned(), light.to_owned()) } else { (light.to_owned(), model.to_owned()) }
}

/// Accuracy in percent, with a mark if it is below the accuracy without images.
fn accuracy_text(report: &ChoiceReport<'_>, cell: Option<&AccuracyCell>) -> String {
    let Some(cell) = cell else {
        return String::new();
    };
    let Some(accuracy) = cell.accuracy else {
        return "– ".to_owned();
    };
    let is_below = !report.findings.below_blind(&cell.subject, None).is_empty();
    let mark = if is_below { BELOW } else { ' ' };
    format!("{}{mark}", percent(accuracy.value))
}
