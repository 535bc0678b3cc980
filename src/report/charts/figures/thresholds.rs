//! Figures of thresholds: one of darkness thresholds, one of blur thresholds.

use std::collections::BTreeSet;

use super::{FigureBuilder, FigureSpec};
use crate::report::charts::chart::figure_chart::FigureChart;
use crate::report::charts::chart::thresholds::{Scale, ThresholdChart, ThresholdRow};
use crate::report::tables::missing_threshold_reason;
use crate::report::text::words::stops;
use crate::types::degradations::Axis;
use darkqa_score::accuracies::Curve;
use darkqa_score::findings::Findings;

/// Name and axis of each figure.
const NAMES: [(&str, Axis); 2] = [("thresholds", Axis::LIGHT), ("blur_thresholds", Axis::MOTION)];

/// Message that a threshold figure is missing because no curve has a threshold, with the reasons; `None` if that is not
/// the cause.
pub(crate) fn missing_threshold_message(findings: &Findings<'_>, figure: &str) -> Option<String> {
    let (_, axis) = NAMES.into_iter().find(|(name, _)| *name == figure)?;
    let reasons: BTreeSet<String> = curves_on(findings, axis)
        .filter_map(|curve| curve.summary.threshold.as_ref().err())
        .map(missing_threshold_reason)
        .collect();
    let reasons: Vec<String> = reasons.into_iter().collect();
    (!reasons.is_empty()).then(|| format!("no curve has a threshold: {}", reasons.join("; ")))
}

/// Curves on an axis that are over all families together.
fn curves_on<'f>(findings: &'f Findings<'_>, axis: Axis) -> impl Iterator<Item = &'f Curve> {
    findings.curves.iter().filter(move |curve| curve.family.is_none() && curve.axis() == axis)
}

impl FigureBuilder<'_> {
    /// One figure for each axis on which a curve has a threshold.
    pub(super) fn thresholds(&self) -> Vec<FigureSpec> {
        Axis::ALL.into_iter().filter_map(|axis| self.thresholds_on(axis)).collect()
    }

    /// One row for each curve on an axis, with its threshold and interval; `None` if no curve has a threshold.
    fn thresholds_on(&self, axis: Axis) -> Option<FigureSpec> {
        let rows: Vec<ThresholdRow> = curves_on(self.findings, axis)
            .filter_map(|curve| {
                let threshold = *curve.summary.threshold.as_ref().ok()?;
                let darkest = curve.summary.darkest.value();
                let light = self.condition_text(&curve.variant, curve.enhancer.as_ref());
                Some(ThresholdRow {
                    name: format!("{}, {light}", self.curve_name(&curve.model)),
                    threshold,
                    text: format!(
                        "{} [{}, {}]",
                        stops(threshold.value, darkest),
                        stops(threshold.low, darkest),
                        stops(threshold.high, darkest)
                    ),
                })
            })
            .collect();
        if rows.is_empty() {
            return None;
        }
        let (name, caption) = if axis == Axis::MOTION {
            (
                "blur_thresholds",
                "Threshold of motion blur: the exposure time at which accuracy is half-way between that at L0 and that without images (or guessing, if that is higher). Arrows: \
                 beyond the longest time asked.",
            )
        } else {
            (
                "thresholds",
                "Darkness threshold: the exposure drop at which accuracy is half-way between that at L0 and that without images (or guessing, if that is higher). Arrows: \
                 beyond the darkest level asked.",
            )
        };
        Some(FigureSpec {
            name,
            caption: caption.to_owned(),
            chart: FigureChart::Thresholds(ThresholdChart {
                rows,
                scale: Scale::for_axis(axis),
                unit: self.findings.unit.to_string(),
            }),
        })
    }
}
