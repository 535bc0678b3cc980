//! Replies that cannot be counted, or count as wrong: [`reply_alerts`], [`people_alerts`].

use std::collections::BTreeMap;

use crate::run_reports::combine::Combined;
use crate::run_reports::settings::is_of_people;
use crate::text::alert::{Alert, AlertKind, MAX_UNREAD};
use crate::text::words::counted;
use crate::types::{TrialRef, UnreadReason};
use darkqa_score::accuracies::Health;

/// Replies that could not be read, with what they count as, and trials without a reply.
pub(super) fn reply_alerts(health: &[Health], unread_as: &str) -> Vec<Alert> {
    let mut counts = BTreeMap::<&str, [usize; 3]>::new();
    for health in health {
        let [replies, unread, failed] = counts.entry(&health.subject.model).or_default();
        *replies += health.replies;
        *unread += health.unreadable();
        *failed += health.failures();
    }
    let mut alerts = Vec::new();
    for (model, [replies, unread, failed]) in counts {
        if unread as f64 > MAX_UNREAD * replies as f64 {
            let share = 100.0 * unread as f64 / replies as f64;
            let text = format!(
                "{unread} of {replies} replies of {model} ({share:.1} %) could not be read, and {unread_as}."
            );
            alerts.push(Alert::new(AlertKind::Unread, text));
        } else if let Some(worst) = worst(health, model) {
            alerts.push(Alert::new(
                AlertKind::Unread,
                in_condition(worst, unread_as),
            ));
        }
        if failed > 0 {
            let (trials, are) = (
                counted(failed, "trial"),
                if failed == 1 { "is" } else { "are" },
            );
            let text = format!("{trials} of {model} failed and {are} not scored.");
            alerts.push(Alert::new(AlertKind::Failed, text));
        }
    }
    alerts
}

/// The condition of a model with the largest share of replies that could not be read, if it is above the limit.
fn worst<'h>(health: &'h [Health], model: &str) -> Option<&'h Health> {
    let share = |health: &Health| health.unreadable() as f64 / health.replies as f64;
    let above = health
        .iter()
        .filter(|health| health.subject.model == model)
        .filter(|health| health.replies > 0 && share(health) > MAX_UNREAD);
    above.max_by(|a, b| share(a).total_cmp(&share(b)))
}

/// The replies of a condition that could not be read, and how many of them the lenient parsing reads.
fn in_condition(health: &Health, unread_as: &str) -> String {
    let unread = health.unreadable();
    let share = 100.0 * unread as f64 / health.replies as f64;
    let lenient = match health.lenient_only {
        0 => String::new(),
        read => format!(" The lenient parsing reads {read} of them."),
    };
    let subject = &health.subject;
    format!(
        "{unread} of {} replies of {} at {} ({share:.1} %) could not be read, and {unread_as}.{lenient}",
        health.replies,
        subject.model,
        subject.condition()
    )
}

/// Generations that broke off, by the server's word for the reason.
pub(super) fn broken_off_alert(combined: &Combined) -> Option<Alert> {
    let mut counts = BTreeMap::<&str, usize>::new();
    for word in combined.trials.iter().filter_map(TrialRef::broken_off) {
        *counts.entry(word).or_default() += 1;
    }
    let words: Vec<String> = counts
        .iter()
        .map(|(word, count)| format!("{word} ({})", counted(*count, "trial")))
        .collect();
    let text = format!(
        "The server ended replies without finishing them, with the finish_reason {}: they are not scored.",
        words.join(", ")
    );
    (!words.is_empty()).then(|| Alert::new(AlertKind::Failed, text))
}

/// Answers of people that are no choice of their question.
pub(super) fn people_alerts(combined: &Combined) -> Vec<Alert> {
    let people = combined
        .runs
        .iter()
        .filter(|run| is_of_people(&run.manifest));
    people
        .filter_map(|run| {
            let unread = combined
                .trials_of(run)
                .filter_map(|trial| trial.strict()?.why);
            // In runs of earlier versions, who could not tell gave an empty answer.
            let is_said =
                |why: &UnreadReason| matches!(why, UnreadReason::Empty | UnreadReason::CannotTell);
            let count = unread.filter(|why| !is_said(why)).count();
            let text = format!(
                "{} of {} of people are not choices of their questions, and count as wrong.",
                count,
                counted(run.trials.len(), "answer")
            );
            (count > 0).then(|| Alert::new(AlertKind::NoChoice, text))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use darkqa_score::subject::ModelInCondition;

    #[test]
    fn one_condition_that_cannot_be_read_is_named() {
        let health = |condition: &str, read: usize| Health {
            subject: ModelInCondition::new("m", Some(&condition.parse().unwrap())),
            replies: 100,
            read,
            lenient_only: 100 - read,
            unread: BTreeMap::new(),
            failed: BTreeMap::new(),
        };
        let mut all: Vec<Health> = (0..19).map(|_| health("L0", 100)).collect();
        assert_eq!(reply_alerts(&all, "count as wrong"), []);
        all.push(health("L5-noise", 80));
        let alerts = reply_alerts(&all, "count as wrong");
        assert_eq!(
            alerts[0].text,
            "20 of 100 replies of m at L5-noise (20.0 %) could not be read, and count as wrong. The lenient parsing reads 20 of them."
        );
    }
}
