//! The values of the columns `level` and `variant` of tables: [`AxisLevel`] and [`KindReading`].

use std::fmt;

use super::degradation::{Axis, Degradation, Kind, ReadingName, Severity};
use super::light_group::LightGroup;
use super::words::written_as_text;

/// A point on the axis of a curve: L0 (the untouched frame) or a severity. All kinds of one axis share their points. The points of
/// an axis follow each other by severity.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct AxisLevel(Option<(Kind, Severity)>);

impl AxisLevel {
    /// The untouched frame, the first point of every axis.
    pub const L0: Self = Self(None);

    /// The level of a severity of a kind.
    #[must_use]
    pub fn new(kind: Kind, severity: Severity) -> Self {
        Self(Some((kind.first_of_axis(), severity)))
    }

    /// The severity; `None` for L0.
    #[must_use]
    pub fn severity(self) -> Option<Severity> {
        self.0.map(|(_, severity)| severity)
    }

    /// The axis; `None` for L0, which is on all axes.
    #[must_use]
    pub fn axis(self) -> Option<Axis> {
        self.0.map(|(kind, _)| kind.axis())
    }

    /// The distance from L0 in the unit of the axis.
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

impl fmt::Display for AxisLevel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            None => f.pad("L0"),
            Some((kind, severity)) => f.pad(&kind.label(severity)),
        }
    }
}

/// A kind of degradation in one light reading, at any severity: the levels of one curve share it.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct KindReading {
    /// The kind; `None` for untouched frames.
    pub kind: Option<Kind>,
    /// The light reading; `None` if the kind has none.
    pub reading: Option<ReadingName>,
    /// The runs that show these images, in a report on runs that show different ones; else `None`.
    pub group: Option<LightGroup>,
}

impl KindReading {
    /// The value for untouched frames: no kind and no reading.
    pub const NONE: Self = Self {
        kind: None,
        reading: None,
        group: None,
    };

    /// The kind's word in files and flags, or `none`.
    #[must_use]
    pub fn word(&self) -> &'static str {
        self.kind.map_or("none", Kind::word)
    }

    /// The name in captions, as `with noise`; with the light reading if it is not the paper's, without the group of runs.
    #[must_use]
    pub fn title(&self) -> String {
        let kind = self.kind.map_or("untouched", Kind::title);
        self.named_reading()
            .map_or(kind.to_owned(), |reading| format!("{kind} @{reading}"))
    }

    /// The kind's word with the light reading if it is not the paper's, as `noise@eld`; without the group of runs.
    #[must_use]
    pub fn kind_and_reading(&self) -> String {
        match self.named_reading() {
            None => self.word().to_owned(),
            Some(reading) => format!("{}@{reading}", self.word()),
        }
    }

    /// The group of runs as names end with it, ` @RUN`; empty without a group.
    #[must_use]
    pub fn group_suffix(&self) -> String {
        self.group
            .as_ref()
            .map_or_else(String::new, ToString::to_string)
    }

    fn named_reading(&self) -> Option<&ReadingName> {
        self.reading
            .as_ref()
            .filter(|name| **name != ReadingName::PAPER)
    }
}

impl From<Option<&Degradation>> for KindReading {
    fn from(degradation: Option<&Degradation>) -> Self {
        Self {
            kind: degradation.map(Degradation::kind),
            reading: degradation.and_then(|how| how.reading().cloned()),
            group: None,
        }
    }
}

impl fmt::Display for KindReading {
    /// `none`, `ev`, `noise`, `noise@eld` or `noise @RUN`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(&(self.kind_and_reading() + &self.group_suffix()))
    }
}

written_as_text!(AxisLevel, KindReading);
