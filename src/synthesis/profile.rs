//! What the paper leaves open, or physics would do otherwise: [`Synthesis`], and the profiles that set it as a whole.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use super::camera::CameraModel;
use crate::error::{Error, Result};

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

/// A set of choices that belong together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Profile {
    /// The DarkQA paper to the letter.
    #[default]
    Paper,
    /// What physics says: all noise is amplified, light lost is photons lost, the tone curve is put back.
    Physical,
}

impl Synthesis {
    /// The choices of a profile, with a camera of one's own.
    #[must_use]
    pub fn of(profile: Profile, camera: CameraModel) -> Self {
        match profile {
            Profile::Paper => Self {
                camera,
                ..Self::default()
            },
            Profile::Physical => Self {
                amplify: Amplify::All,
                tone: Tone::BeforeEv,
                draws: Draws::Shared,
                coupling: Coupling::Photon,
                camera,
            },
        }
    }
}

/// What the ratio r amplifies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Amplify {
    /// The shot noise alone, and read, row and quantisation noise act after it (DarkQA, noise item 1).
    #[default]
    ShotOnly,
    /// The sum of all four (ELD, and every public implementation).
    All,
}

/// Where a forward tone curve, 3x² − 2x³, stands in the way back to sRGB.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
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
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Draws {
    /// The camera and the noise field: levels differ in light alone.
    #[default]
    Shared,
    /// The camera alone: each level has a noise field of its own.
    Fresh,
}

/// What the ratio r depends on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Coupling {
    /// Nothing: it is drawn once a frame (DarkQA).
    #[default]
    Independent,
    /// The level: r = 2^ΔEV, so that light lost is photons lost.
    Photon,
}

/// Reads and writes an option's values by their names.
macro_rules! named {
    ($option:ident: $($name:literal = $value:ident),+) => {
        impl fmt::Display for $option {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(match self { $(Self::$value => $name),+ })
            }
        }

        impl FromStr for $option {
            type Err = Error;

            fn from_str(text: &str) -> Result<Self> {
                match text {
                    $($name => Ok(Self::$value),)+
                    _ => Err(Error::usage(
                        stringify!($option).to_lowercase(),
                        format_args!(concat!("{:?} is none of" $(, " ", $name)+), text),
                    )),
                }
            }
        }
    };
}

named!(Profile: "paper" = Paper, "physical" = Physical);
named!(Amplify: "shot-only" = ShotOnly, "all" = All);
named!(Tone: "none" = None, "before-ev" = BeforeEv, "after-ev" = AfterEv);
named!(Draws: "shared" = Shared, "fresh" = Fresh);
named!(Coupling: "independent" = Independent, "photon" = Photon);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_written_as_they_are_read() {
        for name in ["none", "before-ev", "after-ev"] {
            let tone: Tone = name.parse().unwrap();
            assert_eq!(tone.to_string(), name);
            assert_eq!(serde_json::to_value(tone).unwrap(), name);
        }
        let wrong = "photons".parse::<Coupling>().unwrap_err().to_string();
        assert!(wrong.contains("independent photon"), "{wrong}");
    }

    #[test]
    fn the_default_is_the_paper() {
        let camera = CameraModel::default();
        assert_eq!(
            Synthesis::of(Profile::Paper, camera.clone()),
            Synthesis::default()
        );
        let physical = Synthesis::of(Profile::Physical, camera);
        assert_eq!(physical.amplify, Amplify::All);
        assert_eq!(physical.coupling, Coupling::Photon);
    }
}
