//! A set of kinds of degradation: [`KindSet`].

use std::fmt;
use std::str::FromStr;

use super::degradation::Kind;

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
