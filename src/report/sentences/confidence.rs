//! The sentence about confidence: whether it falls with accuracy in the dark.

use super::sentence::{Numbers, Sentence, Tone};
use crate::types::{AxisLevel, Variant};
use darkqa_score::calibration::Calibration;
use darkqa_score::calibration::MIN_CONFIDENT_REPLIES;
use darkqa_score::cluster::{ClusterUnit, MIN_CLUSTERS};
use darkqa_score::findings::Findings;
use darkqa_score::model_in_condition::ModelInCondition;

/// The calibration of a model with one variant: at the darkest level, and at L0 if it was asked there.
#[derive(Debug, Clone, Copy)]
pub(super) struct Confidence<'f> {
    pub(super) model: &'f str,
    pub(super) level: AxisLevel,
    pub(super) dark: &'f Calibration,
    pub(super) clean: Option<&'f Calibration>,
}

impl<'f> Confidence<'f> {
    /// The calibrations with raw images at the darkest level of a variant, for the models of the pooled findings.
    /// Models with few replies are left out, and all models if there are few clusters, because their intervals are too
    /// wide.
    pub(super) fn all(findings: &'f Findings<'_>, variant: &Variant) -> Vec<Self> {
        if findings.grid.clusters < MIN_CLUSTERS {
            return Vec::new();
        }
        let models = findings.models_of(variant);
        let rows = findings.calibrations.iter().filter(|row| row.replies >= MIN_CONFIDENT_REPLIES);
        let dark = rows.clone().filter(|row| {
            let subject = &row.subject;
            subject.variant == *variant && subject.enhancer.is_none() && models.contains(&&*subject.model)
        });
        let Some(level) = dark.clone().filter_map(|row| row.subject.level).max() else {
            return Vec::new();
        };
        dark.filter(|row| row.subject.level == Some(level))
            .map(|dark| {
                let model = &*dark.subject.model;
                let clean = ModelInCondition::with_images(model, AxisLevel::L0, variant, None);
                Self { model, level, dark, clean: rows.clone().find(|row| row.subject.matches_up_to_group(&clean)) }
            })
            .collect()
    }

    /// True if the confidence is detected to be above the accuracy.
    fn is_overconfident(&self) -> bool {
        self.dark.overconfidence.is_above()
    }

    /// True if the overconfidence is detected to be larger than at L0.
    fn has_grown(&self) -> bool {
        self.dark.growth.is_some_and(|growth| growth.is_above())
    }
}

/// The sentence about the model whose confidence is furthest above its accuracy. Both tests, of overconfidence and of
/// its growth since L0, are corrected over all sentences.
pub(super) fn confidence(all: &[Confidence<'_>], unit: ClusterUnit) -> Option<Sentence> {
    let most = all.iter().copied().max_by(|a, b| {
        let [value, other] = [a, b].map(|one| one.dark.overconfidence.estimate.value);
        a.is_overconfident().cmp(&b.is_overconfident()).then(value.total_cmp(&other))
    })?;
    let mut numbers = Numbers::new(unit);
    let (model, level) = (most.model, most.level);
    let sure = numbers.percent("confidence", most.dark.confidence.value);
    let right = numbers.percent("accuracy", most.dark.accuracy.value);
    let (tone, text) = if most.is_overconfident() && most.has_grown() {
        let text = format!(
            "{model} does not know how little it sees at {level}: its mean confidence is {sure} %, and {right} % of its replies are \
             right."
        );
        (Tone::Worse, text)
    } else if most.is_overconfident() {
        let text = format!(
            "At {level} {model} is surer than it is right: its mean confidence is {sure} %, and {right} % of its replies are right."
        );
        (Tone::Worse, text)
    } else {
        let text = format!(
            "{model} was not detected to be surer than it is right at {level}: its mean confidence is {sure} %, and {right} % of its \
             replies are right."
        );
        (Tone::NotShown, text)
    };
    let difference = numbers.difference("", most.dark.overconfidence.estimate);
    let tested = most.dark.overconfidence;
    let p = numbers.p("p", tested.p_report.unwrap_or(tested.p));
    let clean = most.clean.map(|clean| {
        let difference = numbers.difference("_L0", clean.overconfidence.estimate);
        format!(", {difference} at L0")
    });
    let replies = numbers.count("n", most.dark.replies);
    let others = if all.len() > 1 {
        let overconfident = all.iter().filter(|one| one.is_overconfident()).count();
        let overconfident = numbers.count("shown", overconfident);
        let models = numbers.count("models", all.len());
        format!("; shown of {overconfident} of {models} models")
    } else {
        String::new()
    };
    let detail = format!(
        "confidence less accuracy: {difference} points, {p}{}{others}; n = {replies} replies with probabilities",
        clean.unwrap_or_default()
    );
    Some(numbers.sentence("confidence", tone, text, detail))
}
