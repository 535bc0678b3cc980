//! Leaderboard rows of models that answered multiple-choice questions: [`ModelRunRow`].

use std::collections::{BTreeMap, BTreeSet};

use super::board::{BoardCell, BoardRow, BoardTable};
use super::open::{GroupDigests, RunLink};
use crate::tables::missing_threshold_reason;
use crate::text::table::ColumnKind::{self, Count, Points, Share, Text, Threshold};
use crate::text::table::{Table, TableBuilder, TableCell};
use crate::text::words::{light, points};
use darkqa_base::types::{AxisLevel, Variant, View};
use darkqa_score::accuracies::Curve;
use darkqa_score::choice::ParsingMode;
use darkqa_score::comparisons::{Comparison, ComparisonKind, RankRange};
use darkqa_score::estimate::Estimate;
use darkqa_score::findings::Findings;
use darkqa_score::model_in_condition::{ModelInCondition, is_reference};
use darkqa_score::significance::Verdict;
use darkqa_score::threshold::{NoThreshold, Threshold as EvThreshold};

/// Results of one model in one run.
#[derive(Debug, Clone)]
pub struct ModelRunRow {
    pub model: String,
    pub run: RunLink,
    /// Rank among the models of its table; `None` if it is not ranked.
    pub rank: Option<RankRange>,
    /// Accuracy at L0; `None` without a reply.
    clean: Option<Estimate>,
    /// The variant of the degraded levels, as the page of the run names it.
    light: String,
    /// Accuracy of raw images at each degraded level.
    levels: BTreeMap<AxisLevel, Option<Estimate>>,
    /// Mean accuracy from L0 to the darkest level.
    area: Option<Estimate>,
    /// Darkest level; `None` if no degraded level was asked.
    darkest: Option<AxisLevel>,
    /// Accuracy at the darkest level minus accuracy at L0, with its test.
    change: Option<(Estimate, Option<Verdict>)>,
    threshold: Option<Result<EvThreshold, NoThreshold>>,
    /// Largest gain by an enhancer over raw images: enhancer, level and difference, with its test.
    gain: Option<(String, AxisLevel, Estimate, Option<Verdict>)>,
    /// Levels at which the model is detected to be worse than a model without images.
    below: Vec<AxisLevel>,
    /// Number of unreadable replies, and of all replies.
    unread: [usize; 2],
}

impl ModelRunRow {
    /// True for a reference model, which is listed for comparison and has no rank.
    pub fn is_reference(&self) -> bool {
        is_reference(&self.model)
    }

    /// Key of the initial order: by rank, then by area; rows without a rank come last.
    pub fn sort_key(&self) -> (usize, usize, bool, i64) {
        let rank = self.rank.unwrap_or(RankRange { first: usize::MAX, last: usize::MAX });
        let area = self.area.map_or(0.0, |area| area.value);
        (rank.first, rank.last, self.is_reference(), -(area * 1e9) as i64)
    }

    fn rank_text(&self) -> String {
        match self.rank {
            None => "–".to_owned(),
            Some(RankRange { first, last }) if first == last => first.to_string(),
            Some(RankRange { first, last }) => format!("{first}–{last}"),
        }
    }

    fn below_text(&self, separator: &str) -> String {
        self.below.iter().map(ToString::to_string).collect::<Vec<_>>().join(separator)
    }
}

/// Rows of a run's models with images, in the main variant of its report. All numbers are the same as in the report.
pub fn choice_rows(findings: &Findings<'_>, variant: &Variant, run: &RunLink) -> Vec<ModelRunRow> {
    let mut models: Vec<&str> = Vec::new();
    for subject in &findings.grid.subjects {
        if subject.view == Some(View::Image) && !models.contains(&&*subject.model) {
            models.push(&subject.model);
        }
    }
    models.into_iter().map(|model| row(findings, variant, model, run)).collect()
}

fn row(findings: &Findings<'_>, variant: &Variant, model: &str, run: &RunLink) -> ModelRunRow {
    let grid = &findings.grid;
    let accuracy = |subject: &ModelInCondition| findings.summary.cell(subject, None, ParsingMode::Strict)?.accuracy;
    let clean = ModelInCondition::with_images(model, AxisLevel::L0, variant, None);
    let clean = grid.find_up_to_group(&clean).and_then(|index| accuracy(&grid.subjects[index]));
    let degraded = grid
        .subjects
        .iter()
        .filter(|subject| subject.model == model && subject.variant == *variant && subject.enhancer.is_none());
    let levels = degraded.filter_map(|subject| Some((subject.level?, accuracy(subject))));
    let curve: Option<&Curve> = findings.curves.iter().find(|curve| {
        curve.model == model && curve.variant == *variant && curve.enhancer.is_none() && curve.family.is_none()
    });
    let darkest = curve.map(|curve| curve.summary.darkest);
    let comparisons: Vec<&Comparison> = findings
        .comparisons
        .iter()
        .filter(|comparison| {
            comparison.family.is_none() && comparison.first.model == model && comparison.first.variant == *variant
        })
        .collect();
    let change = comparisons
        .iter()
        .find(|comparison| comparison.kind == ComparisonKind::Level && comparison.first.level == darkest);
    let gain = comparisons.iter().filter(|comparison| comparison.kind == ComparisonKind::Enhancer).max_by(|a, b| {
        let [a, b] = [a, b].map(|gain| gain.strict.tested.difference.value);
        a.total_cmp(&b)
    });
    let below = grid.subjects.iter().filter(|subject| {
        subject.model == model
            && subject.variant == *variant
            && subject.enhancer.is_none()
            && !findings.below_blind(subject, None).is_empty()
    });
    let health = findings.health.iter().filter(|health| health.subject.model == model);
    ModelRunRow {
        model: model.to_owned(),
        run: run.clone(),
        rank: None,
        clean,
        light: light(variant, None),
        levels: levels.filter(|(level, _)| *level != AxisLevel::L0).collect(),
        area: curve.and_then(|curve| curve.summary.area),
        darkest,
        change: change.map(|change| (change.strict.tested.difference, change.verdict())),
        threshold: curve.map(|curve| curve.summary.threshold),
        gain: gain.and_then(|gain| {
            let enhancer = gain.first.enhancer.as_ref()?.to_string();
            let difference = gain.strict.tested.difference;
            Some((enhancer, gain.first.level?, difference, gain.verdict()))
        }),
        below: below.filter_map(|subject| subject.level).collect(),
        unread: health.fold([0, 0], |[unread, all], health| [unread + health.unreadable(), all + health.replies]),
    }
}

/// Table for files. Numbers have the precision of the runs' files. `number` is the group's number on the site.
pub(super) fn table(number: usize, digests: &GroupDigests, rows: &[ModelRunRow]) -> Table {
    TableBuilder::new("leaderboard", rows)
        .column(Count, "csv group", |_| number)
        .column(Count, "csv rank_first", |row| row.rank.map(|rank| rank.first))
        .column(Count, "csv rank_last", |row| row.rank.map(|rank| rank.last))
        .column(Text, "csv model", |row| row.model.clone())
        .column(Text, "csv run", |row| row.run.name.clone())
        .column(Share, "csv l0 l0_low l0_high n", |row| row.clean)
        .column(Share, "csv area area_low area_high area_n", |row| row.area)
        .column(Text, "csv darkest", |row| row.darkest.map(|level| level.to_string()))
        .column(Points, "csv change change_low change_high change_n", |row| row.change.map(|(change, _)| change))
        .column(Text, "csv change_shown", |row| {
            row.change.map(|(_, verdict)| verdict.is_some_and(Verdict::is_shown).to_string())
        })
        .column(Threshold, "csv threshold_ev threshold_low threshold_high", |row| threshold(row))
        .column(Text, "csv best_enhancer", |row| row.gain.as_ref().map(|(enhancer, ..)| enhancer.clone()))
        .column(Text, "csv best_level", |row| row.gain.as_ref().map(|(_, level, ..)| level.to_string()))
        .column(Points, "csv gain gain_low gain_high gain_n", |row| row.gain.as_ref().map(|(.., gain, _)| *gain))
        .column(Text, "csv gain_shown", |row| {
            let gain = row.gain.as_ref();
            gain.map(|(.., verdict)| verdict.is_some_and(Verdict::is_shown).to_string())
        })
        .column(Text, "csv below_blind", |row| row.below_text(";"))
        .column(Count, "csv unread", |row| row.unread[0])
        .column(Count, "csv replies", |row| row.unread[1])
        .column(Text, "csv date", |row| row.run.date.clone())
        .column(Text, "csv version", |row| row.run.version.clone())
        .column(Text, "csv page", |row| row.run.path())
        .column(Text, "csv questions", |_| digests.questions.clone())
        .column(Text, "csv light_digest", |_| digests.light.clone())
        .column(Text, "csv prompts", |_| digests.prompts.clone())
        .build()
}

fn threshold(row: &ModelRunRow) -> TableCell {
    let darkest = row.darkest.map_or(0.0, AxisLevel::value);
    match &row.threshold {
        Some(Ok(threshold)) => TableCell::Threshold(*threshold, darkest),
        Some(Err(reason)) => TableCell::Unknown(missing_threshold_reason(reason)),
        None => TableCell::Missing,
    }
}

/// Heads of the columns on the page before those of the degraded levels.
const FIRST_HEADS: [&str; 4] = ["rank", "model", "n", "L0 in %"];

/// Heads of the columns on the page after those of the degraded levels.
const LAST_HEADS: [&str; 8] = [
    "area in %",
    "change in points",
    "threshold in EV",
    "best enhancer, gain in points",
    "worse than without images at",
    "unread in %",
    "date",
    "version",
];

/// Table for the page, with a column for each level that a row has.
pub(super) fn board(rows: &[ModelRunRow]) -> BoardTable {
    let levels: BTreeSet<AxisLevel> = rows.iter().flat_map(|row| row.levels.keys().copied()).collect();
    let by_level = levels.iter().map(|level| format!("{level} in %"));
    let head =
        FIRST_HEADS.map(str::to_owned).into_iter().chain(by_level).chain(LAST_HEADS.map(str::to_owned)).collect();
    BoardTable { head, rows: rows.iter().map(|row| board_row(row, &levels)).collect() }
}

fn board_row(row: &ModelRunRow, levels: &BTreeSet<AxisLevel>) -> BoardRow {
    let rank_key = row.rank.map(|rank| rank.first * 1000 + rank.last);
    let rank = BoardCell::text(&row.rank_text()).with_key(rank_key.map_or_else(String::new, |key| key.to_string()));
    let run = if row.is_reference() { format!("{}, for comparison", row.run.name) } else { row.run.name.clone() };
    let n = row.clean.map(|clean| clean.n);
    let change = match (&row.change, row.darkest) {
        (Some((change, verdict)), Some(darkest)) => difference(*change, *verdict, &darkest.to_string()),
        _ => BoardCell::new(Points, &TableCell::Missing),
    };
    let gain = match &row.gain {
        Some((enhancer, level, gain, verdict)) => difference(*gain, *verdict, &format!("{enhancer}, {level}")),
        None => BoardCell::new(Points, &TableCell::Missing),
    };
    let threshold = match &row.threshold {
        Some(Err(reason)) => {
            BoardCell::new(Threshold, &TableCell::Missing).with_line(&missing_threshold_reason(reason))
        }
        _ => BoardCell::new(Threshold, &threshold(row)),
    };
    let [unread, replies] = row.unread;
    let unread_share = unread as f64 / replies.max(1) as f64;
    let below = BoardCell::text(&row.below_text(", "))
        .with_key(row.below.first().map_or_else(String::new, |level| level.value().to_string()));
    let first = [
        rank.with_class("rank"),
        BoardCell::text(&row.model).with_line(&run).into_header(row.run.path()),
        BoardCell::new(Count, &TableCell::from(n)),
        row.run.level_cell(&row.model, &row.light, AxisLevel::L0, row.clean),
    ];
    let by_level = levels
        .iter()
        .map(|level| row.run.level_cell(&row.model, &row.light, *level, row.levels.get(level).copied().flatten()));
    let last = [
        BoardCell::new(Share, &TableCell::from(row.area)),
        change,
        threshold,
        gain,
        below.with_class(if row.below.is_empty() { "" } else { "below" }),
        BoardCell::new(ColumnKind::Percent, &TableCell::Number(unread_share))
            .with_line(&format!("{unread} of {replies}")),
        BoardCell::text(&row.run.date),
        BoardCell::text(&row.run.version),
    ];
    BoardRow {
        words: format!("{} {}", row.model, row.run.name).to_lowercase(),
        cells: first.into_iter().chain(by_level).chain(last).collect(),
    }
}

/// Cell with a difference in points, its interval, and its condition. A difference that was not detected is marked.
fn difference(difference: Estimate, verdict: Option<Verdict>, condition: &str) -> BoardCell {
    let ends = format!("[{}, {}]", points(difference.low), points(difference.high));
    let cell = BoardCell::text(&points(difference.value)).with_key(difference.value.to_string()).with_line(&ends);
    match verdict {
        Some(Verdict::Better) => cell.with_line(condition).with_class("better"),
        Some(Verdict::Worse) => cell.with_line(condition).with_class("worse"),
        None => cell.with_line(condition).with_class("unshown"),
        _ => cell.with_line(&format!("{condition}, not shown")).with_class("unshown"),
    }
}
