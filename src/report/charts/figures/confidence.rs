//! Figure of mean confidence and accuracy by level.

use super::FigureBuilder;
use crate::report::charts::chart::{Chart, LineContent, LineStyle, Panel, PlotLine};
use darkqa_score::calibration::Calibration;
use darkqa_score::estimate::Estimate;

/// Reads the value of a line from a calibration result.
type Quantity = fn(&Calibration) -> Estimate;

/// Lines of each panel: name and value.
const LINES: [(&str, Quantity); 2] = [("confidence", |row| row.confidence), ("accuracy", |row| row.accuracy)];

impl FigureBuilder<'_> {
    /// Confidence and accuracy of each model in each variant, without enhancement. The gap between the two lines is
    /// overconfidence.
    pub(super) fn confidence(&self) -> Option<(String, Chart)> {
        let mut panels = Vec::new();
        for variant in self.tested_variants() {
            for model in &self.models {
                let mut lines = Vec::new();
                for (style, (name, quantity)) in LINES.into_iter().enumerate() {
                    let points = self.points(model, &variant, None, |subject| {
                        self.findings.calibrations.iter().find(|row| row.subject == *subject).map(quantity)
                    });
                    if !points.is_empty() {
                        lines.push(PlotLine {
                            name: name.to_owned(),
                            style: LineStyle(style),
                            content: LineContent::Curve(points),
                            model: Some((*model).to_owned()),
                            items: None,
                        });
                    }
                }
                if !lines.is_empty() {
                    let name = self.names.display_name(model);
                    let title = format!("{name}, {}", self.condition_text(&variant, None));
                    panels.push(Panel { title, lines, model: Some((*model).to_owned()) });
                }
            }
        }
        let caption = "Does confidence fall as fast as accuracy in the dark? The mean greatest probability of a choice, and the \
                       accuracy of the same replies, by level.";
        let (caption, mut chart) = self.chart("%", panels, 2, caption)?;
        chart.note = format!("bands and bars are 95 % intervals by {}; strict parsing", self.findings.unit);
        Some((caption, chart))
    }
}
