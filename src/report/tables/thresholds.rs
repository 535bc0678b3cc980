//! Tables of darkness thresholds and of areas under the accuracy curves, for all families together and by family.

use std::collections::BTreeSet;

use crate::report::text::table::ColumnKind::{Number, Percent, Share, Text, Threshold};
use crate::report::text::table::{Table, TableBuilder, TableCell};
use crate::report::text::words::light;
use crate::types::AxisLevel;
use crate::types::degradations::Axis;
use crate::types::text::{counted, plural};
use darkqa_score::accuracies::Curve;
use darkqa_score::choice::ParsingMode;
use darkqa_score::findings::Findings;
use darkqa_score::threshold::{CurveSummary, NoThreshold, SparseLevel};

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
    let notes = notes(&curves);
    let lenient = table(&titles, "", &curves, ParsingMode::Lenient).in_files_only();
    let (all_families, by_family): (Vec<&Curve>, Vec<&Curve>) =
        curves.into_iter().partition(|curve| curve.family.is_none());
    let heading = format!(
        "{} in {} (half-way from L0 to the floor) and mean accuracy in %, with 95 % intervals by {}",
        titles.quantity, axis.unit, findings.unit
    );
    let mut all_families = table(&titles, titles.caption, &all_families, ParsingMode::Strict);
    all_families.heading = (!all_families.rows.is_empty()).then_some(heading);
    all_families.notes = notes;
    if axis == Axis::LIGHT {
        all_families.notes.extend(finer_levels_note(findings));
    }
    let caption = format!("{} by family", titles.caption);
    let mut by_family = table(&titles, &caption, &by_family, ParsingMode::Strict);
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
fn table(titles: &Titles, caption: &str, curves: &[&Curve], mode: ParsingMode) -> Table {
    TableBuilder::new(titles.file, curves)
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

/// Text for the reason why a curve has no threshold.
pub(crate) fn missing_threshold_reason(reason: &NoThreshold) -> String {
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
