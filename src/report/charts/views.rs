//! Figures that need data of few runs: image fidelity, photographs in the dark, or probabilities of answers
//! ([`figure_specs`]).
//!
//! Figure of image fidelity and right answers by level: [`fidelity_spec`].
//!
//! Figure of photographs in the dark compared with synthetic images of the same darkness: [`real_spec`].
//!
//! Reliability diagram, accuracy over confidence: [`reliability_spec`].
//!
//! Standard deviations of a reply by source of variation: [`variation_spec`].

use std::collections::{BTreeMap, BTreeSet};

use super::chart::{Chart, LineContent, LineStyle, Panel, PlotLine, Scale};
use crate::charts::figures::FigureSpec;
use crate::text::words::light;
use darkqa_base::types::degradations::{Axis, Kind};
use darkqa_base::types::{AxisLevel, EnhancerName, Variant};
use darkqa_score::calibration::Calibration;
use darkqa_score::choice::ParsingMode;
use darkqa_score::comparisons::ComparisonKind;
use darkqa_score::estimate::Estimate;
use darkqa_score::findings::Findings;
use darkqa_score::model_in_condition::ModelInCondition;
use darkqa_score::photographs::{ConditionFidelity, PairDarkness};

/// The figures that have data.
pub fn figure_specs(findings: &Findings<'_>) -> impl Iterator<Item = FigureSpec> {
    let specs = [fidelity_spec(findings), real_spec(findings), reliability_spec(findings), variation_spec(findings)];
    specs.into_iter().flatten()
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
        .filter(|panel| panel.lines.iter().any(PlotLine::is_curve))
        .collect();
    if panels.is_empty() {
        return None;
    }
    let models = match fidelity.models.len() {
        1 => format!("answers of {}", fidelity.models[0]),
        several => format!("answers of {several} models together"),
    };
    let chart = Chart {
        panels,
        columns: 3,
        note: format!("{models}; the band of an AUC is its 95 % interval by {}; strict parsing", findings.unit),
    };
    Some(FigureSpec {
        name: "fidelity",
        caption: "Does a better picture mean better answers? Between conditions: how similar the images are to their clean frames \
                  and how many answers are right. Within a condition: AUC of PSNR, 50 is chance. PSNR and the AUC of SSIM are in the table."
            .to_owned(),
        chart,
    })
}

fn panel(lights: &BTreeMap<LightView<'_>, Vec<&ConditionFidelity>>, axis: Axis, spec: &PanelSpec) -> Panel {
    let mut lines = Vec::new();
    for (style, ((variant, enhancer), rows)) in lights.iter().enumerate() {
        if variant.kind.map(Kind::axis) != Some(axis) {
            continue;
        }
        let points: Vec<_> = rows.iter().filter_map(|row| Some((row.level, (spec.quantity)(row)?))).collect();
        if !points.is_empty() {
            lines.push(PlotLine::new(light(variant, *enhancer), LineStyle(style), LineContent::Curve(points)));
        }
    }
    lines.extend(spec.chance.map(PlotLine::chance));
    Panel::over_levels("× 100", spec.title.to_owned(), lines)
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
    let panels: Vec<Panel> = findings
        .pairs
        .iter()
        .flat_map(|pair| models.iter().map(move |model| (pair, *model)))
        .map(|(pair, model)| {
            let panel = Panel::from_bars(format!("{model}: accuracy in %"), bars(findings, pair, model), chance);
            Panel { model: Some(model.to_owned()), ..panel }
        })
        .filter(|panel| panel.places().count() > 1)
        .collect();
    if panels.is_empty() {
        return None;
    }
    let chart =
        Chart { panels, columns: 1, note: format!("lines are 95 % intervals by {}; strict parsing", findings.unit) };
    Some(FigureSpec {
        name: "real",
        caption: "Real against synthetic darkness: accuracy in the light (L0), on photographs in the dark, on synthetic images \
                  that are as dark, and on enhanced photographs. Broken line: chance."
            .to_owned(),
        chart,
    })
}

/// Bars of a model for one set of photographs. Each condition that is compared with the photographs has one bar.
fn bars(findings: &Findings<'_>, pair: &PairDarkness, model: &str) -> Vec<PlotLine> {
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
                bars.push(PlotLine::bar(subject.condition(), LineStyle(bars.len()), share));
            }
        }
    }
    bars
}

/// Maximum number of models with a panel of their variation (chosen).
const MAX_VARIATIONS: usize = 6;

/// Standard deviation of a reply by source, at L0 and at the darkest level of the main variant, a panel for each; `None`
/// if every question was asked in one wording, one order and one draw.
fn variation_spec(findings: &Findings<'_>) -> Option<FigureSpec> {
    let found = findings.variation.as_ref()?;
    let changes = found.darkest_changes(&findings.grid);
    let subjects = changes.iter().take(MAX_VARIATIONS).flat_map(|change| [&change.second, &change.first]);
    let panels: Vec<Panel> = subjects
        .filter_map(|subject| {
            let row = found.accuracies.iter().find(|row| row.subject == *subject)?;
            let bars = row.components.components.iter().enumerate().map(|(style, component)| {
                let name = component.source.name().replace("question × ", "× ");
                PlotLine::bar(name, LineStyle(style), component.deviation)
            });
            let title = format!("{} {}: standard deviation in %", subject.model, subject.condition());
            let panel = Panel::from_bars(title, bars.collect(), None);
            Some(Panel { model: Some(subject.model.clone()), ..panel })
        })
        .collect();
    if panels.is_empty() {
        return None;
    }
    let note = format!("lines are 95 % intervals; {}; strict parsing", found.asked());
    Some(FigureSpec {
        name: "variation",
        caption: "Where the variation of a reply (0 or 1) comes from, at L0 and in the dark. ×: what differs from question to question."
            .to_owned(),
        chart: Chart { panels, columns: 1, note },
    })
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
    let mut panels: Vec<Panel> = Vec::new();
    for (row, level) in rows {
        let Some(style) = levels.iter().position(|other| *other == level) else {
            continue;
        };
        let position = panels.iter().position(|panel| panel.title == row.subject.model);
        let position = position.unwrap_or_else(|| {
            panels.push(reliability_panel(&row.subject.model));
            panels.len() - 1
        });
        let bins = || row.bins.iter().map(|bin| (bin.confidence, bin.accuracy));
        let path = bins().map(|(confidence, accuracy)| [confidence, accuracy.value]).collect();
        let line = |content| PlotLine::new(level.to_string(), LineStyle(style), content);
        let lines = [line(LineContent::Path(path)), line(LineContent::Points(bins().collect()))];
        panels[position].lines.extend(lines);
    }
    if panels.is_empty() {
        return None;
    }
    let dark = variant.map_or_else(String::new, |variant| format!("; dark images {}", light(&variant, None)));
    let chart = Chart {
        panels,
        columns: 3,
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
        chart,
    })
}

/// Panel of accuracy over confidence, with the diagonal on which both are equal.
fn reliability_panel(model: &str) -> Panel {
    let diagonal = LineContent::Path(vec![[0.0, 0.0], [1.0, 1.0]]);
    Panel {
        title: model.to_owned(),
        x: Scale::Percent("confidence in %"),
        y: Scale::Percent("accuracy in %"),
        lines: vec![PlotLine::new(String::new(), LineStyle::REFERENCE, diagonal)],
        model: Some(model.to_owned()),
    }
}

/// Selects at most [`MAX_LEVELS`] levels, evenly from the first to the last.
fn spread(levels: &[AxisLevel]) -> Vec<AxisLevel> {
    let last = levels.len().saturating_sub(1);
    if levels.len() <= MAX_LEVELS {
        return levels.to_vec();
    }
    (0..MAX_LEVELS).map(|place| levels[(place * last).div_ceil(MAX_LEVELS - 1)]).collect()
}
