//! Replies that cannot be counted, or count as wrong: [`of_replies`], [`of_people`].

use std::collections::BTreeMap;

use crate::report::alert::{Alert, AlertKind, MAX_UNREAD};
use crate::report::words::counted;
use crate::run_reports::combine::Combined;
use crate::run_reports::settings::is_of_people;
use crate::score::health::Health;
use crate::types::UnreadReason;

/// Replies that could not be read, with what they count as, and trials without a reply.
pub(super) fn of_replies(health: &[Health], unread_as: &str) -> Vec<Alert> {
    let mut counts = BTreeMap::<&str, [usize; 3]>::new();
    for health in health {
        let [replies, unread, failed] = counts.entry(&health.subject.model).or_default();
        *replies += health.replies;
        *unread += health.replies - health.read;
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

/// Answers of people that are no choice of their question.
pub(super) fn of_people(combined: &Combined) -> Vec<Alert> {
    let people = combined
        .runs
        .iter()
        .filter(|run| is_of_people(&run.manifest));
    let alerts = people.filter_map(|run| {
        let unread = combined.of(run).filter_map(|trial| trial.strict()?.why);
        let count = unread.filter(|why| *why != UnreadReason::Empty).count();
        let text = format!(
            "{} of {} of people are not choices of their questions, and count as wrong.",
            count,
            counted(run.trials.len(), "answer")
        );
        (count > 0).then(|| Alert::new(AlertKind::NoChoice, text))
    });
    alerts.collect()
}
