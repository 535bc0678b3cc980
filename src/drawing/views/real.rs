//! The figure of photographs in the dark beside synthetic images that are as dark: [`drawing`].

use crate::drawing::chart::LineStyle;
use crate::drawing::chart::bars::{Bar, BarChart, BarPanel};
use crate::drawing::chart::drawn::Drawn;
use crate::drawing::figures::Drawing;
use darkqa_score::choice::ReadingMode;
use darkqa_score::comparisons::ComparisonKind;
use darkqa_score::findings::Findings;
use darkqa_score::model_in_condition::ModelInCondition;

/// Accuracy of each model in the light, on photographs in the dark, on synthetic images that are as dark, and on enhanced
/// photographs; `None` where no scene was photographed in the dark.
pub(super) fn drawing(findings: &Findings<'_>) -> Option<Drawing> {
    let chance = findings.summary.family_cells(None, ReadingMode::Strict);
    let mut chance = chance.filter(|cell| cell.subject.view.is_none());
    let line = chance.find_map(|cell| Some(cell.accuracy?.value));
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
        .map(|(pair, model)| {
            let rows = findings.comparisons.iter().filter(|row| {
                row.family.is_none()
                    && row.first.model == model
                    && row.first.variant.photograph() == Some(&pair.name)
            });
            let mut shown: Vec<&ModelInCondition> = Vec::new();
            let mut bars = Vec::new();
            for row in rows {
                // The light, the photograph, what is as dark, and the enhanced photograph, each once.
                if !matches!(
                    row.kind,
                    ComparisonKind::Level
                        | ComparisonKind::RealSynthetic
                        | ComparisonKind::RealEnhanced
                ) {
                    continue;
                }
                for subject in [&row.second, &row.first] {
                    if shown.contains(&subject) {
                        continue;
                    }
                    shown.push(subject);
                    let cell = findings.summary.cell(subject, None, ReadingMode::Strict);
                    let Some(share) = cell.and_then(|cell| cell.accuracy) else {
                        continue;
                    };
                    bars.push(Bar {
                        name: subject.condition(),
                        style: LineStyle(bars.len()),
                        share,
                    });
                }
            }
            BarPanel {
                title: format!("{model}: accuracy in %"),
                bars,
                line,
            }
        })
        .filter(|panel| panel.bars.len() > 1)
        .collect();
    if panels.is_empty() {
        return None;
    }
    let chart = BarChart {
        panels,
        note: format!(
            "lines are 95 % intervals by {}; strict parsing",
            findings.unit
        ),
    };
    Some(Drawing {
        name: "real",
        caption: "Real against synthetic darkness: accuracy in the light (L0), on photographs in the dark, on synthetic images \
                  that are as dark, and on enhanced photographs. Broken line: chance."
            .to_owned(),
        chart: Drawn::Bars(chart),
    })
}
