//! First screen of the page ([`PageHead`]): summary, chart, main finding of each group, and one frame at each level.

use serde::Serialize;

use super::inputs::PageInputs;
use super::strip::Strip;
use crate::error::Result;
use crate::report::charts::chart::figure_chart::FigureChart;
use crate::report::charts::chart::{Chart, Figure};
use crate::report::charts::figures::{Names, overview, split};
use crate::report::charts::paper::figure;
use crate::report::choice_report::ChoiceReport;
use crate::report::finding_groups::{Effect, Finding, FindingGroups};
use crate::report::sentences::capitalised;

/// Half the width of the drawing of intervals, in its own units. The largest end of all intervals is drawn there.
const MARK_REACH: f64 = 50.0;

/// Content of the first screen.
#[derive(Serialize)]
pub(crate) struct PageHead {
    summary: String,
    chart: Option<Figure>,
    rows: Vec<FindingRow>,
    strip: Option<Strip>,
}

/// Main finding of a group.
#[derive(Serialize)]
struct FindingRow {
    group: &'static str,
    class: &'static str,
    sign: char,
    text: String,
    /// Effect with its interval; empty without an interval.
    effect: String,
    /// Level of the effect; empty without a level.
    at: String,
    /// Intervals in other variants.
    in_other_lights: Vec<String>,
    mark: Option<Mark>,
}

/// Interval drawn as a line with a dot, in units from −[`MARK_REACH`] to +[`MARK_REACH`] around zero.
#[derive(Serialize)]
struct Mark {
    value: f64,
    low: f64,
    high: f64,
}

impl PageHead {
    /// Builds the first screen of an evaluation; `None` without a main finding, as in runs with one level and no blind
    /// model.
    ///
    /// # Errors
    /// If the chart cannot be drawn, or a question cannot be read.
    pub(super) fn new(
        report: &ChoiceReport<'_>,
        groups: &FindingGroups<'_>,
        inputs: &PageInputs<'_>,
    ) -> Result<Option<Self>> {
        if groups.main_findings().is_empty() {
            return Ok(None);
        }
        Ok(Some(Self {
            chart: chart(report)?,
            strip: Strip::new(&report.findings.grid, inputs)?,
            ..Self::without_images(groups)
        }))
    }

    /// First screen with only a summary.
    pub(crate) fn from_summary(summary: &str) -> Self {
        Self { summary: with_unbroken_percent(summary), chart: None, rows: Vec::new(), strip: None }
    }

    /// First screen with the summary and the main findings, without chart and images.
    pub(crate) fn without_images(groups: &FindingGroups<'_>) -> Self {
        let first = groups.main_findings();
        let reach = first
            .iter()
            .filter_map(|(_, finding)| difference(finding))
            .flat_map(|[_, low, high]| [low.abs(), high.abs()])
            .fold(1.0, f64::max);
        Self {
            rows: first.iter().map(|(group, finding)| FindingRow::new(group, finding, reach)).collect(),
            ..Self::from_summary(&groups.summary())
        }
    }
}

/// Prevents line breaks before percent signs.
fn with_unbroken_percent(text: &str) -> String {
    text.replace(" %", "\u{a0}%")
}

/// Difference of a finding with the ends of its interval, in points; `None` for a share.
fn difference(finding: &Finding<'_>) -> Option<[f64; 3]> {
    match Effect::from_sentence(finding.main_sentence())? {
        Effect::Difference(numbers) => Some(numbers),
        Effect::Share(_) => None,
    }
}

impl FindingRow {
    fn new(group: &'static str, finding: &Finding<'_>, reach: f64) -> Self {
        let tone = finding.main_sentence().tone;
        let mut intervals = finding.intervals();
        let others = intervals.split_off(intervals.len().min(1));
        let (effect, at) = intervals.pop().map_or_else(Default::default, |main| (main.effect, main.at));
        Self {
            group,
            class: tone.class(),
            sign: tone.sign(),
            text: with_unbroken_percent(&match finding.main_sentence().scope.light {
                Some(_) => capitalised(&finding.text()),
                None => finding.text(),
            }),
            effect,
            at: at.map_or_else(String::new, |at| format!("at {at}")),
            in_other_lights: others.iter().map(ToString::to_string).collect(),
            mark: difference(finding).map(|numbers| {
                let [value, low, high] = numbers.map(|x| (x / reach * MARK_REACH * 10.0).round() / 10.0);
                Mark { value, low, high }
            }),
        }
    }
}

/// Chart of the first screen: mean accuracy by level raw and with each enhancer, else by variant, else accuracy of each
/// model.
fn chart(report: &ChoiceReport<'_>) -> Result<Option<Figure>> {
    let panels = overview(report.findings, &Names::default());
    ["enhancers", "variants", "models"]
        .into_iter()
        .find_map(|wanted| {
            panels.charts.iter().filter(|(name, _)| *name == wanted).find_map(|(_, chart)| chart.as_ref().ok())
        })
        .map(|(caption, chart)| {
            let chart = Chart { note: panels.note.clone(), panels: split(chart.panels.clone()), ..chart.clone() };
            figure("head", caption, &FigureChart::Lines(chart))
        })
        .transpose()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::sentences::{Scope, Sentence, Tone};

    #[test]
    fn a_percent_sign_stays_with_its_number() {
        assert_eq!(with_unbroken_percent("from 90.6 % at L0"), "from 90.6\u{a0}% at L0");
    }

    #[test]
    fn marks_share_one_scale() {
        let values = [("difference", -20.0), ("low", -40.0), ("high", -5.0)];
        let wide = Sentence {
            kind: "darkness",
            tone: Tone::Worse,
            text: "Darkness costs.".to_owned(),
            detail: String::new(),
            values: values.map(|(name, value)| (name.to_owned(), value)).into(),
            scope: Scope::default(),
        };
        let head = PageHead::without_images(&FindingGroups::new(&[wide]));
        let row = &head.rows[0];
        assert_eq!(row.effect, "−20.0 [−40.0, −5.0]");
        let mark = row.mark.as_ref().unwrap();
        let drawn = serde_json::json!([mark.value, mark.low, mark.high]);
        assert_eq!(drawn, serde_json::json!([-25.0, -50.0, -6.3]));
    }
}
