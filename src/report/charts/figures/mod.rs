//! Figures and tables for reports and papers: functions from [`Findings`] to a [`Chart`] or a table, not yet drawn.
//!
//! Mean of curves: [`mean`].

mod answers;
mod names;
mod overview;
mod split;
mod story;
mod tables;

use std::collections::BTreeSet;

use crate::charts::chart::{Chart, DarkMark, LineContent, LineItems, LineStyle, Panel, PlotLine, Scale};
use crate::text::words::{family as family_name, light_with, marked_reference, names_enhancer};
use darkqa_base::types::degradations::{Axis, Kind};
use darkqa_base::types::text::counted;
use darkqa_base::types::{AxisLevel, EnhancerName, Family, Variant, View};
use darkqa_score::choice::ParsingMode;
use darkqa_score::estimate::Estimate;
use darkqa_score::findings::Findings;
use darkqa_score::model_in_condition::{CHANCE, ModelInCondition, models_under_test, pooled_models};

pub use names::{DisplayNames, KnownNames, short_form};
pub use overview::{OverviewPanels, overview};
pub use split::split;
pub use story::{StoryCurves, story_curves};
pub use tables::{missing_threshold_message, paper_tables};

/// Name, caption and chart of a figure that is not yet drawn.
#[derive(Debug, Clone)]
pub struct FigureSpec {
    /// Name of the figure in files.
    pub name: &'static str,
    /// Caption without the note of the chart.
    pub caption: String,
    pub chart: Chart,
}

/// Names of all figures of multiple-choice questions, in the order of a report.
pub const FIGURES: [&str; 10] = [
    "accuracy",
    "variants",
    "enhancers",
    "families",
    "hallucination",
    "collapse",
    "confidence",
    "photographed",
    "thresholds",
    "blur_thresholds",
];

/// All figures that have data. `names` sets the displayed names and the order of models and enhancers.
pub fn figure_specs(findings: &Findings<'_>, names: &DisplayNames) -> Vec<FigureSpec> {
    let builder = FigureBuilder::new(findings, names);
    let charts = [
        ("accuracy", builder.accuracy()),
        ("variants", builder.variants()),
        ("enhancers", builder.enhancers()),
        ("families", builder.families()),
        ("hallucination", builder.hallucination()),
        ("collapse", builder.collapse()),
        ("confidence", builder.confidence()),
    ];
    let mut figures: Vec<FigureSpec> = charts
        .into_iter()
        .filter_map(|(name, chart)| {
            let (caption, chart) = chart?;
            Some(FigureSpec { name, caption, chart })
        })
        .collect();
    figures.extend(builder.photographed());
    figures.extend(builder.thresholds());
    figures
}

const ACCURACY: &str = "accuracy in %";

/// Makes figures from findings: keeps the models, enhancers and levels that occur in them.
struct FigureBuilder<'a> {
    findings: &'a Findings<'a>,
    /// Models that were shown images, in display order, references last. The index of a model is its line style.
    models: Vec<&'a str>,
    /// Number of models under test, which come first.
    under_test: usize,
    enhancers: Vec<&'a EnhancerName>,
    levels: BTreeSet<AxisLevel>,
    names: DisplayNames,
}

/// Caption sentence that explains the horizontal lines; empty without any. It calls them horizontal because curves may
/// be broken or dotted, too.
fn horizontal_lines_note<'l>(lines: impl IntoIterator<Item = &'l PlotLine>) -> &'static str {
    let (chance, blind): (Vec<&PlotLine>, Vec<&PlotLine>) = lines
        .into_iter()
        .filter(|line| matches!(line.content, LineContent::Flat(_)))
        .partition(|line| line.name == CHANCE);
    match (blind.is_empty(), chance.is_empty()) {
        (false, false) => " Horizontal: without images, and chance (dotted).",
        (false, true) => " Horizontal: without images.",
        (true, false) => " Horizontal: chance.",
        (true, true) => "",
    }
}

impl<'a> FigureBuilder<'a> {
    fn new(findings: &'a Findings<'a>, names: &DisplayNames) -> Self {
        let subjects = &findings.grid.subjects;
        // The subjects are sorted by model.
        let mut models: Vec<&str> = subjects
            .iter()
            .filter(|subject| subject.view == Some(View::Image))
            .map(|subject| &*subject.model)
            .collect();
        models.dedup();
        names.sort(&mut models, |model| model);
        // References come last, so that the other models look the same with and without them.
        let under_test = models_under_test(models.iter().copied());
        models.sort_by_key(|model| !under_test.contains(model));
        let enhancers: BTreeSet<&EnhancerName> = subjects.iter().filter_map(|s| s.enhancer.as_ref()).collect();
        let mut enhancers: Vec<&EnhancerName> = enhancers.into_iter().collect();
        names.sort(&mut enhancers, |name| name.as_str());
        Self {
            findings,
            under_test: under_test.len(),
            models,
            enhancers,
            names: names.clone(),
            levels: subjects.iter().filter_map(|s| s.level).collect(),
        }
    }

    /// Values of a model by level, in one variant, raw or enhanced. L0 is the clean frame, enhanced if that was asked,
    /// else raw. Empty if no level was asked with the enhancer.
    fn points(
        &self,
        model: &str,
        variant: &Variant,
        enhancer: Option<&EnhancerName>,
        mut value: impl FnMut(&ModelInCondition) -> Option<Estimate>,
    ) -> Vec<(AxisLevel, Estimate)> {
        let points: Vec<_> = self
            .levels
            .iter()
            .filter_map(|&level| {
                let subject = match self.subject(model, level, variant, enhancer) {
                    None if level == AxisLevel::L0 => self.subject(model, level, variant, None)?,
                    subject => subject?,
                };
                Some((subject.enhancer.as_ref(), level, value(subject)?))
            })
            .collect();
        if points.iter().all(|(used, ..)| *used != enhancer) {
            return Vec::new();
        }
        points.into_iter().map(|(_, level, value)| (level, value)).collect()
    }

    /// A model with images in one condition; `None` if it was not asked.
    fn subject(
        &self,
        model: &str,
        level: AxisLevel,
        variant: &Variant,
        enhancer: Option<&EnhancerName>,
    ) -> Option<&ModelInCondition> {
        let grid = &self.findings.grid;
        let index = grid.find_up_to_group(&ModelInCondition::with_images(model, level, variant, enhancer))?;
        Some(&grid.subjects[index])
    }

    /// `None` for raw images, then each enhancer.
    fn raw_and_enhanced(&self) -> impl Iterator<Item = Option<&EnhancerName>> {
        std::iter::once(None).chain(self.enhancers.iter().copied().map(Some))
    }

    /// Accuracy of a model in a condition on a family, or on all (`None`), by strict parsing.
    fn accuracy_of(&self, subject: &ModelInCondition, family: Option<&Family>) -> Option<Estimate> {
        let cell = self.findings.summary.cell(subject, family, ParsingMode::Strict)?;
        cell.accuracy
    }

    /// Horizontal lines: models without images, each in the style of its model, and chance.
    fn flat_lines(&self, family: Option<&Family>) -> Vec<PlotLine> {
        self.findings
            .summary
            .family_cells(family, ParsingMode::Strict)
            .filter(|cell| cell.subject.view != Some(View::Image))
            .filter_map(|cell| {
                let model = &*cell.subject.model;
                let (name, style, line_model) = if cell.subject.view.is_none() {
                    (CHANCE.to_owned(), LineStyle::REFERENCE, None)
                } else {
                    let name = format!("{} without images", self.names.display_name(model));
                    (name, self.style(model), Some(model.to_owned()))
                };
                Some(PlotLine {
                    name,
                    style,
                    content: LineContent::Flat(cell.accuracy?.value),
                    model: line_model,
                    items: None,
                })
            })
            .collect()
    }

    /// The models over which means are taken: no people; built-in models and the black reference model only if there
    /// are no others.
    fn averaged_models(&self) -> Vec<&'a str> {
        let listing = &self.findings.grid.listing;
        let black = self.names.black.as_deref();
        let models = self.models.iter().copied();
        let others = models.clone().filter(|model| Some(*model) != black);
        let mut averaged = pooled_models(listing.without_people(others));
        if averaged.is_empty() {
            averaged = pooled_models(listing.without_people(models.clone()));
        }
        models.filter(|model| averaged.contains(model)).collect()
    }

    fn style(&self, model: &str) -> LineStyle {
        if self.names.black.as_deref() == Some(model) {
            return LineStyle::BLACK;
        }
        let index = self.models.iter().position(|known| *known == model);
        let index = index.unwrap_or(self.models.len());
        if self.is_reference(model) {
            return LineStyle::built_in(index - self.under_test);
        }
        LineStyle(index)
    }

    /// True for a built-in model that is a reference beside the models under test.
    fn is_reference(&self, model: &str) -> bool {
        self.models[self.under_test..].contains(&model)
    }

    /// Name of a model's curve, which says of a reference that it is one.
    fn curve_name(&self, model: &str) -> String {
        marked_reference(self.names.display_name(model), self.is_reference(model))
    }

    /// Text for a variant and an enhancer, as in "exposure drop with sensor noise, enhanced".
    fn condition_text(&self, variant: &Variant, enhancer: Option<&EnhancerName>) -> String {
        let enhancer = enhancer.map(|name| self.names.display_name(name.as_str()));
        light_with(variant, enhancer.as_deref())
    }

    /// The variant for figures that show only one: sensor noise, if it was asked.
    fn main_variant(&self) -> Option<Variant> {
        self.findings.grid.main_variant()
    }

    /// All variants that were asked: each kind of degradation with each noise profile.
    fn tested_variants(&self) -> Vec<Variant> {
        self.findings.grid.variants().into_iter().cloned().collect()
    }

    /// One line for each model, in one variant, without enhancement.
    fn lines(&self, variant: &Variant, mut value: impl FnMut(&ModelInCondition) -> Option<Estimate>) -> Vec<PlotLine> {
        self.models
            .iter()
            .map(|model| PlotLine {
                name: self.curve_name(model),
                style: self.style(model),
                content: LineContent::Curve(self.points(model, variant, None, &mut value)),
                model: Some((*model).to_owned()),
                items: LineItems::for_model(&[*model], variant, None),
            })
            .collect()
    }

    /// Accuracy of all models, with the horizontal lines.
    fn accuracy_lines(&self, variant: &Variant, family: Option<&Family>) -> Vec<PlotLine> {
        let mut lines = self.lines(variant, |subject| self.accuracy_of(subject, family));
        for items in lines.iter_mut().filter_map(|line| line.items.as_mut()) {
            items.family = family.map(|family| family.name().to_owned());
        }
        lines.extend(self.flat_lines(family));
        lines
    }

    /// Accuracy of all models on photographs in the dark, without enhancement.
    fn photograph_marks(&self) -> Vec<PlotLine> {
        let mut lines = Vec::new();
        for model in &self.models {
            for pair in &self.findings.pairs {
                let marks: Vec<DarkMark> = self
                    .findings
                    .grid
                    .subjects
                    .iter()
                    .filter(|subject| {
                        subject.model == *model
                            && subject.enhancer.is_none()
                            && subject.variant.photograph() == Some(&pair.name)
                    })
                    .filter_map(|subject| self.accuracy_of(subject, None))
                    .map(|share| DarkMark { ev: pair.ev, share })
                    .collect();
                if !marks.is_empty() {
                    lines.push(PlotLine {
                        name: format!("{}, {} (real)", self.curve_name(model), pair.name),
                        style: self.style(model),
                        content: LineContent::Marks(marks),
                        model: Some((*model).to_owned()),
                        items: None,
                    });
                }
            }
        }
        lines
    }

    /// Caption note on the number of items and on the intervals.
    fn note(&self) -> String {
        format!(
            "n = {}; bands and bars are 95 % intervals by {}; strict parsing",
            self.item_count_text(),
            self.findings.unit
        )
    }

    /// Caption note on the training data of the enhancers in the panels; empty if none is known.
    fn training_note(&self, panels: &[Panel]) -> String {
        self.findings
            .grid
            .listing
            .trainings()
            .filter(|(enhancer, _)| {
                panels.iter().flat_map(|panel| &panel.lines).any(|line| names_enhancer(&line.name, enhancer))
            })
            .map(|(enhancer, training)| format!("; {enhancer}: {training}"))
            .collect()
    }

    /// Number of items and clusters, as in `177 items in 24 scenes`.
    fn item_count_text(&self) -> String {
        let grid = &self.findings.grid;
        let items = counted(grid.items.len(), "item");
        let unit = self.findings.unit.to_string();
        format!("{items} in {}", counted(grid.clusters, &unit))
    }

    /// Number of items in a family, or in all.
    fn item_count(&self, family: Option<&Family>) -> usize {
        self.findings.grid.items.iter().filter(|item| item.is_in_family(family)).count()
    }

    /// Accuracy of each model by level: one panel for each variant.
    fn accuracy(&self) -> Option<(String, Chart)> {
        let variants = self.tested_variants();
        let mut panels: Vec<Panel> = variants
            .iter()
            .map(|variant| {
                let mut lines = self.accuracy_lines(variant, None);
                if variant.kind.map(Kind::axis) == Some(Axis::LIGHT) {
                    lines.extend(self.photograph_marks());
                }
                let title = format!("{}, n {}", self.condition_text(variant, None), self.item_count(None));
                Panel::over_levels(ACCURACY, title, lines)
            })
            .collect();
        let mut marks = self.photograph_marks();
        if panels.is_empty() && !marks.is_empty() {
            let mut lines = self.accuracy_lines(&Variant::NONE, None);
            lines.append(&mut marks);
            let title = format!("photographed in the dark, n {}", self.item_count(None));
            panels.push(Panel::over_levels(ACCURACY, title, lines));
        }
        let mut caption = format!(
            "Accuracy of each model by level, without enhancement.{}",
            horizontal_lines_note(panels.iter().flat_map(|panel| &panel.lines))
        );
        if !self.findings.pairs.is_empty() {
            caption +=
                " Hollow: photographed in the dark, at the median exposure drop, with a bar from quartile to quartile.";
        }
        self.chart(panels, 2, &caption)
    }

    /// Mean accuracy over the models for each variant, with the models' range: one panel for each axis with several
    /// variants.
    fn variants(&self) -> Option<(String, Chart)> {
        let models = self.averaged_models();
        let title = match &*models {
            [single] => format!("{}, n {}", self.names.display_name(single), self.item_count(None)),
            several => format!("mean of {} models, n {} each", several.len(), self.item_count(None)),
        };
        let all = self.tested_variants();
        let mut panels = Vec::new();
        for axis in Axis::ALL {
            let variants: Vec<&Variant> =
                all.iter().filter(|variant| variant.kind.map(Kind::axis) == Some(axis)).collect();
            if variants.len() > 1 {
                let lines = self.variant_lines(&variants, &models);
                panels.push(Panel::over_levels(ACCURACY, title.clone(), lines));
            }
        }
        let is_auto = all.iter().any(|variant| variant.kind == Some(Kind::Auto));
        let caption = if is_auto {
            "Exposure drop alone, with sensor noise, and as a camera with automatic exposure meets it, as far as they were asked."
        } else {
            "Exposure drop alone against exposure drop with sensor noise."
        };
        let (caption, mut chart) = self.chart(panels, 1, caption)?;
        if models.len() > 1 {
            chart.note = format!("bands are the range of the {} models, not intervals; strict parsing", models.len());
        }
        Some((caption, chart))
    }

    /// Accuracy by level in each variant, as mean over the models, and chance.
    fn variant_lines(&self, variants: &[&Variant], models: &[&str]) -> Vec<PlotLine> {
        let mut lines = Vec::new();
        for (index, variant) in variants.iter().enumerate() {
            lines.push(PlotLine {
                name: self.condition_text(variant, None),
                style: LineStyle(index),
                content: LineContent::Curve(self.mean_accuracy(models, variant, None)),
                model: None,
                items: LineItems::for_model(models, variant, None),
            });
        }
        lines.extend(self.chance_line());
        lines
    }

    /// Mean accuracy of the models by level, with their range.
    fn mean_accuracy(
        &self,
        models: &[&str],
        variant: &Variant,
        enhancer: Option<&EnhancerName>,
    ) -> Vec<(AxisLevel, Estimate)> {
        let curves: Vec<Vec<(AxisLevel, Estimate)>> =
            models.iter().map(|model| self.accuracy_points(model, variant, enhancer)).collect();
        mean(&curves)
    }

    /// Accuracy of a model by level over all families.
    fn accuracy_points(
        &self,
        model: &str,
        variant: &Variant,
        enhancer: Option<&EnhancerName>,
    ) -> Vec<(AxisLevel, Estimate)> {
        self.points(model, variant, enhancer, |subject| self.accuracy_of(subject, None))
    }

    /// Chance over all families, as a horizontal line.
    fn chance_line(&self) -> impl Iterator<Item = PlotLine> {
        self.flat_lines(None).into_iter().filter(|line| line.name == CHANCE)
    }

    /// Name of a line in figures of enhancers.
    fn enhancer_line_name(&self, enhancer: Option<&EnhancerName>) -> String {
        enhancer.map_or_else(|| "raw".to_owned(), |name| self.names.display_name(name.as_str()))
    }

    /// Accuracy of each model by level in the main variant: one panel for each family.
    fn families(&self) -> Option<(String, Chart)> {
        let variant = &self.main_variant()?;
        let families = self.findings.grid.families();
        let panels: Vec<Panel> = families
            .into_iter()
            .map(|family| {
                let n = self.item_count(Some(family));
                let title = format!("{}, n {n}", self.names.display_name(family_name(Some(family))));
                Panel::over_levels(ACCURACY, title, self.accuracy_lines(variant, Some(family)))
            })
            .collect();
        let caption = format!(
            "Accuracy by family, {}.{}",
            self.condition_text(variant, None),
            horizontal_lines_note(panels.iter().flat_map(|panel| &panel.lines))
        );
        self.chart(panels, 3, &caption)
    }

    /// A caption and a chart; `None` without panels or without models that were shown images.
    fn chart(&self, panels: Vec<Panel>, columns: usize, caption: &str) -> Option<(String, Chart)> {
        if panels.is_empty() || self.models.is_empty() {
            return None;
        }
        let note = self.note() + &self.training_note(&panels);
        let lux = self.findings.set.lux;
        let panels = panels.into_iter().map(|panel| Panel { x: Scale::Levels { lux }, ..panel }).collect();
        Some((caption.to_owned(), Chart { panels: split(panels), columns, note }))
    }
}

/// Mean of curves at the levels that all of them have, with the curves' range as interval. A single curve is returned
/// unchanged.
fn mean(curves: &[Vec<(AxisLevel, Estimate)>]) -> Vec<(AxisLevel, Estimate)> {
    if let [single] = curves {
        return single.clone();
    }
    let levels: BTreeSet<AxisLevel> = curves.iter().flatten().map(|(level, _)| *level).collect();
    levels.into_iter().filter_map(|level| Some((level, mean_at(curves, level)?))).collect()
}

/// Mean of curves at one level, with their range; `None` if a curve has no point there.
fn mean_at(curves: &[Vec<(AxisLevel, Estimate)>], level: AxisLevel) -> Option<Estimate> {
    let values: Option<Vec<f64>> = curves
        .iter()
        .map(|curve| {
            let point = curve.iter().find(|(other, _)| *other == level);
            point.map(|(_, estimate)| estimate.value)
        })
        .collect();
    let values = values.filter(|values| !values.is_empty())?;
    Some(Estimate {
        value: values.iter().sum::<f64>() / values.len() as f64,
        low: values.iter().copied().fold(f64::INFINITY, f64::min),
        high: values.iter().copied().fold(f64::NEG_INFINITY, f64::max),
        n: values.len(),
    })
}
