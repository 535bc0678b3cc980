//! The file beside an image that holds all that made it: [`Sidecar`].

use std::fs;
use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::config::Light;
use crate::dataset::Picture;
use crate::error::{Error, Result};
use crate::synthesis::noise::Term;
use crate::synthesis::{
    self, Amplify, CameraState, Coupling, Draws, Negative, NoiseKey, Tone, expose, exposure,
};
use crate::types::{Degradation, FrameId, Rgb};

/// The schema of these files.
const SCHEMA: &str = "darkqa.image/1";

/// All that made an image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Sidecar {
    schema: String,
    /// The version of this program, for the reader: [`Self::synthesis`] decides.
    darkqa_eval: String,
    frame: String,
    /// The content of the image that it was made from.
    source: String,
    condition: String,
    /// The exposure drop in EV.
    drop: f32,
    /// The version of the branch of the synthesis.
    synthesis: u32,
    sensor: Option<Sensor>,
}

/// What the sensor branch took.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Sensor {
    seed: u64,
    amplify: Amplify,
    tone: Tone,
    draws: Draws,
    coupling: Coupling,
    /// The distribution that the state was drawn from.
    model: Value,
    state: CameraState,
}

impl Sidecar {
    pub(super) fn new(
        frame: &FrameId,
        picture: &Picture,
        degradation: Degradation,
        light: &Light,
        key: &NoiseKey,
    ) -> Self {
        let synthesis = &light.sensor.synthesis;
        let sensor = match degradation {
            Degradation::Sensor(level) => Some(Sensor {
                seed: light.sensor.seed,
                amplify: synthesis.amplify,
                tone: synthesis.tone,
                draws: synthesis.draws,
                coupling: synthesis.coupling,
                model: serde_json::json!(synthesis.camera),
                state: synthesis.state(key, level),
            }),
            _ => None,
        };
        Self {
            schema: SCHEMA.to_owned(),
            darkqa_eval: env!("CARGO_PKG_VERSION").to_owned(),
            frame: frame.0.clone(),
            source: picture.digest().to_string(),
            condition: degradation.to_string(),
            drop: degradation.level().exposure_drop().0,
            synthesis: version(degradation),
            sensor,
        }
    }

    pub(super) fn read(path: &Path) -> Result<Self> {
        let text = fs::read_to_string(path).map_err(|e| Error::file(path, "read", e))?;
        let read: Self = serde_json::from_str(&text)
            .map_err(|e| Error::data(path.display(), format_args!("tells of no image: {e}")))?;
        if read.schema != SCHEMA {
            let problem = format_args!("of the form {:?}; {SCHEMA:?} expected", read.schema);
            return Err(Error::data(path.display(), problem));
        }
        Ok(read)
    }

    /// Whether the file at `path` tells of the same image, whatever program version wrote it.
    pub(super) fn is_at(&self, path: &Path) -> Result<bool> {
        let there = Self::read(path)?;
        Ok(Self {
            darkqa_eval: there.darkqa_eval.clone(),
            ..self.clone()
        } == there)
    }

    pub(super) fn text(&self) -> String {
        format!("{:#}\n", serde_json::json!(self))
    }

    pub(super) fn frame(&self) -> FrameId {
        FrameId(self.frame.clone())
    }

    /// The name of the image file.
    pub(super) fn name(&self, stem: &str) -> String {
        format!("{stem}_{}.png", self.condition)
    }

    /// Makes the image again from the picture that it was made from.
    ///
    /// # Errors
    /// Where the picture is another one, or this program's synthesis is not that which made it.
    pub(super) fn replay(&self, picture: &Picture, path: &Path) -> Result<Rgb> {
        let wrong = |problem: String| Error::data(path.display(), problem);
        let degradation: Degradation = self
            .condition
            .parse()
            .map_err(|e: Error| e.at(path.display().to_string()))?;
        if self.source != picture.digest().to_string() {
            let problem = "made from another image than INPUT (their contents differ)";
            return Err(wrong(problem.to_owned()));
        }
        if self.synthesis != version(degradation) {
            return Err(wrong(format!(
                "made by synthesis {} of darkqa-eval {}; this one has synthesis {}",
                self.synthesis,
                self.darkqa_eval,
                version(degradation)
            )));
        }
        let clean = picture.decode()?;
        Ok(match (degradation, &self.sensor) {
            (Degradation::None, _) => clean,
            (Degradation::Exposure(level), _) => expose(&clean, level),
            (Degradation::Sensor(level), Some(sensor)) => {
                let frame = NoiseKey::new(sensor.seed, &self.frame());
                let key = match sensor.draws {
                    Draws::Shared => frame,
                    Draws::Fresh => frame.at(level),
                };
                let Sensor { amplify, tone, .. } = *sensor;
                let state = sensor.state.clone();
                Negative::taken(&clean, &key, state, amplify, tone, &Term::ALL).develop(level)
            }
            (Degradation::Sensor(_), None) => {
                return Err(wrong("the sensor's state is missing".to_owned()));
            }
        })
    }
}

/// The version of the branch that makes a degradation.
fn version(degradation: Degradation) -> u32 {
    match degradation {
        Degradation::Sensor(_) => synthesis::VERSION,
        Degradation::None | Degradation::Exposure(_) => exposure::VERSION,
    }
}
