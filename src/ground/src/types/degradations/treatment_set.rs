//! The images that enhancers work on: [`TreatmentSet`].

use std::fmt;
use std::str::FromStr;

use super::degradation::Kind;
use super::kind_set::KindSet;
use super::pair_dark::PairDark;
use super::treatment::Treatment;

/// The word for the untouched frame.
const UNTOUCHED: &str = "l0";

/// The word for the darkness of pairs: photographs in the dark.
const PHOTOGRAPHS: &str = "dark";

/// The word for the untouched frame, every kind of degradation, and photographs in the dark.
const ALL: &str = "all";

/// A set of treatments of a frame: untouched, the kinds of degradation, and photographed in the dark.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TreatmentSet(u16);

impl TreatmentSet {
    /// No treatment.
    const NONE: Self = Self(0);

    /// Sensor noise, the images that enhancers work on if nothing else is said.
    pub const NOISE: Self = Self::only(Some(Kind::Sensor));

    /// Photographs in the dark.
    pub const DARK: Self = Self(1 << 15);

    /// The set of a single treatment; `None` is the untouched frame.
    #[must_use]
    pub const fn only(treatment: Option<Kind>) -> Self {
        match treatment {
            None => Self(1),
            Some(kind) => Self(1 << (kind as u16 + 1)),
        }
    }

    /// Whether the set includes a treatment; `None` is the untouched frame.
    #[must_use]
    pub fn includes(self, treatment: Option<Kind>) -> bool {
        self.0 & Self::only(treatment).0 != 0
    }

    /// Whether the set includes a treatment of a frame. Synthetic images that are as dark as a photograph belong to their kind.
    #[must_use]
    pub fn has(self, treatment: &Treatment) -> bool {
        match treatment {
            Treatment::Untouched => self.includes(None),
            Treatment::Degraded(how) => self.includes(Some(how.kind())),
            Treatment::Paired(PairDark::Match(kind, _)) => self.includes(Some(*kind)),
            Treatment::Paired(PairDark::Photograph(_)) => self.and(Self::DARK).is_some(),
        }
    }

    /// The treatments that either set includes.
    #[must_use]
    pub fn or(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// The treatments that both sets include; `None` if there are none.
    #[must_use]
    pub fn and(self, other: Self) -> Option<Self> {
        let both = self.0 & other.0;
        (both != 0).then_some(Self(both))
    }

    /// All treatments: the untouched frame, every kind of degradation, and photographs in the dark.
    fn all() -> Self {
        let kinds = Kind::ALL.map(|kind| Self::only(Some(kind)));
        let both = Self::only(None).or(Self::DARK);
        kinds.into_iter().fold(both, Self::or)
    }

    /// The set with the two kinds of the paper, `both`.
    fn both() -> Self {
        KindSet::BOTH.into()
    }

    /// Names of the treatments; the untouched frame comes first.
    fn words(self) -> Vec<&'static str> {
        let kinds = Kind::ALL.map(Some).into_iter();
        std::iter::once(None)
            .chain(kinds)
            .filter(|treatment| self.includes(*treatment))
            .map(|treatment| treatment.map_or(UNTOUCHED, Kind::word))
            .chain(self.and(Self::DARK).map(|_| PHOTOGRAPHS))
            .collect()
    }

    fn from_word(word: &str) -> Result<Self, String> {
        match word {
            UNTOUCHED => Ok(Self::only(None)),
            PHOTOGRAPHS => Ok(Self::DARK),
            ALL => Ok(Self::all()),
            "both" => Ok(Self::both()),
            _ => {
                let kind = Kind::from_word(word).map(|kind| Self::only(Some(kind)));
                let words = Kind::ALL.map(Kind::word).join(", ");
                kind.ok_or_else(|| {
                    format!(
                        "{word:?} is not one of {UNTOUCHED}, {words}, both, {PHOTOGRAPHS}, {ALL}"
                    )
                })
            }
        }
    }
}

impl From<KindSet> for TreatmentSet {
    fn from(kinds: KindSet) -> Self {
        kinds
            .kinds()
            .map(|kind| Self::only(Some(kind)))
            .fold(Self::NONE, Self::or)
    }
}

impl fmt::Display for TreatmentSet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if *self == Self::all() {
            f.pad(ALL)
        } else if *self == Self::both() {
            f.pad("both")
        } else {
            f.pad(&self.words().join(","))
        }
    }
}

impl FromStr for TreatmentSet {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        text.split(',')
            .try_fold(Self::NONE, |set, word| Ok(set.or(Self::from_word(word)?)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sets_read_back() {
        for (text, written) in [
            ("l0", "l0"),
            ("noise", "noise"),
            ("ev", "ev"),
            ("both", "both"),
            ("noise,ev", "both"),
            ("noise,l0", "l0,noise"),
            ("ev,l0", "l0,ev"),
            ("l0,both", "l0,ev,noise"),
            ("motion,auto", "auto,motion"),
            ("l0,both,auto,motion", "l0,ev,noise,auto,motion"),
            ("dark,l0,both,auto,motion", "all"),
            ("dark", "dark"),
            ("dark,noise", "noise,dark"),
            ("all", "all"),
            ("noise,all", "all"),
        ] {
            let set: TreatmentSet = text.parse().unwrap();
            assert_eq!(set.to_string(), written);
            assert_eq!(written.parse(), Ok(set));
        }
        for wrong in ["L0", "raw", "", "l0,", "l0,raw"] {
            let error = wrong.parse::<TreatmentSet>().unwrap_err();
            assert!(
                error.contains("one of l0, ev, noise, auto, motion, both, dark, all"),
                "{error}"
            );
        }
    }

    #[test]
    fn the_default_is_noise_alone() {
        assert_eq!("noise".parse(), Ok(TreatmentSet::NOISE));
        assert!(!TreatmentSet::NOISE.includes(None));
        assert!(!TreatmentSet::NOISE.includes(Some(Kind::Exposure)));
        let both: TreatmentSet = "both".parse().unwrap();
        assert!(!both.includes(None) && both.includes(Some(Kind::Exposure)));
        let has = |set: &str, condition: &str| {
            let set: TreatmentSet = set.parse().unwrap();
            let condition: crate::types::Condition = condition.parse().unwrap();
            set.has(&condition.treatment)
        };
        assert!(!has("noise", "dark") && has("dark", "dark-2") && has("all", "lamp"));
        assert!(has("noise", "match-noise") && !has("dark", "match-noise") && !has("l0", "dark"));
    }
}
