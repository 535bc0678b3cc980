//! What decides the pixels that are sent, as a digest.

use std::num::NonZeroU32;

use serde::Serialize;

use crate::ask::Format;
use crate::config::{Images, Sensor};
use crate::enhance::{self, ModelFile};
use crate::error::Result;
use crate::synthesis::{self, Readings, Synthesis};
use crate::types::degradation::Kind;
use crate::types::{Condition, Digest, EnhancerName, FrameId, Severity};

/// Everything but the frame and the condition that decides an image.
#[derive(Debug)]
pub(super) struct Recipe {
    pub(super) seed: u64,
    pub(super) readings: Readings,
    pub(super) format: Format,
    pub(super) max_side: Option<NonZeroU32>,
    pub(super) enhancers: Vec<(EnhancerName, Digest)>,
}

impl Recipe {
    pub(super) fn new(sensor: &Sensor, images: &Images, files: &[ModelFile]) -> Self {
        let enhancers = files.iter();
        Self {
            seed: sensor.seed,
            readings: sensor.readings.clone(),
            format: images.format,
            max_side: images.max_side,
            enhancers: enhancers
                .map(|file| (file.name().clone(), file.digest()))
                .collect(),
        }
    }

    /// The digest of everything that decides the image of a frame in a condition, and of nothing else: a run with another
    /// seed has other noise, but the same untouched frames and exposure drops.
    ///
    /// # Errors
    /// If the condition has a reading that the recipe lacks.
    pub(super) fn digest(
        &self,
        frame: &FrameId,
        picture: &Digest,
        condition: &Condition,
    ) -> Result<Digest> {
        let how = condition.degradation.as_ref();
        let degradation = how.map(|how| {
            let kind = how.kind();
            let random = synthesis::is_random(kind);
            Ok(DegradationFacts {
                kind,
                severity: how.severity(),
                version: synthesis::version(kind),
                reading: how
                    .reading()
                    .map(|_| self.readings.of(Some(how)))
                    .transpose()?,
                seed: random.then_some(self.seed),
                frame: random.then_some(frame),
            })
        });
        let enhancer = condition.enhancer.as_ref();
        let enhancer =
            enhancer.and_then(|name| self.enhancers.iter().find(|(known, _)| known == name));
        let facts = ImageFacts {
            picture: *picture,
            degradation: degradation.transpose()?,
            enhancer: enhancer.map(|(_, digest)| EnhancerFacts {
                digest: *digest,
                version: enhance::VERSION,
            }),
            format: self.format.to_string(),
            max_side: self.max_side,
        };
        Digest::canonical("darkqa.image/2", &facts)
    }
}

/// What decides an image.
#[derive(Serialize)]
struct ImageFacts<'a> {
    picture: Digest,
    degradation: Option<DegradationFacts<'a>>,
    enhancer: Option<EnhancerFacts>,
    format: String,
    max_side: Option<NonZeroU32>,
}

/// What decides a degraded frame beside the frame's content; seed and frame only if the kind draws random numbers.
#[derive(Serialize)]
struct DegradationFacts<'a> {
    kind: Kind,
    severity: Severity,
    version: u32,
    reading: Option<&'a Synthesis>,
    seed: Option<u64>,
    frame: Option<&'a FrameId>,
}

#[derive(Serialize)]
struct EnhancerFacts {
    digest: Digest,
    version: u32,
}
