//! A model in a condition: [`Subject`].

use std::collections::BTreeSet;

use serde::Serialize;

use darkqa_ground::types::control::OBSERVER;
use darkqa_ground::types::{
    AxisLevel, Condition, Control, EnhancerName, KindReading, LightGroup, TrialRef, View,
};

/// The model name of the chance line.
pub const CHANCE: &str = "chance";

/// A model name without the run behind it: where several runs are compared, `observer (one)` is the observer of the run `one`.
#[must_use]
pub fn without_run(model: &str) -> &str {
    model.split_once(" (").map_or(model, |(name, _)| name)
}

/// Whether a model of this name is the built-in observer.
#[must_use]
pub fn is_observer(model: &str) -> bool {
    without_run(model) == OBSERVER
}

/// Whether a model of this name is a control of the observer.
#[must_use]
pub fn is_control(model: &str) -> bool {
    Control::from_model_name(model).is_some()
}

/// Whether a model of this name is built in and stands for comparison only: `random`, `observer` and its controls
/// (`observer:…`). It is no model under test, so rankings and comparisons of models leave it out.
#[must_use]
pub fn is_reference(model: &str) -> bool {
    without_run(model) == "random" || is_observer(model) || is_control(model)
}

/// The models that results are about, sorted: references only if there are no others.
#[must_use]
pub fn judged<'m>(models: impl IntoIterator<Item = &'m str>) -> BTreeSet<&'m str> {
    let all: BTreeSet<&str> = models.into_iter().collect();
    let others: BTreeSet<&str> = all
        .iter()
        .copied()
        .filter(|model| !is_reference(model))
        .collect();
    if others.is_empty() { all } else { others }
}

/// The models to pool, sorted: those that are [`judged`]. If only reference models ran, one of them alone, preferably the observer: a mean
/// of the observer and `random` would be meaningless.
#[must_use]
pub fn pooled_models<'m>(models: impl IntoIterator<Item = &'m str>) -> BTreeSet<&'m str> {
    let judged = judged(models);
    if !judged.iter().all(|model| is_reference(model)) {
        return judged;
    }
    judged
        .iter()
        .find(|model| is_observer(model))
        .or(judged.first())
        .copied()
        .into_iter()
        .collect()
}

/// A model in a condition; every cell of a table belongs to one.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub struct Subject {
    /// Name of the model, or [`CHANCE`].
    pub model: String,
    /// Whether the model saw images; `None` for chance.
    pub view: Option<View>,
    /// Level of degradation; `None` if the model saw no image.
    pub level: Option<AxisLevel>,
    /// Kind of degradation with its light reading.
    pub variant: KindReading,
    /// Enhancer; `None` for raw images.
    pub enhancer: Option<EnhancerName>,
}

impl Subject {
    /// The subject of a trial.
    #[must_use]
    pub fn from_trial(trial: TrialRef<'_>) -> Self {
        Self::new(trial.model(), trial.condition())
    }

    /// A model in a condition; without images if the condition is `None`.
    #[must_use]
    pub fn new(model: &str, condition: Option<&Condition>) -> Self {
        Self {
            model: model.to_owned(),
            view: Some(condition.map_or(View::Blind, |_| View::Image)),
            level: condition.map(Condition::level),
            variant: condition.map_or(KindReading::NONE, Condition::kind_reading),
            enhancer: condition.and_then(|condition| condition.enhancer.clone()),
        }
    }

    /// Whether the model is built in and stands for comparison only: `random`, `observer` or one of its controls.
    #[must_use]
    pub fn is_reference(&self) -> bool {
        is_reference(&self.model)
    }

    /// The condition as text, for example `L3-noise+zerodce`; `blind` without images.
    #[must_use]
    pub fn condition(&self) -> String {
        let Some(level) = self.level else {
            return "blind".to_owned();
        };
        let light = match (&self.variant.pair, self.variant.kind) {
            (Some(pair), _) => pair.to_string(),
            (None, None) => level.to_string(),
            (None, Some(_)) => format!("{level}-{}", self.variant.kind_and_reading()),
        };
        let enhancer = self.enhancer.as_ref().map(|name| format!("+{name}"));
        let group = self.variant.group_suffix();
        format!("{light}{}{group}", enhancer.unwrap_or_default())
    }

    /// True if both are the same model in the same condition and their groups of runs overlap.
    #[must_use]
    pub fn matches_up_to_group(&self, other: &Self) -> bool {
        let (one, two) = (&self.variant, &other.variant);
        self.model == other.model
            && (self.view, self.level) == (other.view, other.level)
            && (one.kind, &one.reading, &one.pair) == (two.kind, &two.reading, &two.pair)
            && self.enhancer == other.enhancer
            && LightGroup::meet(one.group.as_ref(), two.group.as_ref())
    }

    /// The same model in the same condition, whichever runs show its images.
    #[must_use]
    pub fn in_any_light(&self) -> Self {
        let mut subject = self.clone();
        subject.variant.group = None;
        subject
    }

    /// A model with images, at a level of a variant, raw or enhanced. L0 is the clean frame of every variant; it keeps the group
    /// of runs, so that [`matches_up_to_group`](Self::matches_up_to_group) finds the clean frames of these runs.
    #[must_use]
    pub fn seeing(
        model: &str,
        level: AxisLevel,
        variant: &KindReading,
        enhancer: Option<&EnhancerName>,
    ) -> Self {
        let is_clean = level == AxisLevel::L0;
        Self {
            model: model.to_owned(),
            view: Some(View::Image),
            level: Some(level),
            variant: if is_clean {
                KindReading {
                    group: variant.group.clone(),
                    ..KindReading::NONE
                }
            } else {
                variant.clone()
            },
            enhancer: enhancer.cloned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn references_are_judged_alone_and_never_pooled() {
        for (models, expected, pooled) in [
            (
                &["gpt-4o", "observer", "m", "random"][..],
                &["gpt-4o", "m"][..],
                &["gpt-4o", "m"][..],
            ),
            (
                &["random", "observer"],
                &["observer", "random"],
                &["observer"],
            ),
            (
                &["random (a)", "observer (b)"],
                &["observer (b)", "random (a)"],
                &["observer (b)"],
            ),
            (&["random"], &["random"], &["random"]),
            (&[], &[], &[]),
        ] {
            let names = |found: BTreeSet<&'static str>| found.into_iter().collect::<Vec<_>>();
            assert_eq!(names(judged(models.iter().copied())), expected);
            assert_eq!(names(pooled_models(models.iter().copied())), pooled);
        }
    }

    #[test]
    fn only_built_in_models_are_references() {
        for (model, expected) in [
            ("random", true),
            ("observer", true),
            ("observer:other-room", true),
            ("observer (one)", true),
            ("random (two)", true),
            ("gpt-4o (one)", false),
            ("observers", false),
            ("random-forest", false),
            ("gpt-4o", false),
            (CHANCE, false),
        ] {
            assert_eq!(
                Subject::new(model, None).is_reference(),
                expected,
                "{model}"
            );
        }
    }
}
