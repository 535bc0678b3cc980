//! Balancing of the answers, so that a model cannot score by always giving the most common one: `balance`.

use std::collections::{BTreeMap, BTreeSet};

use clap::ValueEnum;

use super::rule_context::GeneratedQuestion;
use super::rules::BalanceRule;
use darkqa_base::types::flags::flag_words;
use darkqa_base::types::{Digest, Family};

/// How far the answers are balanced.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum BalanceMode {
    /// No balancing, as in the paper's Algorithm 1.
    None,
    /// Numbers of yes and no differ by at most 1 for each word and activity.
    #[default]
    Binary,
    /// As binary, and no room type or colour exceeds its share of the answers.
    Full,
}

flag_words!(BalanceMode);

/// The questions after balancing.
pub(super) struct BalancedSet {
    pub(super) asked: Vec<GeneratedQuestion>,
    /// The family of each question that was dropped.
    pub(super) dropped: Vec<Family>,
    /// Warnings: a family has too few different answers to balance them.
    pub(super) uneven: Vec<String>,
}

/// Drops questions until the answers are balanced. Among questions with the same answer, those with the largest digests
/// of their ids are dropped.
pub(super) fn balance(asked: Vec<GeneratedQuestion>, mode: BalanceMode, rule: &BalanceRule) -> BalancedSet {
    let mut dropped: BTreeSet<usize> = BTreeSet::new();
    let mut uneven = Vec::new();
    if rule.max_repeat > 0 {
        for (_, list) in groups(&asked, &dropped, |asked| Some(asked.repeat_key())) {
            dropped.extend(list.into_iter().skip(rule.max_repeat));
        }
    }
    if rule.least_entropy_ppm > 0 {
        for (_, list) in groups(&asked, &dropped, |asked| Some(asked.question.text.clone())) {
            if !is_varied(&asked, &list, rule) {
                dropped.extend(list);
            }
        }
    }
    if mode != BalanceMode::None {
        for (_, list) in groups(&asked, &dropped, binary_key) {
            let (yes, no) = list.into_iter().partition::<Vec<_>, _>(|i| asked[*i].question.choices.truth() == Some(0));
            let max = yes.len().min(no.len()) + 1;
            dropped.extend(yes.into_iter().skip(max));
            dropped.extend(no.into_iter().skip(max));
        }
    }
    if mode == BalanceMode::Full {
        uneven = cap_shares(&asked, &mut dropped, rule);
    }
    let families = dropped.iter().map(|i| asked[*i].question.family.clone()).collect();
    BalancedSet {
        asked: asked.into_iter().enumerate().filter(|(i, _)| !dropped.contains(i)).map(|(_, asked)| asked).collect(),
        dropped: families,
        uneven,
    }
}

/// Family and text of a yes-no question; `None` for other questions.
fn binary_key(asked: &GeneratedQuestion) -> Option<(Family, String)> {
    let family = &asked.question.family;
    family.is_yes_no().then(|| (family.clone(), asked.question.text.clone()))
}

/// Drops questions whose room type or colour exceeds its share of the answers. Returns a warning for each family that
/// cannot be balanced.
fn cap_shares(asked: &[GeneratedQuestion], dropped: &mut BTreeSet<usize>, rule: &BalanceRule) -> Vec<String> {
    let mut uneven = Vec::new();
    for family in Family::by_rule() {
        let Some(share) = rule.share_ppm(&family) else {
            continue;
        };
        let lists =
            groups(asked, dropped, |asked| (asked.question.family == family).then(|| asked.answer().to_owned()));
        match max_per_answer(&lists, share) {
            Some(max) => dropped.extend(lists.into_values().flat_map(|list| list.into_iter().skip(max))),
            None if lists.is_empty() => {}
            None => uneven.push(format!(
                "{family}: too few different answers ({}) to limit each to {} % of the questions",
                lists.len(),
                share / 10_000
            )),
        }
    }
    uneven
}

/// Indices of the remaining questions by key, each list sorted by the digests of the ids.
fn groups<K: Ord>(
    asked: &[GeneratedQuestion],
    dropped: &BTreeSet<usize>,
    key: impl Fn(&GeneratedQuestion) -> Option<K>,
) -> BTreeMap<K, Vec<usize>> {
    let mut groups: BTreeMap<K, Vec<usize>> = BTreeMap::new();
    for (i, asked) in asked.iter().enumerate() {
        if let Some(key) = key(asked).filter(|_| !dropped.contains(&i)) {
            groups.entry(key).or_default().push(i);
        }
    }
    for list in groups.values_mut() {
        list.sort_by_key(|i| Digest::from_bytes(asked[*i].question.id.0.as_bytes()));
    }
    groups
}

/// Maximum number of questions with the same answer that keeps every answer within its share of all. `None` with too
/// few different answers.
fn max_per_answer(lists: &BTreeMap<String, Vec<usize>>, share_ppm: u64) -> Option<usize> {
    let total: usize = lists.values().map(Vec::len).sum();
    (1..=total)
        .rev()
        .map(|all| (all, (all as u64 * share_ppm / 1_000_000) as usize))
        .find(|(all, max)| {
            let remaining: usize = lists.values().map(|list| list.len().min(*max)).sum();
            *max > 0 && remaining >= *all
        })
        .map(|(_, max)| max)
}

/// True if a question occurs in enough scenes and the entropy of its answers, relative to that of uniform answers, is
/// high enough (EmbodiedQA, `entropy_based_filtering.py`).
fn is_varied(asked: &[GeneratedQuestion], list: &[usize], rule: &BalanceRule) -> bool {
    let scenes: BTreeSet<&str> = list.iter().map(|i| asked[*i].scene.as_str()).collect();
    if scenes.len() < rule.least_scenes {
        return false;
    }
    let mut counts: BTreeMap<&str, u64> = BTreeMap::new();
    for i in list {
        *counts.entry(asked[*i].answer()).or_insert(0) += 1;
    }
    let total = list.len() as f64;
    let entropy: f64 = counts.values().map(|count| *count as f64 / total).map(|share| -share * libm::log2(share)).sum();
    let possible = list.iter().map(|i| asked[*i].question.choices.len()).max().unwrap_or(2);
    entropy >= libm::log2(possible as f64) * rule.least_entropy_ppm as f64 / 1e6
}

#[cfg(test)]
mod tests {
    use super::*;
    use darkqa_base::types::{Choices, Evidence, FrameId, Question, QuestionId};

    fn asked(number: usize, family: Family, about: &str, answer: usize) -> GeneratedQuestion {
        let texts = ["yes", "no", "perhaps"].map(str::to_owned).to_vec();
        let question = Question {
            id: QuestionId(format!("q{number}")),
            frame: FrameId(format!("f{number}")),
            family,
            text: format!("{about}?"),
            choices: Choices::new(texts, answer).unwrap(),
            group: None,
            evidence: Evidence::default(),
        };
        GeneratedQuestion { question, about: about.to_owned(), scene: format!("s{}", number % 5) }
    }

    fn rule() -> BalanceRule {
        super::super::rules::Rules::built_in().unwrap().book().balance.clone()
    }

    fn count(questions: &[GeneratedQuestion], about: &str, answer: &str) -> usize {
        questions.iter().filter(|asked| asked.about == about && asked.answer() == answer).count()
    }

    fn chairs_and_beds(family: &Family) -> Vec<GeneratedQuestion> {
        (0..12)
            .map(|i| {
                let thing = if i < 9 { "chair" } else { "bed" };
                asked(i, family.clone(), thing, usize::from(i >= 7))
            })
            .collect()
    }

    #[test]
    fn yes_and_no_differ_by_at_most_one() {
        let balanced = balance(chairs_and_beds(&Family::Presence), BalanceMode::Binary, &rule());
        assert_eq!((count(&balanced.asked, "chair", "yes"), count(&balanced.asked, "chair", "no")), (3, 2));
        assert_eq!((balanced.asked.len(), balanced.dropped.len()), (6, 6));
        let mut reversed = chairs_and_beds(&Family::Presence);
        reversed.reverse();
        let mut other = balance(reversed, BalanceMode::Binary, &rule()).asked;
        other.reverse();
        assert_eq!(other, balanced.asked);
        for (family, mode) in [(Family::Presence, BalanceMode::None), (Family::Color, BalanceMode::Binary)] {
            let balanced = balance(chairs_and_beds(&family), mode, &rule());
            assert_eq!(balanced.asked.len(), 12);
        }
    }

    #[test]
    fn no_colour_is_more_than_its_share() {
        let counts = [40, 10, 10];
        let list: Vec<GeneratedQuestion> = counts
            .iter()
            .enumerate()
            .flat_map(|(answer, count)| {
                (0..*count).map(move |i| asked(answer * 100 + i, Family::Color, "sofa", answer))
            })
            .collect();
        let half = BalanceRule { color_share_ppm: 500_000, ..rule() };
        let balanced = balance(list.clone(), BalanceMode::Full, &half);
        assert_eq!((count(&balanced.asked, "sofa", "yes"), balanced.asked.len()), (20, 40));
        let fifth = balance(list, BalanceMode::Full, &rule());
        assert_eq!((fifth.asked.len(), fifth.uneven.len()), (60, 1));
    }

    #[test]
    fn repeats_and_questions_with_one_usual_answer_are_dropped() {
        let list: Vec<GeneratedQuestion> =
            (0..30).map(|i| asked(i, Family::Color, "sofa", usize::from(i < 3))).collect();
        let few = BalanceRule { max_repeat: 2, ..rule() };
        // Five scenes; three of the thirty answers are "no", each in its own scene.
        assert_eq!(balance(list.clone(), BalanceMode::None, &few).asked.len(), 13);
        for (ppm, expected) in [(200_000, 30), (500_000, 0)] {
            let varied = BalanceRule { least_entropy_ppm: ppm, ..rule() };
            assert_eq!(balance(list.clone(), BalanceMode::None, &varied).asked.len(), expected, "{ppm}");
        }
    }
}
