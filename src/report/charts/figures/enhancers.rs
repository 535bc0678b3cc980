//! Figure of accuracy raw and with each enhancer.

use super::{ACCURACY, FigureBuilder};
use crate::report::charts::chart::{Chart, LineContent, LineItems, LineStyle, Panel, PlotLine};
use crate::types::AxisLevel;

impl FigureBuilder<'_> {
    /// Accuracy raw and with each enhancer by level: one panel for each model in each variant.
    pub(super) fn enhancers(&self) -> Option<(String, Chart)> {
        let mut panels = Vec::new();
        for variant in self.tested_variants() {
            for model in &self.models {
                let mut lines = Vec::new();
                for (index, enhancer) in self.raw_and_enhanced().enumerate() {
                    let points = self.accuracy_points(model, &variant, enhancer);
                    // A single level makes no line, except L0 enhanced, which is drawn as a point.
                    let has_clean = points.first().is_some_and(|(level, _)| *level == AxisLevel::L0);
                    if points.len() > 1 || has_clean {
                        lines.push(PlotLine {
                            name: self.enhancer_line_name(enhancer),
                            style: LineStyle(index),
                            content: LineContent::Curve(points),
                            model: Some((*model).to_owned()),
                            items: LineItems::for_model(&[*model], &variant, enhancer),
                        });
                    }
                }
                if lines.len() > 1 {
                    let (name, light) = (self.curve_name(model), self.condition_text(&variant, None));
                    let title = format!("{name}, {light}, n {}", self.item_count(None));
                    panels.push(Panel { title, lines, model: Some((*model).to_owned()) });
                }
            }
        }
        let caption = if self.has_enhanced_clean() {
            "Each enhancer against the raw images, by level. L0 is the untouched frame, in the line of an enhancer enhanced with it where that was asked."
        } else {
            "Each enhancer against the raw dark images, by level. L0 is the untouched frame."
        };
        self.chart(ACCURACY, panels, 2, caption)
    }

    /// True if clean frames (L0) were enhanced.
    fn has_enhanced_clean(&self) -> bool {
        self.findings
            .grid
            .subjects
            .iter()
            .any(|subject| subject.level == Some(AxisLevel::L0) && subject.enhancer.is_some())
    }
}
