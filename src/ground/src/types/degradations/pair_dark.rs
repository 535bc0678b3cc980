//! The darkness of a pair, which is not the same for every frame: [`PairDark`]; and the name of a photograph: [`PhotoName`].

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Deserializer, Serialize};

use super::degradation::{Kind, ReadingName};
use crate::error::Error;
use crate::types::text::words::written_as_text;

/// The word before the kind of a synthetic image that is as dark as the photograph of its frame.
const MATCH: &str = "match";

/// The name of a photograph of a frame's scene in the dark, as `dark`, `dark-2` or `lamp`: a word in lower case.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
pub struct PhotoName(String);

impl PhotoName {
    /// The name of a frame's photograph that the data do not name: `dark`, then `dark-2` and so on.
    #[must_use]
    pub fn numbered(place: usize) -> Self {
        Self(match place {
            0 => "dark".to_owned(),
            place => format!("dark-{}", place + 1),
        })
    }

    /// Checks a name. It becomes a condition, so it must not be one of another sort.
    ///
    /// # Errors
    /// If it does not begin with a small letter, has other characters than small letters, digits, `_`, `-` and `.`, has more than 40
    /// of them, or is a word of another condition.
    pub fn new(name: &str) -> Result<Self, Error> {
        let wrong = |problem: &str| {
            let problem = format!("{name:?} is not a valid name of a dark photograph: {problem}");
            Err(Error::usage("dark", problem))
        };
        if !name.starts_with(|c: char| c.is_ascii_lowercase())
            || !name
                .chars()
                .all(|c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || "_-.".contains(c))
        {
            return wrong(
                "it begins with a letter from a to z, and has only these, digits, '_', '-' and '.'",
            );
        }
        if name.len() > 40 {
            return wrong("it has more than 40 characters");
        }
        let mut letters = name.chars();
        let has_label = "let".contains(letters.next().unwrap_or_default())
            && letters.next().is_some_and(|c| c.is_ascii_digit());
        let is_taken = ["none", "blind", "chance", "guessing", MATCH].contains(&name)
            || name.starts_with("match-")
            || Kind::from_word(name).is_some();
        if has_label || is_taken {
            return wrong("another condition is written so; take another name");
        }
        Ok(Self(name.to_owned()))
    }

    /// The name as a string slice.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }
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

/// A darkness that differs by frame: that of its photograph, or of the synthetic image that matches the photograph.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum PairDark {
    /// Synthesis on the frame, with the exposure drop that its photograph has: the kind, and the reading if the kind has readings.
    Match(Kind, Option<ReadingName>),
    /// A photograph of the same scene in the dark. It passes no synthesis.
    Photograph(PhotoName),
}

impl PairDark {
    /// The name of the photograph; `None` for synthesis.
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

    /// The noise profile of synthesis; `None` for a photograph, and for kinds without readings.
    #[must_use]
    pub fn reading(&self) -> Option<&ReadingName> {
        match self {
            Self::Match(_, reading) => reading.as_ref(),
            Self::Photograph(_) => None,
        }
    }

    /// The same without the noise profile: images of one sort are compared as lights of one level.
    #[must_use]
    pub fn sort(&self) -> Self {
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
                    .filter(|name| **name != ReadingName::PAPER)
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
                    .filter(|name| **name != ReadingName::PAPER)
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
        let wrong = |problem: &str| Error::usage("condition", format!("{text:?}: {problem}"));
        let (word, reading) = match kind.split_once('@') {
            None => (kind, None),
            Some((kind, reading)) => (kind, Some(ReadingName::new(reading)?)),
        };
        let kind = Kind::from_word(word)
            .filter(|kind| kind.can_match())
            .ok_or_else(|| wrong("the forms are match-ev, match-noise and match-auto"))?;
        if reading.is_some() && !kind.has_readings() {
            return Err(wrong("this kind has no noise profiles"));
        }
        if reading == Some(ReadingName::PAPER) {
            return Err(wrong("the reading paper is written without its name"));
        }
        let reading = reading.or_else(|| kind.has_readings().then_some(ReadingName::PAPER));
        Ok(Self::Match(kind, reading))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_photographs_are_no_other_conditions() {
        for name in [
            "dark", "dark-2", "lamp", "low_1.5s", "evening", "tungsten", "match",
        ] {
            assert_eq!(PhotoName::new(name).is_ok(), name != "match", "{name}");
        }
        assert_eq!(PhotoName::numbered(0).as_str(), "dark");
        assert_eq!(PhotoName::numbered(1).as_str(), "dark-2");
        for name in [
            "", "Dark", "2lux", "l3-ev", "e3", "t5", "ev", "noise", "match-ev", "none", "blind",
            "a b", "a+b", "ä",
        ] {
            assert!(PhotoName::new(name).is_err(), "{name}");
        }
        assert!(PhotoName::new(&"a".repeat(41)).is_err());
    }

    #[test]
    fn they_read_back() {
        for text in [
            "dark",
            "dark-2",
            "match-ev",
            "match-noise",
            "match-noise@eld",
            "match-auto",
        ] {
            assert_eq!(text.parse::<PairDark>().unwrap().to_string(), text);
        }
        for text in [
            "match-",
            "match-motion",
            "match-ev@eld",
            "match-noise@paper",
            "match",
        ] {
            assert!(text.parse::<PairDark>().is_err(), "{text}");
        }
    }
}
