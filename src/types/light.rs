//! How much light is missing: [`Level`], [`Stops`], [`Degradation`].

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::error::Error;

/// An amount of light in exposure values (EV): one stop is a factor of two.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
pub struct Stops(pub f32);

/// A degradation level, L0 (untouched) to L5 (9 EV darker).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum Level {
    /// The untouched frame.
    L0,
    /// 2 EV darker.
    L1,
    /// 4 EV darker.
    L2,
    /// 6 EV darker.
    L3,
    /// 7.5 EV darker.
    L4,
    /// 9 EV darker.
    L5,
}

impl Level {
    /// All six levels, lightest first.
    pub const ALL: [Self; 6] = [Self::L0, Self::L1, Self::L2, Self::L3, Self::L4, Self::L5];

    /// The exposure drop of this level: 0, 2, 4, 6, 7.5, 9 EV (DarkQA, section III).
    #[must_use]
    pub fn exposure_drop(self) -> Stops {
        Stops([0.0, 2.0, 4.0, 6.0, 7.5, 9.0][self as usize])
    }

    /// The level as a dark one; `None` for L0.
    #[must_use]
    pub fn dark(self) -> Option<DarkLevel> {
        DarkLevel::ALL.into_iter().find(|dark| dark.level() == self)
    }
}

impl fmt::Display for Level {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(["L0", "L1", "L2", "L3", "L4", "L5"][*self as usize])
    }
}

impl FromStr for Level {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        Self::ALL
            .into_iter()
            .find(|level| level.to_string().eq_ignore_ascii_case(text))
            .ok_or_else(|| {
                Error::usage(
                    "level",
                    format_args!("{text:?} is none of L0, L1, L2, L3, L4, L5"),
                )
            })
    }
}

/// A level with less light than L0, so that "L0 with noise" cannot be written down.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum DarkLevel {
    /// 2 EV darker.
    L1,
    /// 4 EV darker.
    L2,
    /// 6 EV darker.
    L3,
    /// 7.5 EV darker.
    L4,
    /// 9 EV darker.
    L5,
}

impl DarkLevel {
    /// The five dark levels, lightest first.
    pub const ALL: [Self; 5] = [Self::L1, Self::L2, Self::L3, Self::L4, Self::L5];

    /// The same level among all six.
    #[must_use]
    pub fn level(self) -> Level {
        Level::ALL[self as usize + 1]
    }

    /// The exposure drop of this level in EV.
    #[must_use]
    pub fn exposure_drop(self) -> Stops {
        self.level().exposure_drop()
    }
}

/// Which of the paired versions of a level an image is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Variant {
    /// Untouched.
    None,
    /// Exposure drop alone.
    Ev,
    /// Exposure drop and sensor noise.
    Noise,
}

impl fmt::Display for Variant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::None => "none",
            Self::Ev => "ev",
            Self::Noise => "noise",
        })
    }
}

/// A choice among the two dark variants.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Variants {
    /// Exposure drop alone.
    Ev,
    /// With sensor noise.
    Noise,
    /// Each by itself.
    Both,
}

impl Variants {
    /// Whether a variant is among them; the untouched frame never is.
    #[must_use]
    pub fn include(self, variant: Variant) -> bool {
        match variant {
            Variant::None => false,
            Variant::Ev => self != Self::Noise,
            Variant::Noise => self != Self::Ev,
        }
    }
}

impl fmt::Display for Variants {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Ev => "ev",
            Self::Noise => "noise",
            Self::Both => "both",
        })
    }
}

impl FromStr for Variants {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        [Self::Ev, Self::Noise, Self::Both]
            .into_iter()
            .find(|variants| variants.to_string() == text)
            .ok_or_else(|| {
                Error::usage(
                    "variant",
                    format_args!("{text:?} is none of ev, noise, both"),
                )
            })
    }
}

/// What happened to the light of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Degradation {
    /// Nothing: L0.
    None,
    /// Exposure drop alone.
    Exposure(DarkLevel),
    /// Exposure drop with the noise of a sensor.
    Sensor(DarkLevel),
}

impl Degradation {
    /// The level.
    #[must_use]
    pub fn level(self) -> Level {
        match self {
            Self::None => Level::L0,
            Self::Exposure(dark) | Self::Sensor(dark) => dark.level(),
        }
    }

    /// The variant.
    #[must_use]
    pub fn variant(self) -> Variant {
        match self {
            Self::None => Variant::None,
            Self::Exposure(_) => Variant::Ev,
            Self::Sensor(_) => Variant::Noise,
        }
    }
}

impl fmt::Display for Degradation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::None => write!(f, "L0"),
            _ => write!(f, "{}-{}", self.level(), self.variant()),
        }
    }
}

impl FromStr for Degradation {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let unknown = || {
            Error::usage(
                "condition",
                format_args!("{text:?} is not of the form L0, L3-ev or L3-noise"),
            )
        };
        let Some((level, variant)) = text.split_once('-') else {
            return if text == "L0" {
                Ok(Self::None)
            } else {
                Err(unknown())
            };
        };
        let dark = level.parse::<Level>()?.dark().ok_or_else(unknown)?;
        match variant {
            "ev" => Ok(Self::Exposure(dark)),
            "noise" => Ok(Self::Sensor(dark)),
            _ => Err(unknown()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drops_are_the_papers() {
        let drops: Vec<f32> = Level::ALL
            .iter()
            .map(|level| level.exposure_drop().0)
            .collect();
        assert_eq!(drops, [0.0, 2.0, 4.0, 6.0, 7.5, 9.0]);
    }

    #[test]
    fn degradations_read_back() {
        let dark = DarkLevel::ALL.into_iter();
        let all = dark
            .flat_map(|d| [Degradation::Exposure(d), Degradation::Sensor(d)])
            .chain([Degradation::None]);
        for degradation in all {
            assert_eq!(
                degradation.to_string().parse::<Degradation>().unwrap(),
                degradation
            );
        }
        for wrong in ["", "L0-ev", "L6-ev", "L3", "L3-raw", "L3-noise-x"] {
            assert!(wrong.parse::<Degradation>().is_err(), "{wrong}");
        }
    }
}
