//! Figures of the answers of models that no longer see: hallucination and collapse.

use super::Overview;
use crate::drawing::chart::{Chart, LineStyle, Panel, PanelContent, PlotLine};
use crate::text::words::family as family_name;
use crate::types::Family;
use darkqa_score::answers::confusion::{Confusion, Hallucination};
use darkqa_score::estimate::Estimate;

impl Overview<'_> {
    pub(super) fn hallucination(&self) -> Option<(String, Chart)> {
        let variant = self.main_variant()?;
        if self.findings.hallucinations.is_empty() {
            return None;
        }
        let panel = |title: &str, rate: fn(&Hallucination) -> Option<Estimate>| {
            let lines = self.lines(&variant, |subject| {
                let mut rates = self.findings.hallucinations.iter();
                rate(rates.find(|rates| rates.subject == *subject)?)
            });
            let n = lines.iter().find_map(|line| match &line.content {
                PanelContent::Curve(points) => points.first().map(|(_, rate)| rate.n),
                PanelContent::Flat(_) | PanelContent::Marks(_) => None,
            });
            let title = format!("{title}, n {}", n.unwrap_or(0));
            Panel {
                title,
                lines,
                model: None,
            }
        };
        let panels = vec![
            panel("“yes” where nothing is", |rates| rates.false_positive),
            panel("“no” where it is", |rates| rates.false_negative),
        ];
        let caption = format!(
            "Object recognition: false positives (left) and false negatives (right) by level, {}.",
            self.light(&variant, None)
        );
        self.chart("share of replies in %", panels, 2, &caption)
    }

    /// Share of the most frequent answer by level, against the share of the most frequent true answer.
    pub(super) fn collapse(&self) -> Option<(String, Chart)> {
        let variant = self.main_variant()?;
        let panel = |family: Family| {
            let mut truth = None;
            let mut lines = self.lines(&variant, |subject| {
                let confusion = self.findings.confusions.iter().find(|confusion| {
                    confusion.family == family && confusion.subject == *subject
                })?;
                truth = truth.or_else(|| commonest_truth(confusion));
                let share = confusion.collapse.as_ref()?.share;
                Some(Estimate::exact(share.value, share.n))
            });
            let (share, n) = truth?;
            lines.push(PlotLine {
                name: "commonest true answer".to_owned(),
                style: LineStyle::REFERENCE,
                content: PanelContent::Flat(share),
                model: None,
                items: None,
            });
            let title = format!("{}, n {n}", self.names.shown(family_name(Some(&family))));
            Some(Panel {
                title,
                lines,
                model: None,
            })
        };
        let panels: Vec<Panel> = [Family::RoomType, Family::Color]
            .into_iter()
            .filter_map(panel)
            .collect();
        let caption = format!(
            "Answer collapse, {}: how often the answer given most often is given, by level.",
            self.light(&variant, None)
        );
        let (caption, mut chart) = self.chart("share of replies in %", panels, 2, &caption)?;
        "shares of all replies, strict parsing; what the answers are is in collapse.csv"
            .clone_into(&mut chart.note);
        Some((caption, chart))
    }
}

/// Share of the most frequent true answer, and the number of replies.
fn commonest_truth(confusion: &Confusion) -> Option<(f64, usize)> {
    let truths = confusion.shares().into_iter().map(|(_, truth)| truth);
    let (all, highest) = truths.fold((0, 0), |(all, highest), n| (all + n, highest.max(n)));
    (all > 0).then(|| (highest as f64 / all as f64, all))
}
