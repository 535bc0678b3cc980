//! The strength of a degradation, [`Severity`], and its quantity, [`Axis`].

use std::fmt;
use std::num::NonZeroU16;
use std::str::FromStr;

use serde::{Serialize, Serializer};

use crate::error::Error;

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
