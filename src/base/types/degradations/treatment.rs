//! [`Treatment`]: the processing of a frame before it is enhanced.

use std::fmt;
use std::str::FromStr;

use super::degradation::Degradation;
use super::pair_dark::PairDark;
use crate::error::Error;

/// Processing of a frame before it is enhanced.
///
/// A photograph in the dark is not a degradation: it has a name instead of a kind and a severity, so synthesis, curves,
/// thresholds and means over levels, which all take a [`Degradation`], exclude it by type. A synthetic image that
/// matches a photograph is handled in the same way, because its exposure drop differs by frame; it becomes a
/// degradation once its frame is known.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Treatment {
    /// The frame as it is, L0.
    Untouched,
    /// The frame with a degradation, the same for all frames.
    Degraded(Degradation),
    /// The darkness of a pair.
    Paired(PairDark),
}

impl Treatment {
    /// The degradation that is the same for all frames; `None` for L0 and for pairs.
    #[must_use]
    pub fn degradation(&self) -> Option<&Degradation> {
        match self {
            Self::Degraded(how) => Some(how),
            Self::Untouched | Self::Paired(_) => None,
        }
    }

    /// The darkness of a pair; `None` for L0 and degradations.
    #[must_use]
    pub fn pair(&self) -> Option<&PairDark> {
        match self {
            Self::Paired(dark) => Some(dark),
            Self::Untouched | Self::Degraded(_) => None,
        }
    }
}

impl From<Option<Degradation>> for Treatment {
    fn from(degradation: Option<Degradation>) -> Self {
        degradation.map_or(Self::Untouched, Self::Degraded)
    }
}

impl fmt::Display for Treatment {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Untouched => f.write_str("L0"),
            Self::Degraded(how) => how.fmt(f),
            Self::Paired(dark) => dark.fmt(f),
        }
    }
}

impl FromStr for Treatment {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        if text == "L0" {
            return Ok(Self::Untouched);
        }
        // Levels are in upper case, so a lower-case word is parsed as a pair. If that fails, the error about levels
        // lists all forms.
        if text.starts_with(|c: char| c.is_ascii_lowercase()) {
            match text.parse::<PairDark>() {
                Ok(dark) => return Ok(Self::Paired(dark)),
                Err(problem) if text.starts_with("match-") => return Err(problem),
                Err(_) => {}
            }
        }
        text.parse().map(Self::Degraded)
    }
}
