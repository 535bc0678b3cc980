//! Everything needed to make an image again, as the JSON file beside it holds it: [`ImageRecipe`].

use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::dataset::Picture;
use crate::error::{Error, Result};
use crate::images::stored::{ImageOrigin, Sidecar, differing};
use crate::types::degradations::{Axis, Kind};
use crate::types::{
    Condition, Degradation, Digest, ExposureFacts, FrameId, InputNote, ReadingName, Rgb,
};
use darkqa_light::movement::blur::{blur, blurred_codes};
use darkqa_light::{
    self, Amplify, AppliedDegradation, CameraState, Clean, Coupling, Draws, NoiseKey, Streak, Tone,
    develop_with_state, expose, exposure,
};

/// Everything that decides the pixels of an image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct ImageRecipe {
    frame: String,
    /// The digest of the image that this one was made from.
    source: String,
    /// Changes that reading the file made besides decoding its codes; no fields without changes.
    #[serde(flatten)]
    read: InputNote,
    condition: Condition,
    /// The exposure drop in EV.
    drop: f64,
    /// The version of the kind of degradation that made the image.
    synthesis: u32,
    sensor: Option<SensorRecord>,
    /// The camera's exposure; not in the file for kinds that leave it open.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    exposure: Option<ExposureFacts>,
}

/// The inputs of the sensor branch; those of automatic exposure are the noise profile `physical` at its own gain.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct SensorRecord {
    seed: u64,
    /// The noise profile, as defined by the fields below.
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

    fn difference(&self, wanted: &Self) -> String {
        let pair = self.sensor.as_ref().zip(wanted.sensor.as_ref());
        let settings = pair.map_or_else(Vec::new, |(had, wanted)| had.differences(wanted));
        let version = (self.synthesis != wanted.synthesis)
            .then(|| format!("synthesis {}, now {}", self.synthesis, wanted.synthesis));
        let settings: Vec<String> = version.into_iter().chain(settings).collect();
        match (self.source == wanted.source, &settings[..]) {
            (true, []) => {
                let fields = differing(&json!(self), &json!(wanted));
                format!("made with other settings ({})", fields.join(", "))
            }
            (true, settings) => format!("made with {}", settings.join("; ")),
            (false, []) => "made from another image".to_owned(),
            (false, settings) => format!("made from another image, with {}", settings.join("; ")),
        }
    }
}

impl SensorRecord {
    /// The flags that differ, with both values. What follows from others is left out: the state is drawn by the seed, and a noise profile
    /// stands for its choices.
    fn differences(&self, wanted: &Self) -> Vec<String> {
        let mut differences = Vec::new();
        let mut compare = |flag: &str, had: Value, wanted: Value| {
            if had != wanted {
                let [had, wanted] = [had, wanted].map(|value| match value {
                    Value::String(text) => text,
                    other => other.to_string(),
                });
                differences.push(format!("{flag} {had}, now {wanted}"));
            }
        };
        compare("--seed", json!(self.seed), json!(wanted.seed));
        compare("--profile", json!(self.reading), json!(wanted.reading));
        if self.reading == wanted.reading {
            compare(
                "--noise amplify",
                json!(self.amplify),
                json!(wanted.amplify),
            );
            compare("--noise tone", json!(self.tone), json!(wanted.tone));
            compare("--noise draws", json!(self.draws), json!(wanted.draws));
            compare(
                "--noise coupling",
                json!(self.coupling),
                json!(wanted.coupling),
            );
        }
        if self.model != wanted.model {
            differences.push("another --noise camera, gain, ratio or fixed".to_owned());
        }
        differences
    }
}

impl ImageRecipe {
    /// The recipe of an image of a frame, whose file has this digest and was read so; `how` and `applied` are both `None` for the clean
    /// frame.
    pub(crate) fn new(
        frame: &FrameId,
        (source, read): (Digest, InputNote),
        how: Option<&Degradation>,
        applied: Option<&AppliedDegradation>,
        key: &NoiseKey,
        seed: u64,
    ) -> Self {
        let drop = how
            .filter(|how| how.kind().axis() == Axis::LIGHT)
            .map_or(0.0, |how| how.severity().value());
        let sensor = applied.and_then(|applied| {
            let synthesis = applied.synthesis()?;
            let named = how.and_then(Degradation::reading).cloned();
            Some(SensorRecord {
                seed,
                reading: named.unwrap_or_else(|| synthesis.name()),
                amplify: synthesis.amplify,
                tone: synthesis.tone,
                draws: synthesis.draws,
                coupling: synthesis.coupling,
                model: json!(synthesis.camera),
                state: synthesis.state_by(key, applied.drop_ev()),
            })
        });
        Self {
            frame: frame.0.clone(),
            source: source.to_string(),
            read,
            condition: Condition::raw(how.cloned()),
            drop,
            synthesis: version(how),
            sensor,
            exposure: applied.and_then(AppliedDegradation::exposure),
        }
    }

    pub(crate) fn frame(&self) -> FrameId {
        FrameId(self.frame.clone())
    }

    /// The name of the image file without its ending.
    pub(crate) fn name(&self, stem: &str) -> String {
        format!("{stem}_{}", self.condition)
    }

    /// The image of the JSON file at `path`, made again from the same picture.
    ///
    /// # Errors
    /// If the picture has other content, or the synthesis of this program has another version.
    pub(crate) fn replay(file: &Sidecar<Self>, picture: &Picture, path: &Path) -> Result<Rgb> {
        file.recipe.image(picture, file.program(), path)
    }

    fn image(&self, picture: &Picture, program: &str, path: &Path) -> Result<Rgb> {
        let wrong = |problem: String| Error::data(path.display(), problem);
        let how = self.condition.degradation();
        if self.source != picture.digest().to_string() {
            let problem = "made from another image than INPUT (their contents differ, or the flags by which they are read)";
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
        let clean = picture.pixels()?;
        let missing = |what: &str| wrong(format!("{what} is missing"));
        let Some(how) = how else {
            return Ok(Rgb::clone(&clean.codes()));
        };
        let (severity, kind) = (how.severity(), how.kind());
        if kind == Kind::Exposure {
            return Ok(expose(&clean, severity));
        }
        let exposure = self.exposure.filter(|_| kind.has_motion());
        let path = exposure.and_then(|exposure| exposure.blur_px.zip(exposure.blur_angle));
        let streak = match path {
            Some((length, angle)) => Streak::new(length, angle)?,
            None if kind.has_motion() => return Err(missing("the motion blur")),
            None => Streak::STILL,
        };
        let clean = Clean::from(&clean);
        if !kind.has_noise() {
            return Ok(blurred_codes(clean, streak));
        }
        let sensor = self.sensor.as_ref();
        let sensor = sensor.ok_or_else(|| missing("the state of the sensor"))?;
        let drop_ev = match exposure {
            Some(exposure) => exposure.dark.ok_or_else(|| missing("what was left dark"))?,
            None => severity.value(),
        };
        let frame = NoiseKey::new(sensor.seed, &self.frame());
        let key = match sensor.draws {
            Draws::Shared => frame,
            Draws::Fresh => frame.at(severity),
        };
        let blurred = (!streak.is_still()).then(|| blur(clean, streak));
        let light = blurred.as_ref();
        let light = light.map_or(clean, |light| clean.with_light(light));
        let drops = [drop_ev, sensor.coupling.headroom_ev(drop_ev)];
        Ok(develop_with_state(
            light,
            &key,
            &sensor.state,
            sensor.amplify,
            sensor.tone,
            drops,
        ))
    }
}

/// The noise profile of files that do not name one.
fn paper() -> ReadingName {
    ReadingName::PAPER
}

/// The version of the branch that makes a degradation. A clean frame has the version of the exposure branch.
fn version(how: Option<&Degradation>) -> u32 {
    how.map_or(exposure::VERSION, |how| darkqa_light::version(how.kind()))
}
