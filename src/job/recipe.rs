//! What decides the pixels that are sent: [`Recipe`].

use std::num::NonZeroU32;

use serde::Serialize;

use super::scaling::Scaling;
use super::source::{Source, SourceFrame};
use super::walk::{CameraOf, DegradedAt, Walk};
use crate::ask::PayloadFormat;
use crate::enhance::{self, ModelFile};
use crate::error::Result;
use crate::synthesis::{self, NoiseKey, Readings, SensorSettings, Synthesis};
use crate::types::degradation::Kind;
use crate::types::{Condition, Digest, EnhancerName, FrameId, Severity};

/// Everything but the frame and the condition that decides an image.
#[derive(Debug)]
pub(crate) struct Recipe {
    pub(crate) seed: u64,
    pub(crate) readings: Readings,
    pub(crate) format: PayloadFormat,
    pub(crate) scaling: Scaling,
    /// Whether light is reduced before or after scaling.
    pub(crate) scaled: DegradedAt,
    /// What one state of the camera takes.
    pub(crate) camera_of: CameraOf,
    pub(crate) enhancers: Vec<(EnhancerName, Digest)>,
}

impl Recipe {
    pub(crate) fn new(
        sensor: &SensorSettings,
        format: PayloadFormat,
        max_side: Option<NonZeroU32>,
        files: &[ModelFile],
    ) -> Self {
        Self {
            format,
            scaling: max_side.map_or(Scaling::Never, Scaling::MaxSide),
            ..Self::lossless(sensor, files)
        }
    }

    /// The recipe for images of every pixel, each in its own size.
    pub(crate) fn lossless(sensor: &SensorSettings, files: &[ModelFile]) -> Self {
        let enhancers = files.iter();
        Self {
            seed: sensor.seed,
            readings: sensor.readings.clone(),
            format: PayloadFormat::Png,
            scaling: Scaling::Never,
            scaled: DegradedAt::Native,
            camera_of: CameraOf::Frame,
            enhancers: enhancers
                .map(|file| (file.name().clone(), file.digest()))
                .collect(),
        }
    }

    /// The recipe for frames of walks.
    pub(crate) fn of_walks(self, walk: &Walk) -> Self {
        Self {
            scaling: walk.side,
            scaled: walk.darkened,
            camera_of: walk.camera,
            ..self
        }
    }

    /// What the noise of a frame is drawn from.
    pub(crate) fn noise(&self, source: &Source, frame: &FrameId) -> NoiseKey {
        let own = NoiseKey::new(self.seed, frame);
        match self.camera_of {
            CameraOf::Frame => own,
            CameraOf::Episode => own.with_camera_of(&NoiseKey::new(self.seed, &source.name)),
        }
    }

    /// The digest of everything that decides the images of a source in a condition, and of nothing else: a run with another seed has
    /// other noise, but the same untouched frames and exposure drops.
    ///
    /// # Errors
    /// If the condition has a reading that the recipe lacks.
    pub(crate) fn stimulus(&self, source: &Source, condition: &Condition) -> Result<Digest> {
        let images: Vec<ImageKeyFacts<'_>> = source
            .frames
            .iter()
            .map(|frame| self.facts(source, frame, condition))
            .collect::<Result<_>>()?;
        let shown: Vec<&ImageKeyFacts<'_>> =
            source.order.iter().map(|place| &images[*place]).collect();
        Digest::canonical("darkqa.images/2", &shown)
    }

    fn facts<'a>(
        &'a self,
        source: &'a Source,
        frame: &'a SourceFrame,
        condition: &Condition,
    ) -> Result<ImageKeyFacts<'a>> {
        let how = condition.degradation.as_ref();
        let degradation = how.map(|how| {
            let kind = how.kind();
            let random = synthesis::is_random(kind);
            let of_source = random && self.camera_of == CameraOf::Episode;
            Ok(DegradationFacts {
                kind,
                severity: how.severity(),
                version: synthesis::version(kind),
                reading: how
                    .reading()
                    .map(|_| self.readings.of(Some(how)))
                    .transpose()?,
                seed: random.then_some(self.seed),
                frame: random.then_some(&frame.id),
                camera_of: of_source.then_some(&source.name),
            })
        });
        let enhancer = condition.enhancer.as_ref();
        let enhancer =
            enhancer.and_then(|name| self.enhancers.iter().find(|(known, _)| known == name));
        Ok(ImageKeyFacts {
            picture: frame.digest,
            degradation: degradation.transpose()?,
            enhancer: enhancer.map(|(_, digest)| EnhancerFacts {
                digest: *digest,
                version: enhance::VERSION,
            }),
            format: self.format.to_string(),
            scaling: self.scaling,
            scaled_before: (self.scaled == DegradedAt::Resized).then_some(true),
        })
    }
}

/// What decides an image.
#[derive(Serialize)]
struct ImageKeyFacts<'a> {
    picture: Digest,
    degradation: Option<DegradationFacts<'a>>,
    enhancer: Option<EnhancerFacts>,
    format: String,
    scaling: Scaling,
    /// Whether it was scaled before its light was reduced.
    scaled_before: Option<bool>,
}

/// What decides a degraded frame besides the frame's content; seed and frame only if the kind draws random numbers.
#[derive(Serialize)]
struct DegradationFacts<'a> {
    kind: Kind,
    severity: Severity,
    version: u32,
    reading: Option<&'a Synthesis>,
    seed: Option<u64>,
    frame: Option<&'a FrameId>,
    /// The source whose frames one state of the camera takes.
    camera_of: Option<&'a FrameId>,
}

#[derive(Serialize)]
struct EnhancerFacts {
    digest: Digest,
    version: u32,
}
