//! [`PageHead`], the first screen of the page: a summary in words, one chart, the first finding of each group, and one frame through the
//! levels.

use std::collections::HashSet;

use serde::Serialize;

use super::inputs::PageInputs;
use super::strip::Strip;
use crate::drawing::chart::drawn::Drawn;
use crate::drawing::chart::{Chart, Figure};
use crate::drawing::figures::{Names, overview};
use crate::drawing::paper::figure;
use crate::error::Result;
use crate::report::choice_report::ChoiceReport;
use crate::sentences::{Sentence, Tone};
use crate::text::words::points;

/// The groups of findings, in the order of the rows, each with the kinds of its sentences. The first detected finding stands for its
/// group, else the first one.
const GROUPS: [(&str, &[&str]); 5] = [
    ("Darkness", &["darkness"]),
    ("Noise", &["noise"]),
    ("Enhancer", &["enhancer"]),
    (
        "Without images",
        &["below blind", "images", "cannot_tell", "bank_cannot_tell"],
    ),
    (
        "Failures",
        &["collapse", "hallucination", "format", "unread"],
    ),
];

/// Half the width of a mark's drawing, in its own units; the largest interval end of all rows is drawn there.
const MARK_REACH: f64 = 50.0;

/// The first screen.
#[derive(Serialize)]
pub(in crate::report) struct PageHead<'a> {
    summary: String,
    chart: Option<Figure>,
    rows: Vec<FindingRow<'a>>,
    strip: Option<Strip>,
}

/// The finding that stands for a group.
#[derive(Serialize)]
struct FindingRow<'a> {
    group: &'static str,
    class: &'static str,
    sign: char,
    text: &'a str,
    /// Difference in points with its interval; empty of a finding without one.
    interval: String,
    mark: Option<Mark>,
}

/// An interval as a line with a dot, in units from −[`MARK_REACH`] to +[`MARK_REACH`] around zero.
#[derive(Serialize)]
struct Mark {
    value: f64,
    low: f64,
    high: f64,
}

/// A difference in points, with the ends of its interval.
#[derive(Clone, Copy)]
struct Difference {
    value: f64,
    low: f64,
    high: f64,
}

impl Difference {
    /// The difference that a sentence names; `None` if it names none.
    fn from_sentence(sentence: &Sentence) -> Option<Self> {
        let [value, low, high] =
            ["difference", "low", "high"].map(|name| sentence.values.get(name).copied());
        Some(Self {
            value: value?,
            low: low?,
            high: high?,
        })
    }

    /// The largest distance of an end from zero.
    fn reach(self) -> f64 {
        self.low.abs().max(self.high.abs())
    }

    /// The difference as `−4.8 [−8.5, −1.0]`.
    fn words(self) -> String {
        let [value, low, high] = [self.value, self.low, self.high].map(|x| points(x / 100.0));
        format!("{value} [{low}, {high}]")
    }

    fn mark(self, reach: f64) -> Mark {
        let [value, low, high] = [self.value, self.low, self.high]
            .map(|x| (x / reach * MARK_REACH * 10.0).round() / 10.0);
        Mark { value, low, high }
    }
}

impl<'a> PageHead<'a> {
    /// The first screen of an evaluation; `None` if nothing was found, for want of two levels or of a model without images.
    ///
    /// # Errors
    /// If the chart cannot be drawn, or the question of the strip cannot be read.
    pub(super) fn new(
        report: &'a ChoiceReport<'_>,
        inputs: &PageInputs<'_>,
    ) -> Result<Option<Self>> {
        let first: Vec<(&'static str, &Sentence)> = GROUPS
            .iter()
            .filter_map(|(group, kinds)| Some((*group, representative(&report.sentences, kinds)?)))
            .collect();
        if first.is_empty() {
            return Ok(None);
        }
        let reach = first
            .iter()
            .filter_map(|(_, sentence)| Difference::from_sentence(sentence))
            .map(Difference::reach)
            .fold(1.0, f64::max);
        let rows = first
            .iter()
            .map(|(group, sentence)| FindingRow::new(group, sentence, reach))
            .collect();
        Ok(Some(Self {
            summary: summary(&first),
            chart: chart(report)?,
            rows,
            strip: Strip::new(&report.findings.grid, inputs)?,
        }))
    }
}

impl<'a> FindingRow<'a> {
    fn new(group: &'static str, sentence: &'a Sentence, reach: f64) -> Self {
        let difference = Difference::from_sentence(sentence);
        Self {
            group,
            class: sentence.tone.class(),
            sign: sentence.tone.sign(),
            text: sentence.text.trim_end_matches('.'),
            interval: difference.map_or_else(String::new, Difference::words),
            mark: difference.map(|difference| difference.mark(reach)),
        }
    }
}

/// The finding that stands for the sentences of some kinds: the first detected one, else the first.
fn representative<'a>(sentences: &'a [Sentence], kinds: &[&str]) -> Option<&'a Sentence> {
    let mut of_group = sentences
        .iter()
        .filter(|sentence| kinds.contains(&sentence.kind));
    of_group
        .clone()
        .find(|sentence| matches!(sentence.tone, Tone::Better | Tone::Worse))
        .or_else(|| of_group.next())
}

/// The summary: the findings about darkness and enhancers; without either, the first finding.
fn summary(first: &[(&'static str, &Sentence)]) -> String {
    let leading: HashSet<&str> = ["Darkness", "Enhancer"].into();
    let texts: Vec<&str> = first
        .iter()
        .filter(|(group, _)| leading.contains(group))
        .map(|(_, sentence)| &*sentence.text)
        .collect();
    match (&texts[..], first) {
        ([], [(_, sentence), ..]) => sentence.text.clone(),
        _ => texts.join(" "),
    }
}

/// The mean accuracy over the levels, raw and with each enhancer; without enhancers by variant, else of each model.
fn chart(report: &ChoiceReport<'_>) -> Result<Option<Figure>> {
    let panels = overview(report.findings, &Names::default());
    ["enhancers", "variants", "models"]
        .into_iter()
        .find_map(|wanted| {
            let mut charts = panels.charts.iter();
            charts
                .find(|(name, chart)| *name == wanted && chart.is_ok())
                .and_then(|(_, chart)| chart.as_ref().ok())
        })
        .map(|(caption, chart)| {
            let chart = Chart {
                note: panels.note.clone(),
                ..chart.clone()
            };
            figure("head", caption, &Drawn::Lines(chart))
        })
        .transpose()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sentence(kind: &'static str, tone: Tone, difference: Option<[f64; 3]>) -> Sentence {
        let names = ["difference", "low", "high"].map(str::to_owned);
        Sentence {
            kind,
            tone,
            text: format!("About {kind}."),
            detail: String::new(),
            values: difference
                .into_iter()
                .flat_map(|values| names.clone().into_iter().zip(values))
                .collect(),
        }
    }

    #[test]
    fn a_detected_finding_stands_for_its_group() {
        let sentences = [
            sentence("enhancer", Tone::NotShown, None),
            sentence("enhancer", Tone::Worse, None),
            sentence("darkness", Tone::NotShown, None),
        ];
        assert_eq!(
            representative(&sentences, &["enhancer"]),
            Some(&sentences[1])
        );
        assert_eq!(
            representative(&sentences, &["darkness"]),
            Some(&sentences[2])
        );
        assert_eq!(representative(&sentences, &["noise"]), None);
    }

    #[test]
    fn marks_share_one_scale() {
        let wide = sentence("darkness", Tone::Worse, Some([-20.0, -40.0, -5.0]));
        let row = FindingRow::new("Darkness", &wide, 40.0);
        assert_eq!(row.interval, "−20.0 [−40.0, −5.0]");
        let mark = row.mark.unwrap();
        let drawn = serde_json::json!([mark.value, mark.low, mark.high]);
        assert_eq!(drawn, serde_json::json!([-25.0, -50.0, -6.3]));
    }

    #[test]
    fn the_summary_is_about_darkness_and_enhancers() {
        let [darkness, noise, enhancer] =
            ["darkness", "noise", "enhancer"].map(|kind| sentence(kind, Tone::Worse, None));
        let all = [
            ("Darkness", &darkness),
            ("Noise", &noise),
            ("Enhancer", &enhancer),
        ];
        assert_eq!(summary(&all), "About darkness. About enhancer.");
        assert_eq!(summary(&all[1..2]), "About noise.");
    }
}
