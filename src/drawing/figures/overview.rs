//! The panels of the figure that tells a run on one sheet: [`OverviewPanels`].

use std::fmt::Write;

use super::{ACCURACY, Names, Overview, horizontal_lines};
use crate::drawing::chart::{Chart, LineItems, LineStyle, Panel, PanelContent, PlotLine};
use crate::types::degradations::{Axis, Kind};
use crate::types::{AxisLevel, EnhancerName, Variant};
use darkqa_score::findings::Findings;
use darkqa_score::model_in_condition::CHANCE;

/// A chart with its caption, or the reason why there is none.
pub(crate) type PanelChart = Result<(String, Chart), &'static str>;

/// The charts of the sheet, each of one panel, and what its samples show.
#[derive(Debug, Clone)]
pub(crate) struct OverviewPanels {
    /// Each chart with its caption, or the reason why there is none, after its name.
    pub charts: Vec<(&'static str, PanelChart)>,
    /// The variant of the samples; `None` if no dark image was asked.
    pub variant: Option<Variant>,
    /// The first enhancer and the name that is shown for it.
    pub enhancer: Option<(EnhancerName, String)>,
    /// The meaning of the first chart's intervals.
    pub note: String,
}

/// The panels of a run: each model, the mean over the models by variant, and that mean raw and with each enhancer.
pub(crate) fn overview(findings: &Findings<'_>, names: &Names) -> OverviewPanels {
    let overview = Overview::new(findings, names);
    let of_light = |variant: &Variant| variant.kind.map(Kind::axis) == Some(Axis::LIGHT);
    let variant = overview.main_variant();
    let enhancer = overview.enhancers.first().map(|name| {
        let shown = overview.names.shown(name.as_str());
        ((*name).clone(), shown)
    });
    let variants: Vec<Variant> = overview.tested_variants();
    let variants: Vec<&Variant> = variants.iter().filter(|of| of_light(of)).collect();
    let models = overview.averaged_models();
    let by_model = variant.as_ref().ok_or("no dark image was asked");
    let by_model = by_model.map(|variant| overview.each_model(variant));
    let by_variant = match variants.len() {
        0 | 1 => Err("only one variant of the light was asked"),
        _ => overview
            .mean_by_variant(&variants, &models)
            .ok_or("the same models were not asked in two variants"),
    };
    let by_enhancer = match &variant {
        Some(variant) => overview.mean_by_enhancer(variant, &models),
        None => None,
    };
    let training = by_enhancer
        .as_ref()
        .map_or_else(String::new, |(_, chart)| overview.training(&chart.panels));
    OverviewPanels {
        charts: vec![
            ("models", by_model),
            ("variants", by_variant),
            (
                "enhancers",
                by_enhancer.ok_or(if overview.enhancers.is_empty() {
                    "no enhancer was asked"
                } else {
                    "no enhancer was asked in the light of the first panel by the same models"
                }),
            ),
        ],
        variant,
        enhancer,
        // The caption of each panel states what its bands are.
        note: format!("n = {}; strict parsing{training}", overview.items()),
    }
}

impl Overview<'_> {
    fn one(title: String, lines: Vec<PlotLine>) -> Chart {
        Chart {
            measure: ACCURACY,
            panels: vec![Panel {
                title,
                lines,
                model: None,
            }],
            columns: 1,
            note: String::new(),
        }
    }

    /// "mean of 6 models", or the model.
    fn who(&self, models: &[&str]) -> String {
        match models {
            [single] => self.names.shown(single),
            several => format!("mean of {} models", several.len()),
        }
    }

    /// The meaning of a mean's bands.
    fn band(&self, models: &[&str]) -> String {
        match models {
            [_] => format!("Bands: 95 % intervals by {}.", self.findings.unit),
            several => format!(
                "Bands: from the lowest to the highest of the {} models, not intervals.",
                several.len()
            ),
        }
    }

    fn each_model(&self, variant: &Variant) -> (String, Chart) {
        let light = self.light(variant, None);
        let (lines, alone) = with_dark_levels(self.accuracies(variant, None));
        let mut caption = format!(
            "Accuracy of each model by level, {light}, with 95 % intervals by {}.{}",
            self.findings.unit,
            horizontal_lines(&lines)
        );
        if !alone.is_empty() {
            let _ = write!(caption, " Not asked in this light: {}.", alone.join(", "));
        }
        (caption, Self::one(format!("each model, {light}"), lines))
    }

    /// The mean over the models by variant; `None` unless all of them were asked in two.
    fn mean_by_variant(&self, variants: &[&Variant], models: &[&str]) -> Option<(String, Chart)> {
        let (mut lines, alone) = with_dark_levels(self.lines_of_variants(variants, models));
        if variants.len() - alone.len() < 2 {
            return None;
        }
        lines.extend(
            variants
                .last()
                .map_or_else(Vec::new, |last| self.beside_a_mean(last)),
        );
        let who = self.who(models);
        let mut caption = format!(
            "Accuracy by variant of the light, {who}. {}{}",
            self.band(models),
            horizontal_lines(&lines)
        );
        if !alone.is_empty() {
            let _ = write!(caption, " Not asked of all of them: {}.", alone.join(", "));
        }
        Some((caption, Self::one(format!("{who}, raw"), lines)))
    }

    /// The lines beside a mean over models, other than chance: each model without images, and on raw images the model that is drawn in
    /// black.
    fn beside_a_mean(&self, variant: &Variant) -> Vec<PlotLine> {
        let mut lines: Vec<PlotLine> = self
            .flat_lines(None)
            .into_iter()
            .filter(|line| line.name != CHANCE)
            .collect();
        let black = self.names.black.as_deref();
        if let Some(model) = black.filter(|model| self.models.contains(model)) {
            let points = self.points(model, variant, None, |subject| {
                self.accuracy_of(subject, None)
            });
            lines.push(PlotLine {
                name: self.names.shown(model),
                style: LineStyle::BLACK,
                content: PanelContent::Curve(points),
                model: None,
                items: LineItems::for_model(&[model], variant, None),
            });
        }
        lines
    }

    /// The mean over the models, raw and with each enhancer; `None` without an enhancer that has a line.
    fn mean_by_enhancer(&self, variant: &Variant, models: &[&str]) -> Option<(String, Chart)> {
        let line = |(index, enhancer): (usize, Option<&EnhancerName>)| {
            let curves = models.iter().map(|model| {
                self.points(model, variant, enhancer, |subject| {
                    self.accuracy_of(subject, None)
                })
            });
            let points = super::mean(&curves.collect::<Vec<_>>());
            let raw = || "raw".to_owned();
            (!points.is_empty()).then(|| PlotLine {
                name: enhancer.map_or_else(raw, |name| self.names.shown(name.as_str())),
                style: LineStyle(index),
                content: PanelContent::Curve(points),
                model: None,
                items: LineItems::for_model(models, variant, enhancer),
            })
        };
        let mut lines: Vec<PlotLine> = self
            .raw_and_enhanced()
            .enumerate()
            .filter_map(line)
            .collect();
        if lines.len() < 2 {
            return None;
        }
        let flat = self.flat_lines(None).into_iter();
        lines.extend(flat.filter(|line| line.name == CHANCE));
        lines.extend(self.beside_a_mean(variant));
        let (who, light) = (self.who(models), self.light(variant, None));
        let caption = format!(
            "Accuracy raw and with each enhancer, {light}, {who}. L0 is the untouched frame. {}{}",
            self.band(models),
            horizontal_lines(&lines)
        );
        Some((caption, Self::one(format!("{who}, {light}"), lines)))
    }
}

/// The lines that have more than L0, and the names of the curves that have not.
fn with_dark_levels(lines: Vec<PlotLine>) -> (Vec<PlotLine>, Vec<String>) {
    let is_alone = |line: &PlotLine| match &line.content {
        PanelContent::Curve(points) => points.iter().all(|(level, _)| *level == AxisLevel::L0),
        _ => false,
    };
    let (alone, lines): (Vec<PlotLine>, Vec<PlotLine>) = lines.into_iter().partition(is_alone);
    let names = alone.into_iter().map(|line| line.name);
    (lines, names.collect())
}
