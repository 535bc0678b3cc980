//! Curves for the story image, which shows one item and the accuracy over all items: [`story_curves`].

use super::{DisplayNames, FigureBuilder};
use crate::charts::chart::{LineContent, LineItems, LineStyle, PlotLine};
use crate::text::words::light;
use darkqa_base::types::{EnhancerName, Variant};
use darkqa_score::findings::Findings;
use darkqa_score::model_in_condition::CHANCE;

/// Accuracy by level in one variant: each model raw and with each enhancer.
#[derive(Debug, Clone)]
pub struct StoryCurves {
    /// Main variant of the run: sensor noise, if it was asked.
    pub variant: Variant,
    /// Text for the variant.
    pub light: String,
    /// All enhancers of the run.
    pub enhancers: Vec<EnhancerName>,
    /// Curves of models with images, then horizontal lines of models without images and of chance.
    pub lines: Vec<PlotLine>,
    /// Number of items and kind of intervals.
    pub note: String,
}

/// Curves of a run; `None` if no model was shown a dark image.
pub fn story_curves(findings: &Findings<'_>) -> Option<StoryCurves> {
    let builder = FigureBuilder::new(findings, &DisplayNames::default());
    let variant = builder.main_variant()?;
    let mut lines = Vec::new();
    for model in &builder.models {
        for enhancer in builder.raw_and_enhanced() {
            let points = builder.accuracy_points(model, &variant, enhancer);
            let name = enhancer.map_or_else(|| (*model).to_owned(), |name| format!("{model} + {name}"));
            // A single level makes no line.
            if points.len() > 1 {
                lines.push(PlotLine {
                    name,
                    style: LineStyle(lines.len()),
                    content: LineContent::Curve(points),
                    model: Some((*model).to_owned()),
                    items: LineItems::for_model(&[*model], &variant, enhancer),
                });
            }
        }
    }
    for line in builder.flat_lines(None) {
        // The model's own style already belongs to its curve.
        let style = match line.name.as_str() {
            CHANCE => line.style,
            _ => LineStyle(lines.len()),
        };
        lines.push(PlotLine { style, ..line });
    }
    Some(StoryCurves {
        light: light(&variant, None),
        variant,
        enhancers: builder.enhancers.iter().copied().cloned().collect(),
        lines,
        note: builder.note(),
    })
}
