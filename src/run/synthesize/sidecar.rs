//! Everything needed to make an image again, as the JSON file beside it holds it: [`ImageRecipe`].

use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::placed::{ImageOrigin, Sidecar};
use crate::dataset::Picture;
use crate::error::{Error, Result};
use crate::synthesis::LightSettings;
use crate::synthesis::noise::Term;
use crate::synthesis::{
    self, Amplify, CameraState, Coupling, Draws, Negative, NoiseKey, Synthesis, Tone, degrade,
    exposure,
};
use crate::types::{Condition, Degradation, FrameId, ReadingName, Rgb};

/// Everything that decides the pixels of an image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct ImageRecipe {
    frame: String,
    /// The digest of the image that this one was made from.
    source: String,
    condition: Condition,
    /// The exposure drop in EV.
    drop: f64,
    /// The version of the synthesis branch (exposure or sensor) that made the image.
    synthesis: u32,
    sensor: Option<SensorRecord>,
}

/// The inputs of the sensor branch.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct SensorRecord {
    seed: u64,
    /// The light reading, as defined by the fields below.
    #[serde(default = "paper")]
    reading: ReadingName,
    amplify: Amplify,
    tone: Tone,
    draws: Draws,
    coupling: Coupling,
    /// The distribution that the state was drawn from.
    model: Value,
    state: CameraState,
}

impl ImageOrigin for ImageRecipe {
    // The first schema had no digest of the image.
    const SCHEMAS: &'static [&'static str] = &["darkqa.image/2", "darkqa.image/1"];
    const IS_REPLACED: bool = false;
}

impl ImageRecipe {
    pub(super) fn new(
        frame: &FrameId,
        picture: &Picture,
        how: Option<&Degradation>,
        light: &LightSettings,
        key: &NoiseKey,
    ) -> Result<Self> {
        let synthesis = light.sensor.readings.of(how)?;
        let sensor = how.and_then(|how| {
            Some(SensorRecord {
                seed: light.sensor.seed,
                reading: how.reading()?.clone(),
                amplify: synthesis.amplify,
                tone: synthesis.tone,
                draws: synthesis.draws,
                coupling: synthesis.coupling,
                model: serde_json::json!(synthesis.camera),
                state: synthesis.state(key, how.severity()),
            })
        });
        Ok(Self {
            frame: frame.0.clone(),
            source: picture.digest().to_string(),
            condition: Condition::raw(how.cloned()),
            drop: how.map_or(0.0, |how| how.severity().value()),
            synthesis: version(how),
            sensor,
        })
    }

    pub(super) fn frame(&self) -> FrameId {
        FrameId(self.frame.clone())
    }

    /// The name of the image file without its ending.
    pub(super) fn name(&self, stem: &str) -> String {
        format!("{stem}_{}", self.condition)
    }

    /// The image of the JSON file at `path`, made again from the same picture.
    ///
    /// # Errors
    /// If the picture has other content, or the synthesis of this program has another version.
    pub(super) fn replay(file: &Sidecar<Self>, picture: &Picture, path: &Path) -> Result<Rgb> {
        file.recipe.image(picture, file.program(), path)
    }

    fn image(&self, picture: &Picture, program: &str, path: &Path) -> Result<Rgb> {
        let wrong = |problem: String| Error::data(path.display(), problem);
        let how = self.condition.degradation.as_ref();
        if self.source != picture.digest().to_string() {
            let problem = "made from another image than INPUT (their contents differ)";
            return Err(wrong(problem.to_owned()));
        }
        if self.synthesis != version(how) {
            return Err(wrong(format!(
                "made by synthesis {} of darkqa-eval {}; this program has synthesis {}",
                self.synthesis,
                program,
                version(how)
            )));
        }
        let clean = picture.decode()?;
        let (severity, sensor) = match (how, &self.sensor) {
            (None, _) => return Ok(clean),
            (Some(how), Some(sensor)) => (how.severity(), sensor),
            (Some(how), None) if how.reading().is_some() => {
                return Err(wrong("the state of the sensor is missing".to_owned()));
            }
            (how, None) => {
                let key = NoiseKey::new(0, &self.frame());
                return Ok(degrade(&clean, how, &key, &Synthesis::default()));
            }
        };
        let frame = NoiseKey::new(sensor.seed, &self.frame());
        let key = match sensor.draws {
            Draws::Shared => frame,
            Draws::Fresh => frame.at(severity),
        };
        let SensorRecord { amplify, tone, .. } = *sensor;
        let state = sensor.state.clone();
        let negative = Negative::with_state(&clean, &key, &state, amplify, tone, &Term::ALL);
        Ok(negative.develop(severity))
    }
}

/// The light reading of files that do not name one.
fn paper() -> ReadingName {
    ReadingName::PAPER
}

/// The version of the branch that makes a degradation. A clean frame has the version of the exposure branch.
fn version(how: Option<&Degradation>) -> u32 {
    how.map_or(exposure::VERSION, |how| synthesis::version(how.kind()))
}
