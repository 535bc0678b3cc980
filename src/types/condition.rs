//! What a model is shown: [`Condition`] = degradation × enhancer.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Deserializer, Serialize};

use super::axis_level::{AxisLevel, KindReading};
use super::degradation::Degradation;
use super::words::as_text;
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

/// One way in which a frame is shown: degraded or not, enhanced or not.
///
/// Its name is `LABEL-KIND[@READING][+ENHANCER]`, or `L0[+ENHANCER]`; `&` is reserved for several degradations in a row.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Condition {
    /// What was done to the frame; `None` for L0, the untouched frame.
    pub degradation: Option<Degradation>,
    /// The enhancer; `None` for raw.
    pub enhancer: Option<EnhancerName>,
}

impl Condition {
    /// The untouched frame.
    pub const L0: Self = Self {
        degradation: None,
        enhancer: None,
    };

    /// The condition without an enhancer.
    #[must_use]
    pub fn raw(degradation: Option<Degradation>) -> Self {
        Self {
            degradation,
            enhancer: None,
        }
    }

    /// The column `level`.
    #[must_use]
    pub fn level(&self) -> AxisLevel {
        self.degradation.as_ref().into()
    }

    /// The column `variant`, with the light reading.
    #[must_use]
    pub fn kind_reading(&self) -> KindReading {
        self.degradation.as_ref().into()
    }
}

impl fmt::Display for Condition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.degradation {
            None => f.write_str("L0")?,
            Some(degradation) => write!(f, "{degradation}")?,
        }
        match &self.enhancer {
            None => Ok(()),
            Some(name) => write!(f, "+{name}"),
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
        let degradation = match degradation {
            "L0" => None,
            other => Some(other.parse()?),
        };
        Ok(Self {
            degradation,
            enhancer,
        })
    }
}

as_text!(Condition);

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
        for text in [
            "L0",
            "L3-ev",
            "E3.3-ev",
            "L5-noise+zero-dce.v2",
            "L0+ruas",
            "L3-noise@physical",
            "E3.3-noise@eld+zerodce",
            "E0.01-noise@my-own.reading_2+a",
        ] {
            assert_eq!(text.parse::<Condition>().unwrap().to_string(), text);
        }
    }

    #[test]
    fn what_is_no_condition_is_refused() {
        let cases = [
            ("L3-noise+", "no name for an enhancer"),
            ("L3-noise+a b", "no name for an enhancer"),
            ("L3-noise+a+b", "no name for an enhancer"),
            ("L0-ev", "none of L0"),
            ("L6-ev", "none of L0"),
            ("L3", "not of that form"),
            ("", "not of that form"),
            ("L3-raw", "\"raw\""),
            ("L3-noise-x", "\"noise-x\""),
            ("L3-ev@eld", "no light readings; write L3-ev"),
            ("L3-noise@paper", "without its name"),
            ("L3-noise@", "no name of a light reading"),
            ("L3-noise@a&b", "no name of a light reading"),
            ("E6-noise", "is written L3"),
            ("E3.30-ev", "is written E3.3"),
            ("E3.333-ev", "two decimals"),
            ("E0-ev", "0 or too large"),
            ("E16.01-ev", "above E16"),
            ("E1e1-ev", "no decimal number"),
        ];
        for (text, says) in cases {
            let error = text.parse::<Condition>().unwrap_err().to_string();
            assert!(error.contains(says), "{text}: {error}");
        }
    }

    #[test]
    fn order_is_by_severity() {
        let mut names = ["L3-ev", "L0", "E5-noise@eld", "E5-noise", "L2-noise"];
        let key = |name: &&str| name.parse::<Condition>().unwrap();
        names.sort_by_key(key);
        assert_eq!(
            names,
            ["L0", "L2-noise", "E5-noise", "E5-noise@eld", "L3-ev"]
        );
    }
}
