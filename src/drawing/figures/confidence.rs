//! The figure of confidence against accuracy over the levels.

use super::Overview;
use crate::drawing::chart::{Chart, LineStyle, Panel, PanelContent, PlotLine};
use darkqa_score::calibration::Calibration;
use darkqa_score::estimate::Estimate;

/// A quantity of the figure.
type Quantity = fn(&Calibration) -> Estimate;

/// The lines of each panel.
const LINES: [(&str, Quantity); 2] = [
    ("confidence", |row| row.confidence),
    ("accuracy", |row| row.accuracy),
];

impl Overview<'_> {
    /// Confidence and accuracy of each model in each variant, raw: the gap between them is overconfidence.
    pub(super) fn confidence(&self) -> Option<(String, Chart)> {
        let mut panels = Vec::new();
        for variant in self.tested_variants() {
            for model in &self.models {
                let line = |(style, (name, quantity)): (usize, (&str, Quantity))| {
                    let points = self.points(model, &variant, None, |subject| {
                        self.findings
                            .calibrations
                            .iter()
                            .find(|row| row.subject == *subject)
                            .map(quantity)
                    });
                    (!points.is_empty()).then(|| PlotLine {
                        name: name.to_owned(),
                        style: LineStyle(style),
                        content: PanelContent::Curve(points),
                        model: Some((*model).to_owned()),
                        items: None,
                    })
                };
                let lines: Vec<PlotLine> = LINES.into_iter().enumerate().filter_map(line).collect();
                if !lines.is_empty() {
                    let name = self.names.shown(model);
                    let title = format!("{name}, {}", self.light(&variant, None));
                    panels.push(Panel {
                        title,
                        lines,
                        model: Some((*model).to_owned()),
                    });
                }
            }
        }
        let caption = "Does confidence fall as fast as accuracy in the dark? The mean greatest probability of a choice, and the \
                       accuracy of the same replies, by level.";
        let (caption, mut chart) = self.chart("%", panels, 2, caption)?;
        chart.note = format!(
            "bands and bars are 95 % intervals by {}; strict parsing",
            self.findings.unit
        );
        Some((caption, chart))
    }
}
