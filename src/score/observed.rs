//! Accuracy of the observer in each condition, and of its controls: [`ObserverSummary`].

use std::collections::BTreeMap;

use super::cluster::Clusters;
use super::estimate::Estimate;
use super::model_in_condition::{ModelInCondition, is_control, is_observer};
use darkqa_base::types::replies::OBSERVER;
use darkqa_base::types::{
    AnswerSource, ChoiceDetail, Control, FrameId, ItemKey, Observed, TrialOutcome, TrialRef, Trials,
};

/// Results of the observer, or of one of its controls, in one condition.
#[derive(Debug, Clone, PartialEq)]
pub struct ObserverCell {
    /// Observer or control, and condition.
    pub subject: ModelInCondition,
    /// Expected score: 1 for a right answer from evidence, 1 / k for a guess among k choices.
    pub score: Estimate,
    /// Expected score if every answer is guessed.
    pub chance: f64,
    /// Share of answers that follow from visible evidence.
    pub evidence: f64,
    /// Share of the objects of all frames that are seen.
    pub seen: f64,
    /// Share of the objects of all frames whose whole outline is detected.
    pub detected: f64,
    /// Share of an image's variance that the untouched frame explains, averaged over the frames.
    pub explained: f64,
}

impl ObserverCell {
    /// True if this is a control of the observer.
    #[must_use]
    pub fn is_control(&self) -> bool {
        is_control(&self.subject.model)
    }

    /// True if this is the control that every run with the observer asks.
    #[must_use]
    pub fn is_standing(&self) -> bool {
        Control::from_model_name(&self.subject.model).is_some_and(|control| Control::DEFAULTS.contains(&control))
    }

    /// True if this is a control whose interval excludes chance, which invalidates the observer's results.
    #[must_use]
    pub fn is_off_chance(&self) -> bool {
        // The two means are summed in different orders.
        let tolerance = 1e-9;
        let excludes_chance = self.score.low > self.chance + tolerance || self.score.high < self.chance - tolerance;
        Control::from_model_name(&self.subject.model).is_some_and(Control::removes_all_information) && excludes_chance
    }
}

/// Results of the observer and its controls.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ObserverSummary {
    /// Results by model and condition; empty if the observer was not asked with images.
    pub cells: Vec<ObserverCell>,
    /// Results of each control over all conditions together.
    pub controls: Vec<ObserverCell>,
}

impl ObserverSummary {
    /// Computes the results of these trials.
    #[must_use]
    pub fn new(trials: &Trials<ChoiceDetail>, clusters: &Clusters) -> Self {
        // Of two trials for the same item, the later one counts.
        let mut items = BTreeMap::<ModelInCondition, BTreeMap<ItemKey<'_>, TrialRef<'_>>>::new();
        for trial in trials.iter() {
            if trial.observed().is_some() {
                let key = trial.item().key();
                items.entry(ModelInCondition::from_trial(trial)).or_default().insert(key, trial);
            }
        }
        let mut by_control = BTreeMap::<&str, Vec<TrialRef<'_>>>::new();
        let mut cells = Vec::new();
        for (subject, trials) in &items {
            let trials: Vec<TrialRef<'_>> = trials.values().copied().collect();
            if is_control(&subject.model) {
                by_control.entry(&subject.model).or_default().extend(&trials);
            }
            cells.extend(cell(subject.clone(), &trials, clusters));
        }
        Self {
            controls: by_control
                .into_iter()
                .filter_map(|(model, trials)| cell(ModelInCondition::new(model, None), &trials, clusters))
                .collect(),
            cells,
        }
    }

    /// True if the observer was asked with images.
    #[must_use]
    pub fn is_asked(&self) -> bool {
        self.cells.iter().any(|cell| is_observer(&cell.subject.model))
    }

    /// Controls that are not at chance, over all conditions or in one. The intervals are not corrected for the number
    /// of conditions: it is better to hide a sound observer than to show a broken one.
    pub fn failed_controls(&self) -> impl Iterator<Item = &ObserverCell> {
        self.controls.iter().chain(&self.cells).filter(|cell| cell.is_off_chance())
    }

    /// True if the observer's results must not be shown: a control is not at chance, or no control was asked.
    #[must_use]
    pub fn is_hidden(&self) -> bool {
        let is_controlled = self.cells.iter().any(ObserverCell::is_control);
        self.is_asked() && (!is_controlled || self.failed_controls().next().is_some())
    }

    /// Results of the standing control over all conditions; one for each run that has its own.
    #[must_use]
    pub fn standing_controls(&self) -> Vec<&ObserverCell> {
        Control::DEFAULTS
            .into_iter()
            .map(|standing| -> Vec<&ObserverCell> {
                self.controls
                    .iter()
                    .filter(|cell| Control::from_model_name(&cell.subject.model) == Some(standing))
                    .collect()
            })
            .find(|cells| !cells.is_empty())
            .unwrap_or_default()
    }

    /// Result of the standing control in the condition of a cell.
    #[must_use]
    pub fn control_of(&self, cell: &ObserverCell) -> Option<&ObserverCell> {
        // If several runs are compared, each may have its own control.
        let run = cell.subject.model.strip_prefix(OBSERVER).unwrap_or_default();
        Control::DEFAULTS.into_iter().map(Control::model_name).flat_map(|name| [format!("{name}{run}"), name]).find_map(
            |model| {
                let subject = ModelInCondition { model, ..cell.subject.clone() };
                self.cells.iter().find(|other| other.subject == subject)
            },
        )
    }
}

/// Computes the result of some trials; `None` without trials of frames that have a cluster.
fn cell(subject: ModelInCondition, trials: &[TrialRef<'_>], clusters: &Clusters) -> Option<ObserverCell> {
    let mut sums = vec![(0.0, 0.0); clusters.count()];
    let mut frames = BTreeMap::<(&FrameId, String), &Observed>::new();
    let (mut guesses, mut evidence, mut n) = (0.0, 0, 0);
    for trial in trials {
        let cluster = clusters.get(trial.frame(), trial.question());
        let (Some(cluster), Some(observed)) = (cluster, trial.observed()) else {
            continue;
        };
        let guess = 1.0 / trial.choices().len().max(1) as f64;
        let score = match observed.from {
            AnswerSource::Guess => guess,
            AnswerSource::Evidence => f64::from(trial.outcome() == TrialOutcome::Right),
        };
        let (sum, count) = &mut sums[cluster as usize];
        *sum += score;
        *count += 1.0;
        guesses += guess;
        evidence += usize::from(observed.from == AnswerSource::Evidence);
        n += 1;
        let condition = trial.condition().map(ToString::to_string);
        frames.insert((trial.frame(), condition.unwrap_or_default()), observed);
    }
    sums.retain(|(_, count)| *count > 0.0);
    let (mut things, mut seen, mut detected, mut explained) = (0, 0, 0, 0.0);
    for frame in frames.values() {
        things += frame.things;
        seen += frame.seen;
        detected += frame.detected;
        explained += f64::from(frame.explained_ppm) / 1e6;
    }
    let things = things.max(1) as f64;
    // A guess scores exactly 1 / k and adds no noise, so only the answers from evidence count for the noise of the
    // score.
    let max_weight = n as f64 / f64::max(evidence as f64, 1.0);
    Some(ObserverCell {
        subject,
        score: Estimate::from_scores(&sums, max_weight, n)?,
        chance: guesses / n as f64,
        evidence: evidence as f64 / n as f64,
        seen: seen as f64 / things,
        detected: detected as f64 / things,
        explained: explained / frames.len() as f64,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cell(model: &str, [value, low, high]: [f64; 3]) -> ObserverCell {
        ObserverCell {
            subject: ModelInCondition::new(model, None),
            score: Estimate { value, low, high, n: 100 },
            chance: 0.3,
            evidence: 0.0,
            seen: 0.0,
            detected: 0.0,
            explained: 0.0,
        }
    }

    /// The observer with one control, in one condition and over all.
    fn summary(control: &str, in_one: [f64; 3], over_all: [f64; 3]) -> ObserverSummary {
        ObserverSummary {
            cells: vec![cell(OBSERVER, [0.9, 0.8, 1.0]), cell(control, in_one)],
            controls: vec![cell(control, over_all)],
        }
    }

    #[test]
    fn control_off_chance_hides_the_observer() {
        let (chance, above) = ([0.32, 0.28, 0.36], [0.34, 0.31, 0.37]);
        for control in ["observer:other-room", "observer:tiles (night)"] {
            assert!(!summary(control, chance, chance).is_hidden());
            assert!(summary(control, above, chance).is_hidden());
            assert!(summary(control, chance, above).is_hidden());
        }
        assert!(!summary("observer:shift-4", above, above).is_hidden(), "a limit refutes nothing");
        let mut alone = summary("observer:tiles", chance, chance);
        alone.cells.pop();
        assert!(alone.is_hidden(), "without a control");
    }
}
