//! Noise profiles, interpretations of the paper's noise model: their choices ([`Synthesis`]), the named ones
//! ([`NoiseProfile`]), and those of a run ([`NoiseProfiles`]).

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::camera::CameraModel;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::{Degradation, ProfileName};

/// Choices that define the sensor branch. The default follows the paper; `src/docs/method.md` documents the choices
/// that the paper leaves open, with their effects.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Synthesis {
    /// Noise terms that the ratio r amplifies.
    pub amplify: Amplify,
    /// Position of a forward tone curve.
    pub tone: Tone,
    /// Random draws that the levels of a frame share.
    pub draws: Draws,
    /// Quantity that the ratio r depends on.
    pub coupling: Coupling,
    /// Distribution that each frame's camera is drawn from.
    pub camera: CameraModel,
}

/// A named interpretation of the paper's noise model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum NoiseProfile {
    /// As the DarkQA paper states it. Read, row and quantisation noise are added after the amplification, and
    /// contribute less than 0.1 codes.
    #[default]
    Paper,
    /// The ratio amplifies all noise, as in ELD (Wei et al. 2020).
    Eld,
    /// The ratio is 2^ΔEV: photons decrease with the level, read noise does not increase.
    Level,
    /// Physical model: all noise is amplified, less light means fewer photons, and the tone curve is applied again.
    Physical,
}

impl NoiseProfile {
    /// All profiles, in the order in which tables list them.
    pub const ALL: [Self; 4] = [Self::Paper, Self::Eld, Self::Level, Self::Physical];

    /// Name in conditions, such as `eld` in `L3-noise@eld`.
    #[must_use]
    pub fn name(self) -> ProfileName {
        match self {
            Self::Paper => ProfileName::PAPER,
            Self::Eld => ProfileName::from_static("eld"),
            Self::Level => ProfileName::from_static("level"),
            Self::Physical => ProfileName::from_static("physical"),
        }
    }
}

impl Synthesis {
    /// The choices of a named profile, with the given camera.
    #[must_use]
    pub fn new(reading: NoiseProfile, camera: CameraModel) -> Self {
        let (amplify, tone, coupling) = match reading {
            NoiseProfile::Paper => Default::default(),
            NoiseProfile::Eld => (Amplify::All, Tone::None, Coupling::Independent),
            NoiseProfile::Level => (Amplify::ShotOnly, Tone::None, Coupling::Photon),
            NoiseProfile::Physical => (Amplify::All, Tone::BeforeEv, Coupling::Photon),
        };
        Self { amplify, tone, draws: Draws::Shared, coupling, camera }
    }

    /// Name of the profile with these choices, for any camera; `custom` if there is none.
    #[must_use]
    pub fn name(&self) -> ProfileName {
        NoiseProfile::ALL
            .into_iter()
            .find(|reading| Self::new(*reading, self.camera.clone()) == *self)
            .map_or(ProfileName::CUSTOM, NoiseProfile::name)
    }
}

/// Noise profiles of a run by name; at least one.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(transparent)]
pub struct NoiseProfiles(BTreeMap<ProfileName, Synthesis>);

impl Default for NoiseProfiles {
    fn default() -> Self {
        Synthesis::default().into()
    }
}

impl From<Synthesis> for NoiseProfiles {
    fn from(synthesis: Synthesis) -> Self {
        Self([(synthesis.name(), synthesis)].into())
    }
}

impl NoiseProfiles {
    /// Several named profiles with one camera; `paper` alone for an empty list.
    #[must_use]
    pub fn from_profiles(readings: &[NoiseProfile], camera: &CameraModel) -> Self {
        let profiles: BTreeMap<_, _> =
            readings.iter().map(|reading| (reading.name(), Synthesis::new(*reading, camera.clone()))).collect();
        if profiles.is_empty() {
            return Synthesis::new(NoiseProfile::Paper, camera.clone()).into();
        }
        Self(profiles)
    }

    /// Names and choices of the profiles, `paper` first.
    pub fn iter(&self) -> impl Iterator<Item = (&ProfileName, &Synthesis)> {
        self.0.iter()
    }

    /// The sensor that all profiles share, without pinned gain and ratio.
    pub fn camera(&self) -> CameraModel {
        self.0
            .values()
            .next()
            .map(|synthesis| &synthesis.camera)
            .map_or_else(CameraModel::default, CameraModel::unpinned)
    }

    /// The choices of a degradation's noise profile; those of any profile for a kind whose pixels do not depend on it.
    ///
    /// # Errors
    /// If the run does not have the profile.
    pub fn for_degradation(&self, degradation: Option<&Degradation>) -> Result<&Synthesis> {
        let synthesis = match degradation.and_then(Degradation::reading) {
            None => self.0.values().next(),
            Some(name) => self.get(name),
        };
        synthesis.ok_or_else(|| {
            let names: Vec<&str> = self.0.keys().map(ProfileName::as_str).collect();
            let problem = format_args!(
                "{} needs a noise profile that is not among those of --profile ({}); add it there",
                degradation.map_or("L0".to_owned(), ToString::to_string),
                names.join(", ")
            );
            Error::usage("--profile", problem)
        })
    }

    /// The choices of the profile of this name; `None` if the run does not have it.
    pub fn get(&self, name: &ProfileName) -> Option<&Synthesis> {
        self.0.get(name)
    }

    /// The choices of the only profile.
    ///
    /// # Errors
    /// If there are several.
    pub fn only(&self) -> Result<&Synthesis> {
        let mut profiles = self.0.values();
        match (profiles.next(), profiles.next()) {
            (Some(synthesis), None) => Ok(synthesis),
            _ => Err(Error::usage("--profile", "this command takes one noise profile")),
        }
    }
}

/// Noise terms that the ratio r amplifies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "flags", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
pub enum Amplify {
    /// The shot noise alone, and read, row and quantisation noise act after it (DarkQA, noise item 1).
    #[default]
    ShotOnly,
    /// The sum of all four (ELD, and every public implementation).
    All,
}

/// Position of a forward tone curve, 3x² − 2x³, on the way back to sRGB.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "flags", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
pub enum Tone {
    /// Nowhere, as the paper lists none.
    #[default]
    None,
    /// Before the exposure drop: without noise, greys are as in the exposure branch.
    BeforeEv,
    /// After the exposure drop, as in a camera: it crushes the darkest levels.
    AfterEv,
}

/// Random draws that the levels of a frame share.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "flags", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
pub enum Draws {
    /// The camera and the noise field: levels differ in light alone.
    #[default]
    Shared,
    /// The camera alone: each level has another noise field.
    Fresh,
}

/// Quantity that the ratio r depends on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "flags", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
pub enum Coupling {
    /// Nothing: it is drawn once per frame (DarkQA).
    #[default]
    Independent,
    /// The level: r = 2^ΔEV, so that less light means fewer photons.
    Photon,
}

impl Coupling {
    /// Light at which the sensor saturates for linear scene light, in EV above white. In the paper, light is clipped at
    /// white before the drop, so the headroom is 0. If less light means fewer photons, light is reduced before it
    /// reaches the sensor, so the headroom equals the drop.
    #[must_use]
    pub fn headroom_ev(self, drop_ev: f64) -> f64 {
        match self {
            Self::Independent => 0.0,
            Self::Photon => drop_ev.max(0.0),
        }
    }
}

#[cfg(feature = "flags")]
darkqa_base::types::flags::flag_words!(Amplify, Tone, Draws, Coupling);

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(feature = "flags")]
    #[test]
    fn values_have_the_same_text_in_flags_and_json() {
        for name in ["none", "before-ev", "after-ev"] {
            let tone = <Tone as clap::ValueEnum>::from_str(name, false).unwrap();
            assert_eq!(tone.to_string(), name);
            assert_eq!(serde_json::to_value(tone).unwrap(), name);
        }
    }

    #[test]
    fn the_default_is_the_paper() {
        let camera = CameraModel::default();
        assert_eq!(Synthesis::new(NoiseProfile::Paper, camera.clone()), Synthesis::default());
        let physical = Synthesis::new(NoiseProfile::Physical, camera);
        assert_eq!(physical.amplify, Amplify::All);
        assert_eq!(physical.coupling, Coupling::Photon);
    }

    #[test]
    fn choices_of_a_profile_have_its_name() {
        let mut camera = CameraModel::default();
        camera.pin_gain(0.1).unwrap();
        for reading in NoiseProfile::ALL {
            let synthesis = Synthesis::new(reading, camera.clone());
            assert_eq!(synthesis.name(), reading.name());
            let fresh = Synthesis { draws: Draws::Fresh, ..synthesis };
            assert_eq!(fresh.name(), ProfileName::CUSTOM);
        }
    }

    #[test]
    fn errors_name_the_missing_profile() {
        let readings = NoiseProfiles::from_profiles(&[NoiseProfile::Paper], &CameraModel::default());
        let degradation: Degradation = "L3-noise@eld".parse().unwrap();
        let error = readings.for_degradation(Some(&degradation)).unwrap_err().to_string();
        assert!(
            error.contains("L3-noise@eld needs a noise profile that is not among those of --profile (paper)"),
            "{error}"
        );
        assert!(readings.for_degradation(None).is_ok());
    }
}
