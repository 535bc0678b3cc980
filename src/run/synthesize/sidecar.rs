//! The JSON file of an image with everything needed to make it again: [`ImageSidecar`].

use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::dataset::Picture;
use crate::error::{Error, Result};
use crate::files::reading;
use crate::synthesis::LightSettings;
use crate::synthesis::noise::Term;
use crate::synthesis::{
    self, Amplify, CameraState, Coupling, Draws, Negative, NoiseKey, Synthesis, Tone, degrade,
    exposure,
};
use crate::types::{Condition, Degradation, FrameId, ReadingName, Rgb};

/// The value of `schema` in these files.
const SCHEMA: &str = "darkqa.image/1";

/// Everything that decides the pixels of an image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct ImageSidecar {
    schema: String,
    /// The version of this program, for information only; [`Self::synthesis`] is what is checked.
    darkqa_eval: String,
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

impl ImageSidecar {
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
            schema: SCHEMA.to_owned(),
            darkqa_eval: env!("CARGO_PKG_VERSION").to_owned(),
            frame: frame.0.clone(),
            source: picture.digest().to_string(),
            condition: Condition::raw(how.cloned()),
            drop: how.map_or(0.0, |how| how.severity().value()),
            synthesis: version(how),
            sensor,
        })
    }

    pub(super) fn read(path: &Path) -> Result<Self> {
        let text = reading::text(path)?;
        let read: Self = serde_json::from_str(&text).map_err(|e| {
            Error::data(
                path.display(),
                format_args!("not a JSON file of an image: {e}"),
            )
        })?;
        if read.schema != SCHEMA {
            let problem = format_args!("schema {:?}; {SCHEMA:?} expected", read.schema);
            return Err(Error::data(path.display(), problem));
        }
        Ok(read)
    }

    /// Whether the file at `path` describes the same image, even if another program version wrote it.
    pub(super) fn is_at(&self, path: &Path) -> Result<bool> {
        let stored = Self::read(path)?;
        Ok(Self {
            darkqa_eval: stored.darkqa_eval.clone(),
            ..self.clone()
        } == stored)
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

    /// The image, made again from the same picture.
    ///
    /// # Errors
    /// If the picture has other content, or the synthesis of this program has another version.
    pub(super) fn replay(&self, picture: &Picture, path: &Path) -> Result<Rgb> {
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
                self.darkqa_eval,
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
