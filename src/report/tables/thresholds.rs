//! Tables of darkness thresholds and of areas under the accuracy curves, for all families together and by family.
//!
//! Tables of the levels at which question families lose, and of the frames that keep the fewest right answers, under
//! each noise profile: [`fails_first`]. Both are lists, not findings: no test compares one family or frame with
//! another.

use std::collections::{BTreeMap, BTreeSet};

use super::sections::ACCURACY;
use crate::text::table::ColumnKind::{Count, Number, Percent, Share, Text, Threshold};
use crate::text::table::{ColumnHeads, Table, TableBuilder, TableCell};
use crate::text::words::{family as family_name, light, lux, lux_at, points};
use darkqa_base::types::degradations::Axis;
use darkqa_base::types::text::{counted, plural};
use darkqa_base::types::{AxisLevel, Family, FrameId, Variant};
use darkqa_score::accuracies::Curve;
use darkqa_score::choice::ParsingMode;
use darkqa_score::comparisons::{PooledFinding, PooledKind};
use darkqa_score::findings::Findings;
use darkqa_score::significance::{ALPHA, Verdict, holm};
use darkqa_score::threshold::{CurveSummary, NoThreshold, SparseLevel, Threshold as DropThreshold};

pub(super) fn thresholds(findings: &Findings<'_>) -> Vec<Table> {
    let mut tables = Vec::new();
    for axis in Axis::ALL {
        let curves: Vec<&Curve> = findings.curves.iter().filter(|curve| curve.axis() == axis).collect();
        // The light tables are kept even if empty: light is the main axis of a run.
        if !curves.is_empty() || axis == Axis::LIGHT {
            tables.extend(axis_tables(findings, axis, curves));
        }
    }
    tables
}

/// Tables of the curves on one axis: all families together, by family, and both with lenient parsing (in files only).
fn axis_tables(findings: &Findings<'_>, axis: Axis, curves: Vec<&Curve>) -> [Table; 3] {
    let titles = Titles::new(axis);
    let lux = findings.set.lux.filter(|_| axis == Axis::LIGHT);
    let notes = notes(&curves);
    let lenient = table(&titles, "", &curves, ParsingMode::Lenient, lux).in_files_only();
    let (all_families, by_family): (Vec<&Curve>, Vec<&Curve>) =
        curves.into_iter().partition(|curve| curve.family.is_none());
    let heading = format!(
        "{} in {} (half-way from L0 to the floor) and mean accuracy in %, with 95 % intervals by {}",
        titles.quantity, axis.unit, findings.unit
    );
    let mut all_families = table(&titles, titles.caption, &all_families, ParsingMode::Strict, lux);
    all_families.heading = (!all_families.rows.is_empty()).then_some(heading);
    all_families.notes = notes;
    if axis == Axis::LIGHT {
        all_families.notes.extend(finer_levels_note(findings));
    }
    let caption = format!("{} by family", titles.caption);
    let mut by_family = table(&titles, &caption, &by_family, ParsingMode::Strict, lux);
    by_family.is_folded = true;
    [all_families, by_family, lenient]
}

/// File name, caption and column heads of the tables of one axis.
struct Titles {
    /// File name without its extension.
    file: &'static str,
    caption: &'static str,
    /// Name of the threshold in the heading.
    quantity: &'static str,
    /// Heads of the column with the darkest level.
    darkest_column: &'static str,
    /// Heads of the columns with the threshold and its interval.
    threshold_columns: &'static str,
    /// Heads of the column with the range of levels.
    range_column: &'static str,
}

impl Titles {
    fn new(axis: Axis) -> Self {
        if axis == Axis::MOTION {
            return Self {
                file: "blur_thresholds",
                caption: "Thresholds and areas of motion blur",
                quantity: "Exposure time of motion blur",
                darkest_column: "csv longest_ms",
                threshold_columns: "csv threshold_ms low high | terminal threshold, interval | page threshold in ms [95 %]",
                range_column: "page ms",
            };
        }
        Self {
            file: "thresholds",
            caption: "Thresholds and areas",
            quantity: "Darkness threshold",
            darkest_column: "csv darkest_ev",
            threshold_columns: "csv threshold_ev low high | terminal threshold, interval | page threshold in EV [95 %]",
            range_column: "page EV",
        }
    }
}

/// Builds the table of some curves. A threshold is `inf` beyond the darkest level, and empty if unknown.
fn table(titles: &Titles, caption: &str, curves: &[&Curve], mode: ParsingMode, lux: Option<f64>) -> Table {
    let builder = TableBuilder::new(titles.file, curves)
        .page("thresholds", caption)
        .curve(|curve| (&curve.model, &curve.variant, curve.enhancer.as_ref()))
        .column(Text, "terminal light | page light", |curve| light(&curve.variant, curve.enhancer.as_ref()))
        .family(|curve| curve.family.as_ref())
        .column(Number, titles.darkest_column, |curve| curve.parsed(mode).darkest.value())
        .column(Threshold, titles.threshold_columns, |curve| {
            let darkest = curve.parsed(mode).darkest.value();
            match &curve.parsed(mode).threshold {
                Ok(threshold) => TableCell::Threshold(*threshold, darkest),
                Err(reason) => TableCell::Unknown(missing_threshold_reason(reason)),
            }
        });
    in_lux(builder, lux, |curve| {
        let summary = curve.parsed(mode);
        Some((summary.threshold.as_ref().ok().copied()?, summary.darkest.value()))
    })
    .column(Share, "csv area area_low area_high n | terminal mean accuracy | page area in % [95 %]", |curve| {
        curve.parsed(mode).area
    })
    .column(Percent, "csv floor | terminal floor | page floor in %", |curve| curve.parsed(mode).floor)
    .column(Text, "csv floor_of | terminal of | page of", |curve| curve.floor.name())
    .column(Text, titles.range_column, |curve| format!("0–{}", curve.parsed(mode).darkest.value()))
    .column(Text, "csv reason", |curve| csv_reason(curve.parsed(mode)))
    .column(Text, "csv mode", |_| mode.name())
    .build()
}

/// Adds the light at a threshold, in lux, with its interval; no column if the light at L0, `at_l0`, is not known.
/// `threshold` also gives the darkest level, in EV: the light at a threshold beyond it is not known.
pub fn in_lux<T>(
    builder: TableBuilder<T>,
    at_l0: Option<f64>,
    threshold: impl Fn(&T) -> Option<(DropThreshold, f64)>,
) -> TableBuilder<T> {
    let Some(at_l0) = at_l0 else {
        return builder;
    };
    let light = |drop: f64| lux_at(at_l0, drop);
    builder
        .column(Number, "csv lux lux_low lux_high", |item| match threshold(item) {
            Some((DropThreshold { value, low, high }, darkest)) if value.is_finite() => {
                let ends = DropThreshold { value: light(value), low: light(high), high: light(low) };
                TableCell::Threshold(ends, darkest)
            }
            _ => TableCell::Blank,
        })
        .column(Text, "terminal lux | page lux", |item| match threshold(item) {
            None => TableCell::Blank,
            Some((found, darkest)) if found.value.is_infinite() => format!("< {}", lux(at_l0, darkest)).into(),
            Some((found, darkest)) => {
                let low = if found.high.is_infinite() {
                    format!("< {}", lux(at_l0, darkest))
                } else {
                    lux(at_l0, found.high)
                };
                format!("{} [{low}, {}]", lux(at_l0, found.value), lux(at_l0, found.low)).into()
            }
        })
}

/// Text for the reason why a curve has no threshold.
pub fn missing_threshold_reason(reason: &NoThreshold) -> String {
    match reason {
        NoThreshold::NotAboveChance => "not clearly above the floor at L0".to_owned(),
        NoThreshold::Thin(level) => thin_level_text(level),
        NoThreshold::Missing { low } => format!("from {low:.1} on, by the missing replies"),
    }
}

/// Replies and clusters at a level that has too few of them.
fn thin_level_text(level: &SparseLevel) -> String {
    format!(
        "{} has {} in {}",
        level.level,
        plural(level.replies, "reply", "replies"),
        counted(level.clusters, "cluster")
    )
}

/// Reason for a missing threshold, and the levels left out, separated by semicolons; empty if neither applies.
fn csv_reason(summary: &CurveSummary) -> String {
    let left_out = summary.left_out.iter().map(|level| format!("left out: {}", thin_level_text(level)));
    let unknown = summary.threshold.as_ref().err().map(missing_threshold_reason);
    let reasons: Vec<String> = unknown.into_iter().chain(left_out).collect();
    reasons.join("; ")
}

/// Notes on the curves of all families together: the minimum data for a threshold if a curve lacks it, and the levels
/// that each curve leaves out.
fn notes(curves: &[&Curve]) -> Vec<String> {
    let curves = curves.iter().filter(|curve| curve.family.is_none());
    let needs_data = curves.clone().any(|curve| matches!(curve.summary.threshold, Err(NoThreshold::Thin(_))));
    let requirement = needs_data.then(|| format!("a threshold needs {}", SparseLevel::requirement()));
    let left_out = curves.filter(|curve| !curve.summary.left_out.is_empty()).map(|curve| {
        let light = light(&curve.variant, curve.enhancer.as_ref());
        let levels: Vec<String> = curve.summary.left_out.iter().map(thin_level_text).collect();
        format!("left out of {}, {light}: {}", curve.model, levels.join(", "))
    });
    requirement.into_iter().chain(left_out).collect()
}

/// Number of levels to propose between two existing levels.
const PROPOSED_LEVELS: usize = 3;

/// Minimum step between proposed levels, in EV; smaller steps are narrower than the intervals of thresholds.
const MIN_STEP: f64 = 0.25;

/// Note that proposes levels around the light thresholds of all curves without enhancement. `None` if the existing
/// levels are already close, a threshold is beyond the darkest level, or no threshold is known.
///
/// The proposed levels are the same for all models and items. Choosing levels for each model by its answers would gain
/// little, because the spread between items causes most of the error, and it would compare models at different levels.
fn finer_levels_note(findings: &Findings<'_>) -> Option<String> {
    let intervals: Vec<[f64; 2]> = findings
        .curves
        .iter()
        .filter(|curve| curve.family.is_none() && curve.enhancer.is_none() && curve.axis() == Axis::LIGHT)
        .filter_map(|curve| {
            let threshold = curve.summary.threshold.as_ref().ok()?;
            Some([threshold.low, threshold.high])
        })
        .collect();
    let levels: BTreeSet<AxisLevel> = findings
        .grid
        .subjects
        .iter()
        .filter_map(|subject| subject.level)
        .filter(|level| level.axis().is_none_or(|axis| axis == Axis::LIGHT))
        .collect();
    let drops: Vec<f64> = levels.iter().map(|level| level.value()).collect();
    let proposed: Vec<String> = levels_between(&intervals, &drops)?.iter().map(ToString::to_string).collect();
    Some(format!(
        "for a finer threshold, add {} EV to --levels and ask again with --resume: all models, all items, these levels alone",
        proposed.join(", ")
    ))
}

/// Proposed exposure drops in EV, evenly spaced between the two existing `drops` that enclose all `intervals`. `drops`
/// is in ascending order. `None` if nothing encloses the intervals or the step is too small.
fn levels_between(intervals: &[[f64; 2]], drops: &[f64]) -> Option<Vec<f64>> {
    let (low, high) =
        intervals.iter().fold((f64::INFINITY, 0.0_f64), |(low, high), ends| (low.min(ends[0]), high.max(ends[1])));
    let below = drops.iter().rev().find(|drop| **drop <= low)?;
    let above = drops.iter().find(|drop| **drop >= high)?;
    let step = (above - below) / (PROPOSED_LEVELS + 1) as f64;
    let new: Vec<f64> = (1..=PROPOSED_LEVELS)
        .map(|index| below + step * index as f64)
        .map(|drop| (drop * 100.0).round() / 100.0)
        .filter(|drop| !drops.contains(drop))
        .collect();
    (step >= MIN_STEP && !new.is_empty()).then_some(new)
}

/// Maximum number of frames for each variant (chosen).
const MAX_FRAMES: usize = 5;

/// Minimum number of right answers at L0, over all models, that a frame needs to be in the table (chosen).
const MIN_RIGHT: usize = 3;

/// The first level with a loss in each family, and the frames that keep the fewest right answers.
pub(super) fn fails_first(findings: &Findings<'_>) -> [Table; 2] {
    [families(findings), frames(findings)]
}

/// A row for each family and a column for each variant. The rows are in the order of families, because a family with
/// more questions reaches a small p at a lighter level.
fn families(findings: &Findings<'_>) -> Table {
    let variants: Vec<(&Variant, BTreeMap<&Family, &PooledFinding>)> =
        findings.grid.variants().into_iter().map(|variant| (variant, first_losses(findings, variant))).collect();
    let mut families: Vec<&Family> = findings.grid.groups().into_iter().flatten().collect();
    if families.len() < 2 {
        families.clear();
    }
    let mut builder = TableBuilder::new("families_first", families)
        .page(
            "families",
            "First level with a loss from L0 in each family, in points: a list, no comparison of families",
        )
        .column(Text, "terminal family | page family", |family| family_name(Some(family)).to_owned());
    for (variant, losses) in variants {
        let name = light(variant, None);
        let heads = ColumnHeads { terminal: vec![name.clone()], page: Some(name), ..ColumnHeads::default() };
        builder = builder.column(Text, heads, move |family| {
            losses.get(family).map_or_else(
                || "no level".to_owned(),
                |loss| {
                    let difference = loss.strict.tested.difference;
                    let [value, low, high] = [difference.value, difference.low, difference.high].map(points);
                    format!("{}: {value} [{low}, {high}]", loss.level)
                },
            )
        });
    }
    let mut table = builder.build();
    if !table.rows.is_empty() {
        table.heading = Some("First level with a loss from L0, by family".to_owned());
        table.foot = Some(
            "p < 0.05 after one correction over the families and levels of a column; a family with more questions gets there at a lighter \
             level, so the rows do not compare families"
                .to_owned(),
        );
    }
    table
}

/// Loss of each family at the first level where a loss is detected in a variant. One correction (Holm) covers the tests
/// of all families and levels of the variant, so that the many tests do not make a family fail by chance.
fn first_losses<'f>(findings: &'f Findings<'_>, variant: &Variant) -> BTreeMap<&'f Family, &'f PooledFinding> {
    let tested: Vec<(&Family, &PooledFinding)> = findings
        .pooled
        .iter()
        .filter(|finding| finding.kind == PooledKind::Darkness && finding.variant == *variant)
        .filter_map(|finding| Some((finding.family.as_ref()?, finding)))
        .collect();
    let p_values: Vec<f64> = tested.iter().map(|(_, finding)| finding.strict.tested.p).collect();
    let mut losses = BTreeMap::new();
    for ((family, finding), p_holm) in tested.into_iter().zip(holm(&p_values)) {
        if p_holm < ALPHA && finding.strict.tested.verdict == Verdict::Worse {
            let first = losses.entry(family).or_insert(finding);
            if finding.level < first.level {
                *first = finding;
            }
        }
    }
    losses
}

/// Answers of the pooled models to the questions about one frame in one variant.
#[derive(Default)]
struct FrameAnswers {
    /// Number of right answers at L0.
    right: usize,
    /// Number of right answers at L0 that are still right at each dark level.
    kept: BTreeMap<AxisLevel, usize>,
}

impl FrameAnswers {
    /// Share of right answers that are still right, as mean over the dark levels.
    fn kept_share(&self) -> f64 {
        let kept: usize = self.kept.values().sum();
        kept as f64 / (self.right * self.kept.len().max(1)) as f64
    }

    /// First level at which at most half of the right answers are still right.
    fn half_lost_level(&self) -> Option<AxisLevel> {
        self.kept.iter().find(|(_, kept)| 2 * **kept <= self.right).map(|(level, _)| *level)
    }
}

/// A frame in a variant.
struct FrameRow<'f> {
    variant: &'f Variant,
    frame: &'f FrameId,
    answers: FrameAnswers,
}

/// Frames that keep the fewest right answers in each variant of raw images.
fn frames(findings: &Findings<'_>) -> Table {
    let rows = findings.grid.variants().into_iter().flat_map(|variant| frame_rows(findings, variant));
    let mut table = TableBuilder::new("frames_first", rows)
        .page(ACCURACY, "Frames with the fewest right answers of L0 kept in the dark: a list, not a finding")
        .group(|row| Some(light(row.variant, None)))
        .column(Text, "terminal frame | page frame", |row| row.frame.to_string())
        .column(Count, "terminal right at L0 | page right at L0", |row| row.answers.right)
        .column(Percent, "terminal kept % | page kept in the dark, %", |row| row.answers.kept_share())
        .column(Text, "terminal half lost at | page half lost at", |row| {
            row.answers.half_lost_level().map(|level| level.to_string())
        })
        .build();
    if !table.rows.is_empty() {
        table.heading = Some("Frames with the fewest right answers kept in the dark".to_owned());
        table.foot = Some("a list, not a finding: of many frames, some keep few answers by chance".to_owned());
    }
    table
}

/// Frames that keep the fewest right answers in a variant, those with the fewest first.
fn frame_rows<'f>(findings: &'f Findings<'_>, variant: &'f Variant) -> Vec<FrameRow<'f>> {
    let mut rows: Vec<FrameRow<'_>> = answers(findings, variant)
        .into_iter()
        .filter(|(_, answers)| answers.right >= MIN_RIGHT && answers.half_lost_level().is_some())
        .map(|(frame, answers)| FrameRow { variant, frame, answers })
        .collect();
    rows.sort_by(|one, other| {
        let (one, other) = (one.answers.kept_share(), other.answers.kept_share());
        one.total_cmp(&other)
    });
    rows.truncate(MAX_FRAMES);
    rows
}

/// Counts the answers of the pooled models for each frame.
fn answers<'f>(findings: &'f Findings<'_>, variant: &Variant) -> BTreeMap<&'f FrameId, FrameAnswers> {
    let grid = &findings.grid;
    let models = findings.models_of(variant);
    let mut by_frame: BTreeMap<&FrameId, FrameAnswers> = BTreeMap::new();
    for failure in &findings.first_failures {
        let curve = &failure.curve;
        let is_pooled = curve.variant == *variant && curve.enhancer.is_none() && models.contains(&&*curve.model);
        let [(_, clean), dark @ ..] = &curve.subjects[..] else {
            continue;
        };
        if !is_pooled {
            continue;
        }
        for (index, item) in grid.items.iter().enumerate() {
            let is_right = |subject: usize| {
                let answer = grid.compared_result(subject, index).parsed(ParsingMode::Strict);
                answer.is_some_and(|choice| item.is_right(choice))
            };
            if failure.has_item(grid, index) && is_right(*clean) {
                let answers = by_frame.entry(&*item.asked.frame).or_default();
                answers.right += 1;
                for (level, subject) in dark {
                    *answers.kept.entry(*level).or_default() += usize::from(is_right(*subject));
                }
            }
        }
    }
    by_frame
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn proposed_levels_surround_the_thresholds() {
        let ladder = [0.0, 2.0, 4.0, 6.0, 7.5, 9.0];
        assert_eq!(levels_between(&[[2.2, 3.9]], &ladder), Some(vec![2.5, 3.0, 3.5]));
        // The intervals span two steps; the level between the steps already exists.
        assert_eq!(levels_between(&[[2.2, 3.0], [5.0, 5.5]], &ladder), Some(vec![3.0, 5.0]));
        // No proposal: a threshold beyond the darkest level, no known threshold, and a step below the minimum.
        assert_eq!(levels_between(&[[8.0, f64::INFINITY]], &ladder), None);
        assert_eq!(levels_between(&[], &ladder), None);
        assert_eq!(levels_between(&[[1.1, 1.3]], &[0.0, 1.0, 1.5, 2.0]), None);
    }
}
