//! Sentences about levels whose verdict depends on missing replies: [`Undecided`].

use std::collections::BTreeSet;

use super::sample::listed;
use super::sentence::{Numbers, Sentence, Tone, level_runs, models};
use crate::types::{AxisLevel, Variant, View};
use darkqa_score::cluster::ClusterUnit;
use darkqa_score::comparisons::{Claim, PooledFinding, PooledKind};
use darkqa_score::findings::Findings;

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
        let mut numbers = Numbers::new(unit);
        let mut reasons = Vec::new();
        let mut details = Vec::new();
        let worst = self.open.iter().max_by(|a, b| missing_share(a).total_cmp(&missing_share(b)));
        if let Some(worst) = worst {
            numbers.at(&worst.level);
            let share = numbers.percent("missing", missing_share(worst));
            reasons.push(format!("{share} % of the questions lack a reply at {}", worst.level));
            let who = models(&worst.models, &mut numbers);
            let difference = numbers.difference("", worst.strict.difference);
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
        Some(numbers.sentence(kind, Tone::Note, text, details.join("; ")))
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
