//! Topics of sentences ([`Topic`]), and the findings about one variant.

use super::sample::is_impossible;
use super::sentence::Sentence;
use crate::report::text::words::light;
use crate::types::Variant;
use crate::types::degradations::Kind;
use darkqa_score::comparisons::{PooledFinding, PooledKind};
use darkqa_score::findings::Findings;

/// Variants with a common root kind, such as the exposure drop and noise, which sentences report together.
#[derive(Debug)]
pub(super) struct Topic<'f> {
    /// The variants of the last kind, one for each noise profile or group of runs.
    pub(super) lights: Vec<&'f Variant>,
    /// The variants of the other kinds.
    pub(super) others: Vec<&'f Variant>,
    /// True if an earlier topic has the same axis, so that a level alone does not identify the topic.
    shares_levels: bool,
}

impl<'f> Topic<'f> {
    /// The topics of all variants that were asked, in the order of tables. The first one is the main one.
    pub(super) fn all(findings: &'f Findings<'_>) -> Vec<Self> {
        let mut topics: Vec<Self> = Vec::new();
        let variants: Vec<&Variant> = findings.grid.variants().into_iter().collect();
        for group in variants.chunk_by(|a, b| a.kind.map(Kind::root) == b.kind.map(Kind::root)) {
            let last = group.last().map(|variant| variant.kind);
            let (lights, others) = group.iter().copied().partition(|variant| Some(variant.kind) == last);
            let shares_levels = topics
                .iter()
                .flat_map(|topic| &topic.lights)
                .any(|other| other.kind.map(Kind::axis) == group[0].kind.map(Kind::axis));
            topics.push(Self { lights, others, shares_levels });
        }
        topics
    }

    /// Adds the name of the variant to a sentence, if the topic has several lights or shares its levels with another
    /// topic.
    pub(super) fn add_light(&self, variant: &Variant, mut sentence: Sentence) -> Sentence {
        if self.lights.len() > 1 || self.shares_levels {
            let light = light(variant, None);
            sentence.text = format!("{light}: {}", sentence.text);
            sentence.scope.light = Some(light);
        }
        sentence
    }
}

/// Sentences about each light of each topic.
pub(super) fn in_each_light(
    findings: &Findings<'_>,
    about: fn(&Findings<'_>, &Variant) -> Vec<Sentence>,
) -> Vec<Sentence> {
    let mut sentences = Vec::new();
    for topic in Topic::all(findings) {
        for variant in &topic.lights {
            let about_light = about(findings, variant);
            sentences.extend(about_light.into_iter().map(|sentence| topic.add_light(variant, sentence)));
        }
    }
    sentences
}

/// The findings of one kind and variant that average over several levels, in the order of enhancers.
pub(super) fn mean_findings<'f>(
    findings: &'f Findings<'_>,
    kind: PooledKind,
    variant: &Variant,
) -> Vec<&'f PooledFinding> {
    findings.averaged.iter().filter(|mean| mean.kind == kind && mean.variant == *variant).collect()
}

/// The findings of one kind and variant over all families of the kind, in the order of enhancers and levels. The
/// findings about an enhancer are left out if none of them can have a verdict.
pub(super) fn findings_of_kind<'f>(
    findings: &'f Findings<'_>,
    kind: PooledKind,
    variant: &Variant,
) -> Vec<&'f PooledFinding> {
    let of_kind: Vec<&PooledFinding> = findings
        .pooled
        .iter()
        .filter(|finding| {
            finding.kind == kind && finding.family.as_ref() == kind.only_family() && finding.variant == *variant
        })
        .collect();
    of_kind.chunk_by(|a, b| a.enhancer == b.enhancer).filter(|set| !is_impossible(set)).flatten().copied().collect()
}
