//! Alerts about missing replies that may depend on the condition: [`missing_alerts`].

use std::collections::BTreeMap;

use crate::report::text::alert::{Alert, AlertKind};
use crate::types::AxisLevel;
use darkqa_score::accuracies::Health;
use darkqa_score::model_in_condition::ModelInCondition;

/// Share of missing replies in a condition above which an alert names it (chosen).
const MAX_MISSING: f64 = 0.02;

/// Numbers of missing replies and of all trials of a subject.
pub(crate) type MissingCounts<'m> = (&'m ModelInCondition, [usize; 2]);

/// Numbers of missing replies of each subject with images.
pub(super) fn counts(health: &[Health]) -> Vec<MissingCounts<'_>> {
    health
        .iter()
        .filter(|health| health.subject.level.is_some())
        .map(|health| {
            let failed = health.failures();
            (&health.subject, [failed, failed + health.replies])
        })
        .collect()
}

/// One alert for each model with more than 2 % of its replies missing in a condition. It names the condition with the
/// largest share, and the share at L0. `noun` is what is missing.
pub(crate) fn missing_alerts(counts: &[MissingCounts<'_>], noun: &str) -> Vec<Alert> {
    let mut models = BTreeMap::<&str, Vec<&MissingCounts<'_>>>::new();
    for one in counts.iter().filter(|(_, [_, all])| *all > 0) {
        models.entry(&one.0.model).or_default().push(one);
    }
    models
        .into_iter()
        .filter_map(|(model, conditions)| {
            // Of equal shares, the first.
            let (subject, worst) = conditions.iter().rev().max_by(|a, b| {
                let [a, b] = [a, b].map(|(_, counts)| share(*counts));
                a.total_cmp(&b)
            })?;
            if share(*worst) <= MAX_MISSING {
                return None;
            }
            let clean = conditions
                .iter()
                .find(|(subject, _)| {
                    subject.level == Some(AxisLevel::L0) && subject.enhancer.is_none()
                })
                .filter(|(clean, _)| clean != subject)
                .map_or_else(String::new, |(_, counts)| {
                    format!(", and of {:.1} % at L0", 100.0 * share(*counts))
                });
            let [missing, all] = worst;
            let text = format!(
                "{noun} of {model} are missing for {missing} of {all} questions at {} ({:.1} %){clean}. If that depends on the condition, \
                 the others flatter the model: intervals and verdicts hold for all values of the missing ones.",
                subject.condition(),
                100.0 * share(*worst)
            );
            Some(Alert::new(AlertKind::MissingReplies, text))
        })
        .collect()
}

fn share([missing, all]: [usize; 2]) -> f64 {
    missing as f64 / all as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn alert(failed_at_dark: usize) -> Vec<String> {
        let subjects: Vec<ModelInCondition> = ["L0", "L3-noise", "L5-noise"]
            .iter()
            .map(|name| ModelInCondition::new("m", Some(&name.parse().unwrap())))
            .collect();
        let failed = [1, failed_at_dark / 2, failed_at_dark];
        let counts: Vec<MissingCounts<'_>> =
            subjects.iter().zip(failed).map(|(subject, failed)| (subject, [failed, 200])).collect();
        let alerts = missing_alerts(&counts, "Replies");
        alerts.into_iter().map(|alert| alert.text).collect()
    }

    #[test]
    fn the_condition_with_the_largest_share_is_named() {
        let expected = "Replies of m are missing for 90 of 200 questions at L5-noise (45.0 %), and of 0.5 % at L0. If that depends on the \
                        condition, the others flatter the model: intervals and verdicts hold for all values of the missing ones.";
        assert_eq!(alert(90), [expected]);
        assert_eq!(alert(4), [""; 0]);
        assert_eq!(alert(5).len(), 1);
    }
}
