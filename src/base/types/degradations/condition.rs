//! The state in which a frame is shown to a model: [`Condition`] = treatment × enhancer.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Deserializer, Serialize};

use super::axis_level::{AxisLevel, Variant};
use super::degradation::Degradation;
use super::pair_dark::{PairDark, PhotoName};
use super::run_group::RunGroup;
use super::treatment::Treatment;
use crate::error::Error;
use crate::types::text::words::as_text;

/// The name of an enhancement model in tables and records: letters, digits, `_`, `-` and `.`.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
pub struct EnhancerName(String);

impl EnhancerName {
    /// Checks a name.
    ///
    /// # Errors
    /// If it is empty or has other characters than letters, digits, `_`, `-` and `.`.
    pub fn new(name: &str) -> Result<Self, Error> {
        if name.is_empty() || !name.chars().all(|c: char| c.is_ascii_alphanumeric() || "_-.".contains(c)) {
            return Err(Error::usage(
                "--llie",
                format_args!(
                    "{name:?} is not a valid name of an enhancer: only letters, digits, '_', '-' and '.' are allowed; rename the file"
                ),
            ));
        }
        Ok(Self(name.to_owned()))
    }

    /// The name as a string slice.
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

/// A treatment with or without an enhancer: the state in which a frame is shown.
///
/// It is written `LABEL-KIND[@READING][+ENHANCER]` or `L0[+ENHANCER]`; a photograph in the dark is `NAME[+ENHANCER]`,
/// and a synthetic image that is as dark as it is `match-KIND[@READING][+ENHANCER]`. READING is a noise profile. `&` is
/// reserved for several degradations in sequence.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Condition {
    /// Treatment of the frame before it is enhanced.
    pub treatment: Treatment,
    /// The enhancer; `None` if the image is not enhanced.
    pub enhancer: Option<EnhancerName>,
    /// The runs with these images, in a report on runs whose images differ; otherwise `None`.
    pub group: Option<RunGroup>,
}

impl Condition {
    /// The untouched frame without an enhancer.
    pub const L0: Self = Self { treatment: Treatment::Untouched, enhancer: None, group: None };

    /// The condition without an enhancer.
    #[must_use]
    pub fn raw(treatment: impl Into<Treatment>) -> Self {
        Self { treatment: treatment.into(), enhancer: None, group: None }
    }

    /// The degradation of the frame; `None` for L0 and for pairs.
    #[must_use]
    pub fn degradation(&self) -> Option<&Degradation> {
        self.treatment.degradation()
    }

    /// The darkness of the pair; `None` for L0 and for degradations.
    #[must_use]
    pub fn pair(&self) -> Option<&PairDark> {
        self.treatment.pair()
    }

    /// The name of the photograph in the dark; `None` for images that are made from the frame itself.
    #[must_use]
    pub fn photograph(&self) -> Option<&PhotoName> {
        self.pair().and_then(PairDark::photograph)
    }

    /// The value of the column `level`.
    #[must_use]
    pub fn level(&self) -> AxisLevel {
        (&self.treatment).into()
    }

    /// The value of the column `variant`: the kind with its noise profile, or the darkness of a pair; and its group of
    /// runs.
    #[must_use]
    pub fn variant(&self) -> Variant {
        Variant { group: self.group.clone(), ..(&self.treatment).into() }
    }
}

impl fmt::Display for Condition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.treatment.fmt(f)?;
        if let Some(name) = &self.enhancer {
            write!(f, "+{name}")?;
        }
        match &self.group {
            None => Ok(()),
            Some(group) => group.fmt(f),
        }
    }
}

impl FromStr for Condition {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let (treatment, enhancer) = match text.split_once('+') {
            None => (text, None),
            Some((treatment, name)) => (treatment, Some(EnhancerName::new(name)?)),
        };
        Ok(Self { treatment: treatment.parse()?, enhancer, group: None })
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
            "dark",
            "dark-2+zero-dce.v2",
            "match-noise@eld",
            "match-ev+ruas",
        ] {
            assert_eq!(text.parse::<Condition>().unwrap().to_string(), text);
        }
    }

    #[test]
    fn invalid_conditions_are_refused() {
        let cases = [
            ("L3-noise+", "not a valid name of an enhancer"),
            ("L3-noise+a b", "not a valid name of an enhancer"),
            ("L3-noise+a+b", "not a valid name of an enhancer"),
            ("L0-ev", "not one of L0"),
            ("L6-ev", "not one of L0"),
            ("L3", "not of that form"),
            ("", "not of that form"),
            ("L3-raw", "\"raw\""),
            ("L3-noise-x", "\"noise-x\""),
            ("L3-ev@eld", "no noise profiles; write L3-ev"),
            ("L3-noise@paper", "without its name"),
            ("L3-noise@", "not a valid name of a noise profile"),
            ("L3-noise@a&b", "not a valid name of a noise profile"),
            ("E6-noise", "is written L3"),
            ("E3.30-ev", "is written E3.3"),
            ("E3.333-ev", "two decimals"),
            ("E0-ev", "0 or too large"),
            ("E16.01-ev", "above E16"),
            ("E1e1-ev", "not a decimal number"),
            ("match-raw", "the forms are match-ev"),
            ("Dark", "not of that form"),
            ("dark+", "not a valid name of an enhancer"),
        ];
        for (text, expected) in cases {
            let error = text.parse::<Condition>().unwrap_err().to_string();
            assert!(error.contains(expected), "{text}: {error}");
        }
    }

    #[test]
    fn conditions_are_ordered_by_severity() {
        let mut names = ["dark", "L3-ev", "match-ev", "L0", "E5-noise@eld", "E5-noise", "L2-noise"];
        names.sort_by_key(|name| name.parse::<Condition>().unwrap());
        assert_eq!(names, ["L0", "L2-noise", "E5-noise", "E5-noise@eld", "L3-ev", "match-ev", "dark"]);
    }
}
