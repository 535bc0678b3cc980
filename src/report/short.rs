//! The text of a report of questions with choices: [`text()`].

pub(super) mod findings;
mod foot;
mod marked;
mod name_column;

use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::Path;

use self::foot::BELOW;
use self::name_column::{LEVEL, NameColumn};
use crate::report::choice_report::ChoiceReport;
use crate::report::finding_groups::FindingGroups;
use crate::report::report_length::ReportLength;
use crate::sentences::how_to_read;
use crate::text::frame_count::frames;
use crate::text::ladder::{Ladder, SeriesByLevel};
use crate::text::noise_profiles::NoiseProfiles;
use crate::text::terminal::render;
use crate::text::words::{counted, percent, reach_of};
use crate::text::wrapped::{WIDTH, wrapped};
use crate::types::manifests::RunManifest;
use crate::types::{Axis, AxisLevel};
use darkqa_score::accuracies::{AccuracyCell, Health};
use darkqa_score::choice::ReadingMode;
use darkqa_score::grid::Grid;
use darkqa_score::subject::judged;

/// Width of the column of intervals, in characters.
const REACH: usize = 15;

/// Width of a name in the table, in characters: no name is longer.
const MAX_NAME: usize = 40;

/// Maximum number of rows of the table.
const MAX_ROWS: usize = 24;

/// Maximum number of levels side by side in the table: so many leave room for names.
const MAX_LEVELS: usize = 7;

/// A report of questions with choices as text. `runs` are the runs with their folders.
#[must_use]
pub(crate) fn text(
    report: &ChoiceReport<'_>,
    runs: &[(&RunManifest, &Path)],
    length: ReportLength,
) -> String {
    let groups = FindingGroups::new(&report.sentences);
    let mut text = findings::findings(
        &head(report),
        &report.alerts,
        &groups,
        length,
        &how_to_read(&report.sentences),
    );
    match length {
        ReportLength::Findings => return text,
        ReportLength::Summary => text += &marked::table(&table(report)),
        ReportLength::Full => text += &render(&report.tables),
    }
    text += &open_question(report);
    for (_, folder) in runs {
        let _ = writeln!(text, "run: {}", folder.display());
    }
    text
}

/// The open question of a single noise profile; empty without noise or with several readings.
fn open_question(report: &ChoiceReport<'_>) -> String {
    let readings = NoiseProfiles::new(&report.findings.grid.subjects);
    let open = readings.open_question();
    open.map_or_else(String::new, |open| wrapped(" ", &open, " "))
}

/// The models of a grid, in its order.
fn models<'g>(grid: &'g Grid<'_>) -> Vec<&'g str> {
    let mut models: Vec<&str> = grid
        .subjects
        .iter()
        .map(|subject| &*subject.model)
        .collect();
    models.dedup();
    models
}

/// The model under test, or the number of them, and the people. References such as `random` count only if there is no other model.
pub(super) fn who_is_judged(grid: &Grid<'_>) -> String {
    let mut models = models(grid);
    let judged = judged(models.iter().copied());
    models.retain(|model| judged.contains(model));
    who(grid, models)
}

/// The model, or the number of models, and the people.
fn who(grid: &Grid<'_>, models: Vec<&str>) -> String {
    let is_people = |model: &&str| grid.listing.is_people(model);
    let (people, models): (Vec<&str>, Vec<&str>) = models.into_iter().partition(is_people);
    let who = match &models[..] {
        [] => String::new(),
        [one] => (*one).to_owned(),
        several => counted(several.len(), "model"),
    };
    let people = people.into_iter().map(|name| format!("{name} (people)"));
    let who: Vec<String> = Some(who)
        .filter(|who| !who.is_empty())
        .into_iter()
        .chain(people)
        .collect();
    who.join(", ")
}

/// Numbers of models, questions, frames, clusters and replies.
pub(super) fn head(report: &ChoiceReport<'_>) -> String {
    let findings = report.findings;
    let grid = &findings.grid;
    let questions: BTreeSet<_> = grid
        .items
        .iter()
        .map(|item| &*item.asked.question)
        .collect();
    let replies: usize = findings.health.iter().map(|health| health.replies).sum();
    let failed: usize = findings.health.iter().map(Health::failures).sum();
    let replies = match replies {
        1 => "1 reply".to_owned(),
        n => format!("{n} replies"),
    };
    format!(
        "{} · {} · {} · {replies}, {failed} failed · intervals by {}",
        who(grid, models(grid)),
        counted(questions.len(), "question"),
        frames(grid),
        findings.unit
    )
}

/// A row of the table.
#[derive(Clone)]
struct TableLine<'a> {
    /// Title of the block.
    block: String,
    name: String,
    /// The group of its model; `None` without one, and with one model.
    group: Option<&'a str>,
    cells: &'a SeriesByLevel<'a, AccuracyCell>,
}

/// Accuracies by level: a block for each light with a row for each model, or one block if there is one model.
fn table(report: &ChoiceReport<'_>) -> String {
    let common = report.findings.common.as_ref();
    let summary = common.map_or(&report.findings.summary, |common| &common.summary);
    let cells = summary.family_cells(None, ReadingMode::Strict);
    let ladder = Ladder::new(cells.map(|cell| (&cell.subject, cell)))
        .in_light_of(report.findings)
        .with_clean();
    let mut models: Vec<&str> = ladder.series.keys().map(|series| series.model).collect();
    models.dedup();
    let mut rows: Vec<TableLine<'_>> = Vec::new();
    let one = models.len() == 1;
    for (series, cells) in &ladder.series {
        let listing = &report.findings.grid.listing;
        let (block, name) =
            block_and_name(&ladder.light(series), &listing.label(series.model), one);
        let group = listing.group(series.model);
        rows.push(TableLine {
            block,
            name,
            group: group.filter(|_| !one),
            cells,
        });
    }
    // The models of one light stand together.
    rows.sort_by(|a, b| a.block.cmp(&b.block));
    let hidden = rows.len().saturating_sub(MAX_ROWS);
    rows.truncate(MAX_ROWS);
    let levels: Vec<AxisLevel> = ladder.levels.iter().copied().collect();
    let longest = rows.iter().map(|row| row.name.chars().count()).max();
    let titles = rows.iter().map(|row| row.block.chars().count()).max();
    let most = Axis::ALL.map(|axis| {
        levels
            .iter()
            .filter(|level| level.is_shown_on(axis))
            .count()
    });
    let most = most.into_iter().max().unwrap_or_default();
    let room = WIDTH
        .saturating_sub(1 + most.min(MAX_LEVELS) * LEVEL + REACH)
        .max(12);
    let name_width = longest.max(titles).unwrap_or(0).min(room.min(MAX_NAME));
    let texts = rows.iter().flat_map(|row| [&*row.block, &*row.name]);
    let names = NameColumn::new(texts, name_width);
    let shared = common.map(|common| {
        let questions = counted(common.shared_questions, "question");
        format!(" on the {questions} that all models with images answered")
    });
    let counts: BTreeSet<usize> = rows
        .iter()
        .flat_map(|row| row.cells.values())
        .filter_map(|cell| Some(cell.accuracy?.n))
        .collect();
    let counts = match (counts.first(), counts.last()) {
        (Some(least), Some(most)) if least < most => format!("; n from {least} to {most}"),
        _ => String::new(),
    };
    let mut text = format!(" accuracy in %{}{counts}\n", shared.unwrap_or_default());
    for block in rows.chunk_by(|a, b| a.block == b.block) {
        for axis in Axis::ALL {
            let is_on = |level: &AxisLevel| level.is_shown_on(axis);
            let has_level = |row: &&TableLine<'_>| {
                row.cells
                    .keys()
                    .find_map(|level| level.axis())
                    .unwrap_or(Axis::LIGHT)
                    == axis
            };
            let block: Vec<TableLine<'_>> = block.iter().filter(has_level).cloned().collect();
            let levels: Vec<AxisLevel> = levels.iter().copied().filter(is_on).collect();
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

/// The rows of a block at some levels, below a line with its title and the levels; empty if no row has a cell there.
fn block_lines(
    report: &ChoiceReport<'_>,
    block: &[TableLine<'_>],
    levels: &[AxisLevel],
    names: &NameColumn,
) -> String {
    let mut text = String::new();
    let mut above = None;
    for row in block {
        let here = || levels.iter().map(|level| row.cells.get(level).copied());
        if here().all(|cell| cell.is_none()) {
            continue;
        }
        if text.is_empty() {
            let heads = levels.iter().map(|level| format!("{level} "));
            text += &names.line(&row.block, heads, "95 %");
        }
        if row.group != above {
            above = row.group;
            let _ = writeln!(text, " — {}", above.unwrap_or_default());
        }
        let reach = reach_of(here().flatten().filter_map(|cell| cell.accuracy));
        text += &names.line(&row.name, here().map(|cell| value(report, cell)), &reach);
    }
    text
}

/// The title of the block and the name of the row of a series.
fn block_and_name(light: &str, model: &str, is_single: bool) -> (String, String) {
    if is_single {
        (model.to_owned(), light.to_owned())
    } else {
        (light.to_owned(), model.to_owned())
    }
}

/// An accuracy in percent, with a mark if it is below that without images.
fn value(report: &ChoiceReport<'_>, cell: Option<&AccuracyCell>) -> String {
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
