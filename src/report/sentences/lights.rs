//! The lights that sentences are about, and the findings about one of them.

use super::sample::is_impossible;
use super::sentence::Sentence;
use crate::report::words::light;
use crate::score::findings::Findings;
use crate::score::pooled::PooledFinding;
use crate::score::pooled_kind::PooledKind;
use crate::types::KindReading;

/// The variants of the last kind of degradation that was asked, one for each light; and the variants of the other kinds.
pub(super) fn lights<'f>(
    findings: &'f Findings<'_>,
) -> (Vec<&'f KindReading>, Vec<&'f KindReading>) {
    let variants = findings.grid.variants();
    let last = variants.last().map(|variant| variant.kind);
    let variants = variants.into_iter();
    variants.partition(|variant| Some(variant.kind) == last)
}

/// A sentence about a variant, which is named if there are several lights.
pub(super) fn named_light(
    lights: &[&KindReading],
    variant: &KindReading,
    mut sentence: Sentence,
) -> Sentence {
    if lights.len() > 1 {
        sentence.text = format!("{}: {}", light(variant, None), sentence.text);
    }
    sentence
}

/// Sentences about the last kind of degradation that was asked. If it was asked in several lights, each sentence names its own.
pub(super) fn in_each_light(
    findings: &Findings<'_>,
    about: fn(&Findings<'_>, &KindReading) -> Vec<Sentence>,
) -> Vec<Sentence> {
    let (lights, _) = lights(findings);
    let sentences = lights.iter().flat_map(|variant| {
        let of_light = about(findings, variant).into_iter();
        of_light.map(|sentence| named_light(&lights, variant, sentence))
    });
    sentences.collect()
}

/// The findings of one kind and variant over all families that the kind is about, in the order of enhancers and levels. Sets in which
/// no verdict is possible are left out.
pub(super) fn of_set<'f>(
    findings: &'f Findings<'_>,
    kind: PooledKind,
    variant: &KindReading,
) -> Vec<&'f PooledFinding> {
    let pooled = findings.pooled.iter();
    let of_set = pooled.filter(|finding| {
        finding.kind == kind
            && finding.family.as_ref() == kind.only_family()
            && finding.variant == *variant
    });
    let of_set: Vec<&PooledFinding> = of_set.collect();
    let sets = of_set.chunk_by(|a, b| a.enhancer == b.enhancer);
    let possible = sets.filter(|set| !is_impossible(set));
    possible.flatten().copied().collect()
}
