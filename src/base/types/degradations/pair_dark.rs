//! The darkness of a pair, a frame and a photograph of its scene in the dark: [`PairDark`], and the photograph's name:
//! [`PhotoName`].

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
}
