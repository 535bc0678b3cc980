//! The darkness of a pair, a frame and a photograph of its scene in the dark: [`PairDark`], and the photograph's name:
//! [`PhotoName`].
//!
//! The darkness of a frame's photograph: [`PairFacts`].
//!
//! Camera settings of a simulated exposure: [`ExposureFacts`].
//!
//! The light in which the photographs of a set were taken: [`SetLight`].

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Deserializer, Serialize};

use super::degradation::{Kind, ProfileName};
use crate::error::Error;
use crate::types::text::words::written_as_text;

/// The word before the kind of a synthetic image that is as dark as the photograph of its frame.
const MATCH: &str = "match";

/// The name of a photograph of a frame's scene in the dark, as `dark`, `dark-2` or `lamp`: a word in lower case.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
pub struct PhotoName(String);

impl PhotoName {
    /// The default name of a frame's photograph at an index from 0: `dark`, then `dark-2` and so on.
    #[must_use]
    pub fn numbered(place: usize) -> Self {
        Self(match place {
            0 => "dark".to_owned(),
            place => format!("dark-{}", place + 1),
        })
    }

    /// Checks a name. It is used as the name of a condition, so it must differ from all other conditions.
    ///
    /// # Errors
    /// If it does not begin with a lower-case letter, has other characters than lower-case letters, digits, `_`, `-`
    /// and `.`, is longer than 40 characters, or is the name of another condition.
    pub fn new(name: &str) -> Result<Self, Error> {
        if !name.starts_with(|c: char| c.is_ascii_lowercase())
            || !name.chars().all(|c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || "_-.".contains(c))
        {
            return name_error(
                name,
                "it begins with a letter from a to z, and has only these, digits, '_', '-' and '.'",
            );
        }
        if name.len() > 40 {
            return name_error(name, "it has more than 40 characters");
        }
        let mut letters = name.chars();
        let has_label =
            "let".contains(letters.next().unwrap_or_default()) && letters.next().is_some_and(|c| c.is_ascii_digit());
        let is_taken = ["none", "blind", "chance", "guessing", MATCH].contains(&name)
            || name.starts_with("match-")
            || Kind::from_word(name).is_some();
        if has_label || is_taken {
            return name_error(name, "another condition is written so; take another name");
        }
        Ok(Self(name.to_owned()))
    }

    /// The name as a string slice.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

fn name_error(name: &str, problem: &str) -> Result<PhotoName, Error> {
    let problem = format!("{name:?} is not a valid name of a dark photograph: {problem}");
    Err(Error::usage("dark", problem))
}

impl fmt::Display for PhotoName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(&self.0)
    }
}

impl<'de> Deserialize<'de> for PhotoName {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Self::new(&String::deserialize(deserializer)?).map_err(serde::de::Error::custom)
    }
}

/// The dark image of a pair: a photograph, or a synthetic image with the same darkness. The darkness differs by frame.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum PairDark {
    /// A synthetic image of the frame with the exposure drop of its photograph: the kind, and the noise profile if the
    /// kind has several.
    Match(Kind, Option<ProfileName>),
    /// A photograph of the same scene in the dark, without synthesis.
    Photograph(PhotoName),
}

impl PairDark {
    /// The name of the photograph; `None` for a synthetic image.
    #[must_use]
    pub fn photograph(&self) -> Option<&PhotoName> {
        match self {
            Self::Photograph(name) => Some(name),
            Self::Match(..) => None,
        }
    }

    /// The kind of synthesis; `None` for a photograph.
    #[must_use]
    pub fn kind(&self) -> Option<Kind> {
        match self {
            Self::Match(kind, _) => Some(*kind),
            Self::Photograph(_) => None,
        }
    }

    /// The noise profile of synthesis; `None` for a photograph, and for kinds without noise profiles.
    #[must_use]
    pub fn reading(&self) -> Option<&ProfileName> {
        match self {
            Self::Match(_, reading) => reading.as_ref(),
            Self::Photograph(_) => None,
        }
    }

    /// Drops the noise profile: photographs of one name, or synthetic images of one kind, are compared across noise
    /// profiles.
    #[must_use]
    pub fn without_profile(&self) -> Self {
        match self {
            Self::Photograph(name) => Self::Photograph(name.clone()),
            Self::Match(kind, _) => Self::Match(*kind, None),
        }
    }

    /// The name in captions and tables, as `dark (real)` or `with noise (as dark as real)`.
    #[must_use]
    pub fn title(&self) -> String {
        match self {
            Self::Photograph(name) => format!("{name} (real)"),
            Self::Match(kind, reading) => {
                let reading = reading
                    .as_ref()
                    .filter(|name| **name != ProfileName::PAPER)
                    .map_or(String::new(), |name| format!(" @{name}"));
                format!("{}{reading} (as dark as real)", kind.title())
            }
        }
    }
}

impl fmt::Display for PairDark {
    /// `dark`, `match-ev`, `match-noise` or `match-noise@eld`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Photograph(name) => f.pad(name.as_str()),
            Self::Match(kind, reading) => {
                let reading = reading
                    .as_ref()
                    .filter(|name| **name != ProfileName::PAPER)
                    .map_or(String::new(), |name| format!("@{name}"));
                f.pad(&format!("{MATCH}-{kind}{reading}"))
            }
        }
    }
}

written_as_text!(PairDark);

impl FromStr for PairDark {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let Some(kind) = text.strip_prefix("match-") else {
            return PhotoName::new(text).map(Self::Photograph);
        };
        let (word, reading) = match kind.split_once('@') {
            None => (kind, None),
            Some((kind, reading)) => (kind, Some(ProfileName::new(reading)?)),
        };
        let kind = Kind::from_word(word)
            .filter(|kind| kind.can_match())
            .ok_or_else(|| match_error(text, "the forms are match-ev, match-noise and match-auto"))?;
        if reading.is_some() && !kind.has_profiles() {
            return Err(match_error(text, "this kind has no noise profiles"));
        }
        if reading == Some(ProfileName::PAPER) {
            return Err(match_error(text, "the reading paper is written without its name"));
        }
        let reading = reading.or_else(|| kind.has_profiles().then_some(ProfileName::PAPER));
        Ok(Self::Match(kind, reading))
    }
}

fn match_error(text: &str, problem: &str) -> Error {
    Error::usage("condition", format!("{text:?}: {problem}"))
}

/// How much darker a photograph is than its frame, in EV, for records. All numbers are finite.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PairFacts {
    /// Drop in EV computed from the exposure times and gains in the data; `None` if the data do not state them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stated: Option<f64>,
    /// Measured drop in EV: log₂ of the ratio of the mean linear luminances; `None` if one of the images is black.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mean: Option<f64>,
    /// Median over the pixels of log₂ of the luminance ratio, in EV; `None` if too many pixels are black.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub median: Option<f64>,
    /// The drop in EV with which synthesis makes the frame as dark as the photograph. It differs from `mean`, because
    /// synthesis computes light as codes to the power of 2.2.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub synthesis: Option<f64>,
}

impl PairFacts {
    /// The largest drop in EV that can be measured. Above it, noise clipped at black hides a part of the drop: on a dim
    /// frame with a noise deviation of 0.002 in linear light, 6 EV are measured as 5.9, 7.5 EV as 6.8 and 9 EV as 7.3.
    pub const MEASURABLE: f64 = 6.0;

    /// The stated drop in EV, otherwise the measured one; `None` if neither is known.
    #[must_use]
    pub fn ev(&self) -> Option<f64> {
        self.stated.or(self.mean)
    }

    /// The drop in EV with which synthesis matches the photograph: the stated one, otherwise `synthesis`.
    #[must_use]
    pub fn matching(&self) -> Option<f64> {
        self.stated.or(self.synthesis)
    }

    /// True if the drop is measured and the real one may be larger.
    #[must_use]
    pub fn is_lower_bound(&self) -> bool {
        self.stated.is_none() && self.mean.is_some_and(|ev| ev > Self::MEASURABLE)
    }
}

// No number is NaN.
impl Eq for PairFacts {}

/// Camera settings of a simulated exposure, for records and sidecars. All numbers are finite.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExposureFacts {
    /// Longer exposure time, in EV; `None` without automatic exposure.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shutter: Option<f64>,
    /// Gain, in EV; `None` without automatic exposure.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gain: Option<f64>,
    /// Remaining darkness that the exposure did not compensate, in EV; `None` without automatic exposure.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dark: Option<f64>,
    /// Exposure time, in milliseconds.
    pub time_ms: f64,
    /// System gain K, in ADU per electron; `None` without automatic exposure.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub system_gain: Option<f64>,
    /// Length of the motion blur, in pixels of the frame; `None` for several frames in which it differs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub blur_px: Option<f64>,
    /// Direction of the motion blur in degrees: 0 is along a row, 90 down a column; `None` as for the length.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub blur_angle: Option<f64>,
}

impl ExposureFacts {
    /// The settings of a walk: blur length and angle only if they are equal in all frames, the others from the first
    /// frame. `None` if a frame has no settings.
    #[must_use]
    pub fn shared(mut all: impl Iterator<Item = Option<Self>>) -> Option<Self> {
        let first = all.next()??;
        all.try_fold(first, |shared, other| {
            let other = other?;
            Some(Self {
                blur_px: shared.blur_px.filter(|px| other.blur_px == Some(*px)),
                blur_angle: shared.blur_angle.filter(|angle| other.blur_angle == Some(*angle)),
                ..shared
            })
        })
    }
}

// No number is NaN.
impl Eq for ExposureFacts {}

/// The light in which the photographs of a set were taken.
#[cfg_attr(feature = "program", derive(clap::ValueEnum))]
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SetLight {
    /// Well lit: L0 is the frame in the light
    #[default]
    Lit,
    /// In the dark: L0 is the photograph as it was taken, and nothing is darker by default
    Dark,
}

impl SetLight {
    /// The label of L0 in tables and figures: `L0`, or `as photographed`.
    #[must_use]
    pub fn l0_label(self) -> &'static str {
        match self {
            Self::Lit => "L0",
            Self::Dark => "as photographed",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn photograph_names_differ_from_other_conditions() {
        for name in ["dark", "dark-2", "lamp", "low_1.5s", "evening", "tungsten", "match"] {
            assert_eq!(PhotoName::new(name).is_ok(), name != "match", "{name}");
        }
        assert_eq!(PhotoName::numbered(0).as_str(), "dark");
        assert_eq!(PhotoName::numbered(1).as_str(), "dark-2");
        for name in
            ["", "Dark", "2lux", "l3-ev", "e3", "t5", "ev", "noise", "match-ev", "none", "blind", "a b", "a+b", "ä"]
        {
            assert!(PhotoName::new(name).is_err(), "{name}");
        }
        assert!(PhotoName::new(&"a".repeat(41)).is_err());
    }

    #[test]
    fn dark_images_of_pairs_read_back() {
        for text in ["dark", "dark-2", "match-ev", "match-noise", "match-noise@eld", "match-auto"] {
            assert_eq!(text.parse::<PairDark>().unwrap().to_string(), text);
        }
        for text in ["match-", "match-motion", "match-ev@eld", "match-noise@paper", "match"] {
            assert!(text.parse::<PairDark>().is_err(), "{text}");
        }
    }

    #[test]
    fn frames_share_equal_settings() {
        let [first, second] = [10.0, 20.0].map(|blur_angle| {
            Some(ExposureFacts {
                shutter: Some(2.0),
                gain: None,
                dark: None,
                time_ms: 8.33,
                system_gain: None,
                blur_px: Some(2.0),
                blur_angle: Some(blur_angle),
            })
        });
        let one = ExposureFacts::shared([first, second].into_iter()).unwrap();
        assert_eq!((one.blur_px, one.blur_angle), (Some(2.0), None));
        assert_eq!(one.shutter, Some(2.0));
        assert_eq!(ExposureFacts::shared([first].into_iter()), first);
        assert_eq!(ExposureFacts::shared([first, None].into_iter()), None);
        assert_eq!(ExposureFacts::shared([].into_iter()), None);
        let text = serde_json::to_string(&one).unwrap();
        assert_eq!(text, r#"{"shutter":2.0,"time_ms":8.33,"blur_px":2.0}"#);
        assert_eq!(serde_json::from_str::<ExposureFacts>(&text).unwrap(), one);
    }
}
