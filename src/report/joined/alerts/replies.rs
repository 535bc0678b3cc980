//! Alerts about replies that are not scored, or are scored as wrong: [`reply_alerts`], [`ended_early_alerts`],
//! [`broken_off_alert`], [`people_alerts`].

use std::cmp::Reverse;
use std::collections::BTreeMap;

use crate::ask::is_context_full;
use crate::report::joined::combine::Combined;
use crate::report::joined::settings::has_human_answers;
use crate::report::text::alert::{Alert, AlertKind, MAX_UNREAD};
use crate::report::text::outcome_words::failure_reason;
use crate::types::degradations::AxisLevel;
use crate::types::text::counted;
use crate::types::{Condition, FailureKind, Finish, OpenDetail, Record, StoredDetail, TrialRef, UnreadReason, Usage};
use darkqa_score::accuracies::Health;

/// Alerts about replies that could not be parsed and about failed trials. `unread_as` completes the sentence about the
/// former, for example with "count as wrong".
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
            let text =
                format!("{unread} of {replies} replies of {model} ({share:.1} %) could not be read, and {unread_as}.");
            alerts.push(Alert::new(AlertKind::Unread, text));
        } else if let Some(worst) = worst_condition(health, model) {
            alerts.push(Alert::new(AlertKind::Unread, unread_in_condition(worst, unread_as)));
        }
        if failed > 0 {
            let trials = counted(failed, "trial");
            let are = if failed == 1 { "is" } else { "are" };
            let reasons = failure_reasons(health, model);
            let text = format!("{trials} of {model} failed and {are} not scored: {reasons}.");
            alerts.push(Alert::new(AlertKind::Failed, text));
        }
    }
    alerts
}

/// The reasons why trials of a model failed, the commonest first, with their numbers if there are several.
fn failure_reasons(health: &[Health], model: &str) -> String {
    let mut counts = BTreeMap::<FailureKind, usize>::new();
    for (kind, count) in health.iter().filter(|health| health.subject.model == model).flat_map(|health| &health.failed)
    {
        *counts.entry(*kind).or_default() += count;
    }
    let mut counts: Vec<(FailureKind, usize)> = counts.into_iter().collect();
    counts.sort_by_key(|(_, count)| Reverse(*count));
    if let [(kind, _)] = counts[..] {
        return failure_reason(kind, None);
    }
    counts
        .iter()
        .map(|(kind, count)| format!("{} ({count})", failure_reason(*kind, None)))
        .collect::<Vec<String>>()
        .join(", ")
}

/// The condition of a model with the largest share of replies that could not be parsed, if the share is above
/// [`MAX_UNREAD`].
fn worst_condition<'h>(health: &'h [Health], model: &str) -> Option<&'h Health> {
    health
        .iter()
        .filter(|health| health.subject.model == model)
        .filter(|health| health.replies > 0 && unreadable_share(health) > MAX_UNREAD)
        .max_by(|a, b| unreadable_share(a).total_cmp(&unreadable_share(b)))
}

fn unreadable_share(health: &Health) -> f64 {
    health.unreadable() as f64 / health.replies as f64
}

/// The sentence about the replies of a condition that could not be parsed, with the number that the lenient parsing
/// accepts.
fn unread_in_condition(health: &Health, unread_as: &str) -> String {
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

/// Numbers of trials by level.
type ByLevel = BTreeMap<Option<AxisLevel>, usize>;

/// One alert for each model whose replies the server ended early, with the number for each of its words at each level:
/// a filter or a loop may depend on the light. `counts` is true for the replies without an answer; `unread_as`
/// completes the sentence about them.
pub(super) fn ended_early_alerts<'t, D: StoredDetail + 't>(
    trials: impl Iterator<Item = TrialRef<'t, D>>,
    counts: impl Fn(TrialRef<'t, D>) -> bool,
    unread_as: &str,
) -> Vec<Alert> {
    let mut models = BTreeMap::<&str, (ByLevel, BTreeMap<&str, ByLevel>)>::new();
    for trial in trials.filter(|trial| !trial.failed()) {
        let level = trial.condition().map(Condition::level);
        let (replies, words) = models.entry(trial.model()).or_default();
        *replies.entry(level).or_default() += 1;
        if let Some(word) = trial.ended_early().filter(|_| counts(trial)) {
            *words.entry(word).or_default().entry(level).or_default() += 1;
        }
    }
    models
        .into_iter()
        .filter(|(_, (_, words))| !words.is_empty())
        .map(|(model, (replies, words))| {
            let count: usize = words.values().flat_map(BTreeMap::values).sum();
            let all: usize = replies.values().sum();
            let listed: Vec<String> =
                words.iter().map(|(word, at)| format!("{word} {}", counts_by_level(at, &replies))).collect();
            let is_cut = words.keys().all(|word| *word == "length");
            let ended = if is_cut { "were cut at the token limit" } else { "ended early" };
            let text = format!(
                "{count} of {all} replies of {model} {ended} without an answer, and {unread_as}: {}.{}",
                listed.join("; "),
                early_end_remedies(&words)
            );
            Alert::new(AlertKind::Unread, text)
        })
        .collect()
}

/// The number of a word at each level, of all replies there: `2 (L0 0 of 40, L5 2 of 40)`.
fn counts_by_level(at: &ByLevel, replies: &ByLevel) -> String {
    let levels: Vec<String> = replies
        .iter()
        .map(|(level, all)| {
            let count = at.get(level).copied().unwrap_or(0);
            let level = level.map_or_else(|| "no image".to_owned(), |level| level.to_string());
            format!("{level} {count} of {all}")
        })
        .collect();
    let count: usize = at.values().sum();
    format!("{count} ({})", levels.join(", "))
}

/// Remedies for early ends that a setting of the run causes; empty without any.
fn early_end_remedies(words: &BTreeMap<&str, ByLevel>) -> String {
    let mut text = String::new();
    if words.contains_key("length") {
        text += " The same command with a larger --max-tokens asks those of length again.";
    }
    if words.keys().any(|word| is_context_full(word)) {
        text += " The model's context was full: send smaller images (--image max-side=N), or lower --max-tokens, in a new run.";
    }
    text
}

/// The alert about generations that broke off, with the number for each `finish_reason` of the server.
pub(super) fn broken_off_alert(combined: &Combined) -> Option<Alert> {
    let mut counts = BTreeMap::<&str, usize>::new();
    for word in combined.trials.iter().filter_map(TrialRef::broken_off) {
        *counts.entry(word).or_default() += 1;
    }
    let words: Vec<String> =
        counts.iter().map(|(word, count)| format!("{word} ({})", counted(*count, "trial"))).collect();
    let text = format!(
        "The server ended replies without finishing them, with the finish_reason {}: they are not scored.",
        words.join(", ")
    );
    (!words.is_empty()).then(|| Alert::new(AlertKind::Failed, text))
}

/// One alert for each model of a multiple-choice run with empty replies ([`empty_alerts`]).
pub(super) fn empty_choice_alerts(combined: &Combined) -> Vec<Alert> {
    empty_alerts(combined.trials.iter().filter(|trial| !trial.failed()).map(|trial| {
        let why = trial.strict().and_then(|strict| strict.why);
        let is_empty = why == Some(UnreadReason::Empty);
        (trial.model(), is_empty && is_charged(trial.usage()))
    }))
}

/// One alert for each model with empty answers to open questions ([`empty_alerts`]).
pub(crate) fn empty_answer_alerts(records: &[Record<OpenDetail>]) -> Vec<Alert> {
    empty_alerts(records.iter().filter(|record| !record.failed()).filter_map(|record| {
        let reply = record.reply.as_deref()?;
        let is_whole = record.finish == Some(Finish::Stop) && record.refusal.is_none();
        let is_empty = is_whole && reply.trim().is_empty();
        Some((&*record.model, is_empty && is_charged(record.usage)))
    }))
}

/// One alert for each model with more than [`MAX_UNREAD`] complete replies that are empty although the server charged
/// tokens for them. `replies` has the model of each reply, and whether it is one of these.
fn empty_alerts<'a>(replies: impl Iterator<Item = (&'a str, bool)>) -> Vec<Alert> {
    let mut counts = BTreeMap::<&str, [usize; 2]>::new();
    for (model, is_empty) in replies {
        let [all, empty] = counts.entry(model).or_default();
        *all += 1;
        *empty += usize::from(is_empty);
    }
    counts
        .into_iter()
        .filter(|(_, [all, empty])| *empty as f64 > MAX_UNREAD * *all as f64)
        .map(|(model, [all, empty])| {
            let text = format!(
                "{empty} of {all} replies of {model} are empty, although the server charged tokens for them: it may have sent the answers in \
                 another field, as a reasoning parser does if the model does not think. Start the server without the parser, and repeat \
                 the command with another --out."
            );
            Alert::new(AlertKind::Unread, text)
        })
        .collect()
}

fn is_charged(usage: Option<Usage>) -> bool {
    usage.and_then(|usage| usage.completion_tokens) > Some(0)
}

/// One alert for each run with human answers that are not a choice of their question.
pub(super) fn people_alerts(combined: &Combined) -> Vec<Alert> {
    combined
        .runs
        .iter()
        .filter(|run| has_human_answers(&run.manifest))
        .filter_map(|run| {
            let count = combined
                .trials_of(run)
                .filter_map(|trial| trial.strict()?.why)
                // In runs of earlier versions, an empty answer means "cannot tell".
                .filter(|why| !matches!(why, UnreadReason::Empty | UnreadReason::CannotTell))
                .count();
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
    use darkqa_score::model_in_condition::ModelInCondition;

    fn health(condition: &str, read: usize) -> Health {
        Health {
            subject: ModelInCondition::new("m", Some(&condition.parse().unwrap())),
            replies: 100,
            read,
            lenient_only: 100 - read,
            unread: BTreeMap::new(),
            failed: BTreeMap::new(),
        }
    }

    #[test]
    fn one_condition_that_cannot_be_read_is_named() {
        let mut all: Vec<Health> = (0..19).map(|_| health("L0", 100)).collect();
        assert_eq!(reply_alerts(&all, "count as wrong"), []);
        all.push(health("L5-noise", 80));
        let alerts = reply_alerts(&all, "count as wrong");
        assert_eq!(
            alerts[0].text,
            "20 of 100 replies of m at L5-noise (20.0 %) could not be read, and count as wrong. The lenient parsing reads 20 of them."
        );
    }

    #[test]
    fn reasons_of_failures_are_counted() {
        let failed =
            |counts: &[(FailureKind, usize)]| Health { failed: counts.iter().copied().collect(), ..health("L0", 100) };
        let one = [failed(&[(FailureKind::Timeout, 1)])];
        assert_eq!(
            reply_alerts(&one, "count as wrong")[0].text,
            "1 trial of m failed and is not scored: no whole reply in time."
        );
        let several =
            [failed(&[(FailureKind::Timeout, 1)]), failed(&[(FailureKind::Timeout, 1), (FailureKind::Server, 5)])];
        assert_eq!(
            reply_alerts(&several, "count as wrong")[0].text,
            "7 trials of m failed and are not scored: the server failed (5), no whole reply in time (2)."
        );
    }
}
