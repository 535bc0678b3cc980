//! First screen of the page ([`PageHead`]): summary, chart, main finding of each group, and one frame at each level.
//!
//! Images of one frame at each level, with the models' answers: [`Strip`].

use std::collections::{BTreeSet, HashSet};

use serde::Serialize;

use super::run_usage::PageInputs;
use crate::charts::chart::{Chart, Figure};
use crate::charts::figures::{DisplayNames, overview, split};
use crate::charts::paper::figure;
use crate::finding_groups::{Effect, FindingGroups, GroupedFinding};
use crate::sentences::capitalised;
use crate::text::words::light;
use darkqa_base::error::Result;
use darkqa_base::types::{Axis, AxisLevel, EnhancerName, FrameId, Thumbnail, Variant};
use darkqa_score::choice::ParsingMode;
use darkqa_score::findings::Findings;
use darkqa_score::grid::{Grid, TrialResult};
use darkqa_score::model_in_condition::{ModelInCondition, pooled_models};

/// Half the width of the drawing of intervals, in its own units. The largest end of all intervals is drawn there.
const MARK_REACH: f64 = 50.0;

/// Content of the first screen.
#[derive(Serialize)]
pub struct PageHead {
    summary: String,
    /// One chart, or none.
    figures: Vec<Figure>,
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
    mark: Option<IntervalMark>,
}

/// Interval drawn as a line with a dot, in units from −[`MARK_REACH`] to +[`MARK_REACH`] around zero.
#[derive(Serialize)]
struct IntervalMark {
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
    pub fn new(findings: &Findings<'_>, groups: &FindingGroups<'_>, inputs: &PageInputs<'_>) -> Result<Option<Self>> {
        if groups.main_findings().is_empty() {
            return Ok(None);
        }
        Ok(Some(Self {
            figures: chart(findings)?.into_iter().collect(),
            strip: Strip::new(&findings.grid, inputs)?,
            ..Self::without_images(groups)
        }))
    }

    /// First screen with only a summary.
    pub fn from_summary(summary: &str) -> Self {
        Self { summary: with_unbroken_percent(summary), figures: Vec::new(), rows: Vec::new(), strip: None }
    }

    /// First screen with the summary and the main findings, without chart and images.
    pub fn without_images(groups: &FindingGroups<'_>) -> Self {
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
fn difference(finding: &GroupedFinding<'_>) -> Option<[f64; 3]> {
    match Effect::from_sentence(finding.main_sentence())? {
        Effect::Difference(numbers) => Some(numbers),
        Effect::Share(_) => None,
    }
}

impl FindingRow {
    fn new(group: &'static str, finding: &GroupedFinding<'_>, reach: f64) -> Self {
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
                IntervalMark { value, low, high }
            }),
        }
    }
}

/// Chart of the first screen: mean accuracy by level raw and with each enhancer, else by variant, else accuracy of each
/// model.
fn chart(findings: &Findings<'_>) -> Result<Option<Figure>> {
    let panels = overview(findings, &DisplayNames::default());
    ["enhancers", "variants", "models"]
        .into_iter()
        .find_map(|wanted| {
            panels.charts.iter().filter(|(name, _)| *name == wanted).find_map(|(_, chart)| chart.as_ref().ok())
        })
        .map(|(caption, chart)| {
            let chart = Chart { note: panels.note.clone(), panels: split(chart.panels.clone()), ..chart.clone() };
            figure("head", caption, &chart)
        })
        .transpose()
}

/// Maximum number of models whose answers are below an image (chosen to fit one screen).
const MAX_MODELS: usize = 3;

/// Maximum number of rows (chosen to fit one screen).
const MAX_ROWS: usize = 4;

/// Images of one frame at each level, raw and enhanced, with each model's answer to one question.
#[derive(Serialize)]
pub(super) struct Strip {
    question: String,
    /// True choice; empty if it is unknown.
    truth: String,
    levels: Vec<String>,
    rows: Vec<StripRow>,
}

#[derive(Serialize)]
struct StripRow {
    name: String,
    cells: Vec<Option<StripCell>>,
}

#[derive(Serialize)]
struct StripCell {
    url: String,
    alt: String,
    answers: Vec<ImageAnswer>,
}

/// A model's answer in one condition.
#[derive(Serialize)]
struct ImageAnswer {
    class: &'static str,
    sign: char,
    /// Text of the choice or of the reason why there is none, after the model's name if there are several models.
    text: String,
}

/// Variant and enhancer of a row of images.
struct ImageRow<'a> {
    variant: Variant,
    enhancer: Option<&'a EnhancerName>,
}

impl Strip {
    /// Builds the strip of the first frame with thumbnails. The question is the one whose answers change most between
    /// L0 and the other images. `None` without thumbnails at several levels.
    ///
    /// # Errors
    /// If the question cannot be read.
    pub(super) fn new(grid: &Grid<'_>, inputs: &PageInputs<'_>) -> Result<Option<Self>> {
        let thumbnails: Vec<&Thumbnail> =
            inputs.thumbnails.iter().filter(|thumbnail| thumbnail.condition.level().belongs_to(Axis::LIGHT)).collect();
        let Some(frame) = thumbnails.iter().map(|thumbnail| &thumbnail.frame).min() else {
            return Ok(None);
        };
        let levels: BTreeSet<AxisLevel> = thumbnails.iter().map(|thumbnail| thumbnail.condition.level()).collect();
        let rows = rows(grid, &thumbnails);
        let models = models(grid);
        // `max_by_key` returns the last maximum, so the order is reversed to prefer the first item.
        let Some(item) = grid
            .items
            .iter()
            .enumerate()
            .filter(|(_, item)| *item.asked.frame == *frame && item.draw == 0)
            .map(|(index, _)| index)
            .rev()
            .max_by_key(|item| {
                rows.iter()
                    .flat_map(|row| levels.iter().map(move |level| (row, *level)))
                    .filter(|(row, level)| row.has_lost_answer(grid, &models, *item, *level))
                    .count()
            })
        else {
            return Ok(None);
        };
        if rows.is_empty() || levels.len() < 2 {
            return Ok(None);
        }
        let asked = grid.items[item].asked;
        let question = (inputs.questions)(&HashSet::from([&*asked.question]))?
            .remove(&*asked.question)
            .map(|question| question.text);
        let truth = asked.truth.and_then(|truth| asked.choices.get(truth));
        Ok(Some(Self {
            question: question.unwrap_or_else(|| asked.question.to_string()),
            truth: truth.cloned().unwrap_or_default(),
            rows: rows.iter().map(|row| row.strip_row(grid, &models, item, frame, &thumbnails, &levels)).collect(),
            levels: levels.iter().map(AxisLevel::to_string).collect(),
        }))
    }
}

impl<'a> ImageRow<'a> {
    /// Trial of an item with a model at a level of this row.
    fn trial(&'a self, grid: &'a Grid<'a>, model: &'a str, item: usize, level: AxisLevel) -> StripTrial<'a> {
        StripTrial { grid, model, item, level, row: self }
    }

    /// True if a model answers an item right at L0, but wrong at a level.
    fn has_lost_answer(&self, grid: &Grid<'_>, models: &[&str], item: usize, level: AxisLevel) -> bool {
        models.iter().any(|model| {
            self.trial(grid, model, item, level).is_right() == Some(false)
                && self.trial(grid, model, item, AxisLevel::L0).is_right() == Some(true)
        })
    }

    /// Builds the images of the row with the answers to an item.
    fn strip_row(
        &self,
        grid: &Grid<'_>,
        models: &[&str],
        item: usize,
        frame: &FrameId,
        thumbnails: &[&Thumbnail],
        levels: &BTreeSet<AxisLevel>,
    ) -> StripRow {
        let cells = levels.iter().map(|level| {
            let thumbnail =
                thumbnails.iter().find(|thumbnail| thumbnail.frame == *frame && self.contains(thumbnail, *level))?;
            let answers: Vec<ImageAnswer> = models
                .iter()
                .filter_map(|model| self.trial(grid, model, item, *level).answer(models.len() > 1))
                .collect();
            let texts: Vec<String> = answers.iter().map(|answer| format!("{} {}", answer.sign, answer.text)).collect();
            Some(StripCell {
                url: thumbnail.small.clone(),
                alt: format!("{frame} at {}: {}", thumbnail.condition, texts.join(", ")),
                answers,
            })
        });
        StripRow { name: light(&self.variant, self.enhancer), cells: cells.collect() }
    }

    /// True if a thumbnail belongs to this row at a level. The clean frame belongs to each row of raw images.
    fn contains(&self, thumbnail: &Thumbnail, level: AxisLevel) -> bool {
        let condition = &thumbnail.condition;
        condition.level() == level
            && condition.draw().unwrap_or(0) == 0
            && condition.enhancer.as_ref() == self.enhancer
            && (condition.variant() == self.variant || level == AxisLevel::L0)
    }
}

/// Rows of a strip: another variant such as exposure drop alone, the main variant, and the main variant with each
/// enhancer.
fn rows<'a>(grid: &Grid<'_>, thumbnails: &[&'a Thumbnail]) -> Vec<ImageRow<'a>> {
    let Some(main) = grid.main_variant() else {
        return Vec::new();
    };
    let lights: BTreeSet<(Variant, Option<&EnhancerName>)> = thumbnails
        .iter()
        .map(|thumbnail| {
            let condition = &thumbnail.condition;
            (condition.variant(), condition.enhancer.as_ref())
        })
        .filter(|(variant, _)| variant.is_degraded())
        .collect();
    let other_variant = lights.iter().find(|(variant, enhancer)| *variant != main && enhancer.is_none());
    let main_variant = lights.iter().filter(|(variant, _)| *variant == main);
    other_variant
        .into_iter()
        .chain(main_variant)
        .take(MAX_ROWS)
        .map(|(variant, enhancer)| ImageRow { variant: variant.clone(), enhancer: *enhancer })
        .collect()
}

/// First models that were shown images.
fn models<'a>(grid: &'a Grid<'_>) -> Vec<&'a str> {
    let mut models: Vec<&str> =
        grid.subjects.iter().filter(|subject| subject.level.is_some()).map(|subject| &*subject.model).collect();
    models.dedup();
    let pooled = pooled_models(models.iter().copied());
    models.retain(|model| pooled.contains(model));
    models.truncate(MAX_MODELS);
    models
}

/// One item asked of one model at a level of a row.
#[derive(Clone, Copy)]
struct StripTrial<'a> {
    grid: &'a Grid<'a>,
    model: &'a str,
    item: usize,
    level: AxisLevel,
    row: &'a ImageRow<'a>,
}

impl StripTrial<'_> {
    /// Result with or without an enhancer; `None` if the model was not asked in this condition.
    fn result(self, enhancer: Option<&EnhancerName>) -> Option<TrialResult> {
        let subject = ModelInCondition::with_images(self.model, self.level, &self.row.variant, enhancer);
        Some(self.grid.result(self.grid.find_up_to_group(&subject)?, self.item))
    }

    /// True if the answer by strict parsing is right; `None` without a reply or a true choice. At L0, the raw frame
    /// counts even in a row with an enhancer.
    fn is_right(self) -> Option<bool> {
        let enhancer = self.row.enhancer.filter(|_| self.level != AxisLevel::L0);
        let reading = self.result(enhancer)?.parsed(ParsingMode::Strict)?;
        let item = &self.grid.items[self.item];
        item.asked.truth?;
        Some(item.is_right(reading))
    }

    /// Answer with its mark; `None` if the item was not asked. `has_name` puts the model's name before the text.
    fn answer(self, has_name: bool) -> Option<ImageAnswer> {
        let result = self.result(self.row.enhancer)?;
        if !result.is_asked() {
            return None;
        }
        let item = &self.grid.items[self.item];
        let (class, sign, text) = match result.parsed(ParsingMode::Strict) {
            None => ("none", '–', "no reply"),
            Some(None) => ("none", '?', "not readable"),
            Some(Some(chosen)) => {
                let text = item.asked.choices.get(usize::from(chosen));
                let text = text.map_or("", String::as_str);
                match item.asked.truth {
                    None => ("none", '·', text),
                    Some(_) if item.is_right(Some(chosen)) => ("right", '✓', text),
                    Some(_) => ("wrong", '✗', text),
                }
            }
        };
        Some(ImageAnswer {
            class,
            sign,
            text: if has_name { format!("{}: {text}", self.model) } else { text.to_owned() },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sentences::{EffectDirection, Sentence, SentenceScope};

    #[test]
    fn a_percent_sign_stays_with_its_number() {
        assert_eq!(with_unbroken_percent("from 90.6 % at L0"), "from 90.6\u{a0}% at L0");
    }

    #[test]
    fn marks_share_one_scale() {
        let values = [("difference", -20.0), ("low", -40.0), ("high", -5.0)];
        let wide = Sentence {
            kind: "darkness",
            tone: EffectDirection::Worse,
            text: "Darkness costs.".to_owned(),
            detail: String::new(),
            values: values.map(|(name, value)| (name.to_owned(), value)).into(),
            scope: SentenceScope::default(),
        };
        let head = PageHead::without_images(&FindingGroups::new(&[wide]));
        let row = &head.rows[0];
        assert_eq!(row.effect, "−20.0 [−40.0, −5.0]");
        let mark = row.mark.as_ref().unwrap();
        let drawn = serde_json::json!([mark.value, mark.low, mark.high]);
        assert_eq!(drawn, serde_json::json!([-25.0, -50.0, -6.3]));
    }
}
