//! How dark: [`Light`].

use std::fs;
use std::path::Path;

use super::parsed;
use crate::cli::{LightArgs, SensorArgs};
use crate::error::{Error, Result};
use crate::synthesis::{Calibration, CameraModel, Coupling, Sampling, Synthesis};
use crate::types::{Level, Variants};

/// How dark.
#[derive(Debug)]
pub struct Light {
    /// The levels, lightest first, none twice.
    pub levels: Vec<Level>,
    /// The variants of the dark ones.
    pub variants: Variants,
    /// What takes the noisy images.
    pub sensor: Sensor,
}

/// What takes the noisy images.
#[derive(Debug)]
pub struct Sensor {
    /// The seed of all random draws.
    pub seed: u64,
    /// The sensor branch.
    pub synthesis: Synthesis,
}

impl Sensor {
    pub(super) fn resolve(said: &SensorArgs) -> Result<Self> {
        Ok(Self {
            seed: said.seed.unwrap_or(0),
            synthesis: synthesis(said)?,
        })
    }
}

impl Light {
    pub(super) fn resolve(said: &LightArgs, sensor: &SensorArgs) -> Result<Self> {
        Ok(Self {
            levels: said
                .levels
                .as_deref()
                .map_or(Ok(Level::ALL.to_vec()), levels)?,
            variants: parsed("--variant", said.variant.as_deref())?.unwrap_or(Variants::Both),
            sensor: Sensor::resolve(sensor)?,
        })
    }
}

/// A profile, and what is said beside it.
fn synthesis(said: &SensorArgs) -> Result<Synthesis> {
    let profile = parsed("--profile", said.profile.as_deref())?.unwrap_or_default();
    let of = Synthesis::of(profile, camera(said)?);
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

/// Reads `L0-L5` or `L0,L3`, in any order, none twice.
fn levels(text: &str) -> Result<Vec<Level>> {
    let mut levels = Vec::new();
    for part in text.split(',').map(str::trim) {
        let read = |level: &str| level.trim().parse::<Level>().map_err(|e| e.at("--levels"));
        match part.split_once('-') {
            None => levels.push(read(part)?),
            Some((first, last)) => {
                let (first, last) = (read(first)?, read(last)?);
                if first > last {
                    return Err(Error::usage(
                        "--levels",
                        format_args!("{part:?} runs backwards; {last}-{first} is meant?"),
                    ));
                }
                levels.extend(
                    Level::ALL
                        .into_iter()
                        .filter(|level| (first..=last).contains(level)),
                );
            }
        }
    }
    levels.sort_unstable();
    levels.dedup();
    Ok(levels)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthesis::{Amplify, Tone};

    #[test]
    fn levels_are_read_in_any_form() {
        assert_eq!(levels("L0-L5").unwrap(), Level::ALL);
        assert_eq!(levels("l3, L0,L3").unwrap(), [Level::L0, Level::L3]);
        for (wrong, says) in [
            ("L6", "\"L6\" is none of"),
            ("", "\"\" is none of"),
            ("L3-L1", "runs backwards"),
        ] {
            let error = levels(wrong).unwrap_err().to_string();
            assert!(
                error.starts_with("--levels: ") && error.contains(says),
                "{error}"
            );
        }
    }

    #[test]
    fn a_flag_goes_before_its_part_of_the_profile() {
        let said = SensorArgs {
            profile: Some("physical".into()),
            tone: Some("none".into()),
            ..SensorArgs::default()
        };
        let synthesis = Sensor::resolve(&said).unwrap().synthesis;
        assert_eq!(synthesis.amplify, Amplify::All);
        assert_eq!(synthesis.tone, Tone::None);
        assert_eq!(synthesis.coupling, Coupling::Photon);
        let default = Sensor::resolve(&SensorArgs::default()).unwrap();
        assert_eq!(default.synthesis, Synthesis::default());
    }

    #[test]
    fn a_camera_is_a_name_or_a_file() {
        let camera = |name: &str| {
            let said = SensorArgs {
                camera: Some(name.into()),
                ..SensorArgs::default()
            };
            Sensor::resolve(&said).map(|sensor| sensor.synthesis.camera)
        };
        assert_eq!(camera("sony-a7s2").unwrap(), CameraModel::default());
        assert_ne!(camera("nikon-d850").unwrap(), CameraModel::default());
        let missing = camera("no/such.toml").unwrap_err().to_string();
        assert!(missing.contains("no/such.toml"), "{missing}");
    }
}
