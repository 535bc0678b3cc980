//! What a model is shown: [`Condition`] = degradation × enhancer.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::light::Degradation;
use crate::error::Error;

/// The name of an enhancement model as it stands in tables and records: letters, digits, `_`, `-` and `.`.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
pub struct EnhancerName(String);

impl EnhancerName {
    /// Checks a name: not empty, and of letters, digits, `_`, `-` and `.` alone.
    pub fn new(name: &str) -> Result<Self, Error> {
        let fits = |c: char| c.is_ascii_alphanumeric() || "_-.".contains(c);
        if name.is_empty() || !name.chars().all(fits) {
            return Err(Error::usage(
                "--llie",
                format_args!(
                    "{name:?} is no name for an enhancer: letters, digits, '_', '-' and '.' only; rename the file"
                ),
            ));
        }
        Ok(Self(name.to_owned()))
    }

    /// The name.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl fmt::Display for EnhancerName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(&self.0)
    }
}

/// One way in which a frame is shown: how dark, and mended by what.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Condition {
    /// What happened to its light.
    pub degradation: Degradation,
    /// What mended it; `None` for raw.
    pub enhancer: Option<EnhancerName>,
}

impl Condition {
    /// The condition without an enhancer.
    #[must_use]
    pub fn raw(degradation: Degradation) -> Self {
        Self {
            degradation,
            enhancer: None,
        }
    }
}

impl fmt::Display for Condition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.enhancer {
            None => write!(f, "{}", self.degradation),
            Some(name) => write!(f, "{}+{name}", self.degradation),
        }
    }
}

impl FromStr for Condition {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let (degradation, enhancer) = match text.split_once('+') {
            None => (text, None),
            Some((degradation, name)) => (degradation, Some(EnhancerName::new(name)?)),
        };
        Ok(Self {
            degradation: degradation.parse()?,
            enhancer,
        })
    }
}

impl Serialize for Condition {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for Condition {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        String::deserialize(deserializer)?
            .parse()
            .map_err(serde::de::Error::custom)
    }
}

impl<'de> Deserialize<'de> for EnhancerName {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Self::new(&String::deserialize(deserializer)?).map_err(serde::de::Error::custom)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn conditions_read_back() {
        for text in ["L0", "L3-ev", "L5-noise+zero-dce.v2", "L0+ruas"] {
            assert_eq!(text.parse::<Condition>().unwrap().to_string(), text);
        }
        for wrong in ["L3-noise+", "L3-noise+a b", "L3-noise+a+b"] {
            assert!(wrong.parse::<Condition>().is_err(), "{wrong}");
        }
    }
}
