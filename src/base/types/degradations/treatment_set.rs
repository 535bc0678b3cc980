//! The choice of images that are enhanced: [`TreatmentSet`].
//!
//! A set of kinds of degradation: [`KindSet`].

use std::fmt;
use std::str::FromStr;

use super::condition::Treatment;
use super::degradation::Kind;
use super::pair_dark::PairDark;

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

    /// Sensor noise: the images that are enhanced by default.
    pub const NOISE: Self = Self::only(Some(Kind::Sensor));

    /// Photographs in the dark.
    pub const DARK: Self = Self(1 << 15);

    /// The set with a single treatment; `None` is the untouched frame.
    #[must_use]
    pub const fn only(treatment: Option<Kind>) -> Self {
        match treatment {
            None => Self(1),
            Some(kind) => Self(1 << (kind as u16 + 1)),
        }
    }

    /// True if the set includes a kind of degradation, or the untouched frame for `None`.
    #[must_use]
    pub fn includes_kind(self, kind: Option<Kind>) -> bool {
        self.0 & Self::only(kind).0 != 0
    }

    /// True if the set includes a treatment. A synthetic image that matches a photograph counts as its kind.
    #[must_use]
    pub fn includes(self, treatment: &Treatment) -> bool {
        match treatment {
            Treatment::Untouched => self.includes_kind(None),
            Treatment::Degraded(how) => self.includes_kind(Some(how.kind())),
            Treatment::Paired(PairDark::Match(kind, _)) => self.includes_kind(Some(*kind)),
            Treatment::Paired(PairDark::Photograph(_)) => self.intersection(Self::DARK).is_some(),
        }
    }

    /// The treatments that either set includes.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// The treatments that both sets include; `None` if there are none.
    #[must_use]
    pub fn intersection(self, other: Self) -> Option<Self> {
        let both = self.0 & other.0;
        (both != 0).then_some(Self(both))
    }

    /// All treatments: the untouched frame, every kind of degradation, and photographs in the dark.
    fn all() -> Self {
        let kinds = Kind::ALL.map(|kind| Self::only(Some(kind)));
        let others = Self::only(None).union(Self::DARK);
        kinds.into_iter().fold(others, Self::union)
    }

    /// The set with the two kinds of the paper, `both`.
    fn both() -> Self {
        KindSet::BOTH.into()
    }

    /// Names of the treatments; the untouched frame comes first.
    fn words(self) -> Vec<&'static str> {
        std::iter::once(None)
            .chain(Kind::ALL.map(Some))
            .filter(|kind| self.includes_kind(*kind))
            .map(|kind| kind.map_or(UNTOUCHED, Kind::word))
            .chain(self.intersection(Self::DARK).map(|_| PHOTOGRAPHS))
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
                kind.ok_or_else(|| format!("{word:?} is not one of {UNTOUCHED}, {words}, both, {PHOTOGRAPHS}, {ALL}"))
            }
        }
    }
}

impl From<KindSet> for TreatmentSet {
    fn from(kinds: KindSet) -> Self {
        kinds.kinds().map(|kind| Self::only(Some(kind))).fold(Self::NONE, Self::union)
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
        text.split(',').try_fold(Self::NONE, |set, word| Ok(set.union(Self::from_word(word)?)))
    }
}

/// A set of at least one kind of degradation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct KindSet(u16);

impl KindSet {
    /// The two kinds of the paper, `both`.
    pub const BOTH: Self = Self(1 << Kind::Exposure as u16 | 1 << Kind::Sensor as u16);

    /// All kinds, `all`.
    pub const ALL: Self = Self((1 << Kind::ALL.len()) - 1);

    /// The set of a single kind.
    #[must_use]
    pub fn only(kind: Kind) -> Self {
        Self(1 << kind as u16)
    }

    /// Whether the set includes a kind.
    #[must_use]
    pub fn includes(self, kind: Kind) -> bool {
        self.0 & Self::only(kind).0 != 0
    }

    /// The kinds, in the order of tables.
    pub fn kinds(self) -> impl Iterator<Item = Kind> {
        Kind::ALL.into_iter().filter(move |kind| self.includes(*kind))
    }
}

impl fmt::Display for KindSet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if *self == Self::BOTH {
            return f.pad("both");
        }
        if *self == Self::ALL {
            return f.pad("all");
        }
        let words: Vec<&str> = self.kinds().map(Kind::word).collect();
        f.pad(&words.join(","))
    }
}

impl FromStr for KindSet {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut set = Self(0);
        for word in text.split(',') {
            let part = match word.trim() {
                "both" => Self::BOTH,
                "all" => Self::ALL,
                word => {
                    let words = Kind::ALL.map(Kind::word).join(", ");
                    Kind::from_word(word)
                        .map(Self::only)
                        .ok_or_else(|| format!("{word:?} is not one of {words}, both, all"))?
                }
            };
            set.0 |= part.0;
        }
        Ok(set)
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
            assert!(error.contains("one of l0, ev, noise, auto, motion, both, dark, all"), "{error}");
        }
    }

    #[test]
    fn default_is_noise_alone() {
        assert_eq!("noise".parse(), Ok(TreatmentSet::NOISE));
        assert!(!TreatmentSet::NOISE.includes_kind(None));
        assert!(!TreatmentSet::NOISE.includes_kind(Some(Kind::Exposure)));
        let both: TreatmentSet = "both".parse().unwrap();
        assert!(!both.includes_kind(None) && both.includes_kind(Some(Kind::Exposure)));
    }

    #[test]
    fn sets_include_photographs_and_matches() {
        for (set, treatment, expected) in [
            ("noise", "dark", false),
            ("dark", "dark-2", true),
            ("all", "lamp", true),
            ("noise", "match-noise", true),
            ("dark", "match-noise", false),
            ("l0", "dark", false),
        ] {
            let set: TreatmentSet = set.parse().unwrap();
            let treatment: Treatment = treatment.parse().unwrap();
            assert_eq!(set.includes(&treatment), expected, "{set} {treatment}");
        }
    }

    #[test]
    fn kind_set_sets_read_back() {
        for (text, written) in [
            ("ev", "ev"),
            ("noise", "noise"),
            ("both", "both"),
            ("noise,ev", "both"),
            ("motion,ev", "ev,motion"),
            ("both,auto", "ev,noise,auto"),
            ("auto, both, motion", "all"),
            ("all", "all"),
        ] {
            assert_eq!(text.parse::<KindSet>().unwrap().to_string(), written);
        }
        let wrong = "raw".parse::<KindSet>().unwrap_err();
        assert!(wrong.contains("one of ev, noise, auto, motion, both, all"), "{wrong}");
        assert!("".parse::<KindSet>().is_err() && "ev,".parse::<KindSet>().is_err());
    }
}
