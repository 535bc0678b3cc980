//! One frame under several degradations: [`Exposures`].

use std::collections::BTreeMap;

use super::exposure::expose;
use super::negative::Negative;
use super::random::NoiseKey;
use super::reading::Synthesis;
use crate::types::degradation::Kind;
use crate::types::{Degradation, ReadingName, Rgb};

/// The degraded images of one frame, with a cache of one [`Negative`] for each light reading.
#[derive(Debug, Default)]
pub struct Exposures(BTreeMap<ReadingName, Negative>);

impl Exposures {
    /// The frame after a degradation, as [`degrade`](super::degrade) gives it. `synthesis` is the content of the
    /// degradation's light reading. Frame, key and contents must be the same in each call.
    #[must_use]
    pub fn degrade(
        &mut self,
        clean: &Rgb,
        degradation: Option<&Degradation>,
        key: &NoiseKey,
        synthesis: &Synthesis,
    ) -> Rgb {
        let Some(degradation) = degradation else {
            return clean.clone();
        };
        let severity = degradation.severity();
        match degradation.kind() {
            Kind::Exposure => expose(clean, severity),
            Kind::Sensor => {
                let reading = degradation.reading().cloned().unwrap_or(ReadingName::PAPER);
                let cached = self.0.remove(&reading);
                let cached = cached.filter(|negative| negative.serves(severity));
                let negative =
                    cached.unwrap_or_else(|| Negative::new(clean, key, synthesis, severity));
                let degraded = negative.develop(severity);
                self.0.insert(reading, negative);
                degraded
            }
        }
    }
}

/// Version of a kind of degradation, raised whenever one of its pixels changes, so that results of an older version are
/// not reused.
#[must_use]
pub(crate) fn version(kind: Kind) -> u32 {
    match kind {
        Kind::Exposure => super::exposure::VERSION,
        Kind::Sensor => super::VERSION,
    }
}

/// Whether a kind draws random numbers, so that the pixels depend on seed and frame name too.
#[must_use]
pub(crate) fn is_random(kind: Kind) -> bool {
    match kind {
        Kind::Exposure => false,
        Kind::Sensor => true,
    }
}
