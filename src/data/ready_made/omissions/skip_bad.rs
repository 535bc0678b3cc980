//! Maximum share of broken rows and images to leave out: [`SkipBad`].

use std::fmt;
use std::str::FromStr;

/// Default maximum share, in percent (chosen).
const DEFAULT_PERCENT: f64 = 5.0;

/// Value of `--skip bad`: leave out broken rows and unusable images, up to a share of all.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SkipBad {
    max_percent: f64,
}

impl SkipBad {
    /// Checks that `bad` of `all` rows or images may be left out. `noun` names them, and `first` is the problem of the
    /// first.
    ///
    /// # Errors
    /// If their share is too large. The error names the flag that allows it.
    pub fn check(self, bad: usize, all: usize, noun: &str, first: &str) -> Result<(), String> {
        if percent(bad, all) <= self.max_percent {
            return Ok(());
        }
        Err(format!(
            "{bad} of {all} {noun} are broken; the first: {first}; {} leaves out at most {} %: repair the data, or raise the limit with {}",
            self.flag(),
            self.max_percent,
            Self::allowing(bad, all).flag()
        ))
    }

    /// The flag as typed by the user.
    pub fn flag(self) -> String {
        if self == Self::default() {
            return "--skip bad".to_owned();
        }
        format!("--skip bad={}%", self.max_percent)
    }

    /// The default share, or the lowest larger one in whole percent that allows `bad` of `all`.
    pub fn allowing(bad: usize, all: usize) -> Self {
        Self { max_percent: percent(bad, all).ceil().max(DEFAULT_PERCENT) }
    }
}

fn percent(part: usize, all: usize) -> f64 {
    100.0 * part as f64 / all.max(1) as f64
}

impl Default for SkipBad {
    fn default() -> Self {
        Self { max_percent: DEFAULT_PERCENT }
    }
}

impl fmt::Display for SkipBad {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if *self == Self::default() {
            return f.write_str("skip");
        }
        write!(f, "skip:{}%", self.max_percent)
    }
}

impl FromStr for SkipBad {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "skip" {
            return Ok(Self::default());
        }
        // `--bad skip:20%` is an earlier form of `--skip bad=20%`.
        let share = text.strip_prefix("skip:").unwrap_or(text);
        let share: f64 =
            share.strip_suffix('%').unwrap_or(share).parse().map_err(|_| "a share of the rows expected, as 20%")?;
        if !(0.0..=100.0).contains(&share) {
            return Err("a share from 0% to 100% expected".to_owned());
        }
        Ok(Self { max_percent: share })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn share_is_parsed_and_printed() {
        for (text, max_percent) in
            [("skip", 5.0), ("skip:20%", 20.0), ("20%", 20.0), ("skip:0.5%", 0.5), ("skip:100", 100.0)]
        {
            let skip: SkipBad = text.parse().unwrap();
            assert_eq!(skip, SkipBad { max_percent }, "{text}");
            assert_eq!(skip.to_string().parse(), Ok(skip));
        }
        for wrong in ["", "skip:", "skip:-1%", "skip:101%", "skip:NaN", "leave", "skip:x%"] {
            assert!(wrong.parse::<SkipBad>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn larger_share_is_refused_with_the_flag_that_allows_it() {
        let usual = SkipBad::default();
        assert_eq!(usual.check(1, 20, "rows", "a"), Ok(()));
        let problem = usual.check(3, 40, "rows", "line 3").unwrap_err();
        assert!(problem.contains("3 of 40 rows are broken; the first: line 3"), "{problem}");
        let (_, raised) = problem.rsplit_once("--skip bad=").unwrap();
        assert_eq!(raised, "8%");
        assert_eq!(raised.parse::<SkipBad>().unwrap().check(3, 40, "rows", ""), Ok(()));
    }
}
