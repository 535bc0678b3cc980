//! A model in a condition: [`ModelInCondition`].

use std::collections::BTreeSet;

use serde::Serialize;

use darkqa_base::types::replies::OBSERVER;
use darkqa_base::types::{AxisLevel, Condition, Control, EnhancerName, RunGroup, TrialRef, Variant, View};

/// Model name of the chance line in results.
pub const CHANCE: &str = "chance";

/// Removes the name of the run from a model name. When several runs are compared, `observer (one)` is the observer of
/// the run `one`.
#[must_use]
pub fn without_run(model: &str) -> &str {
    model.split_once(" (").map_or(model, |(name, _)| name)
}

/// True if the model is the built-in observer.
#[must_use]
pub fn is_observer(model: &str) -> bool {
    without_run(model) == OBSERVER
}

/// True if the model is a control of the observer.
#[must_use]
pub fn is_control(model: &str) -> bool {
    Control::from_model_name(model).is_some()
}

/// True if the model is built in and serves only as a reference: `random`, `observer` and its controls (`observer:…`).
/// References are not under test, so rankings and comparisons of models leave them out.
#[must_use]
pub fn is_reference(model: &str) -> bool {
    without_run(model) == "random" || is_observer(model) || is_control(model)
}

/// Models under test, sorted. If only references ran, all of them.
#[must_use]
pub fn models_under_test<'m>(models: impl IntoIterator<Item = &'m str>) -> BTreeSet<&'m str> {
    let all: BTreeSet<&str> = models.into_iter().collect();
    let under_test: BTreeSet<&str> = all.iter().copied().filter(|model| !is_reference(model)).collect();
    if under_test.is_empty() { all } else { under_test }
}

/// Models to pool, sorted: the [`models_under_test`]. If only references ran, one of them, preferably the observer,
/// because a mean of the observer and `random` would be meaningless.
#[must_use]
pub fn pooled_models<'m>(models: impl IntoIterator<Item = &'m str>) -> BTreeSet<&'m str> {
    let models = models_under_test(models);
    if !models.iter().all(|model| is_reference(model)) {
        return models;
    }
    models.iter().find(|model| is_observer(model)).or(models.first()).copied().into_iter().collect()
}

/// A model in a condition. Every table cell belongs to one.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub struct ModelInCondition {
    /// Name of the model, or [`CHANCE`].
    pub model: String,
    /// Whether the model saw images; `None` for chance.
    pub view: Option<View>,
    /// Level of degradation; `None` if the model saw no image.
    pub level: Option<AxisLevel>,
    /// Kind of degradation with its noise profile.
    pub variant: Variant,
    /// Enhancer; `None` for raw images.
    pub enhancer: Option<EnhancerName>,
}

impl ModelInCondition {
    /// Name of the runs that showed these images; `None` if all runs of the report showed the same.
    #[must_use]
    pub fn run_group(&self) -> Option<&str> {
        self.variant.group.as_ref().map(RunGroup::name)
    }

    /// Model and condition of a trial.
    #[must_use]
    pub fn from_trial(trial: TrialRef<'_>) -> Self {
        Self::new(trial.model(), trial.condition())
    }

    /// A model in a condition, or without images if the condition is `None`.
    #[must_use]
    pub fn new(model: &str, condition: Option<&Condition>) -> Self {
        Self {
            model: model.to_owned(),
            view: Some(condition.map_or(View::Blind, |_| View::Image)),
            level: condition.map(Condition::level),
            variant: condition.map_or(Variant::NONE, Condition::variant),
            enhancer: condition.and_then(|condition| condition.enhancer.clone()),
        }
    }

    /// True if the model is a reference: `random`, `observer` or one of its controls.
    #[must_use]
    pub fn is_reference(&self) -> bool {
        is_reference(&self.model)
    }

    /// Condition as text, for example `L3-noise+zerodce`; `blind` without images.
    #[must_use]
    pub fn condition(&self) -> String {
        let Some(level) = self.level else {
            return "blind".to_owned();
        };
        let light = match (&self.variant.pair, self.variant.kind) {
            (Some(pair), _) => pair.to_string(),
            (None, None) => level.to_string(),
            (None, Some(_)) => format!("{level}-{}", self.variant.kind_and_profile()),
        };
        let enhancer = self.enhancer.as_ref().map_or_else(String::new, |name| format!("+{name}"));
        let group = self.variant.group_suffix();
        format!("{light}{enhancer}{group}")
    }

    /// True if both are the same model in the same condition and their groups of runs overlap.
    #[must_use]
    pub fn matches_up_to_group(&self, other: &Self) -> bool {
        let (variant, other_variant) = (&self.variant, &other.variant);
        self.model == other.model
            && (self.view, self.level) == (other.view, other.level)
            && variant.kind == other_variant.kind
            && variant.reading == other_variant.reading
            && variant.pair == other_variant.pair
            && self.enhancer == other.enhancer
            && RunGroup::overlap(variant.group.as_ref(), other_variant.group.as_ref())
    }

    /// Returns the same model and condition without its group of runs.
    #[must_use]
    pub fn in_any_light(&self) -> Self {
        let mut subject = self.clone();
        subject.variant.group = None;
        subject
    }

    /// A model with images at a level of a variant, raw or enhanced. Variants share the clean frame: at L0, only the
    /// group of runs is kept of the variant, so that [`matches_up_to_group`](Self::matches_up_to_group) finds the clean
    /// frames of those runs.
    #[must_use]
    pub fn with_images(model: &str, level: AxisLevel, variant: &Variant, enhancer: Option<&EnhancerName>) -> Self {
        let is_clean = level == AxisLevel::L0;
        Self {
            model: model.to_owned(),
            view: Some(View::Image),
            level: Some(level),
            variant: if is_clean { Variant { group: variant.group.clone(), ..Variant::NONE } } else { variant.clone() },
            enhancer: enhancer.cloned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn references_count_only_without_other_models() {
        for (models, expected, pooled) in [
            (&["gpt-4o", "observer", "m", "random"][..], &["gpt-4o", "m"][..], &["gpt-4o", "m"][..]),
            (&["random", "observer"], &["observer", "random"], &["observer"]),
            (&["random (a)", "observer (b)"], &["observer (b)", "random (a)"], &["observer (b)"]),
            (&["random"], &["random"], &["random"]),
            (&[], &[], &[]),
        ] {
            let models = models.iter().copied();
            let [expected, pooled]: [BTreeSet<&str>; 2] =
                [expected, pooled].map(|names| names.iter().copied().collect());
            assert_eq!(models_under_test(models.clone()), expected);
            assert_eq!(pooled_models(models), pooled);
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
            assert_eq!(ModelInCondition::new(model, None).is_reference(), expected, "{model}");
        }
    }
}
