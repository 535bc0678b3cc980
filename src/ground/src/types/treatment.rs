//! What becomes of a frame before it is enhanced: [`Treatment`].

use std::fmt;
use std::str::FromStr;

use super::degradation::Degradation;
use super::pair_dark::PairDark;
use crate::error::Error;

/// What becomes of a frame before it is enhanced.
///
/// A photograph in the dark stands here beside the degradations and is none of them: it has a name instead of a kind and a severity,
/// so no synthesis ever meets one, and no curve, threshold or mean over levels does, which all ask for a [`Degradation`]. A synthetic
/// image that is as dark as the photograph of its frame is of the same sort, because its exposure drop differs by frame: it is resolved
/// to a degradation where its frame is known.
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
        // A word in lower case is no level; where it is no pair either, the problem is told with the forms of levels.
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
