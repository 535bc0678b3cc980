//! One frame under several degradations: [`Film`].

use super::exposure::expose;
use super::negative::Negative;
use super::profile::Synthesis;
use super::random::NoiseKey;
use crate::types::{Degradation, Rgb};

/// The film in a camera: it keeps the last [`Negative`] of a frame, which the levels that it serves are developed from.
#[derive(Debug, Default)]
pub struct Film(Option<Negative>);

impl Film {
    /// The frame under a degradation, as [`degrade`](super::degrade) gives it; a film takes the same frame by the same key each time.
    #[must_use]
    pub fn degrade(
        &mut self,
        clean: &Rgb,
        how: Degradation,
        key: &NoiseKey,
        synthesis: &Synthesis,
    ) -> Rgb {
        match how {
            Degradation::None => clean.clone(),
            Degradation::Exposure(level) => expose(clean, level),
            Degradation::Sensor(level) => {
                let kept = self.0.take().filter(|kept| kept.serves(level));
                let negative = kept.unwrap_or_else(|| Negative::new(clean, key, synthesis, level));
                self.0.insert(negative).develop(level)
            }
        }
    }
}
