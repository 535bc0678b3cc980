//! Bar chart for a data set that was photographed in the dark: accuracy raw and with each enhancer.

use super::{FigureBuilder, FigureSpec};
use crate::report::charts::chart::LineStyle;
use crate::report::charts::chart::bars::{Bar, BarChart, BarPanel};
use crate::report::charts::chart::figure_chart::FigureChart;
use crate::types::{SetLight, View};
use darkqa_score::choice::ParsingMode;

impl FigureBuilder<'_> {
    /// Accuracy of each model on the photographs, raw and with each enhancer; `None` for data sets photographed in good
    /// light, which have curves over levels instead.
    pub(super) fn photographed(&self) -> Option<FigureSpec> {
        let findings = self.findings;
        if findings.set.light == SetLight::Lit || self.models.is_empty() {
            return None;
        }
        let chance = findings
            .summary
            .family_cells(None, ParsingMode::Strict)
            .filter(|cell| cell.subject.view.is_none())
            .find_map(|cell| Some(cell.accuracy?.value));
        let panels = self.models.iter().map(|model| BarPanel {
            title: format!("{}: accuracy in %, n {}", self.names.display_name(model), self.item_count(None)),
            bars: self.photograph_bars(model),
            chance,
        });
        let chart = BarChart {
            panels: panels.filter(|panel| !panel.bars.is_empty()).collect(),
            note: format!("lines are 95 % intervals by {}; strict parsing", findings.unit),
        };
        if chart.panels.is_empty() {
            return None;
        }
        Some(FigureSpec {
            name: "photographed",
            caption: "Accuracy on photographs in the dark, raw (as photographed) and with each enhancer. Broken line: chance."
                .to_owned(),
            chart: FigureChart::Bars(chart),
        })
    }

    /// Accuracy of a model on the photographs, raw and with each enhancer.
    fn photograph_bars(&self, model: &str) -> Vec<Bar> {
        self.findings
            .grid
            .subjects
            .iter()
            .filter(|subject| {
                subject.model == *model && subject.view == Some(View::Image) && !subject.variant.is_degraded()
            })
            .filter_map(|subject| {
                let name = match &subject.enhancer {
                    None => "raw".to_owned(),
                    Some(name) => {
                        let name = self.names.display_name(name.as_str());
                        format!("{name}{}", subject.variant.group_suffix())
                    }
                };
                let index = self.enhancers.iter().position(|known| Some(*known) == subject.enhancer.as_ref());
                Some(Bar {
                    name,
                    style: LineStyle(index.map_or(0, |index| index + 1)),
                    share: self.accuracy_of(subject, None)?,
                })
            })
            .collect()
    }
}
