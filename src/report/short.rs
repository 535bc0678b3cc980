//! The short report on multiple-choice questions in the terminal.
//!
//! Table of accuracies by level: [`short_table`].
//!
//! Start of every report in the terminal, with its findings: [`head_and_findings`].
//!
//! Lines below the short table: models without images and chance ([`baselines`]), and marks and facts of models
//! ([`about_models`]).
//!
//! Column of names in the short table: [`NameColumn`].
//!
//! Lines of a terminal report with coloured signs: [`alert`], [`summary`], [`sentence_line`], [`heading`] and [`table`].
//!
//! Colours are ANSI sequences; the code that prints a text removes them if the terminal has no colours. A sign or a
//! word always has the same meaning as the colour.

use std::collections::BTreeSet;
use std::fmt::Write;

use clap::builder::styling::{AnsiColor, Style};

use super::finding_groups::GroupedFinding;
use super::sentences::{EffectDirection, Sentence};
use super::tables::{control_text, unread_note};
use crate::finding_groups::FindingGroups;
use crate::text::alert::{Alert, lines};
use crate::text::ladder::{Ladder, SeriesByLevel};
use crate::text::terminal::{WIDTH, line, wrapped};
use crate::text::words::{frames, percent, shorten_middle, widest_reach_of, with_interval};
use darkqa_base::types::replies::OBSERVER;
use darkqa_base::types::text::{counted, escape_hidden, plural};
use darkqa_base::types::{Axis, AxisLevel};
use darkqa_runs::outcome::ReportLength;
use darkqa_score::accuracies::{AccuracyCell, Health};
use darkqa_score::choice::ParsingMode;
use darkqa_score::findings::Findings;
use darkqa_score::grid::Grid;
use darkqa_score::model_in_condition::{CHANCE, is_observer, models_under_test, without_run};

/// Width of the interval column, in characters.
const INTERVAL_WIDTH: usize = 15;

/// Maximum width of the name column, in characters.
const MAX_NAME_WIDTH: usize = 40;

/// Maximum number of rows of the table.
const MAX_ROWS: usize = 24;

/// Maximum number of levels side by side in the table; more would leave too little room for names.
const MAX_LEVELS: usize = 7;

/// Table of accuracies by level for the terminal, with the lines below it.
pub(super) fn short_table(findings: &Findings<'_>) -> String {
    table(&accuracy_table(findings))
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

/// Facts at the head of the report: models, questions, frames, replies with failures, and the unit of the intervals.
pub(super) fn facts(findings: &Findings<'_>) -> Vec<String> {
    let grid = &findings.grid;
    let questions: BTreeSet<_> = grid.items.iter().map(|item| &*item.asked.question).collect();
    let replies: usize = findings.health.iter().map(|health| health.replies).sum();
    let failed: usize = findings.health.iter().map(Health::failures).sum();
    let replies = plural(replies, "reply", "replies");
    vec![
        everyone(grid),
        counted(questions.len(), "question"),
        frames(grid),
        format!("{replies}, {failed} failed"),
        format!("intervals by {}", findings.unit),
    ]
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
fn accuracy_table(findings: &Findings<'_>) -> String {
    let common = findings.common.as_ref();
    let summary = common.map_or(&findings.summary, |common| &common.summary);
    let cells = summary.family_cells(None, ParsingMode::Strict);
    let ladder = Ladder::new(cells.map(|cell| (&cell.subject, cell))).with_pairs(findings).with_clean();
    let mut models: Vec<&str> = ladder.series.keys().map(|series| series.model).collect();
    models.dedup();
    let mut rows: Vec<AccuracyRow<'_>> = Vec::new();
    let is_single = models.len() == 1;
    for (series, cells) in &ladder.series {
        let listing = &findings.grid.listing;
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
                text += &block_lines(findings, &block, levels, &names);
            }
        }
    }
    if hidden > 0 {
        let _ = writeln!(text, " {} --full", counted(hidden, "more row"));
    }
    text += &baselines(findings, &ladder);
    text + &about_models(findings, &ladder.models)
}

/// Rows of a block at some levels, below a heading with its title and the levels; empty if no row has a cell at these
/// levels.
fn block_lines(findings: &Findings<'_>, block: &[AccuracyRow<'_>], levels: &[AxisLevel], names: &NameColumn) -> String {
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
        text += &names.line(&row.name, cells.iter().map(|cell| accuracy_text(findings, *cell)), &reach);
    }
    text
}

/// Block title and row name of a series.
fn block_and_name(light: &str, model: &str, is_single: bool) -> (String, String) {
    if is_single { (model.to_owned(), light.to_owned()) } else { (light.to_owned(), model.to_owned()) }
}

/// Accuracy in percent, with a mark if it is below the accuracy without images.
fn accuracy_text(findings: &Findings<'_>, cell: Option<&AccuracyCell>) -> String {
    let Some(cell) = cell else {
        return String::new();
    };
    let Some(accuracy) = cell.accuracy else {
        return "– ".to_owned();
    };
    let is_below = !findings.below_blind(&cell.subject, None).is_empty();
    let mark = if is_below { BELOW } else { ' ' };
    format!("{}{mark}", percent(accuracy.value))
}

/// Width of the column of group titles, in characters.
const GROUP_WIDTH: usize = 15;

/// Head, alerts and summary, then the main finding of each group, or all findings with a note on how to read them.
pub fn head_and_findings(
    head: &[String],
    alerts: &[Alert],
    groups: &FindingGroups<'_>,
    length: ReportLength,
    how_to_read: &str,
) -> String {
    let mut text = if length == ReportLength::Full {
        // As wide as the tables.
        head.iter().map(|text| line("", text, " ")).collect::<String>() + &lines(alerts)
    } else {
        let head = head.iter().map(|text| wrapped("", &escape_hidden(text), " "));
        head.chain(alerts.iter().map(alert)).collect()
    };
    if groups.count() == 0 {
        return text + "\n";
    }
    let _ = write!(text, "\n{}\n", summary(&groups.summary()));
    if length == ReportLength::Summary {
        for (title, finding) in groups.main_findings() {
            text += &row(title, finding);
        }
        let all = counted(groups.count(), "finding");
        return text + &wrapped(" ", &format!("All {all}, and how to read them: --findings"), " ") + "\n";
    }
    for group in groups.all() {
        text += &heading(group.title);
        for sentence in group.sentences() {
            text += &sentence_line(sentence);
        }
    }
    text + &wrapped(" ", how_to_read, " ") + "\n"
}

/// Title of a group and its main finding, with the intervals below.
fn row(title: &str, finding: &GroupedFinding<'_>) -> String {
    let tone = finding.main_sentence().tone;
    let first = format!(" {title:<GROUP_WIDTH$}{}  ", tone.sign());
    let rest = " ".repeat(first.chars().count());
    let lines = wrapped(&first, &escape_hidden(&(finding.text() + ".")), &rest);
    let text = colour_sign(&lines, GROUP_WIDTH + 2, tone);
    let intervals = finding.intervals_text();
    if intervals.is_empty() {
        return text;
    }
    text + &wrapped(&rest, &intervals, &rest)
}

/// Mark of an accuracy that is detected to be below the accuracy without images.
const BELOW: char = '▼';

/// Lines below the table: models without images, chance, and explanations of the last column and of the mark.
fn baselines(findings: &Findings<'_>, ladder: &Ladder<'_, AccuracyCell>) -> String {
    let mut parts = Vec::new();
    for (subject, cell) in &ladder.without_level {
        let Some(share) = cell.accuracy else {
            continue;
        };
        parts.push(match subject.view {
            None => {
                let once = findings.summary.chance_of_questions;
                let once = once.map(|once| {
                    format!(" over all orders of choices ({} with each question once)", percent(once.value))
                });
                format!("chance {}{}", percent(share.value), once.unwrap_or_default())
            }
            Some(_) if parts.is_empty() => {
                format!("without images: {} {}", subject.model, with_interval(share))
            }
            Some(_) => format!("{} {}", subject.model, with_interval(share)),
        });
    }
    let has_mark = findings
        .summary
        .family_cells(None, ParsingMode::Strict)
        .filter(|cell| cell.subject.level.is_some())
        .any(|cell| !findings.below_blind(&cell.subject, None).is_empty());
    if has_mark {
        parts.push(format!("{BELOW} less often right than without images"));
    }
    let mut text = String::new();
    if !ladder.series.is_empty() {
        let line = "95 %: how far the widest interval of the row reaches down and up";
        text += &wrapped(" ", line, " ");
    }
    let lenient: usize = findings.health.iter().map(|health| health.lenient_only).sum();
    if lenient > 0 {
        let replies = if lenient == 1 { "reply is" } else { "replies are" };
        let line = format!("{lenient} more {replies} read by the lenient parsing alone: --full");
        text += &wrapped(" ", &line, " ");
    }
    if !parts.is_empty() {
        text += &wrapped(" ", &parts.join(" · "), " ");
    }
    text += &observer_control(findings);
    if let Some(reasons) = unread_note(&findings.summary) {
        text += &wrapped(" ", &reasons, " ");
    }
    text
}

/// Line that defines the observer, with the score of its standing control in each run; empty if the observer is not in
/// the report.
fn observer_control(findings: &Findings<'_>) -> String {
    let is_shown = findings.grid.subjects.iter().any(|subject| is_observer(&subject.model));
    let controls = findings.observer.standing_controls();
    let Some(first) = controls.first().filter(|_| is_shown) else {
        return String::new();
    };
    let scores: Vec<String> = controls
        .iter()
        .map(|cell| {
            let run = &cell.subject.model[without_run(&cell.subject.model).len()..];
            with_interval(cell.score) + run
        })
        .collect();
    let line = format!(
        "{OBSERVER}: known-signal observer, given the untouched frame; not a model. Control: {}, scores {}; chance is {}",
        control_text(first),
        scores.join(" and "),
        percent(first.chance)
    );
    wrapped(" ", &line, " ")
}

/// Explanations of the marks of models, training data of enhancers, and a line for each model with the facts that the
/// user gave about it.
fn about_models(findings: &Findings<'_>, models: &[&str]) -> String {
    let listing = &findings.grid.listing;
    let mut text = listing.footnote(models.iter().copied()).map_or_else(String::new, |foot| wrapped(" ", &foot, "   "));
    for (enhancer, training) in listing.trainings() {
        text += &wrapped(" ", &format!("{enhancer}: {training}"), "   ");
    }
    for model in models.iter().filter(|model| **model != CHANCE) {
        let facts: Vec<String> = listing
            .columns()
            .iter()
            .map(|column| {
                let fact = Some(listing.cell(*column, model)).filter(|fact| !fact.is_empty());
                format!("{} {}", column.head(), fact.unwrap_or("–"))
            })
            .collect();
        if !facts.is_empty() {
            text += &wrapped(" ", &format!("{model}: {}", facts.join(" · ")), "   ");
        }
    }
    text
}

/// Width of the column of a level, in characters.
const LEVEL_WIDTH: usize = 7;

/// First column of the table: names, shortened to a width.
pub(super) struct NameColumn {
    width: usize,
    /// Shortened names that several different names have in common.
    ambiguous: BTreeSet<String>,
}

impl NameColumn {
    /// Column of at most `width` characters for some names.
    fn new<'a>(names: impl Iterator<Item = &'a str>, width: usize) -> Self {
        let names: BTreeSet<&str> = names.collect();
        let mut seen = BTreeSet::new();
        let ambiguous = names
            .into_iter()
            .map(|name| shorten_middle(name, width))
            .filter(|name| !seen.insert(name.clone()))
            .collect();
        Self { width, ambiguous }
    }

    /// Formats a row: name, values, and the reach of the widest interval. A name that is ambiguous when shortened gets
    /// its own line above the values.
    fn line(&self, name: &str, values: impl Iterator<Item = String>, reach: &str) -> String {
        let width = self.width;
        let mut text = String::new();
        let mut short = shorten_middle(name, width);
        if self.ambiguous.contains(&short) {
            text = format!(" {name}\n");
            short.clear();
        }
        let values: String = values.map(|value| format!("{value:>LEVEL_WIDTH$}")).collect();
        let line = format!(" {short:<width$}{values}  {reach}");
        text + line.trim_end() + "\n"
    }
}

/// Wrapped text of an alert with its sign.
fn alert(alert: &Alert) -> String {
    style_start(&wrapped("! ", &escape_hidden(&alert.text), "  "), 1, colour(AnsiColor::Yellow))
}

/// Wrapped text of a sentence with its sign, and its detail below.
fn sentence_line(sentence: &Sentence) -> String {
    let first = format!(" {}  ", sentence.tone.sign());
    let text = wrapped(&first, &escape_hidden(&sentence.text), "    ");
    colour_sign(&text, 2, sentence.tone) + &wrapped("    ", &escape_hidden(&sentence.detail), "    ")
}

/// Applies the colour of a tone to the first `end` characters, at the end of which the sign is.
fn colour_sign(lines: &str, end: usize, tone: EffectDirection) -> String {
    let style = match tone {
        EffectDirection::Better => colour(AnsiColor::Green),
        EffectDirection::Worse => colour(AnsiColor::Red),
        EffectDirection::NotShown | EffectDirection::Note => Style::new().bold(),
    };
    style_start(lines, end, style)
}

/// Summary of a report, in bold.
fn summary(text: &str) -> String {
    let lines = wrapped(" ", &escape_hidden(text), " ");
    let style = Style::new().bold();
    format!("{style}{}{style:#}\n", lines.trim_end())
}

/// Title of a group of findings.
fn heading(title: &str) -> String {
    format!(" {title}\n")
}

/// Applies red to the marks of accuracies below the accuracy without images in a table.
fn table(text: &str) -> String {
    let style = colour(AnsiColor::Red);
    escape_hidden(text).replace(BELOW, &format!("{style}{BELOW}{style:#}"))
}

fn colour(colour: AnsiColor) -> Style {
    Style::new().bold().fg_color(Some(colour.into()))
}

/// Applies a style to the first `count` characters of a text.
fn style_start(text: &str, count: usize, style: Style) -> String {
    let end = text.char_indices().nth(count).map_or(text.len(), |(index, _)| index);
    let (start, rest) = text.split_at(end);
    format!("{style}{start}{style:#}{rest}")
}

#[cfg(test)]
mod tests {
    use super::NameColumn;

    #[test]
    fn ambiguous_names_are_not_shortened() {
        let names = ["vision-one-instruct", "vision-two-instruct", "raw"];
        let column = NameColumn::new(names.into_iter(), 12);
        let [first, second, third] = names.map(|name| column.line(name, ["50.0".to_owned()].into_iter(), "−1 +2"));
        assert_eq!(first, " vision-one-instruct\n                50.0  −1 +2\n");
        assert_ne!(first, second);
        assert_eq!(third, " raw            50.0  −1 +2\n");
        let single = NameColumn::new(names[..1].iter().copied(), 12);
        let line = single.line(names[0], std::iter::empty(), "");
        assert_eq!(line, " visio…struct\n");
    }
}
