//! Levels of a run by kind of degradation: the named levels, or the ladder of each kind.

use super::levels::{LIGHT, Levels, ladder};
use super::noise_profile::NoiseProfiles;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::degradations::{Axis, Kind};
use darkqa_base::types::{AxisLevel, KindSet, PairDark};

impl Levels {
    /// The levels of a run with these kinds. If the light levels are L0 to L5 (the default), kinds on an axis without a
    /// named level get their own ladder.
    ///
    /// # Errors
    /// If a kind has no level, or a level has no kind.
    pub(super) fn for_kinds(&self, kinds: KindSet) -> Result<Vec<AxisLevel>> {
        let mut levels = self.0.clone();
        levels.retain(|level| *level != AxisLevel::PAIR);
        let is_clean = levels.iter().all(|level| level.severity().is_none());
        let has_ladders = levels.iter().filter(|level| level.axis() != Some(Axis::MOTION)).eq(&ladder(LIGHT));
        for axis in Axis::ALL.into_iter().filter(|_| !is_clean) {
            let kind = kinds.kinds().find(|kind| kind.axis() == axis);
            let level = self.0.iter().find(|level| level.axis() == Some(axis));
            match (kind, level) {
                (Some(kind), None) if has_ladders => levels.extend(ladder(kind)),
                (Some(kind), None) => {
                    let [first, last] = ladder_ends(kind);
                    let problem = format_args!(
                        "no level of {kind} is named; add {first}-{last}, or leave out {kind} in --variant"
                    );
                    return Err(Error::usage("--levels", problem));
                }
                (None, Some(_)) if axis == Axis::LIGHT && has_ladders => {
                    levels.retain(|level| level.axis() != Some(axis));
                }
                (None, Some(level)) => {
                    let words: Vec<&str> =
                        Kind::ALL.into_iter().filter(|kind| kind.axis() == axis).map(Kind::word).collect();
                    let problem = format_args!(
                        "{level} is a level of {}, but --variant {kinds} selects none of them",
                        words.join(", ")
                    );
                    return Err(Error::usage("--levels", problem));
                }
                (Some(_), Some(_)) | (None, None) => {}
            }
        }
        levels.sort_unstable();
        levels.dedup();
        Ok(levels)
    }

    /// The kinds and profiles for synthetic images that are as dark as each frame's own photograph; empty unless the
    /// levels include `match`.
    ///
    /// # Errors
    /// If the levels include `match`, but no kind reduces the light.
    pub(super) fn matches(&self, kinds: KindSet, readings: &NoiseProfiles) -> Result<Vec<PairDark>> {
        if !self.0.contains(&AxisLevel::PAIR) {
            return Ok(Vec::new());
        }
        let mut all = Vec::new();
        for kind in kinds.kinds().filter(|kind| kind.can_match()) {
            if kind.has_profiles() {
                let readings = readings.iter().map(|(name, _)| Some(name.clone()));
                all.extend(readings.map(|reading| PairDark::Match(kind, reading)));
            } else {
                all.push(PairDark::Match(kind, None));
            }
        }
        if all.is_empty() {
            let problem =
                format_args!("match reduces the light, which --variant {kinds} does not; add ev or noise to it");
            return Err(Error::usage("--levels", problem));
        }
        Ok(all)
    }
}

/// Labels of the first and the last level of a kind's ladder.
fn ladder_ends(kind: Kind) -> [String; 2] {
    let ladder = kind.ladder();
    [ladder.first(), ladder.last()].map(|severity| severity.map_or(String::new(), |severity| kind.label(*severity)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn resolve(levels: &str, kinds: &str) -> std::result::Result<String, String> {
        let levels: Levels = levels.parse().unwrap();
        let levels = levels.for_kinds(kinds.parse().unwrap()).map_err(|e| e.to_string())?;
        let names: Vec<String> = levels.iter().map(ToString::to_string).collect();
        Ok(names.join(" "))
    }

    #[test]
    fn each_kind_has_its_levels() {
        let light = "L0 L1 L2 L3 L4 L5";
        let times = "T8.33 T16.67 T33.33 T66.67 T133.33";
        for (levels, kinds, expected) in [
            ("L0-L5", "both", light.to_owned()),
            ("L0-L5", "auto", light.to_owned()),
            ("L0-L5", "motion", format!("L0 {times}")),
            ("L0-L5", "all", format!("{light} {times}")),
            ("L0-L5,T5", "ev,motion", format!("{light} T5")),
            ("L0,T5", "motion", "L0 T5".to_owned()),
            ("L3,T5", "noise,motion", "L3 T5".to_owned()),
            ("L0,3.3", "auto", "L0 E3.3".to_owned()),
            ("L0", "all", "L0".to_owned()),
        ] {
            assert_eq!(resolve(levels, kinds), Ok(expected), "{levels} {kinds}");
        }
        for (levels, kinds, part) in [
            (
                "L0,L3",
                "noise,motion",
                "--levels: no level of motion is named; add T8.33-T133.33, or leave out motion in --variant",
            ),
            ("T5", "both,motion", "no level of ev is named; add L1-L5"),
            ("L0,L3", "motion", "L3 is a level of ev, noise, auto, but --variant motion selects none of them"),
            ("L0-L5,2.5", "motion", "L1 is a level of ev, noise, auto"),
            ("L0-L5,T5", "both", "T5 is a level of motion, but --variant both selects none of them"),
        ] {
            let error = resolve(levels, kinds).unwrap_err();
            assert!(error.contains(part), "{levels} {kinds}: {error}");
        }
    }
}
