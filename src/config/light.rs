//! How dark: [`Light`].

use std::fs;
use std::path::Path;

use super::parsed;
use crate::cli::{LightArgs, SensorArgs};
use crate::error::{Error, Result};
use crate::synthesis::{
    Calibration, CameraModel, Coupling, LightReading, Readings, Sampling, Synthesis,
};
use crate::types::degradation::Kind;
use crate::types::{AxisLevel, Degradation, KindSet, ReadingName, Severity};

/// How dark.
#[derive(Debug)]
pub struct Light {
    /// The levels, lightest first, none twice.
    pub levels: Vec<AxisLevel>,
    /// The kinds of degradation at all levels but L0.
    pub variants: KindSet,
    /// What takes the noisy images.
    pub sensor: Sensor,
}

/// What takes the noisy images.
#[derive(Debug)]
pub struct Sensor {
    /// The seed of all random draws.
    pub seed: u64,
    /// The light readings of the sensor branch.
    pub readings: Readings,
}

impl Sensor {
    pub(super) fn resolve(said: &SensorArgs) -> Result<Self> {
        Ok(Self {
            seed: said.seed.unwrap_or(0),
            readings: readings(said)?,
        })
    }
}

impl Light {
    pub(super) fn resolve(said: &LightArgs, sensor: &SensorArgs) -> Result<Self> {
        Ok(Self {
            levels: levels(said.levels.as_deref().unwrap_or("L0-L5"))?,
            variants: parsed("--variant", said.variant.as_deref())?.unwrap_or(KindSet::BOTH),
            sensor: Sensor::resolve(sensor)?,
        })
    }
}

impl Light {
    /// What is done to each frame, level by level: each kind, in each light reading if it has readings; `None` is L0.
    pub fn degradations(&self) -> Vec<Option<Degradation>> {
        let mut all = Vec::new();
        for level in &self.levels {
            let Some(severity) = level.severity() else {
                all.push(None);
                continue;
            };
            let kinds = self.variants.kinds();
            for kind in kinds.filter(|kind| AxisLevel::new(*kind, severity) == *level) {
                let readings: Vec<Option<ReadingName>> = if kind.has_readings() {
                    let readings = self.sensor.readings.iter();
                    readings.map(|(name, _)| Some(name.clone())).collect()
                } else {
                    vec![None]
                };
                let made = readings
                    .into_iter()
                    .filter_map(|reading| Degradation::new(kind, severity, reading).ok());
                all.extend(made.map(Some));
            }
        }
        all
    }
}

/// The readings of `--profile`; one alone with the parts that stand beside it.
fn readings(said: &SensorArgs) -> Result<Readings> {
    let profile = said.profile.as_deref().unwrap_or("paper");
    let chosen = match profile {
        "all" => LightReading::ALL.to_vec(),
        list => {
            let names = list
                .split(',')
                .map(|name| parsed("--profile", Some(name.trim())));
            let readings: Result<Vec<Option<LightReading>>> = names.collect();
            readings?.into_iter().flatten().collect()
        }
    };
    let camera = camera(said)?;
    if let [reading] = chosen[..] {
        return synthesis(said, Synthesis::of(reading, camera)).map(Readings::from);
    }
    let parts = [
        ("--amplify", &said.amplify),
        ("--tone", &said.tone),
        ("--draws", &said.draws),
        ("--coupling", &said.coupling),
    ];
    if let Some((flag, _)) = parts.into_iter().find(|(_, part)| part.is_some()) {
        let problem = "beside several profiles it would make them the same; name one profile";
        return Err(Error::usage(flag, problem));
    }
    let by_light =
        |of: &&LightReading| Synthesis::of(**of, camera.clone()).coupling == Coupling::Photon;
    if said.ratio.is_some()
        && let Some(reading) = chosen.iter().find(by_light)
    {
        let problem = format!("the ratio of {reading} is 2^EV; leave out one of the two");
        return Err(Error::usage("--ratio", problem));
    }
    Ok(Readings::named(&chosen, &camera))
}

/// A reading with the parts that are said beside it.
fn synthesis(said: &SensorArgs, of: Synthesis) -> Result<Synthesis> {
    let synthesis = Synthesis {
        amplify: parsed("--amplify", said.amplify.as_deref())?.unwrap_or(of.amplify),
        tone: parsed("--tone", said.tone.as_deref())?.unwrap_or(of.tone),
        draws: parsed("--draws", said.draws.as_deref())?.unwrap_or(of.draws),
        coupling: parsed("--coupling", said.coupling.as_deref())?.unwrap_or(of.coupling),
        camera: of.camera,
    };
    if synthesis.coupling == Coupling::Photon && said.ratio.is_some() {
        let problem = "with --coupling photon the ratio is 2^EV; leave out one of the two";
        return Err(Error::usage("--ratio", problem));
    }
    Ok(synthesis)
}

fn camera(said: &SensorArgs) -> Result<CameraModel> {
    let mut camera = match said.camera.as_deref() {
        None => CameraModel::default(),
        Some(name) => match Path::new(name) {
            file if is_file(file) => {
                let text = fs::read_to_string(file).map_err(|e| Error::file(file, "read", e))?;
                CameraModel::new(Calibration::parse(&text, file.display())?)
            }
            _ => CameraModel::preset(name)?,
        },
    };
    if said.fixed {
        camera.set_sampling(Sampling::Fixed);
    }
    if let Some(gain) = said.gain {
        camera.pin_gain(gain)?;
    }
    if let Some(ratio) = said.ratio {
        camera.pin_ratio(ratio)?;
    }
    Ok(camera)
}

/// Whether a file is meant: what ends as one, or lies in a folder, is no name of a camera.
fn is_file(path: &Path) -> bool {
    path.extension().is_some() || path.components().count() > 1
}

/// The most levels of a run.
const MOST_LEVELS: usize = 200;

/// Reads `L0-L5`, `L0,L3` or numbers of EV, in any order, none twice.
fn levels(text: &str) -> Result<Vec<AxisLevel>> {
    let mut levels = Vec::new();
    for part in text.split(',').map(str::trim) {
        match part.split_once('-') {
            None => levels.push(level(part)?),
            Some((first, last)) => {
                let (first, last) = (level(first.trim())?, level(last.trim())?);
                if !part.to_ascii_uppercase().starts_with('L') {
                    let problem = format_args!(
                        "{part:?} is no range; levels are L0-L5, numbers of EV stand alone, as {first},{last}"
                    );
                    return Err(Error::usage("--levels", problem));
                }
                if first > last {
                    return Err(Error::usage(
                        "--levels",
                        format_args!("{part:?} runs backwards; {last}-{first} is meant?"),
                    ));
                }
                let named = LIGHT.ladder().iter();
                let named = named.map(|severity| AxisLevel::new(LIGHT, *severity));
                let all = std::iter::once(AxisLevel::L0).chain(named);
                levels.extend(all.filter(|level| (first..=last).contains(level)));
            }
        }
    }
    levels.sort_unstable();
    levels.dedup();
    if levels.len() > MOST_LEVELS {
        let problem = format_args!("{} levels; {MOST_LEVELS} is the most", levels.len());
        return Err(Error::usage("--levels", problem));
    }
    Ok(levels)
}

/// The kind whose names levels of light have.
const LIGHT: Kind = Kind::ALL[0];

/// One level: a name, or a number of EV.
fn level(text: &str) -> Result<AxisLevel> {
    let number = text.starts_with(|c: char| c.is_ascii_digit());
    if text.eq_ignore_ascii_case("L0") || number && text.parse::<f64>() == Ok(0.0) {
        return Ok(AxisLevel::L0);
    }
    let severity = if number {
        text.parse::<Severity>()
    } else {
        LIGHT.severity(text)
    };
    let severity = severity.map_err(|e| e.at("--levels"))?;
    if severity > LIGHT.largest() {
        let problem = format_args!("{text} EV is above {}", LIGHT.largest());
        return Err(Error::usage("--levels", problem));
    }
    Ok(AxisLevel::new(LIGHT, severity))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthesis::{Amplify, Tone};

    #[test]
    fn levels_are_read_in_any_form() {
        let names = |text| -> Vec<String> {
            let levels = levels(text).unwrap();
            levels.iter().map(ToString::to_string).collect()
        };
        assert_eq!(names("L0-L5"), ["L0", "L1", "L2", "L3", "L4", "L5"]);
        assert_eq!(names("l3, L0,L3"), ["L0", "L3"]);
        assert_eq!(
            names("L4-L5,3.30,6,0,E11"),
            ["L0", "E3.3", "L3", "L4", "L5", "E11"]
        );
        for (wrong, says) in [
            ("L6", "\"L6\" is none of"),
            ("", "\"\" is none of"),
            ("L3-L1", "runs backwards"),
            ("0-5", "is no range"),
            ("3.333", "two decimals"),
            ("16.5", "above 16"),
            ("-2", "none of"),
        ] {
            let error = levels(wrong).unwrap_err().to_string();
            assert!(
                error.starts_with("--levels: ") && error.contains(says),
                "{error}"
            );
        }
    }

    #[test]
    fn profiles_are_a_list_and_parts_stand_beside_one() {
        let names = |profile: &str, tone: Option<&str>| -> Result<Vec<String>> {
            let said = SensorArgs {
                profile: Some(profile.into()),
                tone: tone.map(Into::into),
                ..SensorArgs::default()
            };
            let readings = Sensor::resolve(&said)?.readings;
            Ok(readings.iter().map(|(name, _)| name.to_string()).collect())
        };
        assert_eq!(
            names("physical,paper", None).unwrap(),
            ["paper", "physical"]
        );
        assert_eq!(
            names("all", None).unwrap(),
            ["paper", "eld", "level", "physical"]
        );
        assert_eq!(names("physical", Some("none")).unwrap(), ["custom"]);
        assert_eq!(names("physical", Some("before-ev")).unwrap(), ["physical"]);
        let error = names("paper,eld", Some("none")).unwrap_err().to_string();
        assert!(
            error.starts_with("--tone: beside several profiles"),
            "{error}"
        );
        let error = names("paper,all", None).unwrap_err().to_string();
        assert!(error.starts_with("--profile: "), "{error}");
    }

    #[test]
    fn a_flag_goes_before_its_part_of_the_profile() {
        let said = SensorArgs {
            profile: Some("physical".into()),
            tone: Some("none".into()),
            ..SensorArgs::default()
        };
        let readings = Sensor::resolve(&said).unwrap().readings;
        let synthesis = readings.only().unwrap();
        assert_eq!(synthesis.amplify, Amplify::All);
        assert_eq!(synthesis.tone, Tone::None);
        assert_eq!(synthesis.coupling, Coupling::Photon);
        let default = Sensor::resolve(&SensorArgs::default()).unwrap();
        assert_eq!(default.readings, Readings::default());
    }

    #[test]
    fn a_camera_is_a_name_or_a_file() {
        let camera = |name: &str| {
            let said = SensorArgs {
                camera: Some(name.into()),
                ..SensorArgs::default()
            };
            Sensor::resolve(&said).map(|sensor| sensor.readings.only().unwrap().camera.clone())
        };
        assert_eq!(camera("sony-a7s2").unwrap(), CameraModel::default());
        assert_ne!(camera("nikon-d850").unwrap(), CameraModel::default());
        let missing = camera("no/such.toml").unwrap_err().to_string();
        assert!(missing.contains("no/such.toml"), "{missing}");
    }
}
