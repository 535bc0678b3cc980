//! The paper's figures and others: each is a function from [`Findings`] to a [`Chart`].

mod answers;
mod confidence;
mod names;
mod overview;
mod photographed;
mod split;
mod story;
mod tables;
mod thresholds;

use std::collections::BTreeSet;

use crate::drawing::chart::drawn::Drawn;
use crate::drawing::chart::{Chart, DarkMark, LineItems, LineStyle, Panel, PanelContent, PlotLine};
use crate::text::words::{counted, family as family_name, light_with, names_enhancer};
use crate::types::degradations::{Axis, Kind};
use crate::types::{AxisLevel, EnhancerName, Family, Variant, View};
use darkqa_score::choice::ReadingMode;
use darkqa_score::estimate::Estimate;
use darkqa_score::findings::Findings;
use darkqa_score::model_in_condition::{CHANCE, ModelInCondition, pooled_models};

pub(crate) use names::{KnownNames, Names};
pub(crate) use overview::{OverviewPanels, overview};
pub(crate) use split::split;
pub(crate) use story::{StoryCurves, story_curves};
pub(crate) use tables::paper_tables;
pub(crate) use thresholds::without_threshold;

/// One figure of a report, before it is drawn.
#[derive(Debug, Clone)]
pub(crate) struct Drawing {
    /// Name of the figure in files.
    pub name: &'static str,
    /// Its caption, without the note of the chart.
    pub caption: String,
    pub chart: Drawn,
}

/// The names that figures of questions with choices can have, in their order.
pub(crate) const FIGURES: [&str; 10] = [
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

/// All figures for which there are records, with the names and in the order of the reader.
pub(crate) fn drawings(findings: &Findings<'_>, names: &Names) -> Vec<Drawing> {
    let overview = Overview::new(findings, names);
    let charts = [
        ("accuracy", overview.accuracy()),
        ("variants", overview.variants()),
        ("enhancers", overview.enhancers()),
        ("families", overview.families()),
        ("hallucination", overview.hallucination()),
        ("collapse", overview.collapse()),
        ("confidence", overview.confidence()),
    ];
    let mut figures: Vec<Drawing> = charts
        .into_iter()
        .filter_map(|(name, chart)| {
            let (caption, chart) = chart?;
            let chart = Drawn::Lines(chart);
            Some(Drawing {
                name,
                caption,
                chart,
            })
        })
        .collect();
    figures.extend(overview.photographed());
    figures.extend(overview.thresholds());
    figures
}

const ACCURACY: &str = "accuracy in %";

/// The findings, with the models, enhancers and levels that occur in them.
struct Overview<'a> {
    findings: &'a Findings<'a>,
    /// Models with images, in their order. The index of a model is its line style.
    models: Vec<&'a str>,
    enhancers: Vec<&'a EnhancerName>,
    levels: BTreeSet<AxisLevel>,
    names: Names,
}

/// The sentence of a caption about the horizontal lines that are drawn; empty without any. Curves may be broken or dotted, too.
fn horizontal_lines<'l>(lines: impl IntoIterator<Item = &'l PlotLine>) -> &'static str {
    let (chance, blind): (Vec<&PlotLine>, Vec<&PlotLine>) = lines
        .into_iter()
        .filter(|line| matches!(line.content, PanelContent::Flat(_)))
        .partition(|line| line.name == CHANCE);
    match (blind.is_empty(), chance.is_empty()) {
        (false, false) => " Horizontal: without images, and chance (dotted).",
        (false, true) => " Horizontal: without images.",
        (true, false) => " Horizontal: chance.",
        (true, true) => "",
    }
}

impl<'a> Overview<'a> {
    fn new(findings: &'a Findings<'a>, names: &Names) -> Self {
        let subjects = &findings.grid.subjects;
        let seeing = subjects.iter().filter(|s| s.view == Some(View::Image));
        // Subjects of one model stand together, and models in their order.
        let mut models: Vec<&str> = seeing.map(|subject| &*subject.model).collect();
        models.dedup();
        names.order(&mut models, |model| model);
        let enhancers: BTreeSet<&EnhancerName> = subjects
            .iter()
            .filter_map(|s| s.enhancer.as_ref())
            .collect();
        let mut enhancers: Vec<&EnhancerName> = enhancers.into_iter().collect();
        names.order(&mut enhancers, |name| name.as_str());
        Self {
            findings,
            models,
            enhancers,
            names: names.clone(),
            levels: subjects.iter().filter_map(|s| s.level).collect(),
        }
    }

    /// A quantity of a model by level, in one variant, raw or enhanced. L0 is the clean frame, enhanced if that was asked; empty
    /// without a point of the enhancer.
    fn points(
        &self,
        model: &str,
        variant: &Variant,
        enhancer: Option<&EnhancerName>,
        mut number: impl FnMut(&ModelInCondition) -> Option<Estimate>,
    ) -> Vec<(AxisLevel, Estimate)> {
        let points: Vec<_> = self
            .levels
            .iter()
            .filter_map(|&level| {
                let grid = &self.findings.grid;
                let of = |enhancer| {
                    grid.find_up_to_group(&ModelInCondition::with_images(
                        model, level, variant, enhancer,
                    ))
                };
                let raw = || (level == AxisLevel::L0).then(|| of(None)).flatten();
                let subject = &grid.subjects[of(enhancer).or_else(raw)?];
                Some((subject.enhancer.as_ref(), level, number(subject)?))
            })
            .collect();
        if points.iter().all(|(of, ..)| *of != enhancer) {
            return Vec::new();
        }
        points
            .into_iter()
            .map(|(_, level, number)| (level, number))
            .collect()
    }

    /// Raw (`None`), and then each enhancer.
    fn raw_and_enhanced(&self) -> impl Iterator<Item = Option<&EnhancerName>> {
        std::iter::once(None).chain(self.enhancers.iter().copied().map(Some))
    }

    /// Whether some untouched frames were enhanced.
    fn has_enhanced_clean(&self) -> bool {
        self.findings
            .grid
            .subjects
            .iter()
            .any(|subject| subject.level == Some(AxisLevel::L0) && subject.enhancer.is_some())
    }

    /// Accuracy of a subject on a family, in the strict parsing.
    fn accuracy_of(&self, subject: &ModelInCondition, family: Option<&Family>) -> Option<Estimate> {
        let cell = self
            .findings
            .summary
            .cell(subject, family, ReadingMode::Strict)?;
        cell.accuracy
    }

    /// Flat lines: models without images, each in the style of its model, and chance.
    fn flat_lines(&self, family: Option<&Family>) -> Vec<PlotLine> {
        let cells = self
            .findings
            .summary
            .family_cells(family, ReadingMode::Strict);
        cells
            .filter(|cell| cell.subject.view != Some(View::Image))
            .filter_map(|cell| {
                let model = &*cell.subject.model;
                let (name, style, of) = if cell.subject.view.is_none() {
                    (CHANCE.to_owned(), LineStyle::REFERENCE, None)
                } else {
                    let name = format!("{} without images", self.names.shown(model));
                    (name, self.style(model), Some(model.to_owned()))
                };
                let content = PanelContent::Flat(cell.accuracy?.value);
                Some(PlotLine {
                    name,
                    style,
                    content,
                    model: of,
                    items: None,
                })
            })
            .collect()
    }

    /// The models over which means are taken: without people, and without built-in models and the upper reference if there are others.
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
        LineStyle(index.unwrap_or(self.models.len()))
    }

    /// A variant in words, with its enhancer.
    fn light(&self, variant: &Variant, enhancer: Option<&EnhancerName>) -> String {
        let enhancer = enhancer.map(|name| self.names.shown(name.as_str()));
        light_with(variant, enhancer.as_deref())
    }

    /// The variant for figures that show only one: noise, if it was asked.
    fn main_variant(&self) -> Option<Variant> {
        self.findings.grid.main_variant()
    }

    /// All variants that were asked: kinds in each noise profile.
    fn tested_variants(&self) -> Vec<Variant> {
        self.findings.grid.variants().into_iter().cloned().collect()
    }

    /// Lines of a quantity for all models, in one variant, raw.
    fn lines(
        &self,
        variant: &Variant,
        mut number: impl FnMut(&ModelInCondition) -> Option<Estimate>,
    ) -> Vec<PlotLine> {
        self.models
            .iter()
            .map(|model| PlotLine {
                name: self.names.shown(model),
                style: self.style(model),
                content: PanelContent::Curve(self.points(model, variant, None, &mut number)),
                model: Some((*model).to_owned()),
                items: LineItems::for_model(&[*model], variant, None),
            })
            .collect()
    }

    /// Lines of the accuracy of all models, with the flat lines.
    fn accuracies(&self, variant: &Variant, family: Option<&Family>) -> Vec<PlotLine> {
        let mut lines = self.lines(variant, |subject| self.accuracy_of(subject, family));
        for items in lines.iter_mut().filter_map(|line| line.items.as_mut()) {
            items.family = family.map(|family| family.name().to_owned());
        }
        lines.extend(self.flat_lines(family));
        lines
    }

    /// Marks of the accuracy of all models on photographs in the dark, raw.
    fn photographs(&self) -> Vec<PlotLine> {
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
                        name: format!("{}, {} (real)", self.names.shown(model), pair.name),
                        style: self.style(model),
                        content: PanelContent::Marks(marks),
                        model: Some((*model).to_owned()),
                        items: None,
                    });
                }
            }
        }
        lines
    }

    /// Note on the number of items and on the intervals.
    fn note(&self) -> String {
        format!(
            "n = {}; bands and bars are 95 % intervals by {}; strict parsing",
            self.items(),
            self.findings.unit
        )
    }

    /// The training data of the enhancers in some panels; empty if none are known.
    fn training(&self, panels: &[Panel]) -> String {
        let lines = || panels.iter().flat_map(|panel| &panel.lines);
        let notes: Vec<String> = self
            .findings
            .grid
            .listing
            .trainings()
            .filter(|(enhancer, _)| lines().any(|line| names_enhancer(&line.name, enhancer)))
            .map(|(enhancer, training)| format!("; {enhancer}: {training}"))
            .collect();
        notes.concat()
    }

    /// The number of items, as `177 items in 24 scenes`.
    fn items(&self) -> String {
        let grid = &self.findings.grid;
        let (items, unit) = (
            counted(grid.items.len(), "item"),
            self.findings.unit.to_string(),
        );
        format!("{items} in {}", counted(grid.clusters, &unit))
    }

    fn n(&self, family: Option<&Family>) -> usize {
        self.findings
            .grid
            .items
            .iter()
            .filter(|item| item.is_in_family(family))
            .count()
    }

    fn accuracy(&self) -> Option<(String, Chart)> {
        let variants = self.tested_variants();
        let mut panels: Vec<Panel> = variants
            .iter()
            .map(|variant| {
                let mut lines = self.accuracies(variant, None);
                if variant.kind.map(Kind::axis) == Some(Axis::LIGHT) {
                    lines.extend(self.photographs());
                }
                Panel {
                    title: format!("{}, n {}", self.light(variant, None), self.n(None)),
                    lines,
                    model: None,
                }
            })
            .collect();
        let mut marks = self.photographs();
        if panels.is_empty() && !marks.is_empty() {
            let mut lines = self.accuracies(&Variant::NONE, None);
            lines.append(&mut marks);
            let title = format!("photographed in the dark, n {}", self.n(None));
            panels.push(Panel {
                title,
                lines,
                model: None,
            });
        }
        let lines = panels.iter().flat_map(|panel| &panel.lines);
        let mut caption = format!(
            "Accuracy of each model by level, without enhancement.{}",
            horizontal_lines(lines)
        );
        if !self.findings.pairs.is_empty() {
            caption += " Hollow: photographed in the dark, at the median exposure drop, with a bar from quartile to quartile.";
        }
        self.chart(ACCURACY, panels, 2, &caption)
    }

    /// Mean over the models for each variant, with the range of the models: a panel for each axis with several variants.
    fn variants(&self) -> Option<(String, Chart)> {
        let models = self.averaged_models();
        let title = match &*models {
            [single] => format!("{}, n {}", self.names.shown(single), self.n(None)),
            several => format!("mean of {} models, n {} each", several.len(), self.n(None)),
        };
        let all = self.tested_variants();
        let mut panels = Vec::new();
        for axis in Axis::ALL {
            let is_on = |variant: &&Variant| variant.kind.map(Kind::axis) == Some(axis);
            let variants: Vec<&Variant> = all.iter().filter(is_on).collect();
            if variants.len() > 1 {
                panels.push(Panel {
                    title: title.clone(),
                    lines: self.lines_of_variants(&variants, &models),
                    model: None,
                });
            }
        }
        let is_auto = all.iter().any(|variant| variant.kind == Some(Kind::Auto));
        let caption = if is_auto {
            "Exposure drop alone, with sensor noise, and as a camera with automatic exposure meets it, as far as they were asked."
        } else {
            "Exposure drop alone against exposure drop with sensor noise."
        };
        let (caption, mut chart) = self.chart(ACCURACY, panels, 1, caption)?;
        if models.len() > 1 {
            chart.note = format!(
                "bands are the range of the {} models, not intervals; strict parsing",
                models.len()
            );
        }
        Some((caption, chart))
    }

    /// A line for each of these variants, the mean over the models, and chance.
    fn lines_of_variants(&self, variants: &[&Variant], models: &[&str]) -> Vec<PlotLine> {
        let line = |(index, variant): (usize, &&Variant)| {
            let curves: Vec<Vec<(AxisLevel, Estimate)>> = models
                .iter()
                .map(|model| {
                    self.points(model, variant, None, |subject| {
                        self.accuracy_of(subject, None)
                    })
                })
                .collect();
            PlotLine {
                name: self.light(variant, None),
                style: LineStyle(index),
                content: PanelContent::Curve(mean(&curves)),
                model: None,
                items: LineItems::for_model(models, variant, None),
            }
        };
        let mut lines: Vec<PlotLine> = variants.iter().enumerate().map(line).collect();
        let flat_lines = self.flat_lines(None).into_iter();
        lines.extend(flat_lines.filter(|line| line.name == CHANCE));
        lines
    }

    fn enhancers(&self) -> Option<(String, Chart)> {
        let mut panels = Vec::new();
        for variant in self.tested_variants() {
            for model in &self.models {
                let line = |(index, enhancer): (usize, Option<&EnhancerName>)| {
                    let points = self.points(model, &variant, enhancer, |subject| {
                        self.accuracy_of(subject, None)
                    });
                    // One level is not a line; L0 enhanced is a point of its own.
                    let is_clean = points.first().is_some_and(|(at, _)| *at == AxisLevel::L0);
                    (points.len() > 1 || is_clean).then(|| PlotLine {
                        name: enhancer
                            .map_or("raw".to_owned(), |name| self.names.shown(name.as_str())),
                        style: LineStyle(index),
                        content: PanelContent::Curve(points),
                        model: Some((*model).to_owned()),
                        items: LineItems::for_model(&[*model], &variant, enhancer),
                    })
                };
                let lines: Vec<PlotLine> = self
                    .raw_and_enhanced()
                    .enumerate()
                    .filter_map(line)
                    .collect();
                if lines.len() > 1 {
                    let (name, light) = (self.names.shown(model), self.light(&variant, None));
                    let title = format!("{name}, {light}, n {}", self.n(None));
                    panels.push(Panel {
                        title,
                        lines,
                        model: Some((*model).to_owned()),
                    });
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

    fn families(&self) -> Option<(String, Chart)> {
        let variant = &self.main_variant()?;
        let families = self.findings.grid.families();
        let panels: Vec<Panel> = families
            .into_iter()
            .map(|family| {
                let n = self.n(Some(family));
                Panel {
                    title: format!("{}, n {n}", self.names.shown(family_name(Some(family)))),
                    lines: self.accuracies(variant, Some(family)),
                    model: None,
                }
            })
            .collect();
        let lines = panels.iter().flat_map(|panel| &panel.lines);
        let caption = format!(
            "Accuracy by family, {}.{}",
            self.light(variant, None),
            horizontal_lines(lines)
        );
        self.chart(ACCURACY, panels, 3, &caption)
    }

    /// A caption and a chart; `None` without panels or without models that see.
    fn chart(
        &self,
        measure: &'static str,
        panels: Vec<Panel>,
        columns: usize,
        caption: &str,
    ) -> Option<(String, Chart)> {
        if panels.is_empty() || self.models.is_empty() {
            return None;
        }
        let chart = Chart {
            measure,
            note: self.note() + &self.training(&panels),
            panels: split(panels),
            columns,
        };
        Some((caption.to_owned(), chart))
    }
}

/// Mean of curves at the levels that all of them have, with their range. A single curve is returned as it is.
fn mean(curves: &[Vec<(AxisLevel, Estimate)>]) -> Vec<(AxisLevel, Estimate)> {
    if let [single] = curves {
        return single.clone();
    }
    let at = |level: AxisLevel| {
        let values: Option<Vec<f64>> = curves
            .iter()
            .map(|curve| {
                let point = curve.iter().find(|(at, _)| *at == level);
                point.map(|(_, estimate)| estimate.value)
            })
            .collect();
        let values = values.filter(|values| !values.is_empty())?;
        let estimate = Estimate {
            value: values.iter().sum::<f64>() / values.len() as f64,
            low: values.iter().copied().fold(f64::INFINITY, f64::min),
            high: values.iter().copied().fold(f64::NEG_INFINITY, f64::max),
            n: values.len(),
        };
        Some((level, estimate))
    };
    let levels: BTreeSet<AxisLevel> = curves.iter().flatten().map(|(level, _)| *level).collect();
    levels.into_iter().filter_map(at).collect()
}
