//! The figure of a set that was photographed in the dark: bars, raw and with each enhancer.

use super::{Drawing, Overview};
use crate::drawing::chart::LineStyle;
use crate::drawing::chart::bars::{Bar, BarChart, BarPanel};
use crate::drawing::chart::drawn::Drawn;
use crate::types::{SetLight, View};
use darkqa_score::choice::ReadingMode;

impl Overview<'_> {
    /// The accuracy of each model as photographed, raw and with each enhancer; `None` for sets in the light, which have curves.
    pub(super) fn photographed(&self) -> Option<Drawing> {
        let findings = self.findings;
        if findings.set.light == SetLight::Lit || self.models.is_empty() {
            return None;
        }
        let chance = findings.summary.family_cells(None, ReadingMode::Strict);
        let mut chance = chance.filter(|cell| cell.subject.view.is_none());
        let line = chance.find_map(|cell| Some(cell.accuracy?.value));
        let panels = self.models.iter().map(|model| {
            let bars = findings
                .grid
                .subjects
                .iter()
                .filter(|subject| {
                    subject.model == *model
                        && subject.view == Some(View::Image)
                        && !subject.variant.is_degraded()
                })
                .filter_map(|subject| {
                    let name = match &subject.enhancer {
                        None => "raw".to_owned(),
                        Some(name) => {
                            let name = self.names.shown(name.as_str());
                            format!("{name}{}", subject.variant.group_suffix())
                        }
                    };
                    let place = self
                        .enhancers
                        .iter()
                        .position(|known| Some(*known) == subject.enhancer.as_ref());
                    Some(Bar {
                        name,
                        style: LineStyle(place.map_or(0, |place| place + 1)),
                        share: self.accuracy_of(subject, None)?,
                    })
                });
            BarPanel {
                title: format!(
                    "{}: accuracy in %, n {}",
                    self.names.shown(model),
                    self.n(None)
                ),
                bars: bars.collect(),
                line,
            }
        });
        let chart = BarChart {
            panels: panels.filter(|panel| !panel.bars.is_empty()).collect(),
            note: format!(
                "lines are 95 % intervals by {}; strict parsing",
                findings.unit
            ),
        };
        if chart.panels.is_empty() {
            return None;
        }
        Some(Drawing {
            name: "photographed",
            caption: "Accuracy on photographs in the dark, raw (as photographed) and with each enhancer. Broken line: chance."
                .to_owned(),
            chart: Drawn::Bars(chart),
        })
    }
}
