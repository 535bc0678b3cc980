//! One frame under several degradations: [`Exposures`].

use std::collections::BTreeMap;

use super::exposure::expose;
use super::negative::Negative;
use super::random::NoiseKey;
use super::reading::Synthesis;
use crate::types::degradation::Kind;
use crate::types::{Degradation, ReadingName, Rgb};

/// Makes the degraded images of one frame, and keeps the [`Negative`] of each light reading for the levels that it serves.
#[derive(Debug, Default)]
pub struct Exposures(BTreeMap<ReadingName, Negative>);

impl Exposures {
    /// The frame under a degradation, as [`degrade`](super::degrade) gives it. `synthesis` is the content of the
    /// degradation's reading; frame, key and contents must be the same in each call.
    #[must_use]
    pub fn degrade(
        &mut self,
        clean: &Rgb,
        how: Option<&Degradation>,
        key: &NoiseKey,
        synthesis: &Synthesis,
    ) -> Rgb {
        let Some(how) = how else {
            return clean.clone();
        };
        let severity = how.severity();
        match how.kind() {
            Kind::Exposure => expose(clean, severity),
            Kind::Sensor => {
                let reading = how.reading().cloned().unwrap_or(ReadingName::PAPER);
                let kept = self.0.remove(&reading);
                let kept = kept.filter(|kept| kept.serves(severity));
                let negative =
                    kept.unwrap_or_else(|| Negative::new(clean, key, synthesis, severity));
                let dark = negative.develop(severity);
                self.0.insert(reading, negative);
                dark
            }
        }
    }
}

/// The version of a kind: raised whenever one of its pixels changes, so that no result of an older one is taken for its
/// own.
#[must_use]
pub(crate) fn version(kind: Kind) -> u32 {
    match kind {
        Kind::Exposure => super::exposure::VERSION,
        Kind::Sensor => super::VERSION,
    }
}

/// Whether random numbers enter, so that seed and frame decide the pixels too.
#[must_use]
pub(crate) fn is_random(kind: Kind) -> bool {
    match kind {
        Kind::Exposure => false,
        Kind::Sensor => true,
    }
}
