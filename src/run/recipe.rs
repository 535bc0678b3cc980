//! What decides the pixels that are sent, as a digest.

use serde_json::json;

use crate::ask::Format;
use crate::config::{Images, Sensor};
use crate::enhance::{self, ModelFile};
use crate::synthesis::{self, Synthesis};
use crate::types::{Condition, Degradation, Digest, EnhancerName, FrameId};

/// Everything but the frame and the condition that decides an image.
#[derive(Debug)]
pub(super) struct Recipe {
    pub(super) seed: u64,
    pub(super) synthesis: Synthesis,
    pub(super) format: Format,
    pub(super) max_side: Option<std::num::NonZeroU32>,
    pub(super) enhancers: Vec<(EnhancerName, Digest)>,
}

impl Recipe {
    pub(super) fn new(sensor: &Sensor, images: &Images, files: &[ModelFile]) -> Self {
        let enhancers = files.iter();
        Self {
            seed: sensor.seed,
            synthesis: sensor.synthesis.clone(),
            format: images.format,
            max_side: images.max_side,
            enhancers: enhancers
                .map(|file| (file.name().clone(), file.digest()))
                .collect(),
        }
    }

    /// The digest of everything that decides the image of a frame in a condition, and of nothing else: a run with another
    /// seed has other noise, but the same untouched frames and exposure drops.
    pub(super) fn digest(
        &self,
        frame: &FrameId,
        picture: &Digest,
        condition: &Condition,
    ) -> Digest {
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
        let sent = format!("{} {:?}", self.format, self.max_side);
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
