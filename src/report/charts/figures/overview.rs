//! Panels of the overview figure, which summarizes a run on one sheet: [`OverviewPanels`].

use std::fmt::Write;

use super::{ACCURACY, DisplayNames, FigureBuilder, horizontal_lines_note};
use crate::charts::chart::{Chart, LineContent, LineItems, LineStyle, Panel, PlotLine, Scale};
use darkqa_base::types::degradations::{Axis, Kind};
use darkqa_base::types::{AxisLevel, EnhancerName, Variant};
use darkqa_score::findings::Findings;
use darkqa_score::model_in_condition::CHANCE;

/// A chart with its caption, or the reason why there is none.
pub(super) type PanelChart = Result<(String, Chart), &'static str>;

/// Charts of the overview, one panel each, and the condition of its sample images.
#[derive(Debug, Clone)]
pub struct OverviewPanels {
    /// Name of each chart, and the chart or the reason why there is none.
    pub charts: Vec<(&'static str, PanelChart)>,
    /// Variant of the sample images; `None` if no dark image was asked.
    pub variant: Option<Variant>,
    /// Enhancer of the sample images (the first one) and its display name.
    pub enhancer: Option<(EnhancerName, String)>,
    /// Text for the end of the caption: number of items, parsing, and training data of the enhancers.
    pub note: String,
}

/// Panels of a run: accuracy of each model, mean over the models by variant, and mean over the models raw and with each
/// enhancer.
pub fn overview(findings: &Findings<'_>, names: &DisplayNames) -> OverviewPanels {
    let builder = FigureBuilder::new(findings, names);
    let variant = builder.main_variant();
    let enhancer = builder.enhancers.first().map(|name| {
        let display_name = builder.names.display_name(name.as_str());
        ((*name).clone(), display_name)
    });
    let variants: Vec<Variant> = builder.tested_variants();
    let variants: Vec<&Variant> =
        variants.iter().filter(|variant| variant.kind.map(Kind::axis) == Some(Axis::LIGHT)).collect();
    let models = builder.averaged_models();
    let by_model = variant.as_ref().map(|variant| builder.each_model(variant)).ok_or("no dark image was asked");
    let by_variant = match variants.len() {
        0 | 1 => Err("only one variant of the light was asked"),
        _ => builder.mean_by_variant(&variants, &models).ok_or("the same models were not asked in two variants"),
    };
    let by_enhancer = match &variant {
        Some(variant) => builder.mean_by_enhancer(variant, &models),
        None => None,
    };
    let training = by_enhancer.as_ref().map_or_else(String::new, |(_, chart)| builder.training_note(&chart.panels));
    OverviewPanels {
        charts: vec![
            ("models", by_model),
            ("variants", by_variant),
            (
                "enhancers",
                by_enhancer.ok_or(if builder.enhancers.is_empty() {
                    "no enhancer was asked"
                } else {
                    "no enhancer was asked in the light of the first panel by the same models"
                }),
            ),
        ],
        variant,
        enhancer,
        // The caption of each panel explains its bands.
        note: format!("n = {}; strict parsing{training}", builder.item_count_text()),
    }
}

impl FigureBuilder<'_> {
    fn single_panel_chart(&self, title: String, lines: Vec<PlotLine>) -> Chart {
        let panel = Panel::over_levels(ACCURACY, title, lines);
        let x = Scale::Levels { lux: self.findings.set.lux };
        Chart { panels: vec![Panel { x, ..panel }], columns: 1, note: String::new() }
    }

    /// Title of a mean: "mean of 6 models", or the name of a single model.
    fn mean_title(&self, models: &[&str]) -> String {
        match models {
            [single] => self.names.display_name(single),
            several => format!("mean of {} models", several.len()),
        }
    }

    /// Caption sentence that explains the bands of a mean.
    fn bands_note(&self, models: &[&str]) -> String {
        match models {
            [_] => format!("Bands: 95 % intervals by {}.", self.findings.unit),
            several => format!("Bands: from the lowest to the highest of the {} models, not intervals.", several.len()),
        }
    }

    /// Accuracy of each model by level.
    fn each_model(&self, variant: &Variant) -> (String, Chart) {
        let light = self.condition_text(variant, None);
        let (lines, not_asked) = with_dark_levels(self.accuracy_lines(variant, None));
        let mut caption = format!(
            "Accuracy of each model by level, {light}, with 95 % intervals by {}.{}",
            self.findings.unit,
            horizontal_lines_note(&lines)
        );
        if !not_asked.is_empty() {
            let _ = write!(caption, " Not asked in this light: {}.", not_asked.join(", "));
        }
        (caption, self.single_panel_chart(format!("each model, {light}"), lines))
    }

    /// Mean over the models by variant; `None` unless all of them were asked in two variants.
    fn mean_by_variant(&self, variants: &[&Variant], models: &[&str]) -> Option<(String, Chart)> {
        let (mut lines, not_asked) = with_dark_levels(self.variant_lines(variants, models));
        if variants.len() - not_asked.len() < 2 {
            return None;
        }
        if let Some(last) = variants.last() {
            lines.extend(self.comparison_lines(last));
        }
        let who = self.mean_title(models);
        let mut caption = format!(
            "Accuracy by variant of the light, {who}. {}{}",
            self.bands_note(models),
            horizontal_lines_note(&lines)
        );
        if !not_asked.is_empty() {
            let _ = write!(caption, " Not asked of all of them: {}.", not_asked.join(", "));
        }
        Some((caption, self.single_panel_chart(format!("{who}, raw"), lines)))
    }

    /// Lines to compare a mean with, other than chance: each model without images, and the black model on raw images.
    fn comparison_lines(&self, variant: &Variant) -> Vec<PlotLine> {
        let mut lines: Vec<PlotLine> = self.flat_lines(None).into_iter().filter(|line| line.name != CHANCE).collect();
        let black = self.names.black.as_deref();
        if let Some(model) = black.filter(|model| self.models.contains(model)) {
            lines.push(PlotLine {
                name: self.names.display_name(model),
                style: LineStyle::BLACK,
                content: LineContent::Curve(self.accuracy_points(model, variant, None)),
                model: None,
                items: LineItems::for_model(&[model], variant, None),
            });
        }
        lines
    }

    /// Mean over the models, raw and with each enhancer; `None` without an enhancer that has a line.
    fn mean_by_enhancer(&self, variant: &Variant, models: &[&str]) -> Option<(String, Chart)> {
        let mut lines = Vec::new();
        for (index, enhancer) in self.raw_and_enhanced().enumerate() {
            let points = self.mean_accuracy(models, variant, enhancer);
            if !points.is_empty() {
                lines.push(PlotLine {
                    name: self.enhancer_line_name(enhancer),
                    style: LineStyle(index),
                    content: LineContent::Curve(points),
                    model: None,
                    items: LineItems::for_model(models, variant, enhancer),
                });
            }
        }
        if lines.len() < 2 {
            return None;
        }
        lines.extend(self.chance_line());
        lines.extend(self.comparison_lines(variant));
        let (who, light) = (self.mean_title(models), self.condition_text(variant, None));
        let caption = format!(
            "Accuracy raw and with each enhancer, {light}, {who}. L0 is the untouched frame. {}{}",
            self.bands_note(models),
            horizontal_lines_note(&lines)
        );
        Some((caption, self.single_panel_chart(format!("{who}, {light}"), lines)))
    }
}

/// Leaves out curves without a dark level; returns the other lines and the names of the omitted curves.
fn with_dark_levels(lines: Vec<PlotLine>) -> (Vec<PlotLine>, Vec<String>) {
    let (omitted, lines): (Vec<PlotLine>, Vec<PlotLine>) = lines.into_iter().partition(|line| match &line.content {
        LineContent::Curve(points) => points.iter().all(|(level, _)| *level == AxisLevel::L0),
        _ => false,
    });
    (lines, omitted.into_iter().map(|line| line.name).collect())
}
