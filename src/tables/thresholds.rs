//! Tables of darkness thresholds and areas: all families together, and by family.

use std::collections::BTreeSet;

use crate::text::table::ColumnKind::{Number, Share, Text, Threshold};
use crate::text::table::{Table, TableBuilder, TableCell};
use crate::text::words::{counted, light};
use crate::types::AxisLevel;
use crate::types::degradations::Axis;
use darkqa_score::accuracies::Curve;
use darkqa_score::choice::ReadingMode;
use darkqa_score::findings::Findings;
use darkqa_score::threshold::{CurveSummary, NoThreshold, ThinLevel};

pub(super) fn thresholds(findings: &Findings<'_>) -> Vec<Table> {
    let mut tables = Vec::new();
    for axis in Axis::ALL {
        let curves: Vec<&Curve> = findings
            .curves
            .iter()
            .filter(|curve| curve.axis() == axis)
            .collect();
        // Only light has tables without a row: it is what a run is about.
        if !curves.is_empty() || axis == Axis::LIGHT {
            tables.extend(axis_tables(findings, axis, curves));
        }
    }
    tables
}

/// The tables of the curves over one axis.
fn axis_tables(findings: &Findings<'_>, axis: Axis, curves: Vec<&Curve>) -> [Table; 3] {
    let notes = notes(&curves);
    let lenient = table(&Names::new(axis), "", &curves, ReadingMode::Lenient).in_files_only();
    let (whole, by_family): (Vec<&Curve>, Vec<&Curve>) =
        curves.into_iter().partition(|curve| curve.family.is_none());
    let names = Names::new(axis);
    let heading = format!(
        "{} in {} (half-way from L0 to chance) and mean accuracy in %, with 95 % intervals by {}",
        names.threshold, axis.unit, findings.unit
    );
    let mut whole = table(&names, names.caption, &whole, ReadingMode::Strict);
    whole.heading = (!whole.rows.is_empty()).then_some(heading);
    whole.notes = notes;
    if axis == Axis::LIGHT {
        whole.notes.extend(finer(findings));
    }
    let caption = format!("{} by family", names.caption);
    let mut by_family = table(&names, &caption, &by_family, ReadingMode::Strict);
    by_family.is_folded = true;
    [whole, by_family, lenient]
}

/// Names in the tables of an axis.
struct Names {
    /// The file.
    file: &'static str,
    caption: &'static str,
    threshold: &'static str,
    darkest: &'static str,
    columns: &'static str,
    range: &'static str,
}

impl Names {
    fn new(axis: Axis) -> Self {
        if axis == Axis::MOTION {
            return Self {
                file: "blur_thresholds",
                caption: "Thresholds and areas of motion blur",
                threshold: "Exposure time of motion blur",
                darkest: "csv longest_ms",
                columns: "csv threshold_ms low high | terminal threshold, interval | page threshold in ms [95 %]",
                range: "page ms",
            };
        }
        Self {
            file: "thresholds",
            caption: "Thresholds and areas",
            threshold: "Darkness threshold",
            darkest: "csv darkest_ev",
            columns: "csv threshold_ev low high | terminal threshold, interval | page threshold in EV [95 %]",
            range: "page EV",
        }
    }
}

/// A threshold is `inf` beyond the darkest level, and empty if it is not known.
fn table(names: &Names, caption: &str, curves: &[&Curve], mode: ReadingMode) -> Table {
    TableBuilder::new(names.file, curves)
        .page("thresholds", caption)
        .line(|curve| (&curve.model, &curve.variant, curve.enhancer.as_ref()))
        .column(Text, "terminal light | page light", |curve| {
            light(&curve.variant, curve.enhancer.as_ref())
        })
        .family(|curve| curve.family.as_ref())
        .column(Number, names.darkest, |curve| {
            curve.parsed(mode).darkest.value()
        })
        .column(Threshold, names.columns, |curve| {
            let darkest = curve.parsed(mode).darkest.value();
            match &curve.parsed(mode).threshold {
                Ok(threshold) => TableCell::Threshold(*threshold, darkest),
                Err(reason) => TableCell::Unknown(why(reason)),
            }
        })
        .column(
            Share,
            "csv area area_low area_high n | terminal mean accuracy | page area in % [95 %]",
            |curve| curve.parsed(mode).area,
        )
        .column(Text, names.range, |curve| {
            format!("0–{}", curve.parsed(mode).darkest.value())
        })
        .column(Text, "csv reason", |curve| reason(curve.parsed(mode)))
        .column(Text, "csv mode", |_| mode.name())
        .build()
}

/// Why a threshold is not known.
pub(crate) fn why(reason: &NoThreshold) -> String {
    match reason {
        NoThreshold::NotAboveChance => "not clearly above chance at L0".to_owned(),
        NoThreshold::Thin(level) => thin(level),
    }
}

fn thin(level: &ThinLevel) -> String {
    let replies = match level.replies {
        1 => "1 reply".to_owned(),
        replies => format!("{replies} replies"),
    };
    format!(
        "{} has {replies} in {}",
        level.level,
        counted(level.clusters, "cluster")
    )
}

/// Why the threshold of a curve is not known, or which levels are left out; empty if neither.
fn reason(summary: &CurveSummary) -> String {
    let left_out = summary
        .left_out
        .iter()
        .map(|level| format!("left out: {}", thin(level)));
    let unknown = summary.threshold.as_ref().err().map(why);
    let reasons: Vec<String> = unknown.into_iter().chain(left_out).collect();
    reasons.join("; ")
}

/// The requirements of a threshold that is unknown for lack of them, and a line for each curve of all families together with the levels that are
/// left out.
fn notes(curves: &[&Curve]) -> Vec<String> {
    let curves = curves.iter().filter(|curve| curve.family.is_none());
    let thinned = curves
        .clone()
        .filter(|curve| !curve.summary.left_out.is_empty());
    let is_thin = |curve: &Curve| matches!(curve.summary.threshold, Err(NoThreshold::Thin(_)));
    let is_needed = curves.clone().any(|curve| is_thin(curve));
    let needed = is_needed.then(|| format!("a threshold needs {}", ThinLevel::needed()));
    let left_out = thinned.map(|curve| {
        let light = light(&curve.variant, curve.enhancer.as_ref());
        let left_out: Vec<String> = curve.summary.left_out.iter().map(thin).collect();
        format!(
            "left out of {}, {light}: {}",
            curve.model,
            left_out.join(", ")
        )
    });
    needed.into_iter().chain(left_out).collect()
}

/// Number of levels that [`finer`] proposes.
const MORE_LEVELS: usize = 3;

/// The smallest step in EV that [`finer`] proposes: finer levels differ by less than the intervals of thresholds.
const LEAST_STEP: f64 = 0.25;

/// The levels to add where the thresholds of all raw curves lie, evenly spaced between the levels around them; `None` if the levels
/// there are close already, a threshold lies beyond them, or none is known.
///
/// All items and models are then asked there alike. A search that places levels by the answers of each model gains little, since the
/// spread between items makes most of the error, and it would compare models at different levels.
fn finer(findings: &Findings<'_>) -> Option<String> {
    let intervals: Vec<[f64; 2]> = findings
        .curves
        .iter()
        .filter(|curve| {
            curve.family.is_none() && curve.enhancer.is_none() && curve.axis() == Axis::LIGHT
        })
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
    let more = levels_within(&intervals, &drops)?;
    let more: Vec<String> = more.iter().map(ToString::to_string).collect();
    Some(format!(
        "for a finer threshold, add {} EV to --levels and ask again with --resume: all models, all items, these levels alone",
        more.join(", ")
    ))
}

/// Exposure drops in EV, evenly spaced between the two of `drops` that enclose all intervals; `drops` is in ascending order.
fn levels_within(intervals: &[[f64; 2]], drops: &[f64]) -> Option<Vec<f64>> {
    let (low, high) = intervals
        .iter()
        .fold((f64::INFINITY, 0.0_f64), |(low, high), ends| {
            (low.min(ends[0]), high.max(ends[1]))
        });
    let below = drops.iter().rev().find(|drop| **drop <= low)?;
    let above = drops.iter().find(|drop| **drop >= high)?;
    let step = (above - below) / (MORE_LEVELS + 1) as f64;
    let new: Vec<f64> = (1..=MORE_LEVELS)
        .map(|index| below + step * index as f64)
        .map(|drop| (drop * 100.0).round() / 100.0)
        .filter(|drop| !drops.contains(drop))
        .collect();
    (step >= LEAST_STEP && !new.is_empty()).then_some(new)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_are_added_around_the_thresholds_alone() {
        let ladder = [0.0, 2.0, 4.0, 6.0, 7.5, 9.0];
        let within = |intervals: &[[f64; 2]]| levels_within(intervals, &ladder);
        assert_eq!(within(&[[2.2, 3.9]]), Some(vec![2.5, 3.0, 3.5]));
        // The union spans two steps; the level between them was asked.
        assert_eq!(within(&[[2.2, 3.0], [5.0, 5.5]]), Some(vec![3.0, 5.0]));
        // Beyond the darkest level, or unknown at all.
        assert_eq!(within(&[[8.0, f64::INFINITY]]), None);
        assert_eq!(within(&[]), None);
        assert_eq!(levels_within(&[[1.1, 1.3]], &[0.0, 1.0, 1.5, 2.0]), None);
    }
}
