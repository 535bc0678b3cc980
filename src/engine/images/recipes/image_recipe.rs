//! The recipe of an image in its JSON sidecar, from which the image can be made again: [`ImageRecipe`].
//!
//! The flags that decide the images of a run, as typed. A manifest stores them, and [`ImageFlags`] parses them again.

use std::collections::BTreeMap;
use std::num::NonZeroU32;
use std::path::{Path, PathBuf};

use clap::parser::ValueSource;
use clap::{ArgAction, ArgMatches, CommandFactory as _, Parser};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::images::frames::WalkArgs;
use crate::images::stored::{ImageOrigin, Sidecar, differing_fields};
use darkqa_base::error::{Error, Result};
use darkqa_base::types::degradations::{Axis, Kind};
use darkqa_base::types::flags::flag_spelling;
use darkqa_base::types::{
    Condition, Decides, Degradation, Digest, ExposureFacts, FrameId, InputNote, ProfileName, Rgb,
};
use darkqa_data::{DataArgs, DecodeArgs, Picture, SceneArgs};
use darkqa_enhance::{EnhancedFolder, SizeArgs};
use darkqa_light::movement::blur::{blur, blurred_codes};
use darkqa_light::{
    self, Amplify, AppliedDegradation, CameraArgs, CameraState, Clean, Coupling, Draws, NoiseKey, SensorArgs, Streak,
    Tone, develop_with_state, expose, exposure,
};
use darkqa_pictures::ImageArgs;

/// Everything that decides the pixels of an image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ImageRecipe {
    frame: String,
    /// Digest of the input image.
    source: String,
    /// Changes that reading the file made besides decoding its codes. Without changes it has no JSON fields.
    #[serde(flatten)]
    read: InputNote,
    condition: Condition,
    /// Exposure drop, in EV.
    drop: f64,
    /// Version of the code that makes this kind of degradation.
    synthesis: u32,
    sensor: Option<SensorRecord>,
    /// The camera's exposure; omitted for kinds that do not define it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    exposure: Option<ExposureFacts>,
}

/// Inputs of the noise synthesis. For automatic exposure: the noise profile `physical` at the gain that the camera
/// chose.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct SensorRecord {
    seed: u64,
    /// The noise profile, as defined by the fields below.
    #[serde(default = "paper")]
    reading: ProfileName,
    amplify: Amplify,
    tone: Tone,
    draws: Draws,
    coupling: Coupling,
    /// Distribution from which the state was drawn.
    model: Value,
    state: CameraState,
}

impl ImageOrigin for ImageRecipe {
    // Version 1 has no digest of the image.
    const SCHEMAS: &'static [&'static str] = &["darkqa.image/2", "darkqa.image/1"];
    const REPLACES_OTHER_SETTINGS: bool = false;

    fn difference(&self, wanted: &Self) -> String {
        let mut settings = Vec::new();
        if self.synthesis != wanted.synthesis {
            settings.push(format!("synthesis {}, now {}", self.synthesis, wanted.synthesis));
        }
        if let (Some(had), Some(wanted)) = (&self.sensor, &wanted.sensor) {
            settings.extend(had.differences(wanted));
        }
        match (self.source == wanted.source, &settings[..]) {
            (true, []) => {
                let fields = differing_fields(&json!(self), &json!(wanted));
                format!("made with other settings ({})", fields.join(", "))
            }
            (true, settings) => format!("made with {}", settings.join("; ")),
            (false, []) => "made from another image".to_owned(),
            (false, settings) => format!("made from another image, with {}", settings.join("; ")),
        }
    }
}

impl SensorRecord {
    /// The flags that differ, with both values. Derived values are omitted: the state follows from the seed, and the
    /// noise options from the noise profile.
    fn differences(&self, wanted: &Self) -> Vec<String> {
        let mut flags = vec![
            ("--seed", json!(self.seed), json!(wanted.seed)),
            ("--profile", json!(self.reading), json!(wanted.reading)),
        ];
        if self.reading == wanted.reading {
            flags.extend([
                ("--noise amplify", json!(self.amplify), json!(wanted.amplify)),
                ("--noise tone", json!(self.tone), json!(wanted.tone)),
                ("--noise draws", json!(self.draws), json!(wanted.draws)),
                ("--noise coupling", json!(self.coupling), json!(wanted.coupling)),
            ]);
        }
        let mut differences = Vec::new();
        for (flag, had, wanted) in flags {
            if had != wanted {
                let [had, wanted] = [had, wanted].map(|value| match value {
                    Value::String(text) => text,
                    other => other.to_string(),
                });
                differences.push(format!("{flag} {had}, now {wanted}"));
            }
        }
        if self.model != wanted.model {
            differences.push("another --noise camera, gain, ratio or fixed".to_owned());
        }
        differences
    }
}

impl ImageRecipe {
    /// The recipe of an image of a frame. `source` is the digest of the input file, and `read` how it was read. For the
    /// clean frame, `how` and `applied` are `None`.
    pub fn new(
        frame: &FrameId,
        source: Digest,
        read: InputNote,
        how: Option<&Degradation>,
        applied: Option<&AppliedDegradation>,
        key: &NoiseKey,
        seed: u64,
    ) -> Self {
        let drop = how.filter(|how| how.kind().axis() == Axis::LIGHT).map_or(0.0, |how| how.severity().value());
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
                state: synthesis.state_after_drop(key, applied.drop_ev()),
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

    pub fn frame(&self) -> FrameId {
        FrameId(self.frame.clone())
    }

    /// The name of the image file without its extension.
    pub fn name(&self, stem: &str) -> String {
        format!("{stem}_{}", self.condition)
    }

    /// Makes the image of the JSON file at `path` again.
    ///
    /// # Errors
    /// If `picture` is not the original input, or this program has another version of the synthesis.
    pub fn replay(file: &Sidecar<Self>, picture: &Picture, path: &Path) -> Result<Rgb> {
        file.recipe.image(picture, file.program(), path)
    }

    fn image(&self, picture: &Picture, program: &str, path: &Path) -> Result<Rgb> {
        let how = self.condition.degradation();
        if self.source != picture.digest().to_string() {
            let problem =
                "made from another image than INPUT (their contents differ, or the flags by which they are read)";
            return Err(Error::data(path.display(), problem));
        }
        if self.synthesis != version(how) {
            let problem = format_args!(
                "made by synthesis {} of darkqa-eval {}; this program has synthesis {}",
                self.synthesis,
                program,
                version(how)
            );
            return Err(Error::data(path.display(), problem));
        }
        let clean = picture.pixels()?;
        let missing = |what: &str| Error::data(path.display(), format_args!("{what} is missing"));
        let Some(how) = how else {
            return Ok(Rgb::clone(&clean.codes()));
        };
        let (severity, kind) = (how.severity(), how.kind());
        if kind == Kind::Exposure {
            return Ok(expose(&clean, severity));
        }
        let exposure = self.exposure.filter(|_| kind.has_motion());
        let blur_length_and_angle = exposure.and_then(|exposure| exposure.blur_px.zip(exposure.blur_angle));
        let streak = match blur_length_and_angle {
            Some((length, angle)) => Streak::new(length, angle)?,
            None if kind.has_motion() => return Err(missing("the motion blur")),
            None => Streak::STILL,
        };
        let clean = Clean::from(&clean);
        if !kind.has_noise() {
            return Ok(blurred_codes(clean, streak));
        }
        let sensor = self.sensor.as_ref().ok_or_else(|| missing("the state of the sensor"))?;
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
        let light = blurred.as_ref().map_or(clean, |light| clean.with_light(light));
        let drops = [drop_ev, sensor.coupling.headroom_ev(drop_ev)];
        Ok(develop_with_state(light, &key, &sensor.state, sensor.amplify, sensor.tone, drops))
    }
}

/// Default noise profile of files without this field.
fn paper() -> ProfileName {
    ProfileName::PAPER
}

/// Version of the code that makes a degradation; for a clean frame, that of the exposure drop.
fn version(how: Option<&Degradation>) -> u32 {
    how.map_or(exposure::VERSION, |how| darkqa_light::version(how.kind()))
}

/// The repeatable flag whose values replace those of an earlier call; other repeatable flags add to them.
const REPLACED: &str = "data";

/// Flag values by long name: a text, a list of texts, or `true` for a switch.
pub type ImageWords = BTreeMap<String, Value>;

/// All flags that decide images.
#[derive(Debug, Parser)]
#[command(no_binary_name = true, disable_help_flag = true, mut_arg("frames", |arg| arg.required(false)))]
pub struct ImageFlags {
    #[command(flatten)]
    pub data: DataArgs,
    #[command(flatten)]
    pub scene: SceneArgs,
    #[command(flatten)]
    pub decode: DecodeArgs,
    #[command(flatten)]
    pub sensor: SensorArgs,
    #[command(flatten)]
    pub camera: CameraArgs,
    #[arg(long, add = Decides::Trials)]
    pub llie: Vec<PathBuf>,
    #[arg(long, add = Decides::Trials)]
    pub enhanced: Vec<EnhancedFolder>,
    #[command(flatten)]
    pub size: SizeArgs,
    #[command(flatten)]
    pub images: ImageArgs,
    #[arg(long, add = Decides::Pixels)]
    pub max_side: Option<NonZeroU32>,
    #[command(flatten)]
    pub walk: Option<WalkArgs>,
}

impl ImageFlags {
    /// Parses the flags that a manifest stores.
    pub fn read(words: &ImageWords) -> Result<Self, String> {
        let flags = words.iter().flat_map(|(flag, value)| match value {
            Value::Bool(true) => vec![format!("--{flag}")],
            Value::Array(list) => list.iter().map(|value| format!("--{flag}={}", flag_text(value))).collect(),
            value => vec![format!("--{flag}={}", flag_text(value))],
        });
        Self::try_parse_from(flags)
            .map_err(|e| format!("this version cannot read the image flags in its manifest: {e}"))
    }
}

/// The text of a flag value: a string without its quotes, other values as JSON.
fn flag_text(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

/// The image flags that were typed in a call. A repeatable flag is included even if only its default is set, because a
/// later call may add values.
///
/// # Errors
/// If a value is not valid Unicode, so that a manifest cannot store it.
pub fn typed_flags(matches: &ArgMatches) -> Result<ImageWords> {
    let flags = ImageFlags::command();
    let mut words = ImageWords::new();
    for argument in flags.get_arguments() {
        let id = argument.get_id().as_str();
        let (flag, action) = (argument.get_long().unwrap_or(id), argument.get_action());
        let is_repeatable = matches!(action, ArgAction::Append) && id != REPLACED;
        let source = match matches.try_contains_id(id) {
            Ok(true) => matches.value_source(id),
            _ => None,
        };
        if source != Some(ValueSource::CommandLine) && !(is_repeatable && source.is_some()) {
            continue;
        }
        let mut texts = matches
            .get_raw(id)
            .into_iter()
            .flatten()
            .map(|text| Some(text.to_str()?.into()))
            .collect::<Option<Vec<Value>>>()
            .ok_or_else(|| {
                let problem = "cannot be stored in the manifest: the value is not valid Unicode";
                Error::usage(flag_spelling(flag), problem)
            })?;
        let value = match texts.pop() {
            _ if !action.takes_values() => Value::Bool(true),
            Some(last) if is_repeatable || !texts.is_empty() => Value::Array([texts, vec![last]].concat()),
            Some(last) => last,
            None => continue,
        };
        words.insert(flag.to_owned(), value);
    }
    Ok(words)
}
