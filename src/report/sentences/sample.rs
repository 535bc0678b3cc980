//! Sentences about the sample: findings without a possible verdict, wide intervals, and models that are left out.
//!
//! Sentences about levels whose verdict depends on missing replies: [`Undecided`].

use std::collections::BTreeSet;

use super::sentence::{EffectDirection, NamedNumbers, Sentence, level_runs, models};
use crate::text::words::light;
use darkqa_base::types::{AxisLevel, EnhancerName, Variant, View};
use darkqa_score::cluster::ClusterUnit;
use darkqa_score::comparisons::{Claim, ModelsLeftOut, PooledFinding, PooledKind};
use darkqa_score::findings::Findings;
use darkqa_score::significance::Verdict;

/// Half-width of an interval above which the sample is called small, as a share (0.05 is 5 points); chosen.
pub(super) const WIDE: f64 = 0.05;

/// Maximum number of models that a sentence names.
const MAX_NAMED: usize = 3;

/// The subject of findings of a kind.
fn topic(kind: PooledKind, variant: &Variant, enhancer: Option<&EnhancerName>) -> String {
    match (kind, enhancer) {
        (PooledKind::Enhancer, Some(name)) => name.to_string(),
        (PooledKind::Blind, _) => "dark images against no images".to_owned(),
        _ => kind.name_on(variant.kind).to_owned(),
    }
}

/// The subject of findings of a kind with a variant, as `darkness (with noise)`.
pub(super) fn topic_in_light(kind: PooledKind, variant: &Variant, enhancer: Option<&EnhancerName>) -> String {
    format!("{} ({})", topic(kind, variant, enhancer), light(variant, None))
}

/// True if no finding of a set can have a verdict, because there are too few clusters for a small corrected p-value.
pub(super) fn is_impossible(set: &[&PooledFinding]) -> bool {
    set.iter().all(|finding| !finding.strict.tested.verdict.is_possible())
}

/// The topics without a possible verdict because of too few clusters; `None` if every topic can have one. If the same
/// topic can have a verdict with another variant, the sentence names the variant.
pub(super) fn impossible(findings: &Findings<'_>) -> Option<Sentence> {
    let last = findings.grid.main_variant().and_then(|variant| variant.kind);
    let whole: Vec<&PooledFinding> = findings
        .pooled
        .iter()
        .filter(|finding| finding.family.is_none() && finding.kind != PooledKind::EnhancerPair)
        .collect();
    let (without, with): (Vec<_>, Vec<_>) = whole
        .chunk_by(|a, b| (a.kind, &a.variant, &a.enhancer) == (b.kind, &b.variant, &b.enhancer))
        .partition(|set| is_impossible(set));
    let (mut topics, mut least) = (Vec::<String>::new(), Vec::new());
    for set in without {
        let first = set[0];
        if first.variant.kind != last {
            continue;
        }
        let mut topic = topic(first.kind, &first.variant, first.enhancer.as_ref());
        let is_possible_elsewhere = with.iter().any(|other| {
            (other[0].kind, &other[0].enhancer) == (first.kind, &first.enhancer) && other[0].variant.kind.is_some()
        });
        if is_possible_elsewhere {
            topic = format!("{topic} {}", light(&first.variant, None));
        }
        if !topics.contains(&topic) {
            topics.push(topic);
        }
        least.extend(set.iter().map(|finding| (finding.least_holm, finding.clusters)));
    }
    if let Some(best) = findings.best.as_ref().filter(|best| !best.is_possible()) {
        topics.push("the best model".to_owned());
        least.push((best.pairs.len() as f64 * best.least_p, best.clusters));
    }
    let (p, clusters) = least.into_iter().min_by(|a, b| a.0.total_cmp(&b.0))?;
    let mut numbers = NamedNumbers::new(findings.unit);
    let text = format!(
        "With {} no verdict on {} is possible, however large the effect.",
        numbers.clusters(clusters),
        listed(&topics)
    );
    let p = numbers.p("least_p", p.min(1.0));
    let detail = format!("the smallest possible {p}; take more {}s", findings.unit);
    Some(numbers.sentence("no verdict", EffectDirection::Note, text, detail))
}

/// The half-widths of the narrowest and the widest interval, if the widest exceeds [`WIDE`]. This is not the power of
/// the tests, which depends on more than the intervals.
pub(super) fn power(all: &[PooledFinding], unit: ClusterUnit) -> Option<Sentence> {
    // Missing replies may widen an interval without end, and have a sentence of their own.
    let whole = all.iter().filter(|finding| {
        finding.family.is_none()
            && finding.kind != PooledKind::EnhancerPair
            && finding.strict.tested.verdict != Verdict::Missing
    });
    let which = if whole.clone().all(|finding| finding.strict.tested.verdict.is_possible()) {
        "the findings"
    } else {
        "the findings that may have a verdict"
    };
    let whole = whole.filter(|finding| finding.strict.tested.verdict.is_possible());
    let narrowest = whole.clone().min_by(|a, b| half_width(a).total_cmp(&half_width(b)))?;
    let widest = whole.max_by(|a, b| half_width(a).total_cmp(&half_width(b)))?;
    if half_width(widest) <= WIDE {
        return None;
    }
    let mut numbers = NamedNumbers::new(unit);
    let [least, most] = [("narrowest", narrowest), ("widest", widest)]
        .map(|(name, finding)| numbers.number(name, 100.0 * half_width(finding), 0));
    let range = if least == most { most } else { format!("{least} to {most}") };
    let text = format!(
        "With {} the intervals of {which} reach about {range} points to each side.",
        numbers.clusters(widest.clusters)
    );
    let detail = "over all families; an effect much smaller than that cannot be shown with so small a sample";
    Some(numbers.sentence("power", EffectDirection::Note, text, detail.to_owned()))
}

/// Half the width of a finding's interval, as a share.
fn half_width(finding: &PooledFinding) -> f64 {
    (finding.strict.tested.difference.high - finding.strict.tested.difference.low) / 2.0
}

/// The models that are left out of findings, because they answered fewer questions than others. Findings with the same
/// levels and models share a sentence. False answers are skipped, because they leave out the same models as the cost of
/// darkness.
pub fn left_out(findings: &Findings<'_>) -> Vec<Sentence> {
    let mut grouped: Vec<(&ModelsLeftOut, Vec<String>)> = Vec::new();
    for set in &findings.left_out {
        if matches!(set.kind, PooledKind::Hallucination(_)) {
            continue;
        }
        let about = topic_in_light(set.kind, &set.variant, set.enhancer.as_ref());
        let same = grouped
            .iter_mut()
            .find(|(other, _)| runs(other) == runs(set) && other.models == set.models && other.items == set.items);
        match same {
            Some((_, topics)) => topics.push(about),
            None => grouped.push((set, vec![about])),
        }
    }
    grouped
        .into_iter()
        .map(|(set, topics)| {
            let mut numbers = NamedNumbers::new(findings.unit);
            let is_one = set.models.len() == 1;
            let models = if set.models.len() > MAX_NAMED {
                format!("{} models", numbers.count("models", set.models.len()))
            } else {
                listed(&set.models)
            };
            if set.is_more {
                let were = if is_one { "was" } else { "were" };
                let text = format!("Only {models} {were} asked at {}: no mean is made there.", runs(set));
                let detail = format!("left out of the findings about {}", listed(&topics));
                return numbers.sentence("left out", EffectDirection::Note, text, detail);
            }
            let [all, answered] = set.items;
            let why = match (answered, is_one) {
                (0, true) => "it was not asked".to_owned(),
                (0, false) => "they were not asked".to_owned(),
                (_, is_one) => format!(
                    "{} answered {} of {} questions",
                    if is_one { "it" } else { "each" },
                    numbers.count("answered", answered),
                    numbers.count("questions", all)
                ),
            };
            let text = format!(
                "{models} {} apart from the other models: {why} at {}.",
                if is_one { "stands" } else { "stand" },
                runs(set)
            );
            let detail = format!("in no mean about {}", listed(&topics));
            numbers.sentence("left out", EffectDirection::Note, text, detail)
        })
        .collect()
}

/// The levels at which the models answered fewer questions, in words.
fn runs(set: &ModelsLeftOut) -> String {
    level_runs(&set.levels, &set.asked)
}

/// A list in words, as `a, b and c`.
pub(super) fn listed(things: &[String]) -> String {
    match things {
        [] => String::new(),
        [one] => one.clone(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}

/// Levels of a set of findings without a verdict because of missing replies.
#[derive(Debug)]
pub(super) struct Undecided<'f> {
    /// Findings of all levels.
    levels: Vec<&'f PooledFinding>,
    /// Findings whose verdict the missing replies decide.
    open: Vec<&'f PooledFinding>,
    /// Levels that were asked, and at which no question has all replies; sorted.
    silent: Vec<AxisLevel>,
}

impl<'f> Undecided<'f> {
    pub(super) fn new(levels: &[&'f PooledFinding], silent: &[AxisLevel]) -> Self {
        Self {
            levels: levels.to_vec(),
            open: levels.iter().copied().filter(|finding| finding.claim() == Claim::Missing).collect(),
            silent: silent.to_vec(),
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.open.is_empty() && self.silent.is_empty()
    }

    /// The levels without a verdict, in words.
    pub(super) fn at(&self) -> String {
        let [all, without] = [&self.levels, &self.open].map(|findings| {
            let levels = findings.iter().map(|finding| finding.level);
            let levels: BTreeSet<AxisLevel> = levels.chain(self.silent.iter().copied()).collect();
            levels.into_iter().collect::<Vec<_>>()
        });
        level_runs(&without, &all)
    }

    /// The sentence about these levels; `None` without any. `about` completes "no verdict on".
    pub(super) fn sentence(&self, kind: &'static str, about: &str, unit: ClusterUnit) -> Option<Sentence> {
        let mut numbers = NamedNumbers::new(unit);
        let mut reasons = Vec::new();
        let mut details = Vec::new();
        let worst = self.open.iter().max_by(|a, b| missing_share(a).total_cmp(&missing_share(b)));
        if let Some(worst) = worst {
            numbers.at(&worst.level);
            let share = numbers.percent("missing", missing_share(worst));
            reasons.push(format!("{share} % of the questions lack a reply at {}", worst.level));
            let who = models(&worst.models, &mut numbers);
            let difference = numbers.difference("", worst.strict.tested.difference);
            details.push(format!(
                "{who}: {difference} at {}, with an interval for all values of the missing replies",
                worst.level
            ));
        }
        if !self.silent.is_empty() {
            let at = level_runs(&self.silent, &self.silent);
            reasons.push(format!("no question has all replies at {at}"));
        }
        if reasons.is_empty() {
            return None;
        }
        let undetected: Vec<AxisLevel> = self
            .levels
            .iter()
            .filter(|finding| !matches!(finding.claim(), Claim::Detected(_) | Claim::Impossible | Claim::Missing))
            .map(|finding| finding.level)
            .collect();
        if !undetected.is_empty() {
            let all: Vec<AxisLevel> = self.levels.iter().map(|finding| finding.level).collect();
            let at = level_runs(&undetected, &all);
            details.push(format!("nothing was detected at {at}"));
        }
        details.extend(worst.map(|worst| numbers.sample(worst)));
        let text = format!("No verdict on {about} is possible at {}: {}.", self.at(), listed(&reasons));
        Some(numbers.sentence(kind, EffectDirection::Note, text, details.join("; ")))
    }
}

/// Share of the questions of which a reply is missing, of those asked on both sides.
fn missing_share(finding: &PooledFinding) -> f64 {
    finding.missing as f64 / (finding.missing + finding.items) as f64
}

/// Levels at which raw images of a variant were asked, and at which no question has all replies.
pub(super) fn silent_levels(findings: &Findings<'_>, variant: &Variant) -> Vec<AxisLevel> {
    let found: BTreeSet<AxisLevel> = findings
        .pooled
        .iter()
        .filter(|finding| {
            finding.kind == PooledKind::Darkness && finding.family.is_none() && finding.variant == *variant
        })
        .map(|finding| finding.level)
        .collect();
    if found.is_empty() {
        // L0 was not asked or has no reply: there is nothing to compare with.
        return Vec::new();
    }
    let models = findings.models_of(variant);
    let asked: BTreeSet<AxisLevel> = findings
        .grid
        .subjects
        .iter()
        .filter(|subject| {
            subject.view == Some(View::Image)
                && subject.variant == *variant
                && subject.enhancer.is_none()
                && models.contains(&&*subject.model)
        })
        .filter_map(|subject| subject.level)
        .collect();
    asked.difference(&found).copied().collect()
}
