//! A photograph of a frame's scene in the dark, and how dark it is: [`SourcePhotograph`].

use crate::types::degradations::Kind;
use crate::types::{
    Degradation, Digest, InputNote, PairFacts, PhotoName, ReadingName, Rgb, Severity,
};
use darkqa_light::PairEv;

/// A photograph of a frame's scene in the dark.
#[derive(Debug, Clone)]
pub(crate) struct SourcePhotograph {
    /// Name of the condition in which it is shown.
    pub(crate) name: PhotoName,
    /// Digest of the file and of the rule by which it is read.
    pub(crate) digest: Digest,
    /// Changes that reading the file makes besides decoding its codes.
    pub(crate) note: InputNote,
    /// Exposure drop that the data state, in EV; `None` if they do not.
    pub(crate) stated: Option<f64>,
    /// How dark it is; `None` if it was not measured yet, because no key depends on it.
    pub(crate) facts: Option<PairFacts>,
}

impl SourcePhotograph {
    /// How dark it is beside its frame.
    pub(crate) fn measured(&self, normal: &Rgb, low: &Rgb) -> PairFacts {
        let measured = PairEv::measure(normal, low);
        PairFacts {
            stated: self.stated,
            mean: measured.map(|ev| ev.mean),
            median: measured.and_then(|ev| ev.median),
            synthesis: measured.map(|ev| ev.synthesis),
        }
    }
}

/// The degradation of this kind that is as dark as the first of these photographs, rounded to a hundredth of an EV; `None` if the
/// darkness is not known, or is no drop that synthesis can make.
pub(crate) fn matched(
    photos: &[SourcePhotograph],
    kind: Kind,
    reading: Option<&ReadingName>,
) -> Option<(Degradation, PairFacts)> {
    let facts = photos.first()?.facts?;
    let hundredths = (100.0 * facts.matching()?).round();
    if !(1.0..=f64::from(kind.max_severity().hundredths())).contains(&hundredths) {
        return None;
    }
    let severity = Severity::from_hundredths(hundredths as u16);
    let how = Degradation::new(kind, severity, reading.cloned()).ok()?;
    Some((how, facts))
}
