//! The degradation of a frame, [`Degradation`], and the list of its kinds, [`Kind`].

use std::borrow::Cow;
use std::cmp::Ordering;
use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Deserializer, Serialize};

use super::severity::{Axis, Severity};
use crate::error::Error;
use crate::types::text::words::written_as_text;

/// A kind of degradation at one severity, in one noise profile if the kind has readings.
///
/// The untouched frame, L0, is not a degradation: it is the `None` of an `Option`.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Degradation {
    severity: Severity,
    kind: Kind,
    reading: Option<ReadingName>,
}

impl Degradation {
    /// A degradation; if the kind has readings and none is named, the reading is `paper`.
    ///
    /// # Errors
    /// If the severity is above the maximum of the kind, or a reading is named for a kind that has none.
    pub fn new(
        kind: Kind,
        severity: Severity,
        reading: Option<ReadingName>,
    ) -> Result<Self, Error> {
        if severity > kind.largest() {
            let problem = format_args!(
                "{} {} is more than a {} takes; the largest is {}",
                severity,
                kind.axis().unit,
                kind.title(),
                kind.largest()
            );
            return Err(Error::usage("condition", problem));
        }
        if let Some(reading) = reading.as_ref().filter(|_| !kind.has_readings()) {
            let problem = format_args!(
                "{}-{kind}@{reading}: {kind} has no noise profiles; write {}-{kind}",
                kind.label(severity),
                kind.label(severity)
            );
            return Err(Error::usage("condition", problem));
        }
        let reading = reading.or_else(|| kind.has_readings().then_some(ReadingName::PAPER));
        Ok(Self {
            severity,
            kind,
            reading,
        })
    }

    /// The kind of degradation, as exposure drop or noise.
    #[must_use]
    pub fn kind(&self) -> Kind {
        self.kind
    }

    /// The severity, in the kind's unit.
    #[must_use]
    pub fn severity(&self) -> Severity {
        self.severity
    }

    /// The noise profile; `None` if the kind has no readings.
    #[must_use]
    pub fn reading(&self) -> Option<&ReadingName> {
        self.reading.as_ref()
    }

    /// The name of the severity: `L3`, or `E3.3` for 3.3 EV.
    #[must_use]
    pub fn label(&self) -> String {
        self.kind.label(self.severity)
    }
}

impl Ord for Degradation {
    /// By level, kind and noise profile: the levels of one axis follow each other.
    fn cmp(&self, other: &Self) -> Ordering {
        let key = |how: &Self| (how.kind.first_of_axis(), how.severity, how.kind);
        let order = key(self).cmp(&key(other));
        order.then_with(|| self.reading.cmp(&other.reading))
    }
}

impl PartialOrd for Degradation {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl fmt::Display for Degradation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}-{}", self.label(), self.kind)?;
        match &self.reading {
            Some(reading) if *reading != ReadingName::PAPER => write!(f, "@{reading}"),
            _ => Ok(()),
        }
    }
}

impl FromStr for Degradation {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let wrong = |problem: &dyn fmt::Display| {
            let form =
                "the form is L0, L3-ev, L3-noise, E3.3-noise, L3-noise@READING or T33.33-motion";
            Error::usage("condition", format_args!("{text:?}: {problem}; {form}"))
        };
        let (plain, reading) = match text.split_once('@') {
            None => (text, None),
            Some((plain, reading)) => (plain, Some(ReadingName::new(reading)?)),
        };
        let (label, word) = plain
            .split_once('-')
            .ok_or_else(|| wrong(&"not of that form"))?;
        let kind = Kind::from_word(word)
            .ok_or_else(|| wrong(&format_args!("no kind of degradation is named {word:?}")))?;
        if reading == Some(ReadingName::PAPER) {
            return Err(wrong(&"the reading paper is written without its name"));
        }
        let severity = kind.severity(label).map_err(|e| wrong(&e))?;
        Self::new(kind, severity, reading)
    }
}

/// A kind of degradation. A new kind is described in this `impl` and implemented in the crate `darkqa-light`; no other
/// place lists the kinds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Kind {
    /// Less light, without noise.
    Exposure,
    /// Less light, with sensor noise.
    Sensor,
    /// Less light, met by a camera with automatic exposure: a longer exposure, gain, and a remaining darkness.
    Auto,
    /// The motion blur of an exposure, without less light.
    Motion,
}

impl Kind {
    /// All kinds, in the order of tables.
    pub const ALL: [Self; 4] = [Self::Exposure, Self::Sensor, Self::Auto, Self::Motion];

    /// The word in conditions, in the column `variant` and in `--variant`.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Exposure => "ev",
            Self::Sensor => "noise",
            Self::Auto => "auto",
            Self::Motion => "motion",
        }
    }

    /// The name in captions and tables.
    #[must_use]
    pub fn title(self) -> &'static str {
        match self {
            Self::Exposure => "exposure drop",
            Self::Sensor => "with noise",
            Self::Auto => "automatic exposure",
            Self::Motion => "motion blur",
        }
    }

    /// The quantity that the severity measures; kinds of one axis share a panel.
    #[must_use]
    pub fn axis(self) -> Axis {
        match self {
            Self::Exposure | Self::Sensor | Self::Auto => Axis::LIGHT,
            Self::Motion => Axis::MOTION,
        }
    }

    /// The first kind of the same axis, which stands for all of them.
    #[must_use]
    pub(super) fn first_of_axis(self) -> Self {
        Self::ALL
            .into_iter()
            .find(|other| other.axis() == self.axis())
            .unwrap_or(self)
    }

    /// The severities of the paper, or of a kind that the paper does not have, which are the default.
    #[must_use]
    pub fn ladder(self) -> &'static [Severity] {
        match self {
            Self::Exposure | Self::Sensor | Self::Auto => &Severity::LADDER,
            Self::Motion => &Severity::TIMES,
        }
    }

    /// The maximum severity, in the kind's unit.
    #[must_use]
    pub fn largest(self) -> Severity {
        match self {
            // There fewer than three of the 256 codes are left.
            Self::Exposure | Self::Sensor | Self::Auto => Severity::hundredths(1600),
            // Half a second; chosen. Most cameras move too far in less.
            Self::Motion => Severity::hundredths(50_000),
        }
    }

    /// Whether the kind has noise profiles: several ways to understand it.
    #[must_use]
    pub fn has_readings(self) -> bool {
        self == Self::Sensor
    }

    /// Whether the kind has sensor noise.
    #[must_use]
    pub fn has_noise(self) -> bool {
        matches!(self, Self::Sensor | Self::Auto)
    }

    /// Whether the kind has the motion blur of an exposure.
    #[must_use]
    pub fn has_motion(self) -> bool {
        matches!(self, Self::Auto | Self::Motion)
    }

    /// Whether the kind can be as dark as a photograph: its severity is an exposure drop.
    #[must_use]
    pub fn can_match(self) -> bool {
        self.axis() == Axis::LIGHT
    }

    /// The kind that this one extends and is compared with: noise extends the exposure drop.
    #[must_use]
    pub fn base(self) -> Option<Self> {
        (self == Self::Sensor).then_some(Self::Exposure)
    }

    /// The kind that all findings about this one and those that extend it share: the base, or the kind itself.
    #[must_use]
    pub fn root(self) -> Self {
        self.base().unwrap_or(self)
    }

    /// Gain in EV that brightens a small copy of a degraded image for display. It is 0 for kinds that do not reduce the light, and for
    /// kinds whose darkness depends on the camera's settings.
    #[must_use]
    pub fn relight(self, severity: Severity) -> f32 {
        match self {
            Self::Exposure | Self::Sensor => severity.value() as f32,
            Self::Auto | Self::Motion => 0.0,
        }
    }

    /// The letter before the number of a severity that has no name: `E` for exposure drops, `T` for exposure times.
    #[must_use]
    pub fn letter(self) -> char {
        match self {
            Self::Exposure | Self::Sensor | Self::Auto => 'E',
            Self::Motion => 'T',
        }
    }

    /// The name of a severity: `L1` to `L5` for the exposure drops of the paper, otherwise as `E3.3`; of exposure times, as `T33.33`.
    #[must_use]
    pub fn label(self, severity: Severity) -> String {
        let index = self.named().iter().position(|named| *named == severity);
        match index {
            Some(index) => format!("L{}", index + 1),
            None => format!("{}{severity}", self.letter()),
        }
    }

    /// The severities with names of their own, L1 to L5.
    fn named(self) -> &'static [Severity] {
        match self {
            Self::Exposure | Self::Sensor | Self::Auto => self.ladder(),
            Self::Motion => &[],
        }
    }

    /// The severity with a name, as `L3`, `E3.3` or `T33.33`.
    ///
    /// # Errors
    /// If no severity has the name, or if the severity has another name: `E6` is `L3`.
    pub fn severity(self, label: &str) -> Result<Severity, Error> {
        let wrong = |problem: String| Error::usage("level", problem);
        let upper = label.to_ascii_uppercase();
        let named = self
            .named()
            .iter()
            .find(|severity| self.label(**severity) == upper);
        if let Some(severity) = named {
            return Ok(*severity);
        }
        let Some(number) = upper.strip_prefix(self.letter()) else {
            let expected = match self {
                Self::Exposure | Self::Sensor | Self::Auto => {
                    "one of L0, L1, L2, L3, L4, L5 and not a number of stops such as 3.3 or E3.3"
                }
                Self::Motion => "L0 and not an exposure time in milliseconds such as T33.33",
            };
            return Err(wrong(format!("{label:?} is not {expected}")));
        };
        let severity = number.parse::<Severity>()?;
        if self.label(severity) != upper {
            let expected = self.label(severity);
            return Err(wrong(format!("{label:?} is written {expected}")));
        }
        if severity > self.largest() {
            return Err(wrong(format!(
                "{label:?} is above {}{}",
                self.letter(),
                self.largest()
            )));
        }
        Ok(severity)
    }

    /// The kind with this [word](Self::word).
    #[must_use]
    pub fn from_word(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.word() == word)
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.word())
    }
}

written_as_text!(Kind);

/// The name of a noise profile: letters, digits, `_`, `.` and `-`.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Serialize)]
pub struct ReadingName(Cow<'static, str>);

impl ReadingName {
    /// The paper's noise model exactly as printed; conditions leave this name out.
    pub const PAPER: Self = Self(Cow::Borrowed("paper"));
    /// Settings that match no named reading.
    pub const CUSTOM: Self = Self(Cow::Borrowed("custom"));

    /// Checks a name.
    ///
    /// # Errors
    /// If it is empty or has other characters.
    pub fn new(name: &str) -> Result<Self, Error> {
        if name.is_empty()
            || !name
                .chars()
                .all(|c: char| c.is_ascii_alphanumeric() || "_.-".contains(c))
        {
            let problem = format_args!(
                "{name:?} is not a valid name of a noise profile: only letters, digits, '_', '.' and '-' are allowed"
            );
            return Err(Error::usage("reading", problem));
        }
        // Most records have the paper's reading: its name is not allocated.
        Ok(if name == Self::PAPER.as_str() {
            Self::PAPER
        } else {
            Self(Cow::Owned(name.to_owned()))
        })
    }

    /// A name that needs no check.
    pub const fn from_static(name: &'static str) -> Self {
        Self(Cow::Borrowed(name))
    }

    /// The name as a string slice.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl Ord for ReadingName {
    /// `paper` first, then in alphabetical order.
    fn cmp(&self, other: &Self) -> Ordering {
        let is_other = |name: &Self| *name != Self::PAPER;
        (is_other(self), &self.0).cmp(&(is_other(other), &other.0))
    }
}

impl PartialOrd for ReadingName {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl fmt::Display for ReadingName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(&self.0)
    }
}

impl<'de> Deserialize<'de> for ReadingName {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Self::new(&String::deserialize(deserializer)?).map_err(serde::de::Error::custom)
    }
}
