//! The lights that sentences are about, and the findings about one of them.

use super::sample::is_impossible;
use super::sentence::Sentence;
use crate::text::words::light;
use crate::types::Variant;
use crate::types::degradations::Kind;
use darkqa_score::comparisons::{PooledFinding, PooledKind};
use darkqa_score::findings::Findings;

/// The variants that sentences speak of together: a kind and those that extend it.
#[derive(Debug)]
pub(super) struct Topic<'f> {
    /// The variants of the last kind, one for each light.
    pub(super) lights: Vec<&'f Variant>,
    /// The variants of the other kinds.
    pub(super) others: Vec<&'f Variant>,
    /// Whether another topic has the same levels, so that the level does not tell what a sentence is about.
    shares_levels: bool,
}

impl<'f> Topic<'f> {
    /// The topics of all variants that were asked, in the order of tables. The first one is the main one.
    pub(super) fn all(findings: &'f Findings<'_>) -> Vec<Self> {
        let mut topics: Vec<Self> = Vec::new();
        let variants: Vec<&Variant> = findings.grid.variants().into_iter().collect();
        let root = |variant: &Variant| variant.kind.map(Kind::root);
        let axis = |variant: &Variant| variant.kind.map(Kind::axis);
        for group in variants.chunk_by(|a, b| root(a) == root(b)) {
            let last = group.last().map(|variant| variant.kind);
            let (lights, others) = group
                .iter()
                .copied()
                .partition(|variant| Some(variant.kind) == last);
            let shares_levels = topics
                .iter()
                .flat_map(|topic| &topic.lights)
                .any(|other| axis(other) == axis(group[0]));
            topics.push(Self {
                lights,
                others,
                shares_levels,
            });
        }
        topics
    }

    /// A sentence about a variant, which is named if there are several lights, or if the levels do not tell it.
    pub(super) fn named(&self, variant: &Variant, mut sentence: Sentence) -> Sentence {
        if self.lights.len() > 1 || self.shares_levels {
            let light = light(variant, None);
            sentence.text = format!("{light}: {}", sentence.text);
            sentence.scope.light = Some(light);
        }
        sentence
    }
}

/// Sentences about the last kind of each topic. If it was asked in several lights, each sentence names its own.
pub(super) fn in_each_light(
    findings: &Findings<'_>,
    about: fn(&Findings<'_>, &Variant) -> Vec<Sentence>,
) -> Vec<Sentence> {
    let mut sentences = Vec::new();
    for topic in Topic::all(findings) {
        for variant in &topic.lights {
            let of_light = about(findings, variant).into_iter();
            sentences.extend(of_light.map(|sentence| topic.named(variant, sentence)));
        }
    }
    sentences
}

/// The findings over several levels together of one kind and variant, in the order of enhancers.
pub(super) fn means_of_set<'f>(
    findings: &'f Findings<'_>,
    kind: PooledKind,
    variant: &Variant,
) -> Vec<&'f PooledFinding> {
    findings
        .averaged
        .iter()
        .filter(|mean| mean.kind == kind && mean.variant == *variant)
        .collect()
}

/// The findings of one kind and variant over all families that the kind is about, in the order of enhancers and levels. Sets in which
/// no verdict is possible are left out.
pub(super) fn findings_of_kind<'f>(
    findings: &'f Findings<'_>,
    kind: PooledKind,
    variant: &Variant,
) -> Vec<&'f PooledFinding> {
    let of_set: Vec<&PooledFinding> = findings
        .pooled
        .iter()
        .filter(|finding| {
            finding.kind == kind
                && finding.family.as_ref() == kind.only_family()
                && finding.variant == *variant
        })
        .collect();
    let sets = of_set.chunk_by(|a, b| a.enhancer == b.enhancer);
    sets.filter(|set| !is_impossible(set))
        .flatten()
        .copied()
        .collect()
}
