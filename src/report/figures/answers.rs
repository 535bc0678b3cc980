//! What models say when they no longer see: hallucination and collapse.

use super::super::chart::{Chart, Line, Panel, Shape};
use super::super::subject::{family as family_name, light};
use super::Overview;
use crate::score::confusion::{Confusion, Hallucination};
use crate::score::estimate::Estimate;
use crate::types::{Family, Level, Variant, View};

impl Overview<'_> {
    pub(super) fn hallucination(&self) -> Option<(String, Chart)> {
        let variant = *self.variants_there().last()?;
        if self.findings.hallucinations.is_empty() {
            return None;
        }
        let panel = |title: &str, rate: fn(&Hallucination) -> Option<Estimate>| {
            let lines = self.models.iter().map(|model| {
                let points = Level::ALL.into_iter().filter_map(|level| {
                    let rates = &self.findings.hallucinations;
                    let rates = rates
                        .iter()
                        .find(|rates| raw(&rates.subject, model, level, variant));
                    Some((level, rate(rates?)?))
                });
                Line {
                    name: (*model).to_owned(),
                    look: self.look(model),
                    shape: Shape::Curve(points.collect()),
                }
            });
            let lines: Vec<Line> = lines.collect();
            let n = lines.iter().find_map(|line| match &line.shape {
                Shape::Curve(points) => points.first().map(|(_, rate)| rate.n),
                Shape::Flat(_) => None,
            });
            let title = format!("{title}, n {}", n.unwrap_or(0));
            Panel { title, lines }
        };
        let panels = vec![
            panel("“yes” where nothing is", |rates| rates.false_positive),
            panel("“no” where it is", |rates| rates.false_negative),
        ];
        let caption = format!(
            "Object recognition: false positives (left) and false negatives (right) by level, {}.",
            light(variant, None)
        );
        self.chart("share of replies in %", panels, 2, &caption)
    }

    /// How often the commonest answer is given, by level, against how often the commonest is true.
    pub(super) fn collapse(&self) -> Option<(String, Chart)> {
        let variant = *self.variants_there().last()?;
        let of_family = |family: Family| {
            let confusions = &self.findings.confusions;
            let mut truth = None;
            let lines = self.models.iter().map(|model| {
                let points = Level::ALL.into_iter().filter_map(|level| {
                    let confusion = confusions.iter().find(|confusion| {
                        confusion.family == family && raw(&confusion.subject, model, level, variant)
                    });
                    let confusion = confusion?;
                    truth = truth.or_else(|| commonest_truth(confusion));
                    let collapse = confusion.collapse()?;
                    Some((level, Estimate::exact(collapse.share, collapse.n)))
                });
                Line {
                    name: (*model).to_owned(),
                    look: self.look(model),
                    shape: Shape::Curve(points.collect()),
                }
            });
            let mut lines: Vec<Line> = lines.collect();
            let (share, n) = truth?;
            lines.push(Line {
                name: "commonest true answer".to_owned(),
                look: super::Look(27),
                shape: Shape::Flat(share),
            });
            let title = format!("{}, n {n}", family_name(Some(&family)));
            Some(Panel { title, lines })
        };
        let panels = [Family::RoomType, Family::Color].into_iter();
        let panels: Vec<Panel> = panels.filter_map(of_family).collect();
        let caption = format!(
            "Answer collapse, {}: how often the answer given most often is given, by level.",
            light(variant, None)
        );
        let (caption, mut chart) = self.chart("share of replies in %", panels, 2, &caption)?;
        "shares of all replies, strict reading; what the answers are is in collapse.csv"
            .clone_into(&mut chart.note);
        Some((caption, chart))
    }
}

fn commonest_truth(confusion: &Confusion) -> Option<(f64, usize)> {
    let truths = confusion.shares().into_iter().map(|(_, truth)| truth);
    let (all, most) = truths.fold((0, 0), |(all, most), n| (all + n, most.max(n)));
    (all > 0).then(|| (most as f64 / all as f64, all))
}

/// Whether a subject is a model at a level without enhancement; L0 belongs to every variant.
fn raw(
    subject: &crate::score::accuracy::Subject,
    model: &str,
    level: Level,
    variant: Variant,
) -> bool {
    let variant = if level == Level::L0 {
        Variant::None
    } else {
        variant
    };
    subject.view == Some(View::Image)
        && subject.model == model
        && subject.level == Some(level)
        && subject.variant == variant
        && subject.enhancer.is_none()
}
