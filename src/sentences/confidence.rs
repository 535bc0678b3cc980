//! The sentence about what models know of their own sight: whether their confidence falls with their accuracy.

use super::sentence::{Numbers, Sentence, Tone};
use crate::types::{AxisLevel, Variant};
use darkqa_score::calibration::Calibration;
use darkqa_score::calibration::MIN_CONFIDENT_REPLIES;
use darkqa_score::cluster::{ClusterUnit, MIN_SCENES};
use darkqa_score::findings::Findings;
use darkqa_score::model_in_condition::ModelInCondition;

/// The confidence of a model in the images of a light: at the darkest level, and at L0 if that was asked.
#[derive(Debug, Clone, Copy)]
pub(super) struct Confidence<'f> {
    pub(super) model: &'f str,
    pub(super) level: AxisLevel,
    pub(super) dark: &'f Calibration,
    pub(super) clean: Option<&'f Calibration>,
}

impl<'f> Confidence<'f> {
    /// The confidence in raw images of the darkest level of a variant, of the models over which findings are pooled. Without those of
    /// few replies or clusters, whose intervals reveal little.
    pub(super) fn all(findings: &'f Findings<'_>, variant: &Variant) -> Vec<Self> {
        if findings.grid.clusters < MIN_SCENES {
            return Vec::new();
        }
        let models = findings.models_of(variant);
        let rows = || {
            findings
                .calibrations
                .iter()
                .filter(|row| row.replies >= MIN_CONFIDENT_REPLIES)
        };
        let dark = rows().filter(|row| {
            let subject = &row.subject;
            subject.variant == *variant
                && subject.enhancer.is_none()
                && models.contains(&&*subject.model)
        });
        let Some(level) = dark.clone().filter_map(|row| row.subject.level).max() else {
            return Vec::new();
        };
        dark.filter(|row| row.subject.level == Some(level))
            .map(|dark| {
                let model = &*dark.subject.model;
                let clean = ModelInCondition::with_images(model, AxisLevel::L0, variant, None);
                Self {
                    model,
                    level,
                    dark,
                    clean: rows().find(|row| row.subject.matches_up_to_group(&clean)),
                }
            })
            .collect()
    }

    /// Whether the confidence is shown to be above the accuracy.
    fn is_above(&self) -> bool {
        self.dark.overconfidence.is_above()
    }

    /// Whether the confidence is shown to be further above the accuracy than at L0.
    fn is_grown(&self) -> bool {
        self.dark.growth.is_some_and(|growth| growth.is_above())
    }
}

/// Whether the models know how little they see, of the one whose confidence is furthest above its accuracy. Both
/// tests are among those that are corrected over all sentences.
pub(super) fn confidence(all: &[Confidence<'_>], unit: ClusterUnit) -> Option<Sentence> {
    let above = |one: &Confidence<'_>| (one.is_above(), one.dark.overconfidence.estimate.value);
    let most = all.iter().copied().max_by(|a, b| {
        let (a, b) = (above(a), above(b));
        a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
    })?;
    let mut numbers = Numbers::new(unit);
    let (model, level) = (most.model, most.level);
    let sure = numbers.percent("confidence", most.dark.confidence.value);
    let right = numbers.percent("accuracy", most.dark.accuracy.value);
    let (tone, text) = if most.is_above() && most.is_grown() {
        let text = format!(
            "{model} does not know how little it sees at {level}: its mean confidence is {sure} %, and {right} % of its replies are \
             right."
        );
        (Tone::Worse, text)
    } else if most.is_above() {
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
        let shown = all.iter().filter(|one| one.is_above()).count();
        let shown = numbers.count("shown", shown);
        let models = numbers.count("models", all.len());
        format!("; shown of {shown} of {models} models")
    } else {
        String::new()
    };
    let detail = format!(
        "confidence less accuracy: {difference} points, {p}{}{others}; n = {replies} replies with probabilities",
        clean.unwrap_or_default()
    );
    Some(numbers.sentence("confidence", tone, text, detail))
}
