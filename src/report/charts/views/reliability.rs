//! Reliability diagram, accuracy over confidence: [`figure_spec`].

use std::collections::BTreeSet;

use crate::report::charts::chart::LineStyle;
use crate::report::charts::chart::figure_chart::FigureChart;
use crate::report::charts::chart::reliability::{ReliabilityChart, ReliabilityLine, ReliabilityPanel};
use crate::report::charts::figures::FigureSpec;
use crate::report::text::words::light;
use crate::types::AxisLevel;
use darkqa_score::calibration::Calibration;
use darkqa_score::findings::Findings;

/// Maximum number of levels in a panel (chosen).
const MAX_LEVELS: usize = 4;

/// Accuracy over confidence of each model in the main variant without enhancement, one line for each level; `None` if
/// the servers returned no probabilities of the choices.
pub(super) fn figure_spec(findings: &Findings<'_>) -> Option<FigureSpec> {
    let variant = findings.grid.main_variant();
    let rows: Vec<(&Calibration, AxisLevel)> = findings
        .calibrations
        .iter()
        .filter(|row| !row.bins.is_empty() && row.subject.enhancer.is_none())
        .filter_map(|row| Some((row, row.subject.level?)))
        .filter(|(row, level)| *level == AxisLevel::L0 || Some(&row.subject.variant) == variant.as_ref())
        .collect();
    let levels: BTreeSet<AxisLevel> = rows.iter().map(|(_, level)| *level).collect();
    let levels = spread(&levels.into_iter().collect::<Vec<_>>());
    let mut panels: Vec<ReliabilityPanel> = Vec::new();
    for (row, level) in rows {
        let Some(style) = levels.iter().position(|other| *other == level) else {
            continue;
        };
        let line = ReliabilityLine {
            name: level.to_string(),
            style: LineStyle(style),
            bins: row.bins.iter().map(|bin| (bin.confidence, bin.accuracy)).collect(),
        };
        match panels.iter_mut().find(|panel| panel.title == row.subject.model) {
            Some(panel) => panel.lines.push(line),
            None => panels.push(ReliabilityPanel { title: row.subject.model.clone(), lines: vec![line] }),
        }
    }
    if panels.is_empty() {
        return None;
    }
    let dark = variant.map_or_else(String::new, |variant| format!("; dark images {}", light(&variant, None)));
    let chart = ReliabilityChart {
        panels,
        note: format!(
            "bins of about as many replies each, ten at most; bars are 95 % intervals by {}; strict parsing{dark}",
            findings.unit
        ),
    };
    Some(FigureSpec {
        name: "reliability",
        caption: "Is a model as often right as it is confident? Accuracy over confidence; on the dotted diagonal both are equal, below it \
                  the model is overconfident."
            .to_owned(),
        chart: FigureChart::Reliability(chart),
    })
}

/// Selects at most [`MAX_LEVELS`] levels, evenly from the first to the last.
fn spread(levels: &[AxisLevel]) -> Vec<AxisLevel> {
    let last = levels.len().saturating_sub(1);
    if levels.len() <= MAX_LEVELS {
        return levels.to_vec();
    }
    (0..MAX_LEVELS).map(|place| levels[(place * last).div_ceil(MAX_LEVELS - 1)]).collect()
}
