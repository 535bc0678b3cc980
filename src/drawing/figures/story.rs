//! The curves of the picture that tells a run's story: [`story_curves`].

use super::{Names, Overview};
use crate::drawing::chart::{LineItems, LineStyle, PanelContent, PlotLine};
use crate::text::words::light;
use crate::types::{EnhancerName, Variant};
use darkqa_score::findings::Findings;
use darkqa_score::model_in_condition::CHANCE;

/// Accuracy over the levels in one variant: each model raw, and each with each enhancer.
#[derive(Debug, Clone)]
pub(crate) struct StoryCurves {
    /// The last kind that was asked, in its first noise profile.
    pub variant: Variant,
    /// The variant in words.
    pub light: String,
    /// The enhancers of the run.
    pub enhancers: Vec<EnhancerName>,
    /// Curves, models without images, and chance.
    pub lines: Vec<PlotLine>,
    /// Number of items and kind of intervals.
    pub note: String,
}

/// The curves of a run; `None` if no model was shown a dark image.
pub(crate) fn story_curves(findings: &Findings<'_>) -> Option<StoryCurves> {
    let overview = Overview::new(findings, &Names::default());
    let variant = overview.main_variant()?;
    let mut lines = Vec::new();
    for model in &overview.models {
        for enhancer in overview.raw_and_enhanced() {
            let points = overview.points(model, &variant, enhancer, |subject| {
                overview.accuracy_of(subject, None)
            });
            let name =
                enhancer.map_or_else(|| (*model).to_owned(), |name| format!("{model} + {name}"));
            // One level is not a line.
            if points.len() > 1 {
                lines.push(PlotLine {
                    name,
                    style: LineStyle(lines.len()),
                    content: PanelContent::Curve(points),
                    model: Some((*model).to_owned()),
                    items: LineItems::for_model(&[*model], &variant, enhancer),
                });
            }
        }
    }
    for line in overview.flat_lines(None) {
        // A model without images has a curve in its own style above.
        let style = match line.name.as_str() {
            CHANCE => line.style,
            _ => LineStyle(lines.len()),
        };
        lines.push(PlotLine { style, ..line });
    }
    Some(StoryCurves {
        light: light(&variant, None),
        variant,
        enhancers: overview.enhancers.iter().copied().cloned().collect(),
        lines,
        note: overview.note(),
    })
}
