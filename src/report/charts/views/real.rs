//! Figure of photographs in the dark compared with synthetic images of the same darkness: [`figure_spec`].

use crate::report::charts::chart::LineStyle;
use crate::report::charts::chart::bars::{Bar, BarChart, BarPanel};
use crate::report::charts::chart::figure_chart::FigureChart;
use crate::report::charts::figures::FigureSpec;
use darkqa_score::choice::ParsingMode;
use darkqa_score::comparisons::ComparisonKind;
use darkqa_score::findings::Findings;
use darkqa_score::model_in_condition::ModelInCondition;
use darkqa_score::photographs::pair_darkness::PairDarkness;

/// Accuracy of each model at L0, on photographs in the dark, on synthetic images that are as dark, and on enhanced
/// photographs; `None` if no scene was photographed in the dark.
pub(super) fn figure_spec(findings: &Findings<'_>) -> Option<FigureSpec> {
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
