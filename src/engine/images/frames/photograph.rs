//! A photograph of a frame's scene in the dark, and how dark it is: [`SourcePhotograph`].

use crate::types::degradations::Kind;
use crate::types::{Degradation, Digest, InputNote, PairFacts, PhotoName, ProfileName, Rgb, Severity};
use darkqa_light::PairEv;

/// A photograph of a frame's scene in the dark.
#[derive(Debug, Clone)]
pub(crate) struct SourcePhotograph {
    /// Name of the condition in which it is shown.
    pub(crate) name: PhotoName,
    /// Digest of the file and of its reading rule.
    pub(crate) digest: Digest,
    /// Changes that reading the file makes besides decoding its codes.
    pub(crate) note: InputNote,
    /// Exposure drop stated in the data set, in EV; `None` if unknown.
    pub(crate) stated: Option<f64>,
    /// How dark the photograph is; `None` before it is measured. No store key depends on it.
    pub(crate) facts: Option<PairFacts>,
}

impl SourcePhotograph {
    /// Measures how dark the photograph (`low`) is compared with its frame (`normal`).
    pub(crate) fn measure(&self, normal: &Rgb, low: &Rgb) -> PairFacts {
        let measured = PairEv::measure(normal, low);
        PairFacts {
            stated: self.stated,
            mean: measured.map(|ev| ev.mean),
            median: measured.and_then(|ev| ev.median),
            synthesis: measured.map(|ev| ev.synthesis),
        }
    }
}

/// The degradation of this kind that is as dark as the first of these photographs, rounded to a hundredth of an EV;
/// `None` if the exposure drop is unknown or cannot be synthesised.
pub(crate) fn matching_degradation(
    photos: &[SourcePhotograph],
    kind: Kind,
    reading: Option<&ProfileName>,
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
