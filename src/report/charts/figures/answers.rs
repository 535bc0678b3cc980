//! Figures of what models answer: hallucinated objects and collapse to one answer in the dark; mean confidence and
//! accuracy by level; accuracy raw and with each enhancer, also of a data set that was photographed in the dark.

use super::{ACCURACY, FigureBuilder, FigureSpec};
use crate::charts::chart::{Chart, LineContent, LineItems, LineStyle, Panel, PlotLine};
use crate::text::words::family as family_name;
use darkqa_base::types::questions::{FAMILIES, FamilyAnswers};
use darkqa_base::types::{AxisLevel, Family, SetLight, Variant, View};
use darkqa_score::answers::confusion::{Confusion, Hallucination};
use darkqa_score::calibration::Calibration;
use darkqa_score::choice::ParsingMode;
use darkqa_score::estimate::Estimate;

/// Title of the vertical axis of shares of replies.
const SHARE: &str = "share of replies in %";

impl FigureBuilder<'_> {
    /// False positives and false negatives on questions about the presence of an object, by level.
    pub(super) fn hallucination(&self) -> Option<(String, Chart)> {
        let variant = self.main_variant()?;
        if self.findings.hallucinations.is_empty() {
            return None;
        }
        let panels = vec![
            self.hallucination_panel(&variant, "“yes” where nothing is", |rates| rates.false_positive),
            self.hallucination_panel(&variant, "“no” where it is", |rates| rates.false_negative),
        ];
        let caption = format!(
            "Object recognition: false positives (left) and false negatives (right) by level, {}.",
            self.condition_text(&variant, None)
        );
        self.chart(panels, 2, &caption)
    }

    fn hallucination_panel(
        &self,
        variant: &Variant,
        title: &str,
        rate: fn(&Hallucination) -> Option<Estimate>,
    ) -> Panel {
        let lines = self.lines(variant, |subject| {
            let mut rates = self.findings.hallucinations.iter();
            rate(rates.find(|rates| rates.subject == *subject)?)
        });
        let n = lines.iter().find_map(|line| match &line.content {
            LineContent::Curve(points) => points.first().map(|(_, rate)| rate.n),
            _ => None,
        });
        Panel::over_levels(SHARE, format!("{title}, n {}", n.unwrap_or(0)), lines)
    }

    /// Share of the most frequent answer by level, against the share of the most frequent true answer.
    pub(super) fn collapse(&self) -> Option<(String, Chart)> {
        let variant = self.main_variant()?;
        let panels: Vec<Panel> = FAMILIES
            .iter()
            .filter(|row| row.answers == FamilyAnswers::List)
            .filter_map(|row| self.collapse_panel(&variant, &row.family))
            .collect();
        let caption = format!(
            "Answer collapse, {}: how often the answer given most often is given, by level.",
            self.condition_text(&variant, None)
        );
        let (caption, mut chart) = self.chart(panels, 2, &caption)?;
        "shares of all replies, strict parsing; what the answers are is in collapse.csv".clone_into(&mut chart.note);
        Some((caption, chart))
    }

    /// Panel of one family; `None` if the family was not asked.
    fn collapse_panel(&self, variant: &Variant, family: &Family) -> Option<Panel> {
        let mut truth = None;
        let mut lines = self.lines(variant, |subject| {
            let confusion = self
                .findings
                .confusions
                .iter()
                .find(|confusion| confusion.family == *family && confusion.subject == *subject)?;
            truth = truth.or_else(|| commonest_truth(confusion));
            let share = confusion.collapse.as_ref()?.share;
            Some(Estimate::exact(share.value, share.n))
        });
        let (share, n) = truth?;
        lines.push(PlotLine {
            name: "commonest true answer".to_owned(),
            style: LineStyle::REFERENCE,
            content: LineContent::Flat(share),
            model: None,
            items: None,
        });
        let title = format!("{}, n {n}", self.names.display_name(family_name(Some(family))));
        Some(Panel::over_levels(SHARE, title, lines))
    }
}

/// Share of the most frequent true answer, and the number of replies.
fn commonest_truth(confusion: &Confusion) -> Option<(f64, usize)> {
    let (all, highest) =
        confusion.shares().into_iter().fold((0, 0), |(all, highest), (_, n)| (all + n, highest.max(n)));
    (all > 0).then(|| (highest as f64 / all as f64, all))
}

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
                    let panel = Panel::over_levels("%", title, lines);
                    panels.push(Panel { model: Some((*model).to_owned()), ..panel });
                }
            }
        }
        let caption = "Does confidence fall as fast as accuracy in the dark? The mean greatest probability of a choice, and the \
                       accuracy of the same replies, by level.";
        let (caption, mut chart) = self.chart(panels, 2, caption)?;
        chart.note = format!("bands and bars are 95 % intervals by {}; strict parsing", self.findings.unit);
        Some((caption, chart))
    }
}

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
                    let panel = Panel::over_levels(ACCURACY, title, lines);
                    panels.push(Panel { model: Some((*model).to_owned()), ..panel });
                }
            }
        }
        let caption = if self.has_enhanced_clean() {
            "Each enhancer against the raw images, by level. L0 is the untouched frame, in the line of an enhancer enhanced with it where that was asked."
        } else {
            "Each enhancer against the raw dark images, by level. L0 is the untouched frame."
        };
        self.chart(panels, 2, caption)
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

impl FigureBuilder<'_> {
    /// Accuracy of each model on the photographs, raw and with each enhancer; `None` for data sets photographed in good
    /// light, which have curves over levels instead.
    pub(super) fn photographed(&self) -> Option<FigureSpec> {
        let findings = self.findings;
        if findings.set.light == SetLight::Lit || self.models.is_empty() {
            return None;
        }
        let chance = findings
            .summary
            .family_cells(None, ParsingMode::Strict)
            .filter(|cell| cell.subject.view.is_none())
            .find_map(|cell| Some(cell.accuracy?.value));
        let panels = self.models.iter().map(|model| {
            let title = format!("{}: accuracy in %, n {}", self.names.display_name(model), self.item_count(None));
            let panel = Panel::from_bars(title, self.photograph_bars(model), chance);
            Panel { model: Some((*model).to_owned()), ..panel }
        });
        let chart = Chart {
            panels: panels.filter(|panel| panel.places().next().is_some()).collect(),
            columns: 1,
            note: format!("lines are 95 % intervals by {}; strict parsing", findings.unit),
        };
        if chart.panels.is_empty() {
            return None;
        }
        Some(FigureSpec {
            name: "photographed",
            caption: "Accuracy on photographs in the dark, raw (as photographed) and with each enhancer. Broken line: chance."
                .to_owned(),
            chart,
        })
    }

    /// Accuracy of a model on the photographs, raw and with each enhancer.
    fn photograph_bars(&self, model: &str) -> Vec<PlotLine> {
        self.findings
            .grid
            .subjects
            .iter()
            .filter(|subject| {
                subject.model == *model && subject.view == Some(View::Image) && !subject.variant.is_degraded()
            })
            .filter_map(|subject| {
                let name = match &subject.enhancer {
                    None => "raw".to_owned(),
                    Some(name) => {
                        let name = self.names.display_name(name.as_str());
                        format!("{name}{}", subject.variant.group_suffix())
                    }
                };
                let index = self.enhancers.iter().position(|known| Some(*known) == subject.enhancer.as_ref());
                let style = LineStyle(index.map_or(0, |index| index + 1));
                Some(PlotLine::bar(name, style, self.accuracy_of(subject, None)?))
            })
            .collect()
    }
}
