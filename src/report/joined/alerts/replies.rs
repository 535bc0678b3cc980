//! Alerts about replies that are not scored, or are scored as wrong: [`reply_alerts`], [`ended_early_alerts`],
//! [`broken_off_alert`], [`people_alerts`].
//!
//! Alerts about missing replies that may depend on the condition: [`missing_alerts`].
//!
//! Alerts about replies that were parsed by another version of the lenient rules: [`parsing_alerts`].
//!
//! Alerts about models whose replies lack the requested probabilities: [`confidence_alerts`].

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};

use serde_json::Value;

use crate::joined::combine::CombinedRuns;
use crate::joined::enhancers::LenientChange;
use crate::joined::join::JoinedRun;
use crate::joined::settings::has_human_answers;
use crate::text::alert::{Alert, AlertKind, MAX_UNREAD};
use crate::text::words::failure_reason;
use darkqa_ask::is_context_full;
use darkqa_base::types::text::counted;
use darkqa_base::types::{
    AxisLevel, ChoiceDetail, Condition, FailureKind, Finish, OpenDetail, Record, StoredDetail, TrialRef, Trials,
    UnreadReason, Usage,
};
use darkqa_score::accuracies::Health;
use darkqa_score::model_in_condition::ModelInCondition;

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
pub(super) fn broken_off_alert(combined: &CombinedRuns) -> Option<Alert> {
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
pub(super) fn empty_choice_alerts(combined: &CombinedRuns) -> Vec<Alert> {
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
pub(super) fn people_alerts(combined: &CombinedRuns) -> Vec<Alert> {
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

/// Share of missing replies in a condition above which an alert names it (chosen).
const MAX_MISSING: f64 = 0.02;

/// Numbers of missing replies and of all trials of a subject.
pub(super) type MissingCounts<'m> = (&'m ModelInCondition, [usize; 2]);

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

/// One alert for each run whose lenient parsing would change under the rules of this version.
pub(super) fn parsing_alerts(combined: &CombinedRuns) -> Vec<Alert> {
    combined
        .runs
        .iter()
        .filter_map(|run| {
            let change = LenientChange::new(&run.manifest);
            if change.is_current() {
                return None;
            }
            let records =
                combined.trials_of(run).map(TrialRef::text).map(|place| combined.texts[place.log()].record(place));
            let text = match change.with_records(records) {
                Ok(change) if change.has_changed() => {
                    format!("{}: {}. --rescore stores what it reads now.", run.name, change.words())
                }
                Ok(_) => return None,
                Err(error) => format!("{}: its replies cannot be read again: {error}", run.name),
            };
            Some(Alert::new(AlertKind::Reading, text))
        })
        .collect()
}

/// One alert for each model that was asked with `--request probabilities` and none of whose replies has probabilities.
pub(super) fn confidence_alerts(runs: &[JoinedRun], trials: &Trials<ChoiceDetail>) -> Vec<Alert> {
    let asked: BTreeSet<&String> = runs
        .iter()
        .filter_map(|run| run.manifest.columns.get("model"))
        .flat_map(BTreeMap::iter)
        .filter(|(_, content)| content["--probabilities"] == Value::Bool(true))
        .map(|(name, _)| name)
        .collect();
    let stated: BTreeSet<&str> = trials.iter().filter(|trial| trial.options().is_some()).map(TrialRef::model).collect();
    let replied: BTreeSet<&str> = trials.iter().filter(|trial| !trial.failed()).map(TrialRef::model).collect();
    asked
        .into_iter()
        .filter(|name| replied.contains(&***name) && !stated.contains(&***name)).map(|name| {
        let text = format!(
            "The confidence of {name} is not available: its server states no probabilities of tokens, or its replies do not begin \
             with a choice."
        );
        Alert::new(AlertKind::Parameters, text)
    }).collect()
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
