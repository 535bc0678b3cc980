//! The state in which a frame is shown to a model: [`Condition`] = treatment × enhancer.
//!
//! The values of the columns `level` and `variant` of tables: [`AxisLevel`] and [`Variant`].
//!
//! [`Treatment`]: the processing of a frame before it is enhanced.
//!
//! The columns of a record that are derived from the condition of its images: [`ConditionColumns`].
//!
//! [`RunGroup`]: runs in a report that use the same images.

use std::borrow::Cow;
use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

use serde::{Deserialize, Deserializer, Serialize};

use super::degradation::{Axis, Degradation, Kind, ProfileName, Severity};
use super::pair_dark::PhotoName;
use crate::error::Error;
use crate::types::PairDark;
use crate::types::text::is_in_names;
use crate::types::text::words::{as_text, written_as_text};

/// The name of an enhancement model in tables and records: letters, digits, `_`, `-` and `.`.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
pub struct EnhancerName(String);

impl EnhancerName {
    /// Checks a name.
    ///
    /// # Errors
    /// If it is empty or has other characters than letters, digits, `_`, `-` and `.`.
    pub fn new(name: &str) -> Result<Self, Error> {
        if name.is_empty() || !name.chars().all(is_in_names) {
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
/// It is written `LABEL-KIND[@READING][~DRAW][+ENHANCER]` or `L0[+ENHANCER]`; a photograph in the dark is
/// `NAME[+ENHANCER]`, and a synthetic image that is as dark as it is `match-KIND[@READING][+ENHANCER]`. READING is a
/// noise profile, DRAW the number of a draw of the noise after the first. `&` is reserved for several degradations in
/// sequence.
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

    /// The draw of the noise, from 0; `None` for images without drawn noise.
    #[must_use]
    pub fn draw(&self) -> Option<u16> {
        self.degradation().filter(|how| how.kind().has_noise()).map(Degradation::draw)
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

/// A point on the axis of a curve: L0 (the untouched frame) or a severity. All kinds on one axis share its points,
/// which are ordered by severity. The darkness of pairs is on no axis, because it differs by frame; it is ordered last.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct AxisLevel(AxisPoint);

/// Position of an [`AxisLevel`] on its axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
enum AxisPoint {
    Untouched,
    Degraded(Kind, Severity),
    Pair,
}

impl AxisLevel {
    /// The untouched frame, the first point of every axis.
    pub const L0: Self = Self(AxisPoint::Untouched);

    /// The darkness of pairs, photographed or synthetic.
    pub const PAIR: Self = Self(AxisPoint::Pair);

    /// The level of a severity of a kind.
    #[must_use]
    pub fn new(kind: Kind, severity: Severity) -> Self {
        Self(AxisPoint::Degraded(kind.first_of_axis(), severity))
    }

    /// The severity; `None` for L0 and for pairs.
    #[must_use]
    pub fn severity(self) -> Option<Severity> {
        match self.0 {
            AxisPoint::Degraded(_, severity) => Some(severity),
            AxisPoint::Untouched | AxisPoint::Pair => None,
        }
    }

    /// The axis; `None` for L0, which is on all axes, and for pairs, which are on none.
    #[must_use]
    pub fn axis(self) -> Option<Axis> {
        match self.0 {
            AxisPoint::Degraded(kind, _) => Some(kind.axis()),
            AxisPoint::Untouched | AxisPoint::Pair => None,
        }
    }

    /// True if the level belongs in the tables of an axis: L0 in all of them, photographed pairs in those of light.
    #[must_use]
    pub fn belongs_to(self, axis: Axis) -> bool {
        match self.0 {
            AxisPoint::Untouched => true,
            AxisPoint::Degraded(kind, _) => kind.axis() == axis,
            AxisPoint::Pair => axis == Axis::LIGHT,
        }
    }

    /// The distance from L0 in the unit of the axis; 0 for pairs, whose darkness differs by frame.
    #[must_use]
    pub fn value(self) -> f64 {
        self.severity().map_or(0.0, Severity::value)
    }
}

impl From<Option<&Degradation>> for AxisLevel {
    fn from(degradation: Option<&Degradation>) -> Self {
        degradation.map_or(Self::L0, |how| Self::new(how.kind(), how.severity()))
    }
}

impl From<&Treatment> for AxisLevel {
    fn from(treatment: &Treatment) -> Self {
        match treatment {
            Treatment::Paired(_) => Self::PAIR,
            Treatment::Untouched | Treatment::Degraded(_) => treatment.degradation().into(),
        }
    }
}

impl fmt::Display for AxisLevel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            AxisPoint::Untouched => f.pad("L0"),
            AxisPoint::Degraded(kind, severity) => f.pad(&kind.label(severity)),
            AxisPoint::Pair => f.pad("dark"),
        }
    }
}

/// A kind of degradation in one noise profile, at any severity: the levels of one curve share it. The darkness of pairs
/// is a variant without a kind, because it is on no curve.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct Variant {
    /// The darkness of pairs; `None` for untouched frames and degradations. It is the first field, so that pairs follow
    /// all others.
    pub pair: Option<PairDark>,
    /// The kind; `None` for untouched frames and pairs.
    pub kind: Option<Kind>,
    /// The noise profile; `None` if the kind has none.
    pub reading: Option<ProfileName>,
    /// The runs with these images, in a report on runs whose images differ; otherwise `None`.
    pub group: Option<RunGroup>,
}

impl Variant {
    /// The variant of untouched frames: no kind and no noise profile.
    pub const NONE: Self = Self { kind: None, reading: None, pair: None, group: None };

    /// True for untouched frames, of any group of runs.
    #[must_use]
    pub fn is_untouched(&self) -> bool {
        self.kind.is_none() && self.pair.is_none()
    }

    /// True for degraded frames and for pairs in the dark.
    #[must_use]
    pub fn is_degraded(&self) -> bool {
        !self.is_untouched()
    }

    /// The kind's word in files and flags, or `none`; for pairs the name of their darkness.
    #[must_use]
    pub fn word(&self) -> Cow<'static, str> {
        match &self.pair {
            None => Cow::Borrowed(self.kind.map_or("none", Kind::word)),
            Some(pair) => Cow::Owned(pair.to_string()),
        }
    }

    /// The name of the photograph in the dark; `None` for all other images.
    #[must_use]
    pub fn photograph(&self) -> Option<&PhotoName> {
        self.pair.as_ref().and_then(PairDark::photograph)
    }

    /// The kind of degradation, or of the synthesis that matches a photograph; `None` for images that are not
    /// synthetic.
    #[must_use]
    pub fn synthetic_kind(&self) -> Option<Kind> {
        match &self.pair {
            Some(PairDark::Match(kind, _)) => Some(*kind),
            Some(PairDark::Photograph(_)) => None,
            None => self.kind,
        }
    }

    /// The name in captions, as `with noise`; with the noise profile if it is not the paper's, without the group of
    /// runs.
    #[must_use]
    pub fn title(&self) -> String {
        if let Some(pair) = &self.pair {
            return pair.title();
        }
        let kind = self.kind.map_or("untouched", Kind::title);
        self.unusual_profile().map_or(kind.to_owned(), |reading| format!("{kind} @{reading}"))
    }

    /// The kind's word, or the name of a pair's darkness, with the noise profile if it is not the paper's, as
    /// `noise@eld`; without the group of runs.
    #[must_use]
    pub fn kind_and_profile(&self) -> String {
        match self.unusual_profile() {
            None => self.word().into_owned(),
            Some(reading) => format!("{}@{reading}", self.word()),
        }
    }

    /// The suffix of names for the group of runs, ` @RUN`; empty without a group.
    #[must_use]
    pub fn group_suffix(&self) -> String {
        self.group.as_ref().map_or_else(String::new, ToString::to_string)
    }

    /// The noise profile, unless it is the paper's.
    fn unusual_profile(&self) -> Option<&ProfileName> {
        self.reading.as_ref().filter(|name| **name != ProfileName::PAPER)
    }
}

impl From<Option<&Degradation>> for Variant {
    fn from(degradation: Option<&Degradation>) -> Self {
        Self {
            kind: degradation.map(Degradation::kind),
            reading: degradation.and_then(|how| how.reading().cloned()),
            ..Self::NONE
        }
    }
}

impl From<&Treatment> for Variant {
    fn from(treatment: &Treatment) -> Self {
        Self { pair: treatment.pair().cloned(), ..treatment.degradation().into() }
    }
}

impl fmt::Display for Variant {
    /// `none`, `ev`, `noise`, `noise@eld` or `noise @RUN`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(&(self.kind_and_profile() + &self.group_suffix()))
    }
}

written_as_text!(AxisLevel, Variant);

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

/// The columns derived from a condition. Without a condition no image was shown.
#[derive(Debug, Serialize)]
pub struct ConditionColumns<'a> {
    /// The condition; `None` without an image.
    pub condition: Option<&'a Condition>,
    /// The level, such as L3, 3.3 or `dark`.
    pub level: Option<AxisLevel>,
    /// The kind of degradation, the darkness of a pair, or `none`.
    pub variant: String,
    /// The exposure drop in EV; `None` where it is not measured in EV, or differs by frame.
    pub ev: Option<f64>,
    /// The severity of kinds that are not measured in EV; they have no `ev`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub severity: Option<Severity>,
    /// The noise profile.
    pub reading: Option<&'a ProfileName>,
    /// The enhancer; `None` for a raw image.
    pub enhancer: Option<&'a EnhancerName>,
    /// The draw of the noise after the first; `None` for the first, and for images without drawn noise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub draw: Option<u16>,
}

impl<'a> ConditionColumns<'a> {
    /// The columns of a condition.
    pub fn new(condition: Option<&'a Condition>) -> Self {
        let degradation = condition.and_then(|condition| condition.degradation());
        let level = condition.map(Condition::level);
        // The darkness of pairs differs by frame; it is stored with each image (`PairFacts`).
        let light = level
            .filter(|level| *level != AxisLevel::PAIR)
            .filter(|level| level.axis().is_none_or(|axis| axis == Axis::LIGHT));
        let severity = degradation.map(Degradation::severity);
        Self {
            condition,
            level,
            variant: match condition.and_then(Condition::pair) {
                Some(pair) => pair.to_string(),
                None => degradation.map_or("none", |how| how.kind().word()).to_owned(),
            },
            ev: light.map(AxisLevel::value),
            severity: severity.filter(|_| light.is_none()),
            reading: degradation
                .and_then(Degradation::reading)
                .or_else(|| condition.and_then(Condition::pair).and_then(PairDark::reading)),
            enhancer: condition.and_then(|condition| condition.enhancer.as_ref()),
            draw: condition.and_then(Condition::draw).filter(|draw| *draw > 0),
        }
    }
}

/// The runs in a report whose images of a condition are equal, if other runs in the report have other images under the
/// same condition.
///
/// It is never stored: only a report on several runs sets it.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct RunGroup {
    /// The name of the first of the runs, which the tables show.
    name: Arc<str>,
    /// The numbers of the runs in the report.
    runs: Arc<[usize]>,
}

impl RunGroup {
    /// The group of these runs; the tables show `name`.
    #[must_use]
    pub fn new(name: &str, runs: &[usize]) -> Self {
        Self { name: name.into(), runs: runs.into() }
    }

    /// The name that the tables show.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// True if two groups have a run in common; `None` means all runs.
    #[must_use]
    pub fn overlap(one: Option<&Self>, other: Option<&Self>) -> bool {
        one.zip(other).is_none_or(|(one, other)| one.runs.iter().any(|run| other.runs.contains(run)))
    }
}

/// Writes the suffix of conditions and variants, ` @RUN`.
impl fmt::Display for RunGroup {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, " @{}", self.name)
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
            "L5-noise~1",
            "L5-auto~12",
            "L5-noise@eld~2+zerodce",
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
            ("L3-noise~0", "not a number from 1"),
            ("L3-noise~01", "not a number from 1"),
            ("L3-noise~", "not a number from 1"),
            ("L3-ev~1", "ev has no noise"),
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

    #[test]
    fn groups_with_a_common_run_overlap() {
        let [one, two, both] = [&[0][..], &[1], &[0, 1]].map(|runs| RunGroup::new("a", runs));
        assert!(!RunGroup::overlap(Some(&one), Some(&two)));
        assert!(RunGroup::overlap(Some(&one), Some(&both)));
        assert!(RunGroup::overlap(None, Some(&two)));
        assert_eq!(format!("L3-noise{one}"), "L3-noise @a");
    }
}
