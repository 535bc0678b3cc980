//! What decides the pixels that are sent: [`Recipe`].

use std::num::NonZeroU32;

use serde_json::json;

use super::source::Source;
use crate::ask::{Format, Payload, bilinear};
use crate::config::{CameraOf, Darkened, Images, Sensor, Walk};
use crate::enhance::{self, ModelFile};
use crate::synthesis::{self, NoiseKey, Synthesis};
use crate::types::{Condition, Degradation, Digest, EnhancerName, FrameId};

/// In what size an image is sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Scaling {
    /// In its own.
    Never,
    /// Made smaller if a side is longer than this, in pixels.
    MaxSide(NonZeroU32),
    /// Made larger or smaller, until its longer side has this length in pixels.
    LongerSide(usize),
}

impl Scaling {
    /// The width and height in which an image of this size is sent.
    pub(crate) fn of(self, (width, height): (u32, u32)) -> (usize, usize) {
        match self {
            Self::Never => (width as usize, height as usize),
            Self::MaxSide(side) => {
                let (width, height) = Payload::fitted(width, height, Some(side));
                (width as usize, height as usize)
            }
            Self::LongerSide(side) => {
                let [height, width] = bilinear::size(height as usize, width as usize, side);
                (width, height)
            }
        }
    }
}

/// Everything but the frame and the condition that decides an image.
#[derive(Debug)]
pub(crate) struct Recipe {
    pub(crate) seed: u64,
    pub(crate) synthesis: Synthesis,
    pub(crate) format: Format,
    pub(crate) scaling: Scaling,
    /// Whether light is reduced before or after scaling.
    pub(crate) scaled: Darkened,
    /// What one state of the camera takes.
    pub(crate) camera_of: CameraOf,
    pub(crate) enhancers: Vec<(EnhancerName, Digest)>,
}

impl Recipe {
    pub(crate) fn new(sensor: &Sensor, images: &Images, files: &[ModelFile]) -> Self {
        Self {
            format: images.format,
            scaling: images.max_side.map_or(Scaling::Never, Scaling::MaxSide),
            ..Self::lossless(sensor, files)
        }
    }

    /// The recipe for images of every pixel, each in its own size.
    pub(crate) fn lossless(sensor: &Sensor, files: &[ModelFile]) -> Self {
        let enhancers = files.iter();
        Self {
            seed: sensor.seed,
            synthesis: sensor.synthesis.clone(),
            format: Format::Png,
            scaling: Scaling::Never,
            scaled: Darkened::Native,
            camera_of: CameraOf::Frame,
            enhancers: enhancers
                .map(|file| (file.name().clone(), file.digest()))
                .collect(),
        }
    }

    /// The recipe for frames of walks.
    pub(crate) fn of_walks(self, walk: &Walk) -> Self {
        Self {
            scaling: walk.side.map_or(Scaling::Never, Scaling::LongerSide),
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
            CameraOf::Episode => own.taken_on(&NoiseKey::new(self.seed, &source.name)),
        }
    }

    /// The digest of everything that decides the images of a source in a condition.
    pub(crate) fn stimulus(&self, source: &Source, condition: &Condition) -> Digest {
        let images: Vec<Digest> = source
            .frames
            .iter()
            .map(|frame| self.digest(&frame.id, &frame.digest, condition))
            .collect();
        let shown = source.order.iter().map(|place| images[*place].to_string());
        let shown: Vec<String> = shown.collect();
        Digest::of_parts(shown.iter().map(String::as_bytes))
    }

    /// The digest of everything that decides the image of a frame in a condition, and of nothing else: a run with another
    /// seed has other noise, but the same untouched frames and exposure drops.
    fn digest(&self, frame: &FrameId, picture: &Digest, condition: &Condition) -> Digest {
        let light = match condition.degradation {
            Degradation::None => "untouched".to_owned(),
            Degradation::Exposure(_) => format!("synthesis {}", synthesis::exposure::VERSION),
            Degradation::Sensor(_) => {
                format!(
                    "synthesis {} seed {} frame {} {}",
                    synthesis::VERSION,
                    self.seed,
                    frame,
                    json!(self.synthesis)
                )
            }
        };
        let mended = condition
            .enhancer
            .as_ref()
            .and_then(|name| self.enhancers.iter().find(|(known, _)| known == name));
        let mended = mended.map_or("raw".to_owned(), |(_, digest)| {
            format!("enhance {} {digest}", enhance::VERSION)
        });
        let sent = format!(
            "{} {:?} {} {}",
            self.format, self.scaling, self.scaled, self.camera_of
        );
        let parts = [
            picture.to_string(),
            condition.degradation.to_string(),
            light,
            mended,
            sent,
        ];
        Digest::of_parts(parts.iter().map(String::as_bytes))
    }
}
