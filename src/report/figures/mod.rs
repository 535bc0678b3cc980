//! The paper's figures, and more: each a function from [`Findings`] to a [`Chart`].

mod answers;
mod thresholds;

use std::collections::BTreeSet;

use super::chart::{Chart, Figure, LineStyle, Panel, PanelContent, PlotLine};
use super::words::{family as family_name, light};
use crate::error::Result;
use crate::score::choice::ReadingMode;
use crate::score::estimate::Estimate;
use crate::score::findings::Findings;
use crate::score::subject::{CHANCE, Subject};
use crate::types::{AxisLevel, EnhancerName, Family, KindReading, View};

/// All figures that the records have something for.
///
/// # Errors
/// Where one cannot be drawn.
pub(crate) fn figures(findings: &Findings<'_>) -> Result<Vec<Figure>> {
    let view = Overview::new(findings);
    let charts = [
        ("accuracy", view.accuracy()),
        ("variants", view.variants()),
        ("enhancers", view.enhancers()),
        ("families", view.families()),
        ("hallucination", view.hallucination()),
        ("collapse", view.collapse()),
    ];
    let mut figures = Vec::new();
    for (name, chart) in charts {
        let Some((caption, chart)) = chart else {
            continue;
        };
        let svg = chart.svg()?;
        figures.push(Figure { name, caption, svg });
    }
    figures.extend(thresholds::figure(findings)?);
    Ok(figures)
}

/// The built-in models: a floor and a ceiling, not models under test.
const BUILT_IN: [&str; 2] = ["random", "observer"];

/// The look of what no model says: chance, and the truth.
const GROUND: LineStyle = LineStyle(27);

const ACCURACY: &str = "accuracy in %";

/// What the figures are drawn from.
struct Overview<'a> {
    findings: &'a Findings<'a>,
    /// Models that see, in order; each has the look of its place.
    models: Vec<&'a str>,
    enhancers: Vec<&'a EnhancerName>,
    levels: BTreeSet<AxisLevel>,
}

impl<'a> Overview<'a> {
    fn new(findings: &'a Findings<'a>) -> Self {
        let subjects = &findings.grid.subjects;
        let seeing = subjects.iter().filter(|s| s.view == Some(View::Image));
        let models: BTreeSet<&str> = seeing.map(|subject| &*subject.model).collect();
        let enhancers: BTreeSet<&EnhancerName> = subjects
            .iter()
            .filter_map(|s| s.enhancer.as_ref())
            .collect();
        Self {
            findings,
            models: models.into_iter().collect(),
            enhancers: enhancers.into_iter().collect(),
            levels: subjects.iter().filter_map(|s| s.level).collect(),
        }
    }

    /// Some number of a model over the levels, in one variant, raw or enhanced; L0 is the untouched frame.
    fn points(
        &self,
        model: &str,
        variant: &KindReading,
        enhancer: Option<&EnhancerName>,
        mut number: impl FnMut(&Subject) -> Option<Estimate>,
    ) -> Vec<(AxisLevel, Estimate)> {
        let levels = self.levels.iter();
        let points = levels.filter_map(|&level| {
            let subject = Subject::seeing(model, level, variant, enhancer);
            Some((level, number(&subject)?))
        });
        points.collect()
    }

    /// The accuracy of a subject on a family.
    fn share(&self, subject: &Subject, family: Option<&Family>) -> Option<Estimate> {
        let cell = self
            .findings
            .summary
            .cell(subject, family, ReadingMode::Strict)?;
        cell.accuracy
    }

    /// The blind lines, each in the look of its model, and chance.
    fn floors(&self, family: Option<&Family>) -> Vec<PlotLine> {
        let cells = self.findings.summary.of(family, ReadingMode::Strict);
        let here = cells.filter(|cell| cell.subject.view != Some(View::Image));
        let lines = here.filter_map(|cell| {
            let model = &*cell.subject.model;
            let (name, look) = if cell.subject.view.is_none() {
                (CHANCE.to_owned(), GROUND)
            } else {
                (format!("{model} without images"), self.look(model))
            };
            let shape = PanelContent::Flat(cell.accuracy?.value);
            Some(PlotLine { name, look, shape })
        });
        lines.collect()
    }

    /// The models that a mean is taken over: not the built-in ones, where there are others.
    fn judged(&self) -> Vec<&'a str> {
        let others = self.models.iter().filter(|model| !BUILT_IN.contains(model));
        let others: Vec<&str> = others.copied().collect();
        if others.is_empty() {
            self.models.clone()
        } else {
            others
        }
    }

    fn look(&self, model: &str) -> LineStyle {
        let place = self.models.iter().position(|known| *known == model);
        LineStyle(place.unwrap_or(self.models.len()))
    }

    /// What is drawn where one variant has to do: the last kind that was asked, the noisy one, in its first reading.
    fn noisiest(&self) -> Option<KindReading> {
        let variants = self.variants_there();
        let kind = variants.last()?.kind;
        variants.into_iter().find(|variant| variant.kind == kind)
    }

    /// The kinds that were asked, in each light reading.
    fn variants_there(&self) -> Vec<KindReading> {
        let subjects = self.findings.grid.subjects.iter();
        let variants = subjects.map(|subject| &subject.variant);
        let degraded = variants.filter(|variant| variant.kind.is_some());
        let degraded: BTreeSet<&KindReading> = degraded.collect();
        degraded.into_iter().cloned().collect()
    }

    /// The lines of all models in one variant, raw, of some number of each subject.
    fn lines(
        &self,
        variant: &KindReading,
        mut number: impl FnMut(&Subject) -> Option<Estimate>,
    ) -> Vec<PlotLine> {
        let models = self.models.iter();
        let lines = models.map(|model| PlotLine {
            name: (*model).to_owned(),
            look: self.look(model),
            shape: PanelContent::Curve(self.points(model, variant, None, &mut number)),
        });
        lines.collect()
    }

    /// The lines of the accuracy of all models, with what they are held against.
    fn accuracies(&self, variant: &KindReading, family: Option<&Family>) -> Vec<PlotLine> {
        let mut lines = self.lines(variant, |subject| self.share(subject, family));
        lines.extend(self.floors(family));
        lines
    }

    /// How the intervals were made, and on how many questions.
    fn note(&self) -> String {
        let (grid, unit) = (&self.findings.grid, self.findings.unit);
        format!(
            "n = {} items in {} {unit}s; bands are 95 % intervals by {unit}; strict reading",
            grid.items.len(),
            grid.clusters
        )
    }

    fn n(&self, family: Option<&Family>) -> usize {
        let items = self.findings.grid.items.iter();
        items.filter(|item| item.is_of(family)).count()
    }

    fn accuracy(&self) -> Option<(String, Chart)> {
        let variants = self.variants_there();
        let panels = variants.iter().map(|variant| Panel {
            title: format!("{}, n {}", light(variant, None), self.n(None)),
            lines: self.accuracies(variant, None),
        });
        let panels: Vec<Panel> = panels.collect();
        let caption = "Accuracy of each model by level, without enhancement. Broken lines: without images, and chance.";
        self.chart(ACCURACY, panels, 2, caption)
    }

    /// The mean over models of each variant, with the range of the models.
    fn variants(&self) -> Option<(String, Chart)> {
        let (variants, models) = (self.variants_there(), self.judged());
        if variants.len() < 2 {
            return None;
        }
        let line = |(index, variant): (usize, &KindReading)| {
            let curves = models.iter();
            let curves: Vec<Vec<(AxisLevel, Estimate)>> = curves
                .map(|model| self.points(model, variant, None, |subject| self.share(subject, None)))
                .collect();
            PlotLine {
                name: light(variant, None),
                look: LineStyle(index),
                shape: PanelContent::Curve(mean(&curves)),
            }
        };
        let mut lines: Vec<PlotLine> = variants.iter().enumerate().map(line).collect();
        let floors = self.floors(None).into_iter();
        lines.extend(floors.filter(|line| line.name == CHANCE));
        let title = match &*models {
            [one] => format!("{one}, n {}", self.n(None)),
            several => format!("mean of {} models, n {} each", several.len(), self.n(None)),
        };
        let (caption, mut chart) = self.chart(
            ACCURACY,
            vec![Panel { title, lines }],
            1,
            "Exposure drop alone against exposure drop with sensor noise.",
        )?;
        if models.len() > 1 {
            chart.note = format!(
                "bands are the range of the {} models, not intervals; strict reading",
                models.len()
            );
        }
        Some((caption, chart))
    }

    fn enhancers(&self) -> Option<(String, Chart)> {
        let mut panels = Vec::new();
        for variant in self.variants_there() {
            for model in &self.models {
                let line = |(index, enhancer): (usize, Option<&EnhancerName>)| {
                    let points = self.points(model, &variant, enhancer, |subject| {
                        self.share(subject, None)
                    });
                    // L0 alone is no line of an enhancer's.
                    (points.len() > 1).then(|| PlotLine {
                        name: enhancer.map_or("raw".to_owned(), ToString::to_string),
                        look: LineStyle(index),
                        shape: PanelContent::Curve(points),
                    })
                };
                let all = std::iter::once(None).chain(self.enhancers.iter().copied().map(Some));
                let lines: Vec<PlotLine> = all.enumerate().filter_map(line).collect();
                if lines.len() > 1 {
                    let title = format!("{model}, {}, n {}", light(&variant, None), self.n(None));
                    panels.push(Panel { title, lines });
                }
            }
        }
        self.chart(
            ACCURACY,
            panels,
            2,
            "Each enhancer against the raw dark images, by level. L0 is the untouched frame.",
        )
    }

    fn families(&self) -> Option<(String, Chart)> {
        let variant = &self.noisiest()?;
        let families = self.findings.grid.families();
        let panels = families.into_iter().map(|family| {
            let n = self.n(Some(family));
            Panel {
                title: format!("{}, n {n}", family_name(Some(family))),
                lines: self.accuracies(variant, Some(family)),
            }
        });
        let panels: Vec<Panel> = panels.collect();
        let caption = format!(
            "Accuracy by family, {}. Broken lines: without images, and chance.",
            light(variant, None)
        );
        self.chart(ACCURACY, panels, 3, &caption)
    }

    /// A chart of panels of which some have lines.
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
            panels,
            columns,
            note: self.note(),
        };
        Some((caption.to_owned(), chart))
    }
}

/// The mean of curves at the levels that all of them have, with their range; of one alone itself.
fn mean(curves: &[Vec<(AxisLevel, Estimate)>]) -> Vec<(AxisLevel, Estimate)> {
    if let [one] = curves {
        return one.clone();
    }
    let at = |level: AxisLevel| {
        let values: Option<Vec<f64>> = curves
            .iter()
            .map(|curve| {
                let point = curve.iter().find(|(there, _)| *there == level);
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
