//! The degradation of a frame, [`Degradation`], and the list of its kinds, [`Kind`].
//!
//! The strength of a degradation, [`Severity`], and its quantity, [`Axis`].

use std::borrow::Cow;
use std::cmp::Ordering;
use std::fmt;
use std::num::NonZeroU16;
use std::str::FromStr;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::error::Error;
use crate::types::text::is_in_names;
use crate::types::text::words::written_as_text;

/// A kind of degradation at one severity, in one noise profile ("reading") if the kind has several, and in one draw of
/// the noise.
///
/// The untouched frame, L0, is not a degradation: it is the `None` of an `Option`.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Degradation {
    severity: Severity,
    kind: Kind,
    reading: Option<ProfileName>,
    draw: u16,
}

impl Degradation {
    /// A degradation. The default noise profile of a kind that has several is `paper`.
    ///
    /// # Errors
    /// If the severity is above the maximum of the kind, or a noise profile is named for a kind without noise profiles.
    pub fn new(kind: Kind, severity: Severity, reading: Option<ProfileName>) -> Result<Self, Error> {
        if severity > kind.max_severity() {
            let problem = format_args!(
                "{} {} is more than a {} takes; the largest is {}",
                severity,
                kind.axis().unit,
                kind.title(),
                kind.max_severity()
            );
            return Err(Error::usage("condition", problem));
        }
        if let Some(reading) = reading.as_ref().filter(|_| !kind.has_profiles()) {
            let problem = format_args!(
                "{}-{kind}@{reading}: {kind} has no noise profiles; write {}-{kind}",
                kind.label(severity),
                kind.label(severity)
            );
            return Err(Error::usage("condition", problem));
        }
        let reading = reading.or_else(|| kind.has_profiles().then_some(ProfileName::PAPER));
        Ok(Self { severity, kind, reading, draw: 0 })
    }

    /// The same degradation with another draw of the noise, counted from 0; unchanged for a kind without noise.
    #[must_use]
    pub fn with_draw(self, draw: u16) -> Self {
        Self { draw: if self.kind.has_noise() { draw } else { 0 }, ..self }
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

    /// The noise profile; `None` if the kind has none.
    #[must_use]
    pub fn reading(&self) -> Option<&ProfileName> {
        self.reading.as_ref()
    }

    /// The draw of the noise, from 0. Draw `n` is made with the seed of the run plus `n`.
    #[must_use]
    pub fn draw(&self) -> u16 {
        self.draw
    }

    /// The name of the severity: `L3`, or `E3.3` for 3.3 EV.
    #[must_use]
    pub fn label(&self) -> String {
        self.kind.label(self.severity)
    }
}

impl Ord for Degradation {
    /// Compares axis, severity, kind, noise profile and draw.
    fn cmp(&self, other: &Self) -> Ordering {
        let [one, two] =
            [self, other].map(|how| (how.kind.first_of_axis(), how.severity, how.kind, &how.reading, how.draw));
        one.cmp(&two)
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
        if let Some(reading) = self.reading.as_ref().filter(|reading| **reading != ProfileName::PAPER) {
            write!(f, "@{reading}")?;
        }
        if self.draw > 0 { write!(f, "~{}", self.draw) } else { Ok(()) }
    }
}

impl FromStr for Degradation {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let (first, draw) = match text.split_once('~') {
            None => (text, 0),
            Some((first, number)) => (first, draw(number).map_err(|problem| syntax_error(text, problem))?),
        };
        let (plain, reading) = match first.split_once('@') {
            None => (first, None),
            Some((plain, reading)) => (plain, Some(ProfileName::new(reading)?)),
        };
        let (label, word) = plain.split_once('-').ok_or_else(|| syntax_error(text, "not of that form"))?;
        let kind = Kind::from_word(word)
            .ok_or_else(|| syntax_error(text, format_args!("no kind of degradation is named {word:?}")))?;
        if reading == Some(ProfileName::PAPER) {
            let problem = "the reading paper is written without its name";
            return Err(syntax_error(text, problem));
        }
        if draw > 0 && !kind.has_noise() {
            return Err(syntax_error(text, format_args!("{kind} has no noise, and no draws")));
        }
        let severity = kind.severity(label).map_err(|e| syntax_error(text, e))?;
        Ok(Self::new(kind, severity, reading)?.with_draw(draw))
    }
}

/// The number of a draw after the first, as it is written.
fn draw(number: &str) -> Result<u16, &'static str> {
    let draw: Option<u16> = number.parse().ok().filter(|draw| *draw > 0);
    draw.filter(|draw| draw.to_string() == number).ok_or("the draw after ~ is not a number from 1")
}

fn syntax_error(text: &str, problem: impl fmt::Display) -> Error {
    let form = "the form is L0, L3-ev, L3-noise, E3.3-noise, L3-noise@READING, L3-noise~DRAW or T33.33-motion";
    Error::usage("condition", format_args!("{text:?}: {problem}; {form}"))
}

/// A kind of degradation. To add one, describe it in this `impl` and implement it in the crate `darkqa-light`; the
/// kinds are listed nowhere else.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Kind {
    /// Less light, without noise.
    Exposure,
    /// Less light, with sensor noise.
    Sensor,
    /// Less light for a camera with automatic exposure: a longer exposure time, gain, and the darkness that remains.
    Auto,
    /// The motion blur of an exposure, without a loss of light.
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

    /// The first kind on the same axis, which represents the axis.
    #[must_use]
    pub(super) fn first_of_axis(self) -> Self {
        Self::ALL.into_iter().find(|other| other.axis() == self.axis()).unwrap_or(self)
    }

    /// The default severities: those of the paper, or chosen ones for a kind that the paper does not have.
    #[must_use]
    pub fn ladder(self) -> &'static [Severity] {
        match self {
            Self::Exposure | Self::Sensor | Self::Auto => &Severity::LADDER,
            Self::Motion => &Severity::TIMES,
        }
    }

    /// The maximum severity, in the kind's unit.
    #[must_use]
    pub fn max_severity(self) -> Severity {
        match self {
            // At a drop of 16 EV fewer than three of the 256 codes are left.
            Self::Exposure | Self::Sensor | Self::Auto => Severity::from_hundredths(1600),
            // Half a second; chosen. Most moving cameras travel too far in less time.
            Self::Motion => Severity::from_hundredths(50_000),
        }
    }

    /// True if the kind has noise profiles: several readings of the paper's noise model.
    #[must_use]
    pub fn has_profiles(self) -> bool {
        self == Self::Sensor
    }

    /// True if the kind adds sensor noise.
    #[must_use]
    pub fn has_noise(self) -> bool {
        matches!(self, Self::Sensor | Self::Auto)
    }

    /// True if the kind blurs the image by camera motion during the exposure.
    #[must_use]
    pub fn has_motion(self) -> bool {
        matches!(self, Self::Auto | Self::Motion)
    }

    /// True if the kind can match the darkness of a photograph, because its severity is an exposure drop.
    #[must_use]
    pub fn can_match(self) -> bool {
        self.axis() == Axis::LIGHT
    }

    /// The kind that this one extends and is compared with: noise extends the exposure drop.
    #[must_use]
    pub fn base(self) -> Option<Self> {
        (self == Self::Sensor).then_some(Self::Exposure)
    }

    /// The kind under which findings about this kind are grouped: its base, or the kind itself.
    #[must_use]
    pub fn root(self) -> Self {
        self.base().unwrap_or(self)
    }

    /// Gain in EV that brightens a small copy of a degraded image for display. It is 0 for kinds that do not reduce the
    /// light, and for kinds whose darkness depends on the camera's settings.
    #[must_use]
    pub fn display_gain(self, severity: Severity) -> f32 {
        match self {
            Self::Exposure | Self::Sensor => severity.value() as f32,
            Self::Auto | Self::Motion => 0.0,
        }
    }

    /// The letter in the label of a severity that has no name: `E` for exposure drops, `T` for exposure times.
    #[must_use]
    pub fn letter(self) -> char {
        match self {
            Self::Exposure | Self::Sensor | Self::Auto => 'E',
            Self::Motion => 'T',
        }
    }

    /// The label of a severity: `L1` to `L5` for the exposure drops of the paper, `E3.3` for others, `T33.33` for
    /// exposure times.
    #[must_use]
    pub fn label(self, severity: Severity) -> String {
        let index = self.named_severities().iter().position(|named| *named == severity);
        match index {
            Some(index) => format!("L{}", index + 1),
            None => format!("{}{severity}", self.letter()),
        }
    }

    /// The severities with names of their own, L1 to L5.
    fn named_severities(self) -> &'static [Severity] {
        match self {
            Self::Exposure | Self::Sensor | Self::Auto => self.ladder(),
            Self::Motion => &[],
        }
    }

    /// Parses the label of a severity, as `L3`, `E3.3` or `T33.33`.
    ///
    /// # Errors
    /// If no severity has the label, or if the label is not the canonical one: `E6` must be written `L3`.
    pub fn severity(self, label: &str) -> Result<Severity, Error> {
        let upper = label.to_ascii_uppercase();
        let named = self.named_severities().iter().find(|severity| self.label(**severity) == upper);
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
            return Err(Error::usage("level", format_args!("{label:?} is not {expected}")));
        };
        let severity = number.parse::<Severity>()?;
        if self.label(severity) != upper {
            let expected = self.label(severity);
            return Err(Error::usage("level", format_args!("{label:?} is written {expected}")));
        }
        if severity > self.max_severity() {
            return Err(Error::usage(
                "level",
                format_args!("{label:?} is above {}{}", self.letter(), self.max_severity()),
            ));
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
pub struct ProfileName(Cow<'static, str>);

impl ProfileName {
    /// The paper's noise model exactly as printed. Conditions are written without this name.
    pub const PAPER: Self = Self(Cow::Borrowed("paper"));
    /// Settings that match no named noise profile.
    pub const CUSTOM: Self = Self(Cow::Borrowed("custom"));

    /// Checks a name.
    ///
    /// # Errors
    /// If it is empty or has other characters.
    pub fn new(name: &str) -> Result<Self, Error> {
        if name.is_empty() || !name.chars().all(is_in_names) {
            let problem = format_args!(
                "{name:?} is not a valid name of a noise profile: only letters, digits, '_', '.' and '-' are allowed"
            );
            return Err(Error::usage("reading", problem));
        }
        // Most records use the paper's noise profile, so its name is not allocated.
        Ok(if name == Self::PAPER.as_str() { Self::PAPER } else { Self(Cow::Owned(name.to_owned())) })
    }

    /// A valid name, which is not checked.
    pub const fn from_static(name: &'static str) -> Self {
        Self(Cow::Borrowed(name))
    }

    /// The name as a string slice.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl Ord for ProfileName {
    /// `paper` first, then in alphabetical order.
    fn cmp(&self, other: &Self) -> Ordering {
        let [one, two] = [self, other].map(|name| (*name != Self::PAPER, &name.0));
        one.cmp(&two)
    }
}

impl PartialOrd for ProfileName {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl fmt::Display for ProfileName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(&self.0)
    }
}

impl<'de> Deserialize<'de> for ProfileName {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Self::new(&String::deserialize(deserializer)?).map_err(serde::de::Error::custom)
    }
}

/// The quantity on the axis of a curve.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Axis {
    /// The name of the quantity, as `exposure drop`.
    pub title: &'static str,
    /// The unit of the quantity, as `EV`.
    pub unit: &'static str,
    /// Noun for an increase of the quantity, as `darkness`: findings name it as the cause of a loss.
    pub cause: &'static str,
    /// Phrase for large values of the quantity, as `in the dark`.
    pub place: &'static str,
}

impl Axis {
    /// The exposure drop in exposure values; one EV is a factor of two in light.
    pub const LIGHT: Self = Self { title: "exposure drop", unit: "EV", cause: "darkness", place: "in the dark" };

    /// The exposure time of a moving camera, in milliseconds.
    pub const MOTION: Self =
        Self { title: "exposure time", unit: "ms", cause: "motion blur", place: "with motion blur" };

    /// All axes, in the order of tables.
    pub const ALL: [Self; 2] = [Self::LIGHT, Self::MOTION];

    /// The axes that `is_present` accepts, in the order of tables; [`Self::LIGHT`] if it accepts none, as for a run
    /// with clean frames only.
    #[must_use]
    pub fn present(is_present: impl Fn(Self) -> bool) -> Vec<Self> {
        let axes: Vec<Self> = Self::ALL.into_iter().filter(|axis| is_present(*axis)).collect();
        if axes.is_empty() { vec![Self::LIGHT] } else { axes }
    }
}

/// The strength of a degradation in hundredths of its kind's unit, so that equality and order are exact.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Severity(NonZeroU16);

impl Severity {
    /// Level L1, an exposure drop of 2 EV.
    pub const L1: Self = Self::from_hundredths(200);
    /// Level L2, an exposure drop of 4 EV.
    pub const L2: Self = Self::from_hundredths(400);
    /// Level L3, an exposure drop of 6 EV.
    pub const L3: Self = Self::from_hundredths(600);
    /// Level L4, an exposure drop of 7.5 EV.
    pub const L4: Self = Self::from_hundredths(750);
    /// Level L5, an exposure drop of 9 EV.
    pub const L5: Self = Self::from_hundredths(900);
    /// The exposure drops of the paper (DarkQA, section III), smallest first.
    pub const LADDER: [Self; 5] = [Self::L1, Self::L2, Self::L3, Self::L4, Self::L5];
    /// Exposure times in milliseconds: 1/120 s (half the frame interval of 60 fps video) and its doubles up to 2/15 s;
    /// chosen.
    pub const TIMES: [Self; 5] = [
        Self::from_hundredths(833),
        Self::from_hundredths(1667),
        Self::from_hundredths(3333),
        Self::from_hundredths(6667),
        Self::from_hundredths(13333),
    ];

    /// A severity in hundredths of the kind's unit; 0 becomes 1, because a severity is never zero.
    #[must_use]
    pub const fn from_hundredths(count: u16) -> Self {
        match NonZeroU16::new(count) {
            Some(count) => Self(count),
            None => Self(NonZeroU16::MIN),
        }
    }

    /// The severity in hundredths of the kind's unit.
    #[must_use]
    pub const fn hundredths(self) -> u16 {
        self.0.get()
    }

    /// The severity in the kind's unit.
    #[must_use]
    pub fn value(self) -> f64 {
        f64::from(self.0.get()) / 100.0
    }
}

impl fmt::Display for Severity {
    /// The shortest decimal, as `7.5`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.value())
    }
}

impl Serialize for Severity {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_f64(self.value())
    }
}

impl FromStr for Severity {
    type Err = Error;

    /// Parses a decimal number above 0 with at most two decimals.
    fn from_str(text: &str) -> Result<Self, Error> {
        let (whole, part) = text.split_once('.').unwrap_or((text, "0"));
        let is_decimal =
            [whole, part].iter().all(|digits| !digits.is_empty() && digits.bytes().all(|b| b.is_ascii_digit()));
        if !is_decimal {
            let problem = format_args!("{text:?} is not a decimal number like 3.3");
            return Err(Error::usage("level", problem));
        }
        if part.len() > 2 {
            let problem = format_args!("{text:?} has more than two decimals");
            return Err(Error::usage("level", problem));
        }
        format!("{whole}{part:0<2}")
            .parse::<u16>()
            .ok()
            .and_then(NonZeroU16::new)
            .map(Self)
            .ok_or_else(|| Error::usage("level", format_args!("{text:?} is 0 or too large")))
    }
}
