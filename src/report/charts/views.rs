//! Figures that need data of few runs: image fidelity, photographs in the dark, or probabilities of answers
//! ([`figure_specs`]).
//!
//! Figure of image fidelity and right answers by level: [`fidelity_spec`].
//!
//! Figure of photographs in the dark compared with synthetic images of the same darkness: [`real_spec`].
//!
//! Reliability diagram, accuracy over confidence: [`reliability_spec`].

use std::collections::{BTreeMap, BTreeSet};

use super::chart::{
    Bar, BarChart, BarPanel, Chart, FigureChart, LineContent, LineStyle, Panel, PlotLine, ReliabilityChart,
    ReliabilityLine, ReliabilityPanel,
};
use crate::report::charts::figures::FigureSpec;
use crate::report::text::words::light;
use crate::types::degradations::{Axis, Kind};
use crate::types::{AxisLevel, EnhancerName, Variant};
use darkqa_score::calibration::Calibration;
use darkqa_score::choice::ParsingMode;
use darkqa_score::comparisons::ComparisonKind;
use darkqa_score::estimate::Estimate;
use darkqa_score::findings::Findings;
use darkqa_score::model_in_condition::ModelInCondition;
use darkqa_score::photographs::{ConditionFidelity, PairDarkness};

/// The figures that have data.
pub(crate) fn figure_specs(findings: &Findings<'_>) -> impl Iterator<Item = FigureSpec> {
    [fidelity_spec(findings), real_spec(findings), reliability_spec(findings)].into_iter().flatten()
}

/// Variant, and enhancer if there is one.
type LightView<'f> = (&'f Variant, Option<&'f EnhancerName>);

/// Content of the panel of one quantity.
struct PanelSpec {
    title: &'static str,
    /// Reads the quantity, as a share, from the results of a condition.
    quantity: fn(&ConditionFidelity) -> Option<Estimate>,
    /// Value of the quantity by chance, drawn as a horizontal line.
    chance: Option<f64>,
}

const PANELS: [PanelSpec; 3] = [
    PanelSpec { title: "SSIM of the images", quantity: |row| without_interval(row.means[1]?), chance: None },
    PanelSpec { title: "share of right answers", quantity: |row| without_interval(row.accuracy), chance: None },
    PanelSpec { title: "AUC of PSNR", quantity: |row| Some(row.predicts[0]?.auc.estimate), chance: Some(0.5) },
];

/// Image similarity, accuracy, and how well similarity predicts right answers, by level: a row of panels for each axis,
/// and a line for each variant and enhancer. `None` if no image was measured.
fn fidelity_spec(findings: &Findings<'_>) -> Option<FigureSpec> {
    let fidelity = findings.fidelity.as_ref()?;
    let mut lights = BTreeMap::<LightView<'_>, Vec<&ConditionFidelity>>::new();
    for row in &fidelity.conditions {
        // Photographs in the dark are not at a level.
        if row.level != AxisLevel::PAIR {
            let light = (&row.variant, row.enhancer.as_ref());
            lights.entry(light).or_default().push(row);
        }
    }
    let panels: Vec<Panel> = Axis::ALL
        .into_iter()
        .flat_map(|axis| PANELS.map(|spec| panel(&lights, axis, &spec)))
        .filter(|panel| panel.lines.iter().any(is_curve))
        .collect();
    if panels.is_empty() {
        return None;
    }
    let models = match fidelity.models.len() {
        1 => format!("answers of {}", fidelity.models[0]),
        several => format!("answers of {several} models together"),
    };
    let chart = Chart {
        measure: "× 100",
        panels,
        columns: 3,
        note: format!("{models}; the band of an AUC is its 95 % interval by {}; strict parsing", findings.unit),
    };
    Some(FigureSpec {
        name: "fidelity",
        caption: "Does a better picture mean better answers? Between conditions: how similar the images are to their clean frames \
                  and how many answers are right. Within a condition: AUC of PSNR, 50 is chance. PSNR and the AUC of SSIM are in the table."
            .to_owned(),
        chart: FigureChart::Lines(chart),
    })
}

fn is_curve(line: &PlotLine) -> bool {
    matches!(line.content, LineContent::Curve(_))
}

fn panel(lights: &BTreeMap<LightView<'_>, Vec<&ConditionFidelity>>, axis: Axis, spec: &PanelSpec) -> Panel {
    let mut lines = Vec::new();
    for (style, ((variant, enhancer), rows)) in lights.iter().enumerate() {
        if variant.kind.map(Kind::axis) != Some(axis) {
            continue;
        }
        let points: Vec<_> = rows.iter().filter_map(|row| Some((row.level, (spec.quantity)(row)?))).collect();
        if !points.is_empty() {
            lines.push(PlotLine {
                name: light(variant, *enhancer),
                style: LineStyle(style),
                content: LineContent::Curve(points),
                model: None,
                items: None,
            });
        }
    }
    lines.extend(spec.chance.map(|share| PlotLine {
        name: "chance".to_owned(),
        style: LineStyle::REFERENCE,
        content: LineContent::Flat(share),
        model: None,
        items: None,
    }));
    Panel { title: spec.title.to_owned(), lines, model: None, lux: None }
}

/// A number without an interval.
fn without_interval(value: impl Into<Option<f64>>) -> Option<Estimate> {
    value.into().map(|value| Estimate { value, low: value, high: value, n: 0 })
}

/// Accuracy of each model at L0, on photographs in the dark, on synthetic images that are as dark, and on enhanced
/// photographs; `None` if no scene was photographed in the dark.
fn real_spec(findings: &Findings<'_>) -> Option<FigureSpec> {
    let chance = findings
        .summary
        .family_cells(None, ParsingMode::Strict)
        .filter(|cell| cell.subject.view.is_none())
        .find_map(|cell| Some(cell.accuracy?.value));
    let mut models: Vec<&str> = Vec::new();
    for subject in &findings.grid.subjects {
        if models.last() != Some(&&*subject.model) {
            models.push(&subject.model);
        }
    }
    let panels: Vec<BarPanel> = findings
        .pairs
        .iter()
        .flat_map(|pair| models.iter().map(move |model| (pair, *model)))
        .map(|(pair, model)| BarPanel {
            title: format!("{model}: accuracy in %"),
            bars: bars(findings, pair, model),
            chance,
        })
        .filter(|panel| panel.bars.len() > 1)
        .collect();
    if panels.is_empty() {
        return None;
    }
    let chart = BarChart { panels, note: format!("lines are 95 % intervals by {}; strict parsing", findings.unit) };
    Some(FigureSpec {
        name: "real",
        caption: "Real against synthetic darkness: accuracy in the light (L0), on photographs in the dark, on synthetic images \
                  that are as dark, and on enhanced photographs. Broken line: chance."
            .to_owned(),
        chart: FigureChart::Bars(chart),
    })
}

/// Bars of a model for one set of photographs. Each condition that is compared with the photographs has one bar.
fn bars(findings: &Findings<'_>, pair: &PairDarkness, model: &str) -> Vec<Bar> {
    let mut subjects: Vec<&ModelInCondition> = Vec::new();
    let mut bars = Vec::new();
    for row in &findings.comparisons {
        let is_compared = row.family.is_none()
            && row.first.model == model
            && row.first.variant.photograph() == Some(&pair.name)
            && matches!(row.kind, ComparisonKind::Level | ComparisonKind::RealSynthetic | ComparisonKind::RealEnhanced);
        if !is_compared {
            continue;
        }
        for subject in [&row.second, &row.first] {
            if subjects.contains(&subject) {
                continue;
            }
            subjects.push(subject);
            let cell = findings.summary.cell(subject, None, ParsingMode::Strict);
            if let Some(share) = cell.and_then(|cell| cell.accuracy) {
                bars.push(Bar { name: subject.condition(), style: LineStyle(bars.len()), share });
            }
        }
    }
    bars
}

/// Maximum number of levels in a panel (chosen).
const MAX_LEVELS: usize = 4;

/// Accuracy over confidence of each model in the main variant without enhancement, one line for each level; `None` if
/// the servers returned no probabilities of the choices.
fn reliability_spec(findings: &Findings<'_>) -> Option<FigureSpec> {
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
