//! The values of the columns `level` and `variant` of tables: [`AxisLevel`] and [`Variant`].

use std::borrow::Cow;
use std::fmt;

use super::degradation::{Degradation, Kind, ProfileName};
use super::pair_dark::{PairDark, PhotoName};
use super::run_group::RunGroup;
use super::severity::{Axis, Severity};
use super::treatment::Treatment;
use crate::types::text::words::written_as_text;

/// A point on the axis of a curve: L0 (the untouched frame) or a severity. All kinds on one axis share its points,
/// which are ordered by severity. The darkness of pairs is on no axis, because it differs by frame; it is ordered last.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct AxisLevel(Point);

/// Position of an [`AxisLevel`] on its axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
enum Point {
    Untouched,
    Degraded(Kind, Severity),
    Pair,
}

impl AxisLevel {
    /// The untouched frame, the first point of every axis.
    pub const L0: Self = Self(Point::Untouched);

    /// The darkness of pairs, photographed or synthetic.
    pub const PAIR: Self = Self(Point::Pair);

    /// The level of a severity of a kind.
    #[must_use]
    pub fn new(kind: Kind, severity: Severity) -> Self {
        Self(Point::Degraded(kind.first_of_axis(), severity))
    }

    /// The severity; `None` for L0 and for pairs.
    #[must_use]
    pub fn severity(self) -> Option<Severity> {
        match self.0 {
            Point::Degraded(_, severity) => Some(severity),
            Point::Untouched | Point::Pair => None,
        }
    }

    /// The axis; `None` for L0, which is on all axes, and for pairs, which are on none.
    #[must_use]
    pub fn axis(self) -> Option<Axis> {
        match self.0 {
            Point::Degraded(kind, _) => Some(kind.axis()),
            Point::Untouched | Point::Pair => None,
        }
    }

    /// True if the level belongs in the tables of an axis: L0 in all of them, photographed pairs in those of light.
    #[must_use]
    pub fn belongs_to(self, axis: Axis) -> bool {
        match self.0 {
            Point::Untouched => true,
            Point::Degraded(kind, _) => kind.axis() == axis,
            Point::Pair => axis == Axis::LIGHT,
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
            Point::Untouched => f.pad("L0"),
            Point::Degraded(kind, severity) => f.pad(&kind.label(severity)),
            Point::Pair => f.pad("dark"),
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
