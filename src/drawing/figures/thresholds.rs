//! The figures of the thresholds, one for each axis.

use std::collections::BTreeSet;

use super::{Drawing, Overview};
use crate::drawing::chart::drawn::Drawn;
use crate::drawing::chart::thresholds::{Scale, ThresholdChart, ThresholdRow};
use crate::tables::level_words;
use crate::text::words::stops;
use crate::types::degradations::Axis;
use darkqa_score::accuracies::Curve;
use darkqa_score::findings::Findings;

/// The names of the figures.
const NAMES: [(&str, Axis); 2] = [
    ("thresholds", Axis::LIGHT),
    ("blur_thresholds", Axis::MOTION),
];

/// Why a figure cannot be drawn although its images were asked: the curves have no threshold. `None` if it is for another reason.
pub(crate) fn without_threshold(findings: &Findings<'_>, figure: &str) -> Option<String> {
    let (_, axis) = NAMES.into_iter().find(|(name, _)| *name == figure)?;
    let reasons =
        curves_on(findings, axis).filter_map(|curve| curve.summary.threshold.as_ref().err());
    let reasons: BTreeSet<String> = reasons.map(level_words).collect();
    let reasons: Vec<String> = reasons.into_iter().collect();
    (!reasons.is_empty()).then(|| format!("no curve has a threshold: {}", reasons.join("; ")))
}

/// The curves of all families together on an axis.
fn curves_on<'f>(findings: &'f Findings<'_>, axis: Axis) -> impl Iterator<Item = &'f Curve> {
    findings
        .curves
        .iter()
        .filter(move |curve| curve.family.is_none() && curve.axis() == axis)
}

impl Overview<'_> {
    /// The figure of each axis on which a curve has a threshold.
    pub(super) fn thresholds(&self) -> Vec<Drawing> {
        Axis::ALL
            .into_iter()
            .filter_map(|axis| self.thresholds_on(axis))
            .collect()
    }

    /// A row for each curve, with its threshold and interval on an axis. `None` if no curve has a threshold.
    fn thresholds_on(&self, axis: Axis) -> Option<Drawing> {
        let rows: Vec<ThresholdRow> = curves_on(self.findings, axis)
            .filter_map(|curve| {
                let threshold = *curve.summary.threshold.as_ref().ok()?;
                let darkest = curve.summary.darkest.value();
                let light = self.light(&curve.variant, curve.enhancer.as_ref());
                Some(ThresholdRow {
                    name: format!("{}, {light}", self.names.shown(&curve.model)),
                    threshold,
                    words: format!(
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
                "Threshold of motion blur: the exposure time at which accuracy is half-way between that at L0 and chance. Arrows: \
                 beyond the longest time asked.",
            )
        } else {
            (
                "thresholds",
                "Darkness threshold: the exposure drop at which accuracy is half-way between that at L0 and chance. Arrows: \
                 beyond the darkest level asked.",
            )
        };
        Some(Drawing {
            name,
            caption: caption.to_owned(),
            chart: Drawn::Thresholds(ThresholdChart {
                rows,
                scale: Scale::new(axis),
                unit: self.findings.unit.to_string(),
            }),
        })
    }
}
