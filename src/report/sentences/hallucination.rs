//! Sentences about answers in the dark: false answers about presence, and one answer to most questions.

use std::collections::BTreeSet;

use super::pooled::{detail, runs, with_verdict};
use super::sentence::{EffectDirection, NamedNumbers, Sentence};
use crate::text::words::family as family_name;
use darkqa_base::types::{AxisLevel, Family, Variant};
use darkqa_score::answers::confusion::{Collapse, FalseAnswer, MIN_EXCESS};
use darkqa_score::cluster::ClusterUnit;
use darkqa_score::comparisons::PooledFinding;
use darkqa_score::findings::Findings;
use darkqa_score::model_in_condition::ModelInCondition;
use darkqa_score::significance::Verdict;

/// The rate of a false answer at the darkest level with a detected increase.
pub(super) fn false_answers(levels: &[&PooledFinding], answer: FalseAnswer, unit: ClusterUnit) -> Option<Sentence> {
    let detected = with_verdict(levels, Verdict::Worse);
    let worst = detected.last()?;
    let mut numbers = NamedNumbers::new(unit);
    let objects = match answer {
        FalseAnswer::No => "that are there",
        FalseAnswer::Yes => "that are not there",
    };
    let text = format!(
        "At {} “{}” is answered to {} % of the objects {objects} ({} % at L0).",
        worst.level,
        answer.word(),
        numbers.percent("rate", worst.strict.first),
        numbers.percent("L0", worst.strict.second)
    );
    let more = format!("; an increase is shown at {}", runs(&detected, levels));
    let detail = detail(worst, &mut numbers, &more);
    Some(numbers.sentence("hallucination", EffectDirection::Worse, text, detail))
}

/// The answer that a model gives most often to the questions of a family at the darkest level.
#[derive(Debug, Clone, Copy)]
pub(super) struct TopAnswer<'f> {
    pub(super) model: &'f str,
    pub(super) family: &'f Family,
    pub(super) level: AxisLevel,
    pub(super) collapse: &'f Collapse,
}

impl<'f> TopAnswer<'f> {
    /// The top answers to raw images at the darkest level of a variant, for the models of the pooled findings.
    pub(super) fn all(findings: &'f Findings<'_>, variant: &Variant) -> Vec<Self> {
        let grid = &findings.grid;
        let models = findings.models_of(variant);
        let is_included = |subject: &ModelInCondition| {
            subject.variant == *variant && subject.enhancer.is_none() && models.contains(&&*subject.model)
        };
        let Some(level) =
            grid.subjects.iter().filter(|subject| is_included(subject)).filter_map(|subject| subject.level).max()
        else {
            return Vec::new();
        };
        findings
            .confusions
            .iter()
            .filter(|confusion| is_included(&confusion.subject) && confusion.subject.level == Some(level))
            .filter_map(|confusion| {
                let subject = &confusion.subject;
                let collapse = confusion.collapse.as_ref()?;
                Some(Self { model: &subject.model, family: &confusion.family, level, collapse })
            })
            .collect()
    }

    /// Share of the answer minus its true share.
    fn excess(&self) -> f64 {
        self.collapse.share.value - self.collapse.truth
    }
}

/// Reports the model and family in which one answer exceeds its true share the most. `None` unless an answer is
/// detected to be more frequent than at L0, in both parsings and after the correction over all sentences.
pub(super) fn collapse(answers: &[TopAnswer<'_>], unit: ClusterUnit) -> Option<Sentence> {
    let detected = answers.iter().filter(|answer| answer.collapse.is_shown());
    let largest =
        detected.clone().reduce(|largest, next| if next.excess() > largest.excess() { next } else { largest })?;
    let of_family = answers.iter().filter(|answer| answer.family == largest.family);
    let collapsed = detected.clone().filter(|answer| answer.family == largest.family);
    let mut numbers = NamedNumbers::new(unit);
    let (level, model, top) = (largest.level, largest.model, &largest.collapse.top);
    let name = family_name(Some(largest.family));
    let share = numbers.percent("share", largest.collapse.share.value);
    let truth = numbers.percent("true_share", largest.collapse.truth);
    let text = match (collapsed.count(), of_family.count()) {
        (_, 1) => format!("At {level} {share} % of the replies about {name} are “{top}”, which is true of {truth} %."),
        (1, _) => format!(
            "At {level} {share} % of the replies of {model} about {name} are “{top}”, which is true of {truth} %."
        ),
        (collapsed, models) => format!(
            "At {level} {} of {} models give one answer about {name} far more often than it is true: {share} % of the replies of {model} \
             are “{top}”, which is true of {truth} %.",
            numbers.count("collapsed", collapsed),
            numbers.count("models", models)
        ),
    };
    let others: BTreeSet<&str> = detected
        .filter(|answer| answer.family != largest.family)
        .map(|answer| family_name(Some(answer.family)))
        .collect();
    let others: Vec<&str> = others.into_iter().collect();
    let detail = collapse_detail(largest, &mut numbers);
    let detail = if others.is_empty() { detail } else { format!("{detail}; also in {}", others.join(", ")) };
    Some(numbers.sentence("collapse", EffectDirection::Worse, text, detail))
}

/// Share of an answer with its interval, share at L0, limit and n.
fn collapse_detail(answer: &TopAnswer<'_>, numbers: &mut NamedNumbers) -> String {
    let share = answer.collapse.share;
    numbers.at(&answer.level);
    let value = numbers.percent("share", share.value);
    let ends = numbers.share_ends("", share);
    let clean = answer.collapse.clean.as_ref().map(|clean| {
        let share = numbers.percent("L0", clean.strict.second);
        let difference = numbers.difference("_from_L0", clean.strict.tested.difference);
        let p = numbers.p("p", clean.strict.tested.p_report.unwrap_or(1.0));
        format!(", {share} % at L0 ({difference} points, {p})")
    });
    let limit = numbers.number("limit", 100.0 * MIN_EXCESS, 0);
    let n = numbers.count("n", share.n);
    let clusters = numbers.clusters(answer.collapse.clusters);
    format!(
        "{}: {value} % [{ends}]{}; limit: {limit} points above the true share; n = {n} in {clusters}",
        answer.model,
        clean.unwrap_or_default()
    )
}
