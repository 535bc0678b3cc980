//! Figures of wrong answers in the dark: hallucinated objects, and collapse to one answer.

use super::FigureBuilder;
use crate::report::charts::chart::{Chart, LineContent, LineStyle, Panel, PlotLine};
use crate::report::text::words::family as family_name;
use crate::types::{Family, Variant};
use darkqa_score::answers::confusion::{Confusion, Hallucination};
use darkqa_score::estimate::Estimate;

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
        self.chart("share of replies in %", panels, 2, &caption)
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
            LineContent::Flat(_) | LineContent::Marks(_) => None,
        });
        Panel { title: format!("{title}, n {}", n.unwrap_or(0)), lines, model: None }
    }

    /// Share of the most frequent answer by level, against the share of the most frequent true answer.
    pub(super) fn collapse(&self) -> Option<(String, Chart)> {
        let variant = self.main_variant()?;
        let panels: Vec<Panel> = [Family::RoomType, Family::Color]
            .into_iter()
            .filter_map(|family| self.collapse_panel(&variant, &family))
            .collect();
        let caption = format!(
            "Answer collapse, {}: how often the answer given most often is given, by level.",
            self.condition_text(&variant, None)
        );
        let (caption, mut chart) = self.chart("share of replies in %", panels, 2, &caption)?;
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
        Some(Panel {
            title: format!("{}, n {n}", self.names.display_name(family_name(Some(family)))),
            lines,
            model: None,
        })
    }
}

/// Share of the most frequent true answer, and the number of replies.
fn commonest_truth(confusion: &Confusion) -> Option<(f64, usize)> {
    let (all, highest) =
        confusion.shares().into_iter().fold((0, 0), |(all, highest), (_, n)| (all + n, highest.max(n)));
    (all > 0).then(|| (highest as f64 / all as f64, all))
}
