//! How the paper's noise is understood: [`Synthesis`], its named contents [`LightReading`], and those of a run, [`Readings`].

use std::collections::BTreeMap;

use clap::ValueEnum;
use serde::{Deserialize, Serialize};

use super::camera::CameraModel;
use crate::error::{Error, Result};
use crate::types::flag::flag_words;
use crate::types::{Degradation, ReadingName};

/// How the sensor branch is made. The default is the paper to the letter.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Synthesis {
    /// What the ratio r amplifies.
    pub amplify: Amplify,
    /// Where a forward tone curve stands.
    pub tone: Tone,
    /// What the levels of a frame share.
    pub draws: Draws,
    /// What the ratio r depends on.
    pub coupling: Coupling,
    /// The distribution that each frame's camera is drawn from.
    pub camera: CameraModel,
}

/// A way to understand the paper's noise that has a name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum LightReading {
    /// The DarkQA paper to the letter.
    #[default]
    Paper,
    /// The ratio amplifies all noise, as in ELD (Wei et al. 2020).
    Eld,
    /// The ratio is 2^ΔEV: photons fall with the level, read noise does not grow.
    Level,
    /// What physics says: all noise is amplified, light lost is photons lost, the tone curve is put back.
    Physical,
}

impl LightReading {
    /// All readings, in the order of tables.
    pub const ALL: [Self; 4] = [Self::Paper, Self::Eld, Self::Level, Self::Physical];

    /// The name in conditions.
    #[must_use]
    pub fn name(self) -> ReadingName {
        match self {
            Self::Paper => ReadingName::PAPER,
            Self::Eld => ReadingName::of("eld"),
            Self::Level => ReadingName::of("level"),
            Self::Physical => ReadingName::of("physical"),
        }
    }
}

impl Synthesis {
    /// The choices of a reading, with any camera.
    #[must_use]
    pub fn of(reading: LightReading, camera: CameraModel) -> Self {
        let (amplify, tone, coupling) = match reading {
            LightReading::Paper => Default::default(),
            LightReading::Eld => (Amplify::All, Tone::None, Coupling::Independent),
            LightReading::Level => (Amplify::ShotOnly, Tone::None, Coupling::Photon),
            LightReading::Physical => (Amplify::All, Tone::BeforeEv, Coupling::Photon),
        };
        Self {
            amplify,
            tone,
            draws: Draws::Shared,
            coupling,
            camera,
        }
    }

    /// The name of these choices: that of the reading which they match, whatever the camera, else `custom`.
    #[must_use]
    pub fn name(&self) -> ReadingName {
        let mut readings = LightReading::ALL.into_iter();
        let same = readings.find(|reading| Self::of(*reading, self.camera.clone()) == *self);
        same.map_or(ReadingName::CUSTOM, LightReading::name)
    }
}

/// The light readings of a run, by name; at least one.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(transparent)]
pub(crate) struct Readings(BTreeMap<ReadingName, Synthesis>);

impl Default for Readings {
    fn default() -> Self {
        Synthesis::default().into()
    }
}

impl From<Synthesis> for Readings {
    fn from(synthesis: Synthesis) -> Self {
        Self([(synthesis.name(), synthesis)].into())
    }
}

impl Readings {
    /// Several named readings, with one camera; `paper` alone of an empty list.
    #[must_use]
    pub(crate) fn named(readings: &[LightReading], camera: &CameraModel) -> Self {
        let contents = readings.iter();
        let contents: BTreeMap<_, _> = contents
            .map(|reading| (reading.name(), Synthesis::of(*reading, camera.clone())))
            .collect();
        if contents.is_empty() {
            return Synthesis::of(LightReading::Paper, camera.clone()).into();
        }
        Self(contents)
    }

    /// The names with the contents, `paper` first.
    pub(crate) fn iter(&self) -> impl Iterator<Item = (&ReadingName, &Synthesis)> {
        self.0.iter()
    }

    /// The content that a degradation is made by: that of its reading; of a kind without readings any, for it has no part
    /// in the pixels.
    ///
    /// # Errors
    /// If the run does not know the reading.
    pub(crate) fn of(&self, how: Option<&Degradation>) -> Result<&Synthesis> {
        let content = match how.and_then(Degradation::reading) {
            None => self.0.values().next(),
            Some(name) => self.0.get(name),
        };
        content.ok_or_else(|| {
            let names: Vec<&str> = self.0.keys().map(ReadingName::as_str).collect();
            let problem = format_args!(
                "{} is not made by the readings {}; name its reading in --profile",
                how.map_or("L0".to_owned(), ToString::to_string),
                names.join(", ")
            );
            Error::usage("--profile", problem)
        })
    }

    /// The content of the one reading.
    ///
    /// # Errors
    /// If there are several, where a command takes one.
    pub(crate) fn only(&self) -> Result<&Synthesis> {
        let mut contents = self.0.values();
        match (contents.next(), contents.next()) {
            (Some(one), None) => Ok(one),
            _ => Err(Error::usage(
                "--profile",
                "one light reading at a time is taken here",
            )),
        }
    }
}

/// What the ratio r amplifies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Amplify {
    /// The shot noise alone, and read, row and quantisation noise act after it (DarkQA, noise item 1).
    #[default]
    ShotOnly,
    /// The sum of all four (ELD, and every public implementation).
    All,
}

/// Where a forward tone curve, 3x² − 2x³, stands in the way back to sRGB.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Tone {
    /// Nowhere, as the paper lists none.
    #[default]
    None,
    /// Before the exposure drop: the clean chain is the exposure branch on greys.
    BeforeEv,
    /// After it, as a camera would: it crushes the darkest levels.
    AfterEv,
}

/// What the five levels of a frame share.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Draws {
    /// The camera and the noise field: levels differ in light alone.
    #[default]
    Shared,
    /// The camera alone: each level has a noise field of its own.
    Fresh,
}

/// What the ratio r depends on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Coupling {
    /// Nothing: it is drawn once a frame (DarkQA).
    #[default]
    Independent,
    /// The level: r = 2^ΔEV, so that light lost is photons lost.
    Photon,
}

flag_words!(Amplify, Tone, Draws, Coupling);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_written_as_they_are_read() {
        for name in ["none", "before-ev", "after-ev"] {
            let tone = Tone::from_str(name, false).unwrap();
            assert_eq!(tone.to_string(), name);
            assert_eq!(serde_json::to_value(tone).unwrap(), name);
        }
    }

    #[test]
    fn the_default_is_the_paper() {
        let camera = CameraModel::default();
        assert_eq!(
            Synthesis::of(LightReading::Paper, camera.clone()),
            Synthesis::default()
        );
        let physical = Synthesis::of(LightReading::Physical, camera);
        assert_eq!(physical.amplify, Amplify::All);
        assert_eq!(physical.coupling, Coupling::Photon);
    }

    #[test]
    fn parts_that_match_a_reading_have_its_name() {
        let mut camera = CameraModel::default();
        camera.pin_gain(0.1).unwrap();
        for reading in LightReading::ALL {
            let synthesis = Synthesis::of(reading, camera.clone());
            assert_eq!(synthesis.name(), reading.name());
            let fresh = Synthesis {
                draws: Draws::Fresh,
                ..synthesis
            };
            assert_eq!(fresh.name(), ReadingName::CUSTOM);
        }
    }

    #[test]
    fn a_reading_that_the_run_lacks_is_named() {
        let readings = Readings::named(&[LightReading::Paper], &CameraModel::default());
        let how: Degradation = "L3-noise@eld".parse().unwrap();
        let error = readings.of(Some(&how)).unwrap_err().to_string();
        assert!(
            error.contains("L3-noise@eld is not made by the readings paper"),
            "{error}"
        );
        assert!(readings.of(None).is_ok());
    }
}
